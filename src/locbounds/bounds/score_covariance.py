r"""Covariance of the noise score of one link: the part of the Fisher information that depends on the noise alone.

Write ``s_n(r)`` for the location score of the noise at step n in mode r and
``a(n, k) = E[s_n(r_n) | w_{1:k}]``. If position and noise are independent, the information about the positions is
``sum_m C_m(n, n'; k) E[grad h_m(x_n) grad h_m(x_n')^T]`` with ``C(n, n'; k) = E[a(n, k) a(n', k)]``.

For fixed n, ``a(n, k)`` is a martingale in k, so that C grows by the covariance of its increments. With the filtered
law ``p_k(r) = Pr(r_k = r | w_{1:k})``, ``q(r) = Pr(r_{k-1} = r | w_{1:k})`` and the differences between modes
``d_n(r) = E[s_n | w_{1:k-1}, r_{k-1} = r] - E[s_n | w_{1:k-1}, r_{k-1} = 0]``, one new measurement adds

* between older steps n, n': ``E[xi_n xi_n']`` with ``xi_n = sum_r (q(r) - p_{k-1}(r)) d_n(r)``, positive semidefinite
  draw by draw;
* at (k, k), by Louis' identity: the known-mode information minus ``E[Var(s_k | w_{1:k})]``;
* at (n, k), likewise: ``-E[Cov(s_n, s_k | w_{1:k})]``, that is ``-E[sum_r c(r) d_n(r)]`` with
  ``c(r) = E[s_k ; r_{k-1} = r | w_{1:k}] - a(k, k) q(r)``.

The last two replace products of scores, whose noise does not vanish when the modes are certain. No mode sequence is
enumerated; all entries decay with the lag as fast as the chain forgets, which is what the window uses.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.blocks import Stream, block_key
from locbounds.noise import Noise
from locbounds.scenario import Link, Scenario
from locbounds.simulation import draw_noise, draw_sight, equal_weights, likelihood_ratios


class NoiseProcess(NamedTuple):
    """The noise of one link over time: chain, noise per mode, and which steps reported."""

    start: Float[Array, " modes"]
    transitions: Float[Array, "steps modes modes"]
    noises: tuple[Noise, ...]
    reports: Bool[Array, " steps"]


def noise_process(scenario: Scenario, link: Link) -> NoiseProcess:
    """The noise process of a link on the scenario's time steps."""
    reports = np.ones(scenario.steps, dtype=bool) if link.reports is None else link.reports
    return NoiseProcess(
        link.sight.start, link.sight.transitions(scenario.times.intervals), link.noises, jnp.asarray(reports)
    )


def mode_probabilities(process: NoiseProcess) -> Float[Array, "steps modes"]:
    """Law of the mode at steps 1..K before any measurement."""

    def step(law, T):
        law = law @ T
        return law, law

    return jax.lax.scan(step, jnp.asarray(process.start), process.transitions)[1]


def mode_information(process: NoiseProcess) -> Float[Array, " modes"]:
    """Intrinsic accuracy of the noise of every mode, 1/m^2."""
    return jnp.stack([jnp.asarray(noise.information()) for noise in process.noises])


@partial(jax.jit, static_argnames=("groups", "paths", "window", "differentiable"))
def score_covariance_increments(
    process: NoiseProcess,
    seed: Array,
    block: Array,
    *,
    groups: int,
    paths: int,
    window: int,
    differentiable: bool = False,
) -> Float[Array, "groups steps window window"]:
    """Group means of the increments ``C(., .; k) - C(., .; k-1)``, entries by age relative to the horizon k.

    Parameters
    ----------
    process
        The noise process.
    seed, block
        Which draws: ``groups * paths`` noise paths.
    groups, paths, window
        Groups kept apart, paths in each, ages kept.
    differentiable
        Weigh the paths with their likelihood ratios, so that derivatives with respect to the chain are unbiased.

    Notes
    -----
    Cost and memory are linear in steps and paths; the sums over paths are matrix products.
    """
    n, modes = groups * paths, len(process.noises)
    chain, noise = jax.random.split(block_key(seed, Stream.SIGHT_AND_NOISE, block))
    sight = draw_sight(chain, process.start, process.transitions, n)
    w = draw_noise(noise, process.noises, sight)
    reported = process.reports[:, None, None]
    log_l = jnp.where(reported, jnp.stack([law.log_prob(w) for law in process.noises], 1), 0.0)  # [steps, modes, n]
    s = jnp.where(reported, jnp.stack([law.score(w) for law in process.noises], 1), 0.0)
    known = mode_probabilities(process) @ mode_information(process) * process.reports

    weights = None  # of the paths in each group, by step
    if differentiable:
        weights = equal_weights(likelihood_ratios(sight, process.start, process.transitions), groups)

    def step(carry, inputs):
        p, d = carry  # [modes, n], [modes-1, window, n]: d[r, i] at age i, given r_{k-1} = r + 1
        T, log_l, s, known, weight = inputs
        weight = jnp.full((groups, paths), 1 / paths) if weight is None else weight

        def mean(x: Array) -> Array:  # over the paths of each group
            return jnp.sum(x.reshape(*x.shape[:-1], groups, paths) * weight, -1)

        log_l = jnp.where(T.T @ p > 0, log_l, -jnp.inf)  # a mode that cannot be has no say in the scale
        joint = p[:, None] * T[:, :, None] * jnp.exp(log_l - jnp.max(log_l, 0))  # [modes before, modes now, n]
        joint = joint / joint.sum((0, 1))
        p_new, q = joint.sum(0), joint.sum(1)
        s_with = jnp.sum(joint * s, 1)  # E[s_k ; r_{k-1} = r | w_{1:k}]
        a = s_with.sum(0)

        older = d[:, :-1]
        newest = known - mean(jnp.sum(p_new * s**2, 0) - a**2)
        c = s_with - a * q
        cross = -mean(jnp.sum(c[1:, None] * older, 0))
        xi = jnp.sum((q - p)[1:, None] * older, 0).reshape(window - 1, groups, paths)
        old = jnp.einsum("ign,jgn->ijg", xi * weight, xi)
        top = jnp.concatenate([newest[None, None], cross[None]], 1)
        increment = jnp.concatenate([top, jnp.concatenate([cross[:, None], old], 1)], 0)

        backward = joint / jnp.where(p_new > 0, p_new, 1.0)  # Pr(r_{k-1} | r_k, w_{1:k})
        apart = backward[1:, 1:] - backward[1:, :1]
        kept = sum((apart[r, :, None] * older[r] for r in range(modes - 1)), jnp.zeros(()))
        return (p_new, jnp.concatenate([(s[1:] - s[:1])[:, None], kept], 1)), increment

    start = jnp.broadcast_to(jnp.asarray(process.start)[:, None], (modes, n))
    first = start, jnp.zeros((modes - 1, window, n))
    _, increments = jax.lax.scan(step, first, (process.transitions, log_l, s, known, weights))
    return jnp.moveaxis(increments, -1, 0)
