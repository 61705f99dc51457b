"""What the paper says, and whether it holds."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from locbounds.papers.chen2010.outputs import bounds, segments
from locbounds.papers.chen2010.setting import (
    MATCHED_STAY,
    PUBLISHED_BOUND_M,
    PUBLISHED_RANGE_M,
    STAY,
    least_steady_bound,
)
from locbounds.papers.chen2010.study import Study, overall, paired
from locbounds.requirement import E911, Decision, comply

SURE = 5.0  # standard errors of a paired difference
RANKING = ("RBPF", "EKF banks", "IMM-KF")


class Statement(NamedTuple):
    """One sentence of the paper.

    Attributes
    ----------
    paper
        What it says.
    verdict
        ``holds``, ``does not hold``, ``cannot hold``, ``undecided`` or ``misread`` (true, but not what it seems).
    why
        The numbers.
    """

    paper: str
    verdict: str
    why: str


def statements(found: Study) -> list[Statement]:
    """The paper's statements against what was computed."""
    return [
        _ranking(found),
        _level(found),
        _emergency(found),
        _segments(found),
        _above(found),
        _gap(found),
        Statement(
            "CDF of the posterior CRLB, 67 % and 95 % (Fig. 2)",
            "misread",
            "the curve is the distribution of one curve's values over time; a bound on a mean square error has no "
            "error distribution, and its quantiles must not be compared with those of the errors",
        ),
    ]


def _ranking(found: Study) -> Statement:
    parts, sigmas = [], []
    for better, worse in pairwise(RANKING):
        difference, error = paired(found.results[better], found.results[worse])
        sigmas.append(difference / error if error > 0 else np.inf)
        parts.append(f"{worse} - {better} = {difference:.2f} +- {error:.2f} m ({sigmas[-1]:.1f} s.e.)")
    clear = "does not hold" if min(sigmas) < -SURE else "undecided"
    verdict = "holds" if min(sigmas) > SURE else clear
    weighted = {s.method: s.result for s in found.settings if s.stay == STAY}["IMM-KF weighted"]
    difference, error = paired(found.results["EKF banks"], weighted)
    parts.append(
        f"with ranges weighted by their variances the IMM-KF changes places: minus EKF banks {difference:.2f} "
        f"+- {error:.2f} m"
    )
    return Statement("RBPF is the most accurate, then EKF banks, then IMM-KF", verdict, "; ".join(parts))


def _level(found: Study) -> Statement:
    rows = {(name, reading): values for name, reading, *values in bounds(found)}
    q67, q95, low, _ = rows[found.evaluators[0].name, "total"]
    axis67, axis95, *_ = rows[found.evaluators[0].name, "per axis"]
    axis = found.along_tracks[1:] / np.sqrt(2)
    spread = [np.quantile(np.quantile(axis, share, axis=0), (0.05, 0.5, 0.95)) for share in PUBLISHED_BOUND_M]
    ranges = ", ".join(
        f"{100 * share:g} %: {value} m printed, {a[1]:.1f} m [{a[0]:.1f}, {a[2]:.1f}] computed"
        for (share, value), a in zip(PUBLISHED_BOUND_M.items(), spread, strict=True)
    )
    return Statement(
        f"most values of sqrt(C11 + C22) lie within [{PUBLISHED_RANGE_M[0]:g}, {PUBLISHED_RANGE_M[1]}] m, "
        "67 % within 31.9, 95 % within 32.9 m",
        "cannot hold",
        f"with three LOS stations and the printed parameters no layout has a steady value below "
        f"{least_steady_bound():.1f} m; here 67 % within {q67:.1f}, 95 % within {q95:.1f}, least {low:.1f} m. "
        f"Per axis, divided by sqrt 2, the printed numbers fit: {axis67:.1f} and {axis95:.1f} m; along single tracks "
        f"{ranges} (median and 90 % of the tracks). Station positions are not in the paper and were chosen to fit",
    )


def _emergency(found: Study) -> Statement:
    decisions = {name: comply(E911, found.results[name].diagnostics["error_m"][:, 1:]) for name in RANKING}
    every = [c.decision for d in decisions.values() for c in d]
    verdict = "holds" if set(every) == {Decision.PASS} else "undecided"
    verdict = "does not hold" if Decision.FAIL in every else verdict
    shares = "; ".join(f"{name} {', '.join(f'{100 * c.share:.2f} %' for c in d)}" for name, d in decisions.items())
    return Statement(
        f"all three satisfy {E911}", verdict, f"within 100 m and 300 m: {shares}; RMSE alone would hide the tails"
    )


def _segments(found: Study) -> Statement:
    values: dict[str, list[tuple[float, float]]] = {}
    for name, _, value, error in segments(found):
        values.setdefault(name, []).append((value, error))

    def above_bound(name: str, part: slice) -> float:
        squares = [np.mean([v**2 for v, _ in values[m][part]]) for m in (name, "known-sight")]
        return float(np.sqrt(squares[0] / squares[1]))

    parts = {name: (above_bound(name, slice(0, 3)), above_bound(name, slice(3, 8))) for name in RANKING}
    true = [name for name, (early, late) in parts.items() if early > late]
    verdict = "holds" if len(true) == len(RANKING) else f"holds for {' and '.join(true)}" if true else "does not hold"
    return Statement(
        "errors are larger in T(1) to T(3), with one NLOS station, while the bound hardly suffers",
        verdict,
        "RMSE over the bound in T(1) to T(3), and in T(4) to T(8): "
        + "; ".join(f"{name} {early:.2f}, {late:.2f}" for name, (early, late) in parts.items())
        + ". What is left in T(4) to T(8) for the IMM-KF are tracks that pass a station, where its range model fails",
    )


def _above(found: Study) -> Statement:
    bound, bound_error = overall(found.results["known-sight"])
    text, above = [f"bound {bound:.2f} +- {bound_error:.2f} m"], []
    for name in (*RANKING, "oracle"):
        value, error = overall(found.results[name])
        above.append((value - bound) / np.hypot(error, bound_error))
        text.append(f"{name} {value:.2f} +- {error:.2f} m")
    return Statement(
        "the error level is in general above the bound",
        "holds" if min(above) > -3 else "does not hold",
        ", ".join(text) + "; over random tracks, where it must be so. Over the noise of one fixed track, as printed, a "
        "Bayesian bound bounds nothing",
    )


def _gap(found: Study) -> Statement:
    bound = overall(found.results["known-sight"])[0]
    by = {(s.method, s.stay): overall(s.result)[0] for s in found.settings}
    text = ", ".join(
        f"{name} {by[name, STAY] - bound:.1f} m with {STAY:g}, {by[name, MATCHED_STAY] - bound:.1f} m with "
        f"{MATCHED_STAY:g}"
        for name in RANKING
    )
    return Statement(
        "there is still room for improving the location performance",
        "misread",
        f"above the bound: {text}. Most of the gap comes from a chain of mean duration 1/0.15 = 6.7 samples for "
        "conditions that last 200",
    )
