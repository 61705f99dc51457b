"""From increments of information about the last positions to the bound at every horizon.

Covariance form on a window of the last states: no inverse of the process noise or the prior, so that singular ones
work, and a cost linear in steps. With a window as long as the scenario it is the exact inverse of the whole
information matrix ``J_{0:k}`` at every k; with a shorter one, older information is kept as it was when it left the
window.
"""

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.linalg import symmetrize
from locbounds.scenario import Scenario


class LinearModel(NamedTuple):
    """Linear Gaussian motion and prior.

    Attributes
    ----------
    observed
        State components that the increments of information are about.
    position
        Those of the position.
    """

    F: Float[Array, "steps state state"]
    Q: Float[Array, "steps state state"]
    P0: Float[Array, "state state"]
    observed: tuple[int, ...]
    position: tuple[int, ...]


def linear_model(scenario: Scenario | LinearModel) -> LinearModel:
    """Motion and prior of a scenario, whose increments are about positions."""
    if isinstance(scenario, LinearModel):
        return scenario
    position = scenario.motion.position_index
    P0 = jnp.asarray(scenario.prior.covariance)
    return LinearModel(scenario.transition, scenario.process_noise, P0, position, position)


class Increments(ABC):
    """What the measurement of every step adds to the information about the positions at ages 0..W-1 (age 0: now).

    Attributes
    ----------
    ages
        The window W.
    groups
        How many changes of the increments are followed besides (0: none).
    pieces
        Pytree with the steps as leading axis: what :meth:`advance` gets of each step.
    """

    ages: int
    groups: int
    pieces: Any

    @abstractmethod
    def first(self) -> Any:
        """What is carried along before step 1."""

    @abstractmethod
    def advance(self, carried: Any, piece: Any) -> tuple[Any, Array, Array | None]:
        """Carried further, the step's increment [W*space, W*space], and its changes [W*space, groups, W*space]."""


class GivenIncrements(Increments):
    """Increments that are known as arrays.

    Parameters
    ----------
    increments
        [steps, W, space, W, space].
    changes
        [groups, steps, W, space, W, space], or None.
    """

    def __init__(self, increments: Array, changes: Array | None = None):
        self.ages = increments.shape[1]
        self.groups = 0 if changes is None else len(changes)
        size = self.ages * increments.shape[2]
        flat = jnp.asarray(increments).reshape(-1, size, size)
        if changes is not None:
            changes = jnp.moveaxis(jnp.asarray(changes), 0, 3).reshape(-1, size, self.groups, size)
        self.pieces = flat, changes

    def first(self) -> Any:
        return None

    def advance(self, carried: Any, piece: Any) -> tuple[Any, Array, Array | None]:
        return carried, *piece


