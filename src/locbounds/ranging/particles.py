"""Particle filter of a distance that stays alive where likelihoods have hard edges."""

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, ndarray
from locbounds.blocks import check_seed
from locbounds.errors import InputError
from locbounds.filters import Estimates
from locbounds.filters.resampling import systematic
from locbounds.noise import Gaussian
from locbounds.precision import double_precision
from locbounds.ranging.likelihood import limits, table
from locbounds.ranging.model import DistanceModel

AT_ONCE = 32  # runs
NODES = 128  # distances at which the likelihood is computed; particles look it up
LEAST_SHARE = 0.5  # effective share of the particles below which they are resampled


class DistanceParticles(eqx.Module):
    """Rao-Blackwellised particle filter: the attainable reference for any noise.

    Particles are paths of the distance; its derivatives given a path are Gaussian and follow from a Kalman filter.
    (With particles for the derivatives too, a driving noise of rank one leaves them no diversity, and tracks are lost.)

    A step at which no particle explains the samples (all of them lie outside the support of some sample's error) is
    counted, and the particles are drawn anew between the limits that the samples set to the distance, keeping their
    derivatives; where the samples contradict each other the prediction goes on alone. ``diagnostics["stranded"]`` says
    how often, per run.

    Parameters
    ----------
    particles
        How many.

    Raises
    ------
    InputError
        If there are fewer than two particles.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.ranging import DistanceModel, DistanceParticles, TimeOfArrival, evaluate_distance
    >>> toa = TimeOfArrival(lb.TruncatedGaussian(0.0, 3.5, -7.0, 7.0), lb.Uniform(0.0, 3.0), samples=10)
    >>> model = DistanceModel(lb.Times.uniform(step_s=1.0, steps=4), [10, 0, 0], [2, 0.5, 0.75], 1.0, [toa])
    >>> found = evaluate_distance(DistanceParticles(200), model, runs=32)
    >>> int(found.diagnostics["stranded"].sum())
    0
    """

    particles: int = eqx.field(static=True, default=2_000)

    id: ClassVar[str] = "distance-particles"
    name: ClassVar[str] = "particle filter"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges"})

    def __check_init__(self):
        if self.particles < 2 or int(self.particles) != self.particles:
            raise InputError(f"the number of particles is {self.particles}", "Give a whole number of at least 2")

    @double_precision
    def __call__(
        self, model: DistanceModel, z: Sequence[Float[ndarray, "runs steps samples"]], seed: int = 0
    ) -> Estimates:
        """Filter many runs; ``z`` as from :func:`~locbounds.ranging.measure`.

        Raises
        ------
        RefusedError
            If samples share a bias and their own noise is not Gaussian.
        """
        laws = [sensor.epoch_noise()[0] for sensor in model.sensors]
        z = [np.mean(s, -1, keepdims=True) if sensor.shares else s for sensor, s in zip(model.sensors, z, strict=True)]
        runs = len(z[0])
        padded = -(-runs // AT_ONCE) * AT_ONCE
        samples = tuple(
            jnp.asarray(np.concatenate([s, np.repeat(s[-1:], padded - runs, 0)])).reshape(-1, AT_ONCE, *s.shape[1:])
            for s in z
        )
        keys = jax.random.split(jax.random.key(check_seed(seed)), padded // AT_ONCE)
        plain = tuple(  # their laws are in the tables: one compiled filter for all of them
            dataclasses.replace(sensor, noise=Gaussian(0.0, 1.0), bias=None, samples=1, common=False)
            for sensor in model.sensors
        )
        mean, variance, stranded = _filter(
            _conditional(model),
            plain,
            tuple(table(noise) for noise in laws),
            samples,
            keys,
            jnp.asarray([limits(noise) for noise in laws]),
            particles=self.particles,
        )
        shape = (padded, model.steps + 1)
        return Estimates(
            np.asarray(mean).reshape(*shape, -1)[:runs],
            np.asarray(variance).reshape(*shape, model.size, model.size)[:runs],
            {"stranded": np.asarray(stranded).reshape(padded)[:runs]},
        )


def _looked_up(
    d: Float[Array, "particles runs"], left: Float[Array, " runs"], right: Float[Array, " runs"], function: Any
) -> Float[Array, "particles runs"]:
    """A log-likelihood at many distances from its values at few between two limits; minus infinity outside of them.

    Logarithms are interpolated, next to a node where the likelihood is zero the likelihood itself.
    """
    step = jnp.maximum(right - left, 0.0) / (NODES - 1)
    values = function(left + step * jnp.arange(NODES)[:, None])
    x = (d - left) / jnp.where(step > 0, step, 1.0)
    i = jnp.clip(jnp.floor(x), 0, NODES - 2).astype(int)
    share = x - i
    a, b = (jnp.take_along_axis(values, j, axis=0) for j in (i, i + 1))
    inside = (x >= 0) & (x <= NODES - 1) & (step > 0)
    both = (a > -jnp.inf) & (b > -jnp.inf)
    smooth = jnp.where(both, a, 0.0) + share * (jnp.where(both, b, 0.0) - jnp.where(both, a, 0.0))
    edge = jnp.maximum(a, b) + jnp.log(jnp.where(a > -jnp.inf, 1 - share, share))
    return jnp.where(inside, jnp.where(both, smooth, edge), -jnp.inf)


class _Motion(NamedTuple):
    """The law of the distance given the earlier distances, as a Kalman filter that sees them exactly has it.

    ``d_k ~ N((F m)_0, S_k)``, then ``m <- F m + K_k (d_k - (F m)_0)``; m is the mean of the whole state given the
    particle's distances, P its covariance, the same for all particles.
    """

    F: Float[Array, "steps state state"]
    K: Float[Array, "steps state"]
    root: Float[Array, " steps"]
    P: Float[Array, "times state state"]
    mean: Float[Array, " state"]
    std: Float[Array, ""]


def _conditional(model: DistanceModel) -> _Motion:
    F, Q = np.asarray(model.motion.F), np.asarray(model.motion.Q)
    P = np.diag(np.asarray(model.std) ** 2)
    P[0] = 0.0
    gains, roots, spreads = [], [], [P]
    for F_k, Q_k in zip(F, Q, strict=True):
        P = F_k @ P @ F_k.T + Q_k
        S = P[0, 0]
        gain = P[0] / S if S > 0 else np.eye(len(P))[0]
        P = P - np.outer(gain, P[0])
        P = 0.5 * (P + P.T)
        gains.append(gain)
        roots.append(np.sqrt(S))
        spreads.append(P)
    numbers = (F, np.array(gains), np.array(roots), np.array(spreads), model.mean, model.std[0])
    return _Motion(*(jnp.asarray(a) for a in numbers))


@eqx.filter_jit
def _filter(motion, sensors, tables, samples, keys, ends, *, particles):
    return jax.lax.map(
        lambda piece: _some_runs(motion, sensors, tables, piece[0], piece[1], particles, ends), (samples, keys)
    )


def _some_runs(motion: _Motion, sensors: Any, tables: Any, z: Any, key: Any, N: int, ends: Any) -> Any:
    """[runs, times, state] means, covariances, and how many steps had no particle in the support."""
    runs, n = z[0].shape[0], len(motion.mean)
    start, go = jax.random.split(key)
    x = jnp.broadcast_to(motion.mean[:, None, None], (n, N, runs))
    x = x.at[0].add(motion.std * jax.random.normal(start, (N, runs)))

    def log_likelihood(d, here):  # d [particles, runs], samples [runs, samples]
        total = jnp.zeros_like(d)
        for sensor, t, s in zip(sensors, tables, here, strict=True):
            mean = sensor.mean(d)
            known = jnp.isfinite(mean)
            each = jnp.where(known, mean, 0.0)
            for m in range(s.shape[1]):
                total = total + t.log_prob(s[:, m] - each)
            total = jnp.where(known, total, -jnp.inf)
        return total

    def possible(here):
        """Limits that bounded errors set to the distance."""
        low, high = jnp.full(runs, -jnp.inf), jnp.full(runs, jnp.inf)
        for m, (sensor, s) in enumerate(zip(sensors, here, strict=True)):
            a, b = ends[m]
            one, two = sensor.inverse(s.max(1) - b), sensor.inverse(s.min(1) - a)
            low = jnp.maximum(low, jnp.minimum(one, two))
            high = jnp.minimum(high, jnp.maximum(one, two))
        return low, high

    def step(carry, piece):
        x, before = carry
        F, K, root, P, key, here = piece
        move, draw = jax.random.split(key)
        x = jnp.stack([sum(F[a, b] * x[b] for b in range(n)) for a in range(n)])
        x = x + (K * root)[:, None, None] * jax.random.normal(move, (N, runs))
        low, high = possible(here)
        left, right = jnp.maximum(low, x[0].min(0)), jnp.minimum(high, x[0].max(0))
        apart = ~(right > left)
        can = apart & (high > low) & jnp.isfinite(low) & jnp.isfinite(high)
        anew = low + (high - low) * (jnp.arange(N)[:, None] + 0.5) / N
        x = x.at[0].set(jnp.where(can, anew, x[0]))
        left, right = jnp.where(can, low, left), jnp.where(can, high, right)
        seen = _looked_up(x[0], left, right, lambda d: log_likelihood(d, here))
        weight = jnp.where(can, 0.0, before) + seen
        lost = apart | ~jnp.any(weight > -jnp.inf, 0)
        weight = jnp.where(jnp.any(weight > -jnp.inf, 0), weight, before)  # contradictory samples: the prediction alone
        w = jnp.exp(weight - weight.max(0))
        w = w / w.sum(0)
        mean = jnp.sum(x * w, 1)
        e = x - mean[:, None]
        spread = jnp.stack([jnp.stack([jnp.sum(w * a * b, 0) for b in e], -1) for a in e], -1) + P
        few = jnp.sum(w**2, 0) * N * LEAST_SHARE > 1
        chosen = jnp.where(few, systematic(w, jax.random.uniform(draw, (runs,))), jnp.arange(N)[:, None])
        x = jnp.take_along_axis(x, chosen[None], axis=1)
        return (x, jnp.where(few, 0.0, weight - weight.max(0))), (mean.T, spread, lost)

    here = tuple(jnp.moveaxis(s, 1, 0) for s in z)
    pieces = (motion.F, motion.K, motion.root, motion.P[1:], jax.random.split(go, len(motion.F)), here)
    _, (mean, spread, lost) = jax.lax.scan(step, (x, jnp.zeros((N, runs))), pieces)
    first = jnp.broadcast_to(motion.mean, (1, runs, n))
    start_spread = jnp.broadcast_to(motion.P[0].at[0, 0].set(motion.std**2), (1, runs, n, n))
    mean, spread = jnp.concatenate([first, mean]), jnp.concatenate([start_spread, spread])
    return jnp.moveaxis(mean, 0, 1), jnp.moveaxis(spread, 0, 1), lost.sum(0)
