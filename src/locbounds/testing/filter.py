"""What every filter promises: an answer at every step, from the past alone, for every run on its own."""

from collections.abc import Callable
from typing import Any

import numpy as np

from locbounds.evaluation import estimates, position_error
from locbounds.linalg import is_positive_semidefinite
from locbounds.measurement import Range
from locbounds.simulation import Draws, simulate
from locbounds.testing import small
from locbounds.testing.suite import run

RUNS, CUT = 64, 3
SAME = 1e-6  # relative; sums in another order


def check_filter(filter: Callable[..., Any]) -> None:
    """Check a filter of your own: ``filter(scenario, z, seed) -> estimates``, for `locbounds.evaluate`.

    Parameters
    ----------
    filter
        An instance or a function. One that is told the sight says so: ``filter.sees`` contains ``"sight"``.

    Raises
    ------
    Nonconforming
        Listing every check that fails.

    Notes
    -----
    ``estimates``: finite, [runs, steps+1 or steps, state or space]. ``missing ranges``: so also where ranges are NaN.
    ``past only``: later ranges do not change earlier estimates. ``each run alone``: runs in another order give the same
    estimates. ``reproducible``: the same seed gives the same. ``input``: the ranges are left as they were.
    ``covariances``, if it returns any: positive semidefinite. ``learns``: with two links the error at the end is
    smaller than that of never looking at the ranges.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.testing import check_filter
    >>> check_filter(lb.ImmEkf())
    """
    model = small.scenario(measurement=Range)
    run(filter, CHECKS, model, simulate(model, runs=RUNS, seed=7))


def _run(filter: Any, model: Any, draws: Draws, z: Any = None, sight: Any = None) -> tuple[Any, Any]:
    z, sight = draws.measurements if z is None else z, draws.sight if sight is None else sight
    return estimates(filter, model, np.array(z), sight, 0)


def _estimates(filter: Any, model: Any, draws: Draws) -> str | None:
    mean, _ = _run(filter, model, draws)
    return None if np.all(np.isfinite(mean)) else "some are not finite"


def _missing(filter: Any, model: Any, draws: Draws) -> str | None:
    z = np.array(draws.measurements)
    z[np.random.default_rng(0).random(z.shape) < 0.4] = np.nan
    mean, _ = _run(filter, model, draws, z)
    return None if np.all(np.isfinite(mean)) else "estimates are not finite where ranges are missing (NaN)"


def _past_only(filter: Any, model: Any, draws: Draws) -> str | None:
    z, sight = np.array(draws.measurements), np.array(draws.sight)
    z[:, CUT:] += 5.0
    sight[:, CUT:] = 1 - sight[:, CUT:]
    a, b = _run(filter, model, draws)[0], _run(filter, model, draws, z, sight)[0]
    if not np.allclose(a[:, : CUT + 1], b[:, : CUT + 1], rtol=SAME):
        return f"ranges after step {CUT} change the estimates up to it"
    return None


def _alone(filter: Any, model: Any, draws: Draws) -> str | None:
    back = slice(None, None, -1)
    a, b = _run(filter, model, draws)[0], _run(filter, model, draws, draws.measurements[back], draws.sight[back])[0]
    other = np.array(draws.measurements)
    other[1:] += 50.0
    c = _run(filter, model, draws, other)[0]
    if not np.allclose(a, b[back], rtol=SAME) or not np.allclose(a[0], c[0], rtol=SAME):
        return "the estimates of a run depend on the other runs"
    return None


def _reproducible(filter: Any, model: Any, draws: Draws) -> str | None:
    a, b = (_run(filter, model, draws)[0] for _ in range(2))
    return None if np.array_equal(a, b) else "the same seed gives other estimates"


def _input(filter: Any, model: Any, draws: Draws) -> str | None:
    z = np.array(draws.measurements)
    estimates(filter, model, z, draws.sight, 0)
    return None if np.array_equal(z, draws.measurements) else "the filter changes the ranges that it is given"


def _covariances(filter: Any, model: Any, draws: Draws) -> str | None:
    mean, spread = _run(filter, model, draws)
    if spread is None:
        return None
    if np.shape(spread) != (*mean.shape, mean.shape[-1]):
        return f"their shape is {np.shape(spread)} for estimates {mean.shape}"
    good = all(is_positive_semidefinite(P) for P in np.asarray(spread).reshape(-1, *np.shape(spread)[-2:]))
    return None if good else "one is not positive semidefinite"


def _learns(filter: Any, model: Any, draws: Draws) -> str | None:
    state = np.asarray(model.prior.mean)
    for F in np.asarray(model.transition):
        state = F @ state
    blind = np.sum((draws.states[:, -1, :2] - state[:2]) ** 2, -1)
    error = position_error(model, _run(filter, model, draws)[0], draws.states)[:, -1] ** 2
    if not error.mean() < blind.mean():
        return f"RMSE at the end is {np.sqrt(error.mean()):.3g} m, without any range {np.sqrt(blind.mean()):.3g} m"
    return None


CHECKS = {
    "estimates": _estimates,
    "missing ranges": _missing,
    "past only": _past_only,
    "each run alone": _alone,
    "reproducible": _reproducible,
    "input": _input,
    "covariances": _covariances,
    "learns": _learns,
}
