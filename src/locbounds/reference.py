"""What a very good filter reaches: the yardstick for how tight a bound is."""

from collections.abc import Callable

import numpy as np

from locbounds.errors import InputError
from locbounds.evaluation import evaluate_on
from locbounds.filters import Rbpf
from locbounds.result import Result
from locbounds.scenario import Scenario
from locbounds.simulation import simulate
from locbounds.verdict import Status, Verdict

FIRST = 50
FACTOR = 4
MOST = 12_800


def reference(
    scenario: Scenario,
    *,
    runs: int = 400,
    rtol: float = 1e-2,
    seed: int = 0,
    most: int = MOST,
    announce: Callable[[str], None] | None = None,
) -> Result:
    """The Rao-Blackwellised particle filter with as many particles as it takes.

    The number of particles is multiplied by four, on the same tracks, until the RMSE changes by less than ``rtol``:
    until the change and two standard errors of it (paired over runs, each with fresh particles) lie within.

    Parameters
    ----------
    scenario
        The model; anchors may be many.
    runs
        Tracks drawn from it.
    rtol
        Largest relative change of the RMSE over runs and steps 1..K.
    seed
        Seed of the tracks and of the particles.
    most
        No more particles than this; if that is not enough the verdict warns.
    announce
        Called with the number of particles before each pass.

    Returns
    -------
    Result
        Of the largest number of particles, named ``reference``. ``diagnostics``: ``particles`` and ``change``, one
        entry per pass (the first change is NaN).

    Raises
    ------
    InputError
        If an option makes no sense.

    Notes
    -----
    The limit of many particles is the mixture of the EKFs of all sight sequences. It is the exact posterior where
    ranges are linear over the spread of the state, that is where spread^2 / (2 range) is small against the noise; next
    to an anchor it is not. Its efficiency against a bound says how tight the bound *at least* is: the true gap between
    the bound and the best filter is not larger.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(stay=0.9, steps=3)
    >>> best = reference(scenario, runs=100)
    >>> best.verdict.warnings, best.efficiency(lb.bcrb(scenario)).high > 0.9
    ((), True)
    """
    if not 0 < rtol < 1:
        raise InputError(f"rtol is {rtol}", "Give a relative change between 0 and 1, for example 1e-2")
    if runs < 2 or int(runs) != runs:
        raise InputError(f"the number of runs is {runs}", "Give a whole number of at least 2")
    if most < FIRST * FACTOR:
        raise InputError(f"the most particles are {most}", f"Give at least {FIRST * FACTOR}: two passes to compare")
    say = announce or (lambda text: None)
    draws = simulate(scenario, runs=runs, seed=seed)
    particles, counts, changes = FIRST, [], []
    before = None
    while True:
        say(f"{particles:,} particles")
        result = evaluate_on(
            Rbpf(particles, covariance=False),
            scenario,
            draws,
            seed=(seed + len(counts)) % 2**32,
            name="reference",
            truth=scenario,
        )
        square = np.square(np.asarray(result.diagnostics["error_m"])[:, 1:]).mean(axis=1)
        change, error = (np.nan, np.inf) if before is None else _relative_change(before, square)
        counts.append(particles)
        changes.append(change)
        converged = abs(change) + 2 * error <= rtol
        if converged or particles * FACTOR > most:
            break
        before, particles = square, particles * FACTOR
    warnings = result.verdict.warnings
    if not converged:
        warnings += (
            f"not converged: from {counts[-2]:,} to {counts[-1]:,} particles the RMSE changed by {change:.2%} "
            f"+- {error:.2%}; more particles or runs are needed",
        )
    diagnostics = result.diagnostics | {"particles": np.array(counts), "change": np.array(changes)}
    fields = {name: getattr(result, name) for name in result.__dataclass_fields__}
    return Result(**fields | {"verdict": Verdict(Status.VALID, (), warnings), "diagnostics": diagnostics})


def _relative_change(before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
    """Relative change of the RMSE from one pass to the next and its standard error, paired over runs."""
    mean = before.mean()
    difference = after - before
    return (
        float(np.sqrt(after.mean() / mean) - 1),
        float(difference.std(ddof=1) / np.sqrt(len(difference)) / (2 * mean)),
    )
