"""The maximum of the switching likelihood, and how certain it is; arrays in, arrays out.

Everything is done in the errors' own units (middle, robust deviation, median interval), so that one set of limits
serves centimetres and kilometres; `to_si` brings parameters and covariances back.
"""

from __future__ import annotations

from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from locbounds.axes import Bool, Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.fit import switching

MEANS, LOG_STDS, RATES = (0, 2, 7), (1, 3, 8), (4, 5)
SHARE, WIDE_MEAN, WIDE_STD, START = 6, 7, 8, 9

FEW = 12
"""Sequences on which several starts are tried before the best goes on to all."""

_STD = np.log([1e-3, 1e3])  # of a sight, in robust deviations of all errors
_RATE = np.log([1e-7, 5.0])  # per median interval; at 5 the sight is forgotten within one step
LOWER = np.array([-1e3, _STD[0], -1e3, _STD[0], _RATE[0], _RATE[0], -16.0, -1e3, 0.0, -12.0])
UPPER = np.array([1e3, _STD[1], 1e3, _STD[1], _RATE[1], _RATE[1], 0.0, 1e3, np.log(1e5), 12.0])


class Units(NamedTuple):
    """Middle and robust deviation of the errors, m; median interval, s."""

    middle: float
    scale: float
    tick: float


class Sequences(NamedTuple):
    """Times, errors and known sights (-1 unknown), in `Units`; NaN is padding of times and a missing error."""

    t: Float[ndarray, "sequences steps"]
    e: Float[ndarray, "sequences steps"]
    label: Int[ndarray, "sequences steps"]


class Problem(NamedTuple):
    """What is fitted: the free parameters, their lower limits, and the form of the likelihood."""

    free: Bool[ndarray, "10"]
    lower: Float[ndarray, "10"]
    stationary: bool
    outliers: bool


class Maximum(NamedTuple):
    """Parameters, the log likelihood there, its derivative per sequence."""

    theta: Float[ndarray, "10"]
    value: float
    score: Float[ndarray, "sequences 10"]


def units(t: Float[ndarray, "sequences steps"], e: Float[ndarray, "sequences steps"]) -> Units:
    """Median, robust deviation (interquartile range / 1.349) and median interval."""
    there = e[np.isfinite(e)]
    q1, middle, q3 = np.quantile(there, [0.25, 0.5, 0.75])
    scale = (q3 - q1) / 1.349 or float(np.std(there))
    if not scale > 0:
        raise InputError(
            "all range errors are equal", "Fit to measured ranges; ranges computed from the truth have no noise"
        )
    dt = np.diff(t, axis=1)
    return Units(float(middle), float(scale), float(np.median(dt[np.isfinite(dt)])))


def to_si(units: Units) -> tuple[Float[ndarray, "10"], Float[ndarray, "10"]]:
    """Gain and offset such that ``gain * theta + offset`` is in metres and seconds."""
    gain, offset = np.ones(10), np.zeros(10)
    gain[list(MEANS)], offset[list(MEANS)] = units.scale, units.middle
    offset[list(LOG_STDS)] = np.log(units.scale)
    offset[list(RATES)] = -np.log(units.tick)
    return gain, offset


@cache
def _value_and_score(stationary: bool, outliers: bool):
    likelihood = partial(switching.log_likelihood, stationary=stationary, outliers=outliers)
    return jax.jit(jax.vmap(jax.value_and_grad(likelihood), (None, 0, 0, 0)))


def maximise(problem: Problem, theta: Float[ndarray, "10"], data: Sequences, *, iterations: int) -> Maximum:
    """L-BFGS within the limits, on the exact derivative, each parameter scaled by its own information."""
    kernel = _value_and_score(problem.stationary, problem.outliers)
    arrays = tuple(jnp.asarray(d) for d in data)
    theta = np.where(problem.free, np.clip(theta, problem.lower, UPPER), theta)

    def at(theta):
        value, score = kernel(jnp.asarray(theta), *arrays)
        return np.asarray(value), np.asarray(score)

    # The sum of squared scores of the sequences estimates the information: its root makes unit steps comparable.
    unit = 1.0 / np.sqrt(np.maximum((at(theta)[1] ** 2).sum(0), 1.0))[problem.free]

    def spread(x):
        full = theta.copy()
        full[problem.free] = x * unit
        return full

    def cost(x):
        value, score = at(spread(x))
        return -value.sum(), -score.sum(0)[problem.free] * unit

    free = problem.free
    box = np.stack([problem.lower[free] / unit, UPPER[free] / unit], axis=1)
    options = {"maxiter": iterations, "ftol": 1e-12, "gtol": 1e-3, "maxcor": 20}
    found = minimize(cost, theta[free] / unit, jac=True, method="L-BFGS-B", bounds=box, options=options)
    best = spread(np.asarray(found.x))
    value, score = at(best)
    return Maximum(best, float(value.sum()), score)


def starts(data: Sequences, log_wide: float) -> list[Float[ndarray, "10"]]:
    """Several starting points: LOS the lower half, 70 or 90 % of the errors; or both sights alike but one wider."""
    e = np.clip(data.e[np.isfinite(data.e)], -10, 10)
    rest = [np.log(0.05), np.log(0.1), np.log(1e-3), 0.0, log_wide + 0.5, 0.0]
    known = data.label[np.isfinite(data.e)]
    if (known >= 0).any():
        split = [(e[known == 0], e[known == 1])]
    else:
        split = [(e[e <= q], e[e > q]) for q in np.quantile(e, [0.5, 0.7, 0.9])]
    found = [
        np.array([low.mean(), np.log(low.std() + 0.05), high.mean(), np.log(high.std() + 0.05), *rest])
        for low, high in split
        if len(low) and len(high)
    ]
    return found if (known >= 0).any() else [*found, np.array([-0.1, np.log(0.5), 0.1, np.log(2.0), *rest])]


def covariances(problem: Problem, top: Maximum, inner: Bool[ndarray, "10"], data: Sequences, group: Int[ndarray, "n"]):
    """Covariance of the parameters from the observed information, and robust to dependence within groups.

    The second is ``H^-1 (sum_g s_g s_g^T) H^-1`` with the score ``s_g`` of a group (White 1982; Liang and Zeger 1986),
    times ``G / (G - 1)``: it holds for wrong models too.  Parameters that are not ``inner`` (fixed, or at a limit) get
    zero.  H is differenced from the exact derivative.
    """
    kernel = _value_and_score(problem.stationary, problem.outliers)
    arrays = tuple(jnp.asarray(d) for d in data)
    where = np.flatnonzero(inner)
    h = np.zeros((len(where), len(where)))
    for row, i in enumerate(where):
        up, down = top.theta.copy(), top.theta.copy()
        up[i] += 1e-4
        down[i] -= 1e-4
        difference = [np.asarray(kernel(jnp.asarray(x), *arrays)[1]).sum(0)[where] for x in (up, down)]
        h[row] = (difference[1] - difference[0]) / 2e-4
    inverse = np.linalg.pinv(0.5 * (h + h.T), hermitian=True)
    groups = np.unique(group)
    s = np.stack([top.score[group == g][:, where].sum(0) for g in groups])
    robust = inverse @ (s.T @ s) @ inverse * len(groups) / max(len(groups) - 1, 1)
    model, full = np.zeros((10, 10)), np.zeros((10, 10))
    model[np.ix_(where, where)] = inverse
    full[np.ix_(where, where)] = robust if len(groups) > 1 else np.nan
    return model, full
