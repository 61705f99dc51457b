"""Gaussian prior, of a state or of a position."""

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.errors import InputError
from locbounds.linalg import is_positive_semidefinite
from locbounds.precision import float64, traced
from locbounds.priors.position import PositionPrior, as_points, product

REACH = 8.0  # standard deviations beyond which a Gaussian has less than 1e-15 of its mass


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
        from scipy.linalg import solve_triangular

        root = self._root()
        z = solve_triangular(root, (as_points(points, self.dim) - self.mean).T, lower=True)
        return -0.5 * np.sum(z**2, axis=0) - np.sum(np.log(np.diag(root))) - 0.5 * self.dim * np.log(2 * np.pi)

    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        return np.ones(len(as_points(points, self.dim)), dtype=bool)

    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """Gauss-Hermite along the columns of the covariance's Cholesky factor."""
        x, w = np.polynomial.hermite_e.hermegauss(n)
        z, weights = product(*[(x, w / np.sqrt(2 * np.pi))] * self.dim)
        return self.mean + z @ self._root().T, weights / weights.sum()

    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        reach = REACH * np.sqrt(np.diag(self.covariance))
        return self.mean - reach, self.mean + reach

    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        return self.mean + np.random.default_rng(seed).normal(size=(n, self.dim)) @ self._root().T

    def irregular(self) -> None:
        return None
