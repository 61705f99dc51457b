r"""Increments of the information from one part of a model, step by step.

Let ``g_n(r)`` be the score of step n in mode r, the gradient of ``log p(z_n | x_n, r)``, plus
``log p(x_n | x_{n-1}, r)`` where the motion belongs to the part. The mean ``a_n(k) = E[g_n(r_n) | x, z_{1:k}]`` is a
martingale in k, its expectation given the past is zero at k = n, and the score of horizon k is ``sum_n a_n(k)``. Hence
the information grows by ``E[D_k D_k^T]`` with ``D_k = a_k(k) + sum_{n<k} (a_n(k) - a_n(k-1))``. See the theory page.

With the filtered law ``p_k(r)``, ``q(r) = Pr(r_{k-1} = r | x, z_{1:k})`` and the differences between modes
``d_n(r) = E[g_n | past, r_{k-1} = r] - E[g_n | past, r_{k-1} = 0]`` one step adds

* between older steps ``E[xi_n xi_n'^T]``, ``xi_n = sum_r (q(r) - p_{k-1}(r)) d_n(r)``;
* at (k, k), by Louis' identity, the known-mode information minus ``E[Cov(g_k | x, z_{1:k})]``;
* at (k, n) ``-E[Cov(g_k, g_n | x, z_{1:k})] = -E[sum_r c(r) d_n(r)^T]``,
  ``c(r) = E[g_k ; r_{k-1} = r] - a_k(k) q(r)``.

No mode sequence is enumerated and no derivative runs through the recursion.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds.general.parts import Part
from locbounds.bounds.general.switching_motion import Steps


class Increments(NamedTuple):
    """Group means.

    Attributes
    ----------
    information
        By age relative to the horizon of step k: age 0 is x_k.
    score
        Of the newest score, then of each density's own that the user wrote: zero in expectation, which checks
        densities against samplers.
    """

    information: Float[Array, "groups steps ages components ages components"]
    score: Float[Array, "groups steps scores"]


@eqx.filter_jit
def information_increments(
    part: Part,
    x: Float[Array, "times samples state"],
    z: tuple[Array, ...],
    exact: Float[Array, "steps m m"],
    *,
    groups: int,
    window: int,
) -> Increments:
    """Group means of one part's increments.

    Parameters
    ----------
    part
        The part.
    x, z
        Paths and the part's measurements.
    exact
        Known-mode information that needs no draws; added to the newest step's.
    groups
        Groups that the samples are divided into.
    window
        Scores kept: ages 0..window-1; they are about ages 0..window-1 of the state, one more with lag 1.
    """
    n, modes, lag, v = x.shape[1], part.modes, part.lag, len(part.components)
    exact_root = part.exact_roots()
    density = part.densities()
    m = v * (1 + lag)

    def evaluate(x, before, z, motion, k, reported):
        return jax.vmap(lambda x, before, z: part.evaluate(x, before, z, motion, k, reported))(x, before, z)

    def mean(u: Array) -> Array:
        return u.reshape(groups, -1, *u.shape[1:]).mean(1)

    def products(a: Array, b: Array) -> Array:  # group means of sums of outer products: [n, i, a], [n, i, b]
        a, b = (u.reshape(groups, n // groups * u.shape[1], u.shape[2]) for u in (a, b))
        return jnp.einsum("gia,gib->gab", a, b) * (groups / n)

    def step(carry, inputs):
        p, law, d, before = carry  # d [n, modes-1, window, m]: at age i, given r_{k-1} = r + 1
        k, T, x, z, motion, reported, exact = inputs
        log_l, g, roots = evaluate(x, before, z, motion, k, reported)
        log_l = jnp.where(p @ T > 0, log_l, -jnp.inf)  # a mode that cannot be has no say in the scale
        joint = p[:, :, None] * T * jnp.exp(log_l - jnp.max(log_l, -1, keepdims=True))[:, None, :]
        joint = joint / joint.sum((1, 2), keepdims=True)
        p_new, q, law = joint.sum(1), joint.sum(2), law @ T
        g_with = jnp.einsum("nij,njm->nim", joint, g)  # E[g_k ; r_{k-1} = r | past and present]
        a = g_with.sum(1)

        older = d[:, :, : window - 1]
        weight = jnp.where(exact_root, law[:, None], p_new[:, :, None])
        root = roots * jnp.sqrt(weight)[..., None]
        root = root.reshape(n, modes * len(exact_root), m)
        known = products(root, root) + exact
        weighted = jnp.sqrt(p_new)[..., None] * g
        newest = known - products(weighted, weighted) + products(a[:, None], a[:, None])
        c = g_with - a[:, None] * q[..., None]
        cross = -products(c[:, 1:], older.reshape(n, modes - 1, (window - 1) * m))
        xi = jnp.einsum("nr,nrwm->nwm", (q - p)[:, 1:], older)
        xi = _spread(xi, v, lag).reshape(n, 1, (window - 1 + lag) * v)
        table = _table(newest, cross.reshape(groups, m, window - 1, m), products(xi, xi), window, v, lag)

        backward = joint / jnp.where(p_new > 0, p_new, 1.0)[:, None, :]  # Pr(r_{k-1} | r_k, past and present)
        apart = backward[:, 1:, 1:] - backward[:, 1:, :1]
        kept = jnp.einsum("nrs,nrwm->nswm", apart, older)
        d = jnp.concatenate([(g[:, 1:] - g[:, :1])[:, :, None], kept], 2)
        own_scores = jnp.einsum("nr,nrcm->ncm", p_new, roots[:, :, density]).reshape(n, int(density.sum()) * m)
        return (p_new, law, d, x), (table, mean(jnp.concatenate([a, own_scores], -1)))

    first = (
        jnp.broadcast_to(jnp.asarray(part.start), (n, modes)),
        jnp.asarray(part.start),
        jnp.zeros((n, modes - 1, window, m)),
        x[0],
    )
    steps = jnp.arange(1, len(x))
    motion = part.motion if isinstance(part.motion, Steps) else None
    inputs = (steps, part.transitions, x[1:], z, motion, part.reports, exact)
    _, (table, score) = jax.lax.scan(step, first, inputs)
    return Increments(jnp.moveaxis(table, 0, 1), jnp.moveaxis(score, 0, 1))


def _spread(u: Float[Array, "*n ages m"], v: int, lag: int) -> Float[Array, "*n ages_and_lag v"]:
    """From scores about (x_n, x_{n-1}) by age to scores about every state."""
    if not lag:
        return u
    none = [(0, 0)] * (u.ndim - 2)
    return jnp.pad(u[..., :v], [*none, (0, 1), (0, 0)]) + jnp.pad(u[..., v:], [*none, (1, 0), (0, 0)])


def _table(newest: Array, cross: Array, old: Array, window: int, v: int, lag: int) -> Array:
    """One step's increments by age; the newest score is about ages 0..lag, older ones about ages 1 and more."""
    groups, ages = len(newest), window + lag
    near, far = np.arange(v * (1 + lag)), np.arange(v, v * ages)
    cross = _spread(cross, v, lag).reshape(groups, len(near), (window - 1 + lag) * v)
    table = jnp.zeros((groups, v * ages, v * ages))
    table = table.at[:, near[:, None], near].add(newest)
    if window > 1:
        table = table.at[:, near[:, None], far].add(cross).at[:, far[:, None], near].add(jnp.swapaxes(cross, 1, 2))
        table = table.at[:, far[:, None], far].add(old)
    return table.reshape(groups, ages, v, ages, v)
