"""Gaussian prior, of a state or of a position."""

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.errors import InputError
from locbounds.linalg import is_positive_semidefinite
from locbounds.precision import float64, traced
from locbounds.priors.position import PositionPrior, as_points, legendre, product

REACH = 8.0  # standard deviations beyond which a Gaussian has less than 1e-15 of its mass
MOST_HERMITE = 100  # nodes along a line; more of them lie mostly where nothing is, and their weights overflow


class GaussianPrior(PositionPrior):
    """Gaussian law of the state at step 0, or of a static position.

    Parameters
    ----------
    mean
        [state], in the motion model's order and units; of a position [space], in metres.
    covariance
        [state, state], symmetric positive semidefinite.

    Raises
    ------
    InputError
        If shapes do not match or the covariance is not positive semidefinite.

    Examples
    --------
    >>> GaussianPrior(np.zeros(4), np.diag([2500.0, 2500.0, 4.0, 4.0])).mean.shape
    (4,)
    """

    mean: Float[Array, " state"] = eqx.field(converter=float64)
    covariance: Float[Array, "state state"] = eqx.field(converter=float64)

    def __check_init__(self):
        if self.mean.ndim != 1 or self.covariance.shape != self.mean.shape * 2:
            raise InputError(
                f"prior mean has shape {self.mean.shape}, its covariance {self.covariance.shape}",
                "Give n numbers and an n x n matrix",
            )
        if traced(self.mean, self.covariance):
            return
        if not np.all(np.isfinite(self.mean)):
            raise InputError(f"prior mean is {self.mean}", "Give finite numbers")
        if not is_positive_semidefinite(self.covariance):
            raise InputError(
                f"prior covariance is not positive semidefinite: {self.covariance.tolist()}",
                "Give a symmetric matrix without negative eigenvalues",
            )

    def _root(self) -> Float[Array, "space space"]:
        try:
            return np.linalg.cholesky(self.covariance)
        except np.linalg.LinAlgError as error:
            raise InputError(
                "the covariance of a position prior is singular: the law has no density",
                "Give a small positive variance instead of zero",
            ) from error

    def log_density(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        root = self._root()
        z = np.linalg.inv(root) @ (as_points(points, self.dim) - self.mean).T
        return -0.5 * np.sum(z**2, axis=0) - np.sum(np.log(np.diag(root))) - 0.5 * self.dim * np.log(2 * np.pi)

    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        return np.ones(len(as_points(points, self.dim)), dtype=bool)

    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """Gauss-Hermite along the columns of the covariance's Cholesky factor.

        From 101 nodes on, Gauss-Legendre over eight deviations to both sides, with the density in the weights.

        >>> points, weights = GaussianPrior([1.0], [[4.0]]).nodes(420)
        >>> [round(float(weights @ points[:, 0] ** k), 9) for k in range(5)]
        [1.0, 1.0, 5.0, 13.0, 73.0]
        """
        if n <= MOST_HERMITE:
            x, w = np.polynomial.hermite_e.hermegauss(n)
        else:
            x, w = legendre(n, -REACH, REACH)
            w = w * np.exp(-0.5 * x**2)
        z, weights = product(*[(x, w / w.sum())] * self.dim)
        return self.mean + z @ self._root().T, weights / weights.sum()

    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        reach = REACH * np.sqrt(np.diag(self.covariance))
        return self.mean - reach, self.mean + reach

    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        return self.mean + np.random.default_rng(seed).normal(size=(n, self.dim)) @ self._root().T

    def irregular(self) -> None:
        return None
