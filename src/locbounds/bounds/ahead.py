"""Prediction: bounds for a state some steps after the last measurement, for linear motion.

Without measurements in between, the last block of the inverse information matrix moves on as a covariance does,
``P(k+1 given j) = F P(k given j) F' + Q``; that is eq. (39) of McGuire et al. (2009) in covariance form, Q may be
singular.
"""

import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float
from locbounds.bounds.recursion import LinearModel


def predicted(
    model: LinearModel, P: Float[Array, "times state state"], ahead: int
) -> Float[Array, "times state state"]:
    """Bounds for x_k from measurements up to step k - ahead, given those of the filter; before that the prior's.

    Parameters
    ----------
    model
        Motion and prior.
    P
        Filtering bounds at steps 0..K.
    ahead
        Number of steps, at most K.
    """
    F, Q = jnp.asarray(model.F), jnp.asarray(model.Q)
    last = len(F) - 1
    start = jnp.arange(len(P))

    def on(i, moved):
        at = jnp.minimum(start + i, last)
        return F[at] @ moved @ jnp.swapaxes(F[at], 1, 2) + Q[at]

    moved = jax.lax.fori_loop(0, ahead, on, jnp.asarray(P))

    def from_prior(P, step):
        P = step[0] @ P @ step[0].T + step[1]
        return P, P

    first = jnp.asarray(model.P0)
    _, early = jax.lax.scan(from_prior, first, (F[: max(ahead - 1, 0)], Q[: max(ahead - 1, 0)]))
    return jnp.concatenate([first[None], early, moved[: len(P) - ahead]])


def readout(model: LinearModel, ahead: int) -> Float[Array, "steps space state"]:
    """Rows that give the position ``ahead`` steps after each of the steps 1..K (within the record)."""
    F = jnp.asarray(model.F)
    last = len(F) - 1
    start = jnp.arange(1, len(F) + 1)

    def on(i, moved):
        return F[jnp.minimum(start + i, last)] @ moved

    moved = jax.lax.fori_loop(0, ahead, on, jnp.broadcast_to(jnp.eye(F.shape[1]), F.shape))
    return moved[:, jnp.array(model.position)]


def delayed(changes: Float[Array, "groups times"], ahead: int) -> Float[Array, "groups times"]:
    """Changes of the filter's bounds at the rows of the prediction that they belong to."""
    times = changes.shape[1]
    return jnp.concatenate([jnp.zeros((len(changes), ahead)), changes[:, : times - ahead]], axis=1)
