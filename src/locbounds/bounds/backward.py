r"""Smoothing: bounds for every x_k from all measurements of the record, the diagonal blocks of ``J_{0:K}^-1``.

The forward recursion (:mod:`locbounds.bounds.recursion`) treats the increments D_k of the information as measurements
of the window's state. Its adjoint, run backwards, gives what later increments add. With the predicted and updated
window covariances ``S-``, ``S``, the gain ``A = (I + D S-_pp)^-1 D`` and ``M = I - S-[:, p] A E_p'``,

    L-_k = E_p A_k E_p' + M_k' L_k M_k,      L_{k-1} = T_k' L-_k T_k,      L_K = 0,
    P(k given K) = S_k - S_k L_k S_k,

the smoother of Bryson and Frazier for "measurements" whose information need not be positive semidefinite. No matrix of
the motion or of a prediction is inverted, so that Q and the prior may be singular.
"""

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds.ahead import delayed, predicted, readout
from locbounds.bounds.recursion import Increments, LinearModel, Window, covariance_recursion, linear_model
from locbounds.horizon import PREDICT, SMOOTH, Horizon
from locbounds.linalg import symmetrize
from locbounds.scenario import Scenario


def bound_recursion(
    scenario: Scenario | LinearModel,
    increments: Increments,
    horizon: Horizon,
    extra: Float[Array, "times state state"] | None = None,
) -> tuple[Float[Array, "times state state"], Float[Array, "groups times"]]:
    """Bound at steps 0..K for any horizon, and first-order changes of its position part.

    Parameters
    ----------
    scenario, increments, extra
        As for :func:`~locbounds.bounds.recursion.covariance_recursion`.
    horizon
        Which measurements may be used.
    """
    model = linear_model(scenario)
    if horizon.kind == SMOOTH:
        return smoothing_recursion(model, increments, extra)
    if horizon.kind == PREDICT:
        rows = readout(model, horizon.ahead)
        P, changes = covariance_recursion(model, increments, extra=extra, rows=rows)
        return predicted(model, P, horizon.ahead), delayed(changes, horizon.ahead)
    return covariance_recursion(model, increments, extra=extra)


def smoothing_recursion(
    model: LinearModel, increments: Increments, extra: Float[Array, "times state state"] | None = None
) -> tuple[Float[Array, "times state state"], Float[Array, "groups times"]]:
    """Smoothing bounds at steps 0..K, and first-order changes of their position parts."""
    window = Window(model, increments.ages)

    def gather(carried, piece):
        carried, D, dD = increments.advance(carried, piece)
        return carried, (D, dD)

    _, (D, dD) = jax.lax.scan(gather, increments.first(), increments.pieces)
    if dD is None:
        return _smoothed(model, window, D, extra), jnp.zeros((0, len(D) + 1))
    P, change = jax.linearize(lambda D: _smoothed(model, window, D, extra), D)
    index = np.array(model.position)
    changes = jax.lax.map(lambda dD: change(dD)[:, index, index].sum(-1), jnp.moveaxis(dD, 2, 0))
    return P, changes


def _smoothed(
    model: LinearModel, window: Window, D: Float[Array, "steps p p"], extra: Array | None
) -> Float[Array, "times state state"]:
    n = window.n

    def forward(S, inputs):
        F, Q, D, X = inputs
        before = window.predict(S, F, Q)
        after = between = window.update(before, D)
        if X is not None:
            after = window.update(between, X, window.state)
        return after, (before, between, after)

    first = window.first() if extra is None else window.update(window.first(), extra[0], window.state)
    inputs = model.F, model.Q, D, None if extra is None else extra[1:]
    _, (before, between, after) = jax.lax.scan(forward, first, inputs)

    def adjoint(L, S, D, about):
        """What an increment and everything later says, given the covariance before the increment."""
        A = window.gain(S, D, about)
        M = jnp.eye(window.size).at[:, about].add(-S[:, about] @ A)
        return (M.T @ L @ M).at[np.ix_(about, about)].add(A)

    def backward(L, inputs):
        F, D, X, before, between, after = inputs
        P = after[:n, :n] - after[:n] @ L @ after[:, :n]
        if X is not None:
            L = adjoint(L, between, X, window.state)
        T = window.shift(F)
        L = symmetrize(T.T @ adjoint(L, before, D, window.observed) @ T)
        return L, P

    start = jnp.zeros((window.size, window.size))
    L, later = jax.lax.scan(backward, start, (model.F, D, inputs[3], before, between, after), reverse=True)
    initial = first[:n, :n] - first[:n] @ L @ first[:, :n]
    return symmetrize(jnp.concatenate([initial[None], later]))
