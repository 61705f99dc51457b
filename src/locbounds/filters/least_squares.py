"""Position from ranges by nonlinear least squares, for many tracks at once."""

from typing import Any

import jax
import jax.numpy as jnp

from locbounds.axes import Array
from locbounds.filters.range_update import direction
from locbounds.filters.tracks_last import Symmetric, Vector, dot, materialise, solve, upper

ITERATIONS = 8
RIDGE = 1e-12  # relative: keeps a singular geometry solvable, far below what a position accuracy can notice
DAMPING = 1e-6  # relative, at the start: practically Gauss-Newton
CLEARLY_BETTER = 25.0  # by how much the squared normalised residuals must differ for the track to jump: 5 deviations


def _normal_equations(
    position: Vector, anchors: Array, ranges: Array, weights: Array
) -> tuple[Array, Symmetric, Vector]:
    """Cost, ``sum w u u^T`` and ``sum w u (range - distance)`` over links."""
    h, u = direction(position, anchors.T[:, :, None])
    residual = ranges - h
    wu = [weights * a for a in u]
    return (
        jnp.sum(weights * residual**2, axis=0),
        {(i, j): jnp.sum(wu[i] * u[j], axis=0) for i, j in upper(len(u))},
        [jnp.sum(a * residual, axis=0) for a in wu],
    )


def damped(G: Symmetric, damping: Array | float) -> Symmetric:
    """``G + damping tr(G) I``."""
    dim = 1 + max(i for i, _ in G)
    extra = (damping + RIDGE) * sum(G[i, i] for i in range(dim))
    return {(i, j): G[i, j] + extra if i == j else G[i, j] for i, j in G}


def _descend(start: Vector, anchors: Array, ranges: Array, weights: Array) -> Vector:
    """Levenberg-Marquardt with a fixed number of steps; a step that does not lower the cost is not taken."""

    def iterate(_: Any, carry: Any) -> Any:
        position, damping, (cost, G, b) = carry
        trial = [p + d for p, d in zip(position, solve(damped(G, damping), b), strict=True)]
        there = materialise(_normal_equations(trial, anchors, ranges, weights))
        better = there[0] <= cost
        position, state = jax.tree.map(
            lambda new, old: jnp.where(better, new, old), (trial, there), (position, (cost, G, b))
        )
        damping = jnp.where(better, 0.1 * damping, jnp.maximum(100.0 * damping, 1e-3))
        return materialise((position, damping, state))

    first = materialise(_normal_equations(start, anchors, ranges, weights))
    carry = start, jnp.full_like(start[0], DAMPING), first
    return jax.lax.fori_loop(0, ITERATIONS, iterate, carry)[0]


def _linear_solution(anchors: Array, ranges: Array, weights: Array) -> Vector:
    """Least squares of the equations ``2 (a_l - a)^T p = |a_l|^2 - r_l^2 - mean``, linear in the position."""
    share = weights / jnp.sum(weights, axis=0)
    a = [anchors[:, i, None] for i in range(anchors.shape[1])]
    centre = [jnp.sum(share * c, axis=0) for c in a]
    offset = [c - m for c, m in zip(a, centre, strict=True)]
    right = 0.5 * (dot(offset, offset) - ranges**2)
    right = right - jnp.sum(share * right, axis=0)
    G = {(i, j): jnp.sum(share * offset[i] * offset[j], axis=0) for i, j in upper(len(a))}
    x = solve(damped(G, 1e-9), [jnp.sum(share * c * right, axis=0) for c in offset])
    return [c + m for c, m in zip(x, centre, strict=True)]


def locate(start: Vector, anchors: Array, ranges: Array, weights: Array, precision: Array) -> Vector:
    """Minimise ``sum_l w_l (range_l - |p - a_l|)^2`` over the position p.

    Two descents, one from the given start and one from the solution of the linearised equations. The second is taken
    only if the ranges contradict the first, measured against their own variances: behind nearly collinear anchors lies
    a mirror image that fits about as well, and must not capture the track.

    Parameters
    ----------
    start
        Position to start from, [space] of [tracks].
    anchors
        [links, space] metres.
    ranges, weights, precision
        [links, tracks]; precision are the inverse variances of the ranges.
    """
    near = _descend(start, anchors, ranges, weights)
    far = _descend(_linear_solution(anchors, ranges, weights), anchors, ranges, weights)
    misfit, other = (_normal_equations(p, anchors, ranges, precision)[0] for p in (near, far))
    switch = materialise(misfit > other + CLEARLY_BETTER)
    return [jnp.where(switch, b, a) for a, b in zip(near, far, strict=True)]
