"""What is known of a static position before the measurement."""

from abc import abstractmethod
from typing import TYPE_CHECKING, Any

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float, Scalar, ndarray
from locbounds.errors import InputError


class PositionPrior(eqx.Module):
    """Law of a position.

    Everything is NumPy and takes points [points, space] in metres.
    """

    if TYPE_CHECKING:  # where these are properties, type checkers must not take them for arguments of the constructor
        mean: Float[Array, " space"] = eqx.field(init=False)
        covariance: Float[Array, "space space"] = eqx.field(init=False)
    else:
        mean: eqx.AbstractVar[Float[Array, " space"]]
        covariance: eqx.AbstractVar[Float[Array, "space space"]]

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return len(self.mean)

    @abstractmethod
    def log_density(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        """Logarithm of the density in 1/m^dim; minus infinity outside the support."""

    @abstractmethod
    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        """Whether points are in the support; its edge counts as inside."""

    @abstractmethod
    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """Points and weights with ``sum(w * f(x))`` close to ``E[f]``, for f smooth on the support.

        ``n`` is the number of nodes along a line; weights sum to one.
        """

    @abstractmethod
    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        """Lower and upper corner of a box that holds the support, or all but 1e-15 of an unbounded law."""

    @abstractmethod
    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        """Independent draws."""

    @abstractmethod
    def irregular(self) -> str | None:
        """Why the law has no finite information (its density jumps at an edge), or None where it has."""

    @property
    def regular(self) -> bool:
        """Whether the information of the density exists: what a Bayesian Cramér-Rao bound needs."""
        return self.irregular() is None


def as_points(points: Any, dim: int) -> Float[Array, "points space"]:
    """Points as float64 [points, dim].

    >>> as_points([[1, 2]], 2).dtype.name
    'float64'
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != dim:
        raise InputError(f"the points have shape {points.shape}", f"Give [points, {dim}] coordinates in metres")
    return points


def legendre(n: int, low: Scalar = 0.0, high: Scalar = 1.0) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Gauss-Legendre nodes and weights of the mean over an interval.

    >>> x, w = legendre(3)
    >>> float(w @ x**2)
    0.333333333333
    """
    if n < 1:
        raise InputError(f"{n} nodes", "Give at least 1")
    x, w = np.polynomial.legendre.leggauss(n)
    return np.asarray(low + (high - low) * 0.5 * (x + 1)), 0.5 * w


def product(*rules: tuple[Any, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Tensor product of rules of one variable: points [nodes, variables] and weights.

    >>> [a.shape for a in product(legendre(3), legendre(4))]
    [(12, 2), (12,)]
    """
    x = np.meshgrid(*(rule[0] for rule in rules), indexing="ij")
    w = np.meshgrid(*(rule[1] for rule in rules), indexing="ij")
    return np.stack([a.ravel() for a in x], axis=1), np.prod([a.ravel() for a in w], axis=0)