def covariance_recursion(
    scenario: Scenario | LinearModel,
    increments: Increments,
    *,
    extra: Float[Array, "times state state"] | None = None,
    rows: Float[Array, "steps space state"] | None = None,
) -> tuple[Float[Array, "times state state"], Float[Array, "groups times"]]:
    """Bound on the mean square error matrix at steps 0..K, and first-order changes of its position part.

    Parameters
    ----------
    scenario
        Motion and prior are taken from it; or these alone.
    increments
        The information that the steps add.
    extra
        Information about the state at steps 0..K from further independent measurements.
    rows
        Matrices R_k whose ``tr R_k P_k R_k'`` the changes are of, at steps 1..K; by default those of the position.

    Returns
    -------
    covariance
        [steps+1, state, state].
    changes
        Of the position mean square error, one row per change of the increments, [groups, steps+1].

    Notes
    -----
    Window covariance S of [x_k, position at age 1, ..., position at age W-1]; predict ``S <- T S T' + Q``, update
    ``S <- S - S_p (I + D S_pp)^-1 D S_p'`` with the information increment D on the positions p. Changes follow from
    ``dS <- T dS T'`` and ``d (S^-1 + D)^-1 = K dS K' - S_p+ dD S_p+'`` with ``K = S+ S^-1 = I - S_p+ D``: all of them
    share the matrices, so that each step is four matrix products.
    """
    model = linear_model(scenario)
    n, groups = len(model.P0), increments.groups
    window = Window(model, increments.ages)
    if rows is None:
        rows = jnp.broadcast_to(jnp.eye(n)[np.array(model.position)], (len(model.F), len(model.position), n))

    def step(carry, inputs):
        S, dS, carried = carry
        F, Q, X, R, piece = inputs
        carried, D, dD = increments.advance(carried, piece)
        S = window.update(window.predict(S, F, Q), D)
        if dD is not None:
            L = S[:, window.observed]
            M = (jnp.eye(window.size).at[:, window.observed].add(-L @ D)) @ window.shift(F)
            dS = congruence(M, dS) - congruence(L, dD)
        if X is not None:
            S = window.update(S, X, window.state)
            M = jnp.eye(window.size).at[:, window.state].add(-S[:, window.state] @ X)
            dS = congruence(M, dS)
        return (S, dS, carried), (S[:n, :n], jnp.einsum("ai,igj,aj->g", R, dS[:n, :, :n], R))

    S = window.first() if extra is None else window.update(window.first(), extra[0], window.state)
    first = S, jnp.zeros((window.size, groups, window.size)), increments.first()
    inputs = model.F, model.Q, None if extra is None else extra[1:], rows, increments.pieces
    _, (later, changes) = jax.lax.scan(step, first, inputs)
    P = jnp.concatenate([S[:n, :n][None], later])
    return P, jnp.concatenate([jnp.zeros((groups, 1)), changes.T], axis=1)


def congruence(A: Float[Array, "a b"], X: Float[Array, "b groups b"]) -> Float[Array, "a groups a"]:
    """``A X_g A'`` for every group, as two matrix products."""
    a, b = A.shape
    left = (A @ X.reshape(b, -1)).reshape(-1, b)
    return (left @ A.T).reshape(a, -1, a)


class Window:
    """The last states as one vector [x_k, position at age 1, ..., position at age W-1] and its covariance."""

    def __init__(self, model: LinearModel, ages: int):
        n, d = len(model.P0), len(model.observed)
        position = np.array(model.observed)
        self.n, self.size = n, n + d * (ages - 1)
        self.prior = model.P0
        self.observed = np.concatenate([position, np.arange(n, self.size)])
        self.state = np.arange(n)
        self.age = np.zeros((self.size, self.size))  # ages move on by one; age 1 is taken from the state
        if ages > 1:
            self.age[n + np.arange(d), position] = 1.0
        self.age[np.arange(n + d, self.size), np.arange(n, self.size - d)] = 1.0

    def first(self) -> Float[Array, "size size"]:
        return jnp.zeros((self.size, self.size)).at[: self.n, : self.n].set(self.prior)

    def shift(self, F: Float[Array, "state state"]) -> Float[Array, "size size"]:
        corner = jnp.zeros((self.size, self.size)).at[: self.n, : self.n].set(F)
        return corner + self.age

    def predict(self, S: Array, F: Array, Q: Array) -> Float[Array, "size size"]:
        T = self.shift(F)
        return jnp.asarray(T @ S @ T.T).at[: self.n, : self.n].add(Q)

    def update(self, S: Array, D: Array, about: np.ndarray | None = None) -> Float[Array, "size size"]:
        """Covariance with the information D added, by default about the observed components."""
        cross = S[:, self.observed if about is None else about]
        return symmetrize(S - cross @ self.gain(S, D, about) @ cross.T)

    def gain(self, S: Array, D: Array, about: np.ndarray | None = None) -> Array:
        """``(I + D S_pp)^-1 D``: symmetric."""
        about = self.observed if about is None else about
        return jnp.linalg.solve(jnp.eye(len(about)) + D @ S[about][:, about], D)
