"""From increments of information about the last positions to the bound at every horizon.

Covariance form on a window of the last states: no inverse of the process noise or the prior, so that singular ones
work, and a cost linear in steps. With a window as long as the scenario it is the exact inverse of the whole
information matrix ``J_{0:k}`` at every k; with a shorter one, older information is kept as it was when it left the
window.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.linalg import symmetrize
from locbounds.scenario import Scenario


class LinearModel(NamedTuple):
    """Linear Gaussian motion, prior, and the state components that the increments of information are about."""

    F: Float[Array, "steps state state"]
    Q: Float[Array, "steps state state"]
    P0: Float[Array, "state state"]
    index: tuple[int, ...]


def linear_model(scenario: Scenario | LinearModel) -> LinearModel:
    """Motion and prior of a scenario, whose increments are about positions."""
    if isinstance(scenario, LinearModel):
        return scenario
    return LinearModel(
        scenario.transition,
        scenario.process_noise,
        jnp.asarray(scenario.prior.covariance),
        scenario.motion.position_index,
    )


def covariance_recursion(
    scenario: Scenario | LinearModel, increments: Float[Array, "steps window space window space"]
) -> Float[Array, "times state state"]:
    """Bound on the mean square error matrix at steps 0..K.

    Parameters
    ----------
    scenario
        Motion and prior are taken from it; or these alone.
    increments
        Information that the measurement of step k adds about the positions (the components ``index`` of a
        :class:`LinearModel`) at ages 0..W-1 (age 0 is step k).

    Notes
    -----
    Window covariance S of [x_k, position at age 1, ..., position at age W-1]; predict ``S <- T S T' + Q``, update
    ``S <- S - S_p (I + D S_pp)^-1 D S_p'`` with the information increment D on the positions p.
    """
    model = linear_model(scenario)
    n = len(model.P0)
    window = _Window(model, increments.shape[1])

    def step(S, inputs):
        F, Q, D = inputs
        S = window.update(window.predict(S, F, Q), D)
        return S, S[:n, :n]

    inputs = (model.F, model.Q, window.flat(increments))
    return jnp.concatenate([jnp.asarray(model.P0)[None], jax.lax.scan(step, window.first(), inputs)[1]])


def covariance_deviations(
    scenario: Scenario | LinearModel,
    increments: Float[Array, "steps window space window space"],
    changes: Float[Array, "groups steps window space window space"],
) -> Float[Array, "groups times state state"]:
    """First-order changes of :func:`covariance_recursion` for several changes of the increments.

    From ``dS <- T dS T'`` and ``d (S^-1 + D)^-1 = K dS K' - S+ dD S+`` with ``K = S+ S^-1 = I - S+ D``: all groups
    share the matrices, so that each step is four matrix products.
    """
    model = linear_model(scenario)
    n = len(model.P0)
    window = _Window(model, increments.shape[1])
    groups = len(changes)

    def step(carry, inputs):
        S, dS = carry
        F, Q, D, dD = inputs
        S = window.update(window.predict(S, F, Q), D)
        L = S[:, window.observed]
        M = (jnp.eye(window.size).at[:, window.observed].add(-L @ D)) @ window.shift(F)
        dS = jnp.einsum("ab,gbc,dc->gad", M, dS, M) - jnp.einsum("ab,gbc,dc->gad", L, dD, L)
        return (S, dS), dS[:, :n, :n]

    inputs = (model.F, model.Q, window.flat(increments), jnp.moveaxis(window.flat(changes), 0, 1))
    first = (window.first(), jnp.zeros((groups, window.size, window.size)))
    _, later = jax.lax.scan(step, first, inputs)
    return jnp.concatenate([jnp.zeros((groups, 1, n, n)), jnp.moveaxis(later, 0, 1)], axis=1)


class _Window:
    """The last states as one vector [x_k, position at age 1, ..., position at age W-1] and its covariance."""

    def __init__(self, model: LinearModel, ages: int):
        n, d = len(model.P0), len(model.index)
        position = np.array(model.index)
        self.n, self.size = n, n + d * (ages - 1)
        self.prior = model.P0
        self.observed = np.concatenate([position, np.arange(n, self.size)])
        self.age = np.zeros((self.size, self.size))  # ages move on by one; age 1 is taken from the state
        if ages > 1:
            self.age[n + np.arange(d), position] = 1.0
        self.age[np.arange(n + d, self.size), np.arange(n, self.size - d)] = 1.0

    def first(self) -> Float[Array, "size size"]:
        return jnp.zeros((self.size, self.size)).at[: self.n, : self.n].set(self.prior)

    def flat(self, D: Float[Array, "*n w d w d"]) -> Float[Array, "*n observed observed"]:
        return D.reshape(*D.shape[:-4], len(self.observed), len(self.observed))

    def shift(self, F: Float[Array, "state state"]) -> Float[Array, "size size"]:
        corner = jnp.zeros((self.size, self.size)).at[: self.n, : self.n].set(F)
        return corner + self.age

    def predict(self, S: Array, F: Array, Q: Array) -> Float[Array, "size size"]:
        T = self.shift(F)
        return jnp.asarray(T @ S @ T.T).at[: self.n, : self.n].add(Q)

    def update(self, S: Array, D: Array) -> Float[Array, "size size"]:
        cross = S[:, self.observed]
        gain = jnp.linalg.solve(jnp.eye(len(self.observed)) + D @ cross[self.observed], D @ cross.T)
        return symmetrize(S - cross @ gain)
