"""Which statements of the paper hold, from the computed numbers and their standard errors."""

import math

from locbounds.papers.prieto2011.setting import CASES
from locbounds.papers.prieto2011.study import (
    EKF,
    PAPER_EKF,
    PARTICLES,
    RANDOM,
    REGULAR,
    REPEATS,
    WEINSTEIN,
    Study,
)

HOLDS, FAILS, UNDECIDED = "holds", "does not hold", "not decided by so few runs"
SIGMAS = 4.0  # standard errors that a difference has to have before its sign is believed
FAR = 0.1  # of the RMSE: a filter on which the best one gains less is not called far from it


def last(found: Study, case: str, method: str) -> tuple[float, float]:
    """A curve's value over the whole record, and its standard error."""
    curve = next(c for c in found.curves if c.case == case and c.method.startswith(method))
    return float(curve.rmse_m[-1]), float(curve.stderr_m[-1])


def sign(value: float, error: float) -> int:
    """Of a number with a standard error; 0 where it may be either.

    >>> sign(1.0, 0.1), sign(-1.0, 0.1), sign(1.0, 0.5), sign(1.0, 0.0)
    (1, -1, 0, 1)
    """
    return 0 if abs(value) <= SIGMAS * error else int(math.copysign(1, value))


def remarks(found: Study) -> list[str]:
    """What the numbers say about the paper's statements."""
    return [
        _closed_form(found),
        _other_model(found),
        _trajectory(found),
        _error_of_the_ekf(found),
        _fusion(found),
        _readings(found),
        f"Steps at which no particle explained the samples: {found.stranded}, counted and recovered.",
    ]


def _closed_form(found: Study) -> str:
    cases = {d.case: [e for e in found.drifts if e.case == d.case] for d in found.drifts}
    texts = []
    for case, d in cases.items():
        decades = math.log10(d[-1].draws / d[0].draws)
        measured = (d[-1].information - d[0].information) / decades
        error = math.hypot(d[-1].spread, d[0].spread) / math.sqrt(REPEATS) / decades
        texts.append(
            f"{case} {d[0].information:.4f} at N = {d[0].draws}, {d[-1].information:.4f} at N = {d[-1].draws}, with a "
            f"spread of {d[-1].spread:.4f} left; it grows by {measured:.5f} ± {error:.5f} per factor of ten, the edges "
            f"of the density demand {d[0].growth:.5f}"
        )
    infinite = all(d[0].growth > 0 for d in cases.values())
    why = (
        "both densities vanish linearly at their ends, the Fisher information is infinite and the exact bound 0; a "
        "Monte Carlo value depends on its draws"
        if infinite
        else "no linear edge makes the Fisher information of every case infinite"
    )
    return (
        '"This expression has no closed-form solution and its result has to be obtained by Monte Carlo": '
        f"{FAILS if infinite else HOLDS}; {why} ({'; '.join(texts)}). Without the cut it is one integral."
    )


def _other_model(found: Study) -> str:
    bound, (reached, error) = last(found, RANDOM, REGULAR)[0], last(found, RANDOM, PARTICLES)
    where = {
        1: "lies above what filters reach on the cut noise and bounds nothing there",
        0: "cannot be told from what filters reach on the cut noise, and is no bound there",
        -1: "lies below what filters reach on the cut noise here, but is no bound there",
    }
    return (
        "The noise that is not cut is another model with more variance. Its bound, "
        f"{bound:.2f} m for times of arrival over random tracks, {where[sign(bound - reached, error)]} ({PARTICLES} "
        f"{reached:.2f} ± {error:.2f} m); Weiss-Weinstein bounds it, {last(found, RANDOM, WEINSTEIN)[0]:.2f} m."
    )


def _trajectory(found: Study) -> str:
    below = []
    for case in CASES:
        bound, (reached, error) = last(found, case, WEINSTEIN)[0], last(found, case, PARTICLES)
        if sign(bound - reached, error) > 0:
            below.append(f"{case} {reached:.2f} ± {error:.2f} m where the number is {bound:.2f} m")
    seen = f"So it does here: {'; '.join(below)}" if below else "It does not here"
    return (
        '"The accumulated PCRLB in each position" of the trajectory is a conditional number: the trajectory is far '
        "smoother than the model's, and starts where the prior says, so that a filter may lie below numbers that bound "
        f"the error over random tracks. {seen}. With signal strengths a bound over random tracks does not exist, "
        "because E[1/d^2] is infinite."
    )


def _error_of_the_ekf(found: Study) -> str:
    """Far from the best: more than :data:`FAR` is gained in some case."""
    names = {EKF: (*CASES, RANDOM), PAPER_EKF: tuple(CASES)}
    verdicts, texts = {}, {}
    for method, cases in names.items():
        gains = {case: found.gains[case, method] for case in cases}
        signs = [sign(gain - FAR, error) for gain, error in gains.values()]
        verdicts[method] = HOLDS if 1 in signs else UNDECIDED if 0 in signs else FAILS
        texts[method] = "; ".join(f"{case} {100 * g:.1f} ± {100 * e:.1f} %" for case, (g, e) in gains.items())
    return (
        f'"The error introduced by the EKF", taken as: a particle filter gains more than {FAR:.0%} in root mean square '
        f"in some case: {verdicts[EKF]} of an EKF with matched moments ({texts[EKF]}), {verdicts[PAPER_EKF]} of the "
        f"one as printed ({texts[PAPER_EKF]})."
    )


def _fusion(found: Study) -> str:
    both, more = last(found, "fusion", PARTICLES)
    single = {case: last(found, case, PARTICLES) for case in ("rss", "toa")}
    signs = [sign(value - both, math.hypot(error, more)) for value, error in single.values()]
    verdict = HOLDS if min(signs) > 0 else FAILS if min(signs) < 0 else UNDECIDED
    alone = ", ".join(f"{value:.2f} ± {error:.2f} m from {case} alone" for case, (value, error) in single.items())
    return (
        f'"The improvement ... by means of the RSS and TOA data fusion": {verdict}; {PARTICLES} {alone}, '
        f"{both:.2f} ± {more:.2f} m with both."
    )


def _readings(found: Study) -> str:
    wide = {(s.case, s.bias, s.derivatives): s.rmse_m for s in found.settings}
    many, one = (wide["rss", bias, "initial"] for bias in ("one per sample", "one per second"))
    once, every = (wide["fusion", "one per sample", prior] for prior in ("initial", "every step"))
    biases = "are optimistic" if many < one else "are not optimistic"
    counted = "over-confident" if every < once else "without effect"
    return (
        f"Ten biases per second {biases}: with one per second the signal-strength bound goes from {many:.2f} to "
        f"{one:.2f} m. Taking the prior of the derivatives as a measurement of every second counts one fact many times "
        f"({once:.2f} to {every:.2f} m, fusion): {counted}."
    )
