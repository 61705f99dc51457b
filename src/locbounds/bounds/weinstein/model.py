"""The recursive Weiss-Weinstein bound of a jump-Markov model with linear measurements and any noise."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.bounds.ahead import predicted
from locbounds.bounds.recursion import LinearModel
from locbounds.bounds.weinstein.coefficients import ModelCoefficients
from locbounds.bounds.weinstein.path import path_bounds
from locbounds.bounds.weinstein.recursion import weiss_weinstein_recursion
from locbounds.errors import InputError, RefusedError
from locbounds.horizon import PREDICT, SMOOTH, Horizon
from locbounds.linalg import psd_root
from locbounds.model import JumpMarkov, jump_markov
from locbounds.model.linear import gradients, matrices, singular_motion
from locbounds.motion.linear import whitened
from locbounds.noise.log_coefficient import rough_variance
from locbounds.precision import double_precision
from locbounds.registry import method
from locbounds.result import Provenance, Result
from locbounds.scenario import Scenario
from locbounds.verdict import Status

MOVED = ("both", "states", "paths")
SIZES = (0.6, 1.2, 2.0)  # of the test shifts along each axis, relative to each other
SCALES = np.geomspace(0.03, 1.5, 12)  # common scales, in conditional deviations
FINER = 6
LONGEST = 60.0  # conditional deviations: where the search for a common scale ends


@double_precision
def wwb_recursive(
    model: JumpMarkov | Scenario,
    *,
    horizon: str | Horizon = "filter",
    moved: str = "both",
    sizes: Sequence[float] | ndarray = SIZES,
    scale: float | None = None,
) -> Result:
    """Recursive Weiss-Weinstein bound, for noises without a Fisher information too; nothing is drawn.

    Parameters
    ----------
    model
        Linear Gaussian motion without modes, Gaussian prior, additive channels whose ``h`` is linear in the state.
        Where the modes of one channel are drawn afresh at every step, its noise is their mixture. Where the chain
        remembers, or channels share it, the bound is that of estimators which are told its modes, and says so: the
        coefficients of a chain that nobody is told are integrals over all measurements at once.
    horizon
        ``"filter"``, ``"predict:N"`` or ``"smooth"``; the last one by moved paths only.
    moved
        What test functions move: ``"states"``, one state at a time, by recursion (the motion has to be regular);
        ``"paths"``, whole paths in the best direction, at a cost quadratic in steps; ``"both"``: the larger bound of
        every step.
    sizes
        Lengths of the test shifts of the recursion along each axis of the state, relative to each other.
    scale
        Common scale of the recursion's shifts in conditional deviations; by default the best one is searched for
        every step.

    Returns
    -------
    Result
        ``diagnostics["scale"]`` [steps+1]: the best scale of the recursion, NaN where a path was better. At the lowest
        one of the search the shifts tend to zero, as they do for smooth noises: the bound is then the Bayesian
        Cramér-Rao bound.

    Raises
    ------
    RefusedError
        If the model is another one; if states are moved alone where the motion leaves some direction without noise.
    InputError
        If an option makes no sense.

    Notes
    -----
    :mod:`locbounds.bounds.weinstein.recursion` and :mod:`locbounds.bounds.weinstein.path`; every choice of shifts is
    valid, and the one with the largest position error counts.

    Examples
    --------
    A random walk seen with uniform noise, whose Fisher information is infinite:

    >>> import numpy as np, locbounds as lb
    >>> ones = np.ones((4, 1, 1))
    >>> model = lb.JumpMarkov(
    ...     times=lb.Times.uniform(step_s=1.0, steps=4),
    ...     prior=lb.GaussianPrior([0.0], [[4.0]]),
    ...     motion=lb.LinearMotion(ones, 0.25 * ones, position_index=(0,)),
    ...     channels=lb.AdditiveChannel(lambda x, mode, k: x[0], [lb.Uniform(-1.0, 1.0)]),
    ...     chains=lb.MarkovSight([1.0], [[1.0]]),
    ... )
    >>> wwb_recursive(model).position_rmse.values.round(2)
    array([2.  , 0.43, 0.32, 0.31, 0.3 ])
    """
    scenario = model.fingerprint() if isinstance(model, Scenario) else ""
    model = jump_markov(model) if isinstance(model, Scenario) else model
    horizon = Horizon.parse(horizon, model.steps)
    _check(moved, sizes, scale)
    entry = method("wwb-recursive")
    verdict = entry.verdict(model)
    why = singular_motion(model) if moved == "states" else None
    if verdict.status is Status.REFUSED or why is not None:
        reasons = verdict.reasons if why is None else (why,)
        raise RefusedError(
            f"wwb-recursive does not apply: {'; '.join(reasons)}", "See: locbounds explain wwb-recursive"
        )
    if moved == "states" and horizon.kind == SMOOTH:
        raise RefusedError("test functions that move one state at a time give no smoothing bound", "Use moved='paths'")
    F, Q, P0 = matrices(model)
    slopes = gradients(model)
    coefficients = ModelCoefficients(model, slopes)
    if coefficients.told:
        verdict = entry.verdict(model, ("estimators told the modes: a bound for all that are not told them too",))
    index = np.array(model.position_index)
    times = model.steps + 1
    P, best = np.zeros((times, len(P0), len(P0))), np.full(times, np.nan)
    if moved != "paths" and horizon.kind != SMOOTH and singular_motion(model) is None:
        axes = _axes(model, F, Q, P0, slopes)
        P, best = _states(F, Q, P0, axes, coefficients, index, np.asarray(sizes, dtype=float), scale)
        if horizon.kind == PREDICT:
            P = np.asarray(predicted(LinearModel(F, Q, P0, (), ()), P, horizon.ahead))
    if moved != "states":
        X = whitened(F, np.asarray(psd_root(P0)), np.asarray(psd_root(Q)))
        other = path_bounds(X, slopes, 1 / _least_variances(model), coefficients.path, index, horizon)
        larger = other[:, index, index].sum(-1) > P[:, index, index].sum(-1)
        P, best = np.where(larger[:, None, None], other, P), np.where(larger, np.nan, best)
    mse = P[:, index, index].sum(-1)
    return Result(
        id=entry.id,
        name=entry.name + horizon.label,
        kind="bound",
        sees=horizon.sees(entry.sees | frozenset({"sight"}) if coefficients.told else entry.sees),
        time_s=np.asarray(model.times.time_s),
        position_mse=mse,
        replicates=np.zeros((1, len(mse))),
        covariance=P,
        verdict=verdict,
        provenance=Provenance.now(0, 0, f"test functions move {moved}", entry.references),
        diagnostics={"scale": best},
        scenario=scenario,
    )


def _check(moved: str, sizes: Sequence[float] | ndarray, scale: float | None) -> None:
    if moved not in MOVED:
        raise InputError(f"moved is {moved!r}", f"Give one of {', '.join(MOVED)}")
    relative = np.asarray(sizes, dtype=float)
    if relative.ndim != 1 or not len(relative) or not np.all(np.isfinite(relative) & (relative > 0)):
        raise InputError(f"the sizes are {sizes}", "Give positive numbers, for example (0.6, 1.2, 2.0)")
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise InputError(f"the scale is {scale}", "Give a positive number, or none: then the best is searched")


def _states(
    F: ndarray, Q: ndarray, P0: ndarray, axes: ndarray, coefficients: ModelCoefficients, index: ndarray,
    sizes: ndarray, scale: float | None,
) -> tuple[Float[ndarray, "times state state"], Float[ndarray, " times"]]:  # fmt: skip
    """Bounds by shifts of one state each, and the best common scales of these."""

    def bounds(scales: ndarray) -> tuple[ndarray, ndarray]:
        found = []
        for one in scales:
            shifts = (one * sizes[:, None, None] * axes[:, None]).reshape(len(axes), -1, axes.shape[-1])
            found.append(weiss_weinstein_recursion(F, Q, P0, shifts, coefficients))
        found = np.stack(found)
        return found, found[:, :, index, index].sum(-1)

    if scale is not None:
        return bounds(np.array([float(scale)]))[0][0], np.full(len(axes), float(scale))
    tried = SCALES
    found, position = bounds(tried)
    while np.any(position.argmax(0) == len(tried) - 1) and tried[-1] < LONGEST:  # the grid is too short
        tried = np.append(tried, tried[-1] * np.array([1.5, 2.25]))
        more, at = bounds(tried[-2:])
        found, position = np.concatenate([found, more]), np.concatenate([position, at])
    grid = tried
    for i in np.unique(position.argmax(0)):
        near = np.geomspace(grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)], FINER)[1:-1]
        more, at = bounds(near)
        tried = np.append(tried, near)
        found, position = np.concatenate([found, more]), np.concatenate([position, at])
    best = position.argmax(0)
    return found[best, np.arange(len(axes))], tried[best]


def _axes(model: JumpMarkov, F: ndarray, Q: ndarray, P0: ndarray, slopes: ndarray) -> Float[ndarray, "times n n"]:
    """Test directions of every state: columns of a root of its covariance given all others, roughly."""
    inverse = [np.linalg.inv(P0), *np.linalg.inv(Q)]
    least = _least_variances(model)
    out = []
    for k in range(model.steps + 1):
        J = inverse[k] + (F[k].T @ inverse[k + 1] @ F[k] if k < model.steps else 0.0)
        if k:
            J = J + np.einsum("ca,c,cb->ab", slopes[:, k - 1], 1 / least, slopes[:, k - 1])
        out.append(np.linalg.cholesky(np.linalg.inv(J)).T)
    return np.stack(out)


def _least_variances(model: JumpMarkov) -> Float[ndarray, " channels"]:
    channels: Any = model.channels
    return np.array([min(rough_variance(n) for n in channel.noises) for channel in channels])
