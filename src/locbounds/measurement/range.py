"""Ranges: distance to one anchor (time of arrival times the speed of light, round trips halved)."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.precision import float64, traced


class Range(eqx.Module):
    """Distance to an anchor.

    Parameters
    ----------
    anchor
        Position of the anchor in metres, [space] with 2 or 3 coordinates.

    Raises
    ------
    InputError
        If the position is not 2 or 3 finite numbers.

    Notes
    -----
    At the anchor itself the range has no gradient; there the gradient is defined as zero (no direction, no
    information), so that no NaN arises.

    Examples
    --------
    >>> float(Range([0.0, 0.0])(np.array([3.0, 4.0])))
    5.0
    """

    anchor: Float[Array, " space"] = eqx.field(converter=float64)

    def __check_init__(self):
        if traced(self.anchor):
            return
        if self.anchor.shape not in ((2,), (3,)) or not np.all(np.isfinite(self.anchor)):
            raise InputError(f"anchor position is {self.anchor}", "Give 2 or 3 finite coordinates in metres")

    def under(self, mode: int) -> "Range":
        """The measurement under one sight condition: itself."""
        return self

    def __call__(self, position: Float[Array, " space"]) -> Scalar:
        square = jnp.sum((position - self.anchor) ** 2, axis=-1)
        safe = jnp.where(square > 0, square, 1.0)
        return jnp.where(square > 0, jnp.sqrt(safe), 0.0)
