"""What every sight model offers."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import traced

SUM_TOLERANCE = 1e-9  # probabilities typed in decimal sum to one within rounding


class Sight(eqx.Module):
    """A chain of sight conditions, independent of every other link's.

    Convention: ``transition[i, j] = Pr(next = j | now = i)``, rows sum to one; mode 0 is LOS, mode 1 NLOS.
    """

    start: eqx.AbstractVar[Float[Array, " modes"]]

    @abstractmethod
    def transitions(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps modes modes"]:
        """Transition matrices from step k-1 to step k for k = 1..K, given the intervals in seconds."""


def check_probabilities(rows: Any, what: str) -> None:
    """Raise an InputError unless the last axis holds probabilities that sum to one."""
    if not np.all(np.isfinite(rows)) or np.any(rows < 0) or np.any(np.abs(rows.sum(-1) - 1) > SUM_TOLERANCE):
        raise InputError(
            f"{what} is {rows.tolist()}: probabilities must not be negative and every row must sum to one",
            "Correct the numbers; row i holds Pr(next = j | now = i) for j = LOS, NLOS",
        )


def stationary(transition: Float[Array, "modes modes"]) -> Float[Array, " modes"]:
    """Stationary law of a transition matrix; the uniform law where it is not unique.

    While JAX traces the matrix, its law is taken to be unique.

    >>> stationary(np.array([[0.9, 0.1], [0.3, 0.7]])).round(3).tolist()
    [0.75, 0.25]
    """
    n = len(transition)
    if traced(transition):
        ones = jnp.ones((n, n))  # pi (I - T + ones) = (1, ..., 1), as pi (I - T) = 0 and pi sums to one
        return jnp.linalg.solve((jnp.eye(n) - transition + ones).T, jnp.ones(n))
    if not np.all(np.isfinite(transition)):
        return np.full(n, 1 / n)  # the chain itself is refused
    equations = np.vstack([transition.T - np.eye(n), np.ones(n)])
    if np.linalg.matrix_rank(equations) < n:
        return np.full(n, 1 / n)
    return np.linalg.lstsq(equations, np.append(np.zeros(n), 1.0), rcond=None)[0].clip(0.0)
