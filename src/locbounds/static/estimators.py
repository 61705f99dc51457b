"""Maximum likelihood and least squares on draws of a plan, beside the least error that is possible."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.blocks import check_seed
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.result import Result
from locbounds.static.common import check_clock, static_result, verdict_of
from locbounds.static.likelihood import Likelihood, likelihood
from locbounds.static.mmse import REPLICATES, Drawn, draw, nodes_of, over_replicates, posterior, power
from locbounds.static.plan_laws import needs_prior

DRAWS = 2048
NODES = 48  # along a line, where searches start
WIDER = 3.0  # the box of least squares, relative to that of the prior
ZOOMS, ACROSS, SHRINK = 16, 5, 0.6  # ever smaller grids around the best place
TABLE = 2**21  # numbers in one table


@double_precision
def ml(plan: Plan, *, draws: int = DRAWS, seed: int = 0) -> Result:
    """Mean square error of maximum likelihood within the support of the prior.

    Parameters
    ----------
    plan
        With a prior: positions are drawn from it, and its support is where the estimate is searched.
    draws, seed
        About so many draws, those of :func:`mmse` with the same seed.

    Returns
    -------
    Result
        With standard errors from 16 scrambled Sobol sets.

    Notes
    -----
    The likeliest node of the posterior's quadrature, then ever smaller grids around it: no gradients.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 5.0, prior=lb.UniformDisc([0, 0], 15))
    >>> likeliest = lb.ml(plan, draws=512)
    >>> bool(likeliest.position_mse > lb.mmse(plan, draws=512).position_mse)
    True
    """
    prior = needs_prior(plan, "an average over positions")
    check_clock(plan)
    verdict, law = verdict_of("ml", plan), likelihood(plan)
    drawn = draw(plan, law, power(draws), REPLICATES, check_seed(seed))
    nodes = nodes_of(plan, law, NODES)
    low, high = (np.asarray(x) for x in prior.bounds())

    def objective(which: ndarray, places: ndarray) -> ndarray:
        return law.each(_pick(drawn, which), law.features(places))

    start = posterior(law, nodes, drawn).likeliest
    found = search(objective, start, 2 * (high - low) / NODES, lambda at: np.asarray(prior.inside(at)))
    return _scored("ml", found, drawn, verdict, "search within the support", seed)


@double_precision
def ls(plan: Plan, *, draws: int = DRAWS, seed: int = 0) -> Result:
    """Mean square error of unweighted least squares in a box three times as wide as the prior's.

    Parameters
    ----------
    plan
        With a prior, from which positions are drawn; the estimate uses neither it nor the noise's law.
    draws, seed
        As for :func:`ml`.

    Returns
    -------
    Result
        With standard errors from 16 scrambled Sobol sets.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 5.0, prior=lb.UniformDisc([0, 0], 15))
    >>> bool(lb.ls(plan, draws=512).position_mse > lb.ml(plan, draws=512).position_mse)
    True
    """
    prior = needs_prior(plan, "an average over positions")
    check_clock(plan)
    verdict, law = verdict_of("ls", plan), likelihood(plan)
    drawn = draw(plan, law, power(draws), REPLICATES, check_seed(seed))
    low, high = (np.asarray(x) for x in prior.bounds())
    middle, half = 0.5 * (low + high), 0.5 * WIDER * (high - low)
    t = np.linspace(-1, 1, 2 * NODES + 1 if plan.dim < 3 else 25)
    grid = middle + half * np.stack(np.meshgrid(*[t] * plan.dim, indexing="ij"), -1).reshape(-1, plan.dim)

    def objective(which: ndarray, places: ndarray) -> ndarray:
        return -law.squares(_pick(drawn, which), law.features(places))

    def inside(places: ndarray) -> ndarray:
        return np.all(np.abs(places - middle) <= half * (1 + 1e-12), axis=1)

    start = _start(law, drawn, grid)
    found = search(objective, start, half * (t[1] - t[0]), inside)
    return _scored("ls", found, drawn, verdict, f"search in a box {WIDER:g} times as wide as the prior's", seed)


def _start(law: Likelihood, drawn: Drawn, grid: ndarray) -> ndarray:
    white, other = law.features(grid)
    best = np.empty_like(drawn.places)
    step = max(1, TABLE // len(grid))
    for k in range(0, len(best), step):
        z = tuple(m[k : k + step, None] for m in drawn.measured)
        best[k : k + step] = grid[law.squares(z, (white, other)).argmin(1)]  # pyright: ignore[reportArgumentType]
    return best


def _pick(drawn: Drawn, which: ndarray) -> tuple[ndarray, ndarray]:
    return drawn.measured[0][which], drawn.measured[1][which]


def _scored(id: str, found: ndarray, drawn: Drawn, verdict, how: str, seed: int) -> Result:
    error = found - drawn.places
    reached = over_replicates(error[:, :, None] * error[:, None, :], REPLICATES)
    return static_result(
        id, reached.matrix, verdict, how, replicates=reached.replicates, seed=seed, samples=len(found),
        diagnostics={"draws": len(found)},
    )  # fmt: skip


def search(
    objective: Callable[[ndarray, ndarray], ndarray],
    start: Float[ndarray, "draws space"],
    width: Float[ndarray, " space"],
    allowed: Callable[[ndarray], ndarray],
) -> Float[ndarray, "draws space"]:
    """Local maximum of an objective near a start, by ever smaller grids of allowed places.

    Parameters
    ----------
    objective
        ``(which draws [k], places [k, space]) -> [k]``, to be largest.
    start, width
        Where, and half-width of the first grid.
    allowed
        ``places [k, space] -> [k]``.

    Examples
    --------
    >>> def bowl(which, at):
    ...     return -np.square(at - [0.3, 0.8]).sum(1)
    >>> search(bowl, np.zeros((1, 2)), np.ones(2), lambda at: np.ones(len(at), bool)).round(3).tolist()
    [[0.3, 0.8]]
    """
    best, (draws, space) = start.copy(), start.shape
    t = np.linspace(-1, 1, ACROSS)
    steps = np.stack(np.meshgrid(*[t] * space, indexing="ij"), -1).reshape(-1, space)
    steps = steps[np.argsort(np.square(steps).sum(1), kind="stable")]  # ties stay where they are
    which = np.repeat(np.arange(draws), len(steps))
    for _ in range(ZOOMS):
        tried = (best[:, None] + steps * width).reshape(-1, space)
        ok = allowed(tried).reshape(draws, -1)
        ok[:, 0] = True
        value = np.where(ok, objective(which, tried).reshape(draws, -1), -np.inf)
        best = tried.reshape(draws, -1, space)[np.arange(draws), value.argmax(1)]
        width = width * SHRINK
    return best
