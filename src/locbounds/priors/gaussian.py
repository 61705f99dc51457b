"""Gaussian prior."""

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.linalg import is_positive_semidefinite
from locbounds.precision import float64, traced


class GaussianPrior(eqx.Module):
    """Gaussian law of the state at step 0.

    Parameters
    ----------
    mean
        [state], in the motion model's order and units.
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
