"""Motion and prior from true positions along tracks.

The intensity of a constant-velocity model by maximum likelihood: a Kalman filter per axis whose start is exactly
diffuse (the first two positions give the state and its covariance), at the tracks' own irregular times.

References
----------
Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, sections 6.2.2 (the
model) and 5.5.3 (two-point initiation).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from locbounds.axes import Array, Float, ndarray
from scipy.optimize import minimize_scalar

from locbounds.errors import InputError
from locbounds.precision import double_precision

STRAIGHT = 0.9
"""Share of steps on a straight line at constant speed from which the truth is reported as interpolated."""


@dataclass(frozen=True)
class MotionFit:
    """Fitted intensity of the constant-velocity model.

    Attributes
    ----------
    psd_m2_s3 : float
        Power spectral density of the white acceleration, m^2/s^3, the same on all axes.
    stderr : float
        Its standard error, from the scores of the tracks (robust to a wrong model); NaN with one track.
    truth_std_m : float
        The deviation of the true positions that was assumed, m.
    straight_share : float
        Share of steps at which the velocity of the truth does not change within ``truth_std_m``.
    tracks, steps : int
        What was fitted to.
    notes : tuple of str
    """

    psd_m2_s3: float
    stderr: float
    truth_std_m: float
    straight_share: float
    tracks: int
    steps: int
    notes: tuple[str, ...] = ()


def _log_likelihood(
    log_q: Float[Array, ""], r2: Float[Array, ""], t: Float[Array, "n"], x: Float[Array, "n space"]
) -> Float[Array, ""]:
    """log p(x_2.. | x_0, x_1) of positions at times t; NaN times at the end are padding."""
    q = jnp.exp(log_q)
    dt = jnp.diff(t)
    ok = jnp.isfinite(dt)
    dt, x = jnp.where(ok, dt, 1.0), jnp.where(jnp.isfinite(x), x, 0.0)
    # Position and velocity at x_1 from a flat start: v = (x_1 - x_0)/dt, whose error is also the process noise's.
    p, v = x[1], (x[1] - x[0]) / dt[0]
    start = (p, v, r2, r2 / dt[0], 2 * r2 / dt[0] ** 2 + q * dt[0] / 3)

    def step(carry, inputs):
        p, v, pp, pv, vv = carry
        dt, z, ok = inputs
        m = p + dt * v
        a = pp + 2 * dt * pv + dt**2 * vv + q * dt**3 / 3
        b = pv + dt * vv + q * dt**2 / 2
        c = vv + q * dt
        s = a + r2
        y = z - m
        new = (m + a / s * y, v + b / s * y, a * r2 / s, b * r2 / s, c - b * b / s)
        gain = -0.5 * jnp.sum(y**2 / s + jnp.log(2 * jnp.pi * s))
        return jax.tree.map(lambda n, o: jnp.where(ok, n, o), new, carry), jnp.where(ok, gain, 0.0)

    _, gains = jax.lax.scan(step, start, (dt[1:], x[2:], ok[1:]))
    return gains.sum()


@cache
def _kernel():
    return jax.jit(jax.vmap(jax.value_and_grad(_log_likelihood), (None, None, 0, 0)))


@double_precision
def fit_psd(times_s, positions_m, *, truth_std_m: float = 1e-3) -> MotionFit:
    """Intensity of the constant-velocity model by maximum likelihood, pooled over tracks and axes.

    Parameters
    ----------
    times_s : sequence of arrays [n]
        Times of each track, s, increasing.
    positions_m : sequence of arrays [n, space]
        True positions, m.
    truth_std_m : float
        Known deviation of the true positions, independent from one to the next, m.  Zero is allowed.

    Returns
    -------
    MotionFit

    Raises
    ------
    InputError
        No track with three positions, or a truth without any change of velocity.

    Notes
    -----
    A truth interpolated between corner points has no acceleration but at the corners; the estimate is then the
    mean squared change of velocity per second, which is right for the model's covariance on the time scale of a leg,
    and says little about single steps.

    Examples
    --------
    With exact velocity changes of deviation 0.1 m/s once a second, the intensity is near 0.01 m^2/s^3:

    >>> rng = np.random.default_rng(0)
    >>> t = np.arange(2000.0)
    >>> x = np.cumsum(np.cumsum(0.1 * rng.normal(size=(2000, 2)), 0), 0)
    >>> round(fit_psd([t], [x]).psd_m2_s3, 2)
    0.01
    """
    pairs = [(np.asarray(t, float), np.asarray(x, float)) for t, x in zip(times_s, positions_m, strict=True)]
    pairs = [(t, x) for t, x in pairs if len(t) >= 3]
    if not pairs:
        raise InputError(
            "no track has three true positions: motion.psd_m2_s3 cannot be estimated", "Give a value for it"
        )
    if not truth_std_m >= 0:
        raise InputError(f"truth_std_m is {truth_std_m}", "Give the deviation of the true positions in metres")
    n, dim = max(len(t) for t, _ in pairs), pairs[0][1].shape[1]
    t, x = np.full((len(pairs), n), np.nan), np.full((len(pairs), n, dim), np.nan)
    turns = []  # change of velocity over the mean of both intervals' lengths, as a distance from the straight line
    for i, (ti, xi) in enumerate(pairs):
        t[i, : len(ti)], x[i, : len(ti)] = ti - ti[0], xi - xi[0]
        dt = np.diff(ti)[:, None]
        change = np.diff(np.diff(xi, axis=0) / dt, axis=0)
        turns.append(np.column_stack([np.linalg.norm(change, axis=1), (dt[1:, 0] + dt[:-1, 0]) / 2]))
    turn = np.concatenate(turns)
    moment = float((turn[:, 0] ** 2).sum() / dim / turn[:, 1].sum())  # mean squared velocity change per second
    limit = truth_std_m**2 / float(np.median(turn[:, 1])) ** 3  # what the jitter alone would look like
    if not moment > 0:
        raise InputError(
            "the true velocity never changes: motion.psd_m2_s3 cannot be estimated", "Give a value for it"
        )
    arrays, r2, kernel = (jnp.asarray(t), jnp.asarray(x)), jnp.asarray(truth_std_m**2), _kernel()

    def at(log_q: float):
        value, score = kernel(jnp.asarray(log_q), r2, *arrays)
        return np.asarray(value), np.asarray(score)

    low, high = np.log(moment) - 25.0, np.log(moment) + 5.0
    coarse = np.linspace(low, high, 31)
    best = coarse[int(np.argmax([at(g)[0].sum() for g in coarse]))]
    found = minimize_scalar(
        lambda g: -at(g)[0].sum(), bounds=(max(low, best - 1), min(high, best + 1)), method="bounded"
    )
    log_q = float(found.x)
    if log_q < low + 0.5:
        raise InputError(
            f"the true velocity does not change by more than its error of {truth_std_m} m allows: "
            "motion.psd_m2_s3 cannot be estimated",
            "Give a value for it, or a smaller truth_std_m",
        )
    score = at(log_q)[1]
    curvature = (at(log_q - 1e-3)[1].sum() - at(log_q + 1e-3)[1].sum()) / 2e-3
    g = len(pairs)
    relative = np.sqrt((score**2).sum() * g / (g - 1)) / curvature if g > 1 else np.nan
    straight = float(np.mean(turn[:, 0] * turn[:, 1] <= max(2 * truth_std_m, 1e-9)))
    notes = []
    if straight > STRAIGHT:
        notes.append(
            f"The truth is a straight line at constant speed in {straight:.0%} of its steps, as if interpolated between "
            "corner points: the intensity measures the corners, not the real walk, and may be too small."
        )
    if np.exp(log_q) < limit * 1e-3:
        notes.append(
            f"The assumed error of the truth, {truth_std_m:g} m, hides most single changes of velocity: the intensity "
            "rests on changes that last."
        )
    return MotionFit(
        psd_m2_s3=float(np.exp(log_q)),
        stderr=float(np.exp(log_q) * relative),
        truth_std_m=float(truth_std_m),
        straight_share=straight,
        tracks=g,
        steps=int(sum(len(t) - 1 for t, _ in pairs)),
        notes=tuple(notes),
    )


def prior_from_tracks(
    times_s: Sequence[ndarray], positions_m: Sequence[ndarray], *, where: str = "area", window_s: float = 1.0
) -> tuple[ndarray, ndarray]:
    """Mean and covariance of position and velocity over tracks, as a Gaussian prior of step 0.

    Parameters
    ----------
    times_s, positions_m
        As for `fit_psd`.
    where : {"area", "start"}
        "area": the mobile is somewhere the tracks have been, each moment alike (default: it promises nothing about
        where a new track starts).  "start": it starts where the tracks started, for logs that always begin at the same
        place; needs at least three tracks.
    window_s : float
        Velocities are differences over at least this long, so that jitter of the truth does not enter.

    Returns
    -------
    mean [state], covariance [state, state]
        State order: position, velocity; SI.  Position and velocity are taken as uncorrelated.
    """
    if where not in ("area", "start"):
        raise InputError(f'prior is "{where}"', 'Choose "area" or "start"')
    if where == "start" and len(times_s) < 3:
        raise InputError(
            f"{len(times_s)} tracks do not tell where tracks start: prior.position_m cannot be estimated",
            'Give it, or take "area"',
        )
    places, weights, speeds, spans = [], [], [], []
    for t, x in zip(times_s, positions_m, strict=True):
        t, x = np.asarray(t, float), np.asarray(x, float)
        gap = np.gradient(t)
        places.append(x[:1] if where == "start" else x)
        weights.append(np.ones(1) if where == "start" else gap)
        ahead = np.minimum(np.searchsorted(t, t + window_s), len(t) - 1)
        use = ahead > np.arange(len(t))
        speeds.append(((x[ahead] - x) / np.where(use, t[ahead] - t, 1.0)[:, None])[use])
        spans.append(gap[use])
    dim = places[0].shape[1]
    mean, covariance = np.zeros(2 * dim), np.zeros((2 * dim, 2 * dim))
    for block, values, weight in ((slice(0, dim), places, weights), (slice(dim, None), speeds, spans)):
        v, w = np.concatenate(values), np.concatenate(weight)
        mean[block] = w @ v / w.sum()
        d = v - mean[block]
        covariance[block, block] = (d * w[:, None]).T @ d / w.sum()
    if where == "start":
        covariance[:dim, :dim] *= len(times_s) / (len(times_s) - 1)
    # A straight corridor leaves one direction without spread: keep the covariance positive definite.
    floor = 1e-6 * np.trace(covariance[:dim, :dim]) / dim, 1e-6 * np.trace(covariance[dim:, dim:]) / dim
    return mean, covariance + np.diag(np.repeat(np.maximum(floor, 1e-12), dim))
