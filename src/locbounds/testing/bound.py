"""What every bound promises: a labelled result, honest standard errors, and never above a filter that is optimal."""

from collections.abc import Callable
from typing import Any

import numpy as np

from locbounds.linalg import is_positive_semidefinite
from locbounds.result import Result
from locbounds.scenario import Scenario
from locbounds.testing import small
from locbounds.testing.suite import run

SIGMAS = 4.5  # seven in a million by chance
EXACT = 1e-9
HAND_KEPT = 3  # repetitions with other seeds


def check_bound(bound: Callable[..., Result], *, prepare: Callable[[Scenario], Scenario] | None = None) -> None:
    """Check a bound of your own, ``bound(scenario, seed=...) -> Result``.

    Parameters
    ----------
    bound
        The function.
    prepare
        Makes the scenarios of the suite fit, for example ``lambda s: s.with_known_sight(np.zeros(s.steps, int))``.

    Raises
    ------
    Nonconforming
        Listing every check that fails.

    Notes
    -----
    ``result``: a finite, labelled number per step. ``covariance``: positive semidefinite, its position block adds up to
    ``position_mse``. ``start``: step 0 is the prior's. ``reproducible``: the same seed gives the same numbers.
    ``standard error``: other seeds differ by no more than it explains. ``optimal filter``: in a linear Gaussian model,
    where the Kalman filter is optimal, the number is not above that filter's error (not asked of bounds for filters
    that discard ranges). ``more ranges``: leaving a link out never lowers the number.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.testing import check_bound
    >>> check_bound(lb.bcrb)
    """
    fit = prepare or (lambda s: s)
    run(bound, CHECKS, fit)


def _same(bound: Any, fit: Any, seed: int = 0, **options: Any) -> Result:
    return bound(fit(small.scenario(**options)), seed=seed)


def _mean(r: Result) -> tuple[float, float]:
    return float(r.mean_position_rmse()), r.mean_position_rmse_stderr()


def _result(bound: Any, fit: Any) -> str | None:
    r, n = _same(bound, fit), small.STEPS + 1
    if not isinstance(r, Result) or r.kind != "bound" or not r.id or not r.sees:
        return f"it returned {type(r).__name__}, not a Result of kind bound with an id and what it sees"
    if r.position_mse.shape != (n,) or r.covariance.shape != (n, 4, 4) or r.replicates.shape[1:] != (n,):
        return f"shapes are {r.position_mse.shape}, {r.covariance.shape}, {r.replicates.shape} for {n} times"
    if not np.all(np.isfinite(r.position_mse)) or np.any(np.asarray(r.position_mse) < 0):
        return "position_mse has numbers that are negative or not finite"
    return None if np.array_equal(r.time_s, small.scenario().times.time_s) else "time_s is not the scenario's"


def _covariance(bound: Any, fit: Any) -> str | None:
    r = _same(bound, fit)
    if not all(is_positive_semidefinite(P) for P in np.asarray(r.covariance)):
        return "a covariance is not positive semidefinite"
    total = np.asarray(r.covariance)[:, [0, 1], [0, 1]].sum(-1)
    return (
        None if np.allclose(total, r.position_mse, rtol=EXACT) else "position_mse is not the sum of its position block"
    )


def _start(bound: Any, fit: Any) -> str | None:
    r, prior = _same(bound, fit), small.scenario().prior.covariance
    same = np.allclose(np.asarray(r.covariance)[0], prior, rtol=1e-6, atol=1e-9)
    return None if same else "the covariance at step 0 is not the prior's"


def _reproducible(bound: Any, fit: Any) -> str | None:
    a, b = (np.asarray(_same(bound, fit, seed=3).position_mse) for _ in range(2))
    return None if np.array_equal(a, b) else "the same seed gives other numbers"


def _standard_error(bound: Any, fit: Any) -> str | None:
    found = [_mean(_same(bound, fit, seed=s)) for s in range(HAND_KEPT + 1)]
    for value, error in found[1:]:
        gap, allowed = abs(value - found[0][0]), SIGMAS * np.hypot(error, found[0][1])
        if gap > allowed + EXACT * value:
            return f"two seeds differ by {gap:.3g} m, {SIGMAS} standard errors are {allowed:.3g} m"
    return None


def _optimal_filter(bound: Any, fit: Any) -> str | None:
    r = _same(bound, fit, same_noise=True)
    if "los-ranges" in r.sees:
        return None
    best = np.sqrt(small.kalman(small.scenario(same_noise=True))).mean()
    value, error = _mean(r)
    if value > best + SIGMAS * error + 1e-6 * best:
        return f"it is {value:.4f} +- {error:.4f} m where the optimal filter reaches {best:.4f} m"
    return None


def _more_ranges(bound: Any, fit: Any) -> str | None:
    reports = np.ones((small.STEPS, 2), bool)
    reports[:, 1] = False
    (both, e), (one, f) = _mean(_same(bound, fit)), _mean(_same(bound, fit, reports=reports))
    if both > one + SIGMAS * np.hypot(e, f):
        return f"{both:.4f} m with two links, {one:.4f} m with one of them"
    return None


CHECKS = {
    "result": _result,
    "covariance": _covariance,
    "start": _start,
    "reproducible": _reproducible,
    "standard error": _standard_error,
    "optimal filter": _optimal_filter,
    "more ranges": _more_ranges,
}
