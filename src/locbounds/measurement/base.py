"""What every measurement of a static position says of itself."""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import traced

UNITS = ("m", "dB", "rad", "")
TINY_M = 1e-9  # distance below which a measurement takes the mobile to be at the anchor


class Measurement(eqx.Module):
    """Noise-free measurement ``h(position)``: one number, or [size] of a vector-valued one.

    Written for one position; ``jax.vmap`` batches and ``jax.jacfwd`` differentiates it, free of NaN everywhere. Where
    the derivative does not exist (:meth:`singular`) it is zero.
    """

    periodic: ClassVar[bool] = False
    """Whether values that differ by 2 pi are the same (bearings)."""

    clocked: ClassVar[bool] = False
    """Whether an offset of the mobile's clock, in metres, adds to the value (times of arrival)."""

    cancels: ClassVar[bool] = False
    """Whether the derivative is a difference of unit vectors, which may cancel except for rounding."""

    unit: ClassVar[str] = ""
    """``"m"``, ``"dB"``, ``"rad"``, or empty if unknown."""

    size: ClassVar[int] = 1
    """Number of values."""

    dim: ClassVar[Any] = None
    """Number of coordinates of a position; None: any."""

    def under(self, mode: int) -> "Measurement":
        """The measurement under one sight condition: itself."""
        return self

    @abstractmethod
    def __call__(self, position: Float[Array, " space"]) -> Any:
        """The value at one position [space]."""

    @abstractmethod
    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        """How far points are, in metres, from the nearest place without derivative: an anchor, an axis."""


def check_anchor(anchor: Any, name: str = "anchor", dims: tuple[int, ...] = (2, 3)) -> None:
    """Raise an InputError unless a position is 2 or 3 finite coordinates."""
    if traced(anchor):
        return
    if anchor.ndim != 1 or len(anchor) not in dims or not np.all(np.isfinite(anchor)):
        raise InputError(
            f"{name} position is {anchor}", f"Give {' or '.join(map(str, dims))} finite coordinates in metres"
        )


def distance(position: Float[Array, "*n space"], anchor: Float[Array, " space"]) -> Float[Array, "*n"]:
    """Euclidean distance whose derivative is zero at the anchor.

    >>> float(distance(np.array([3.0, 4.0]), np.zeros(2)))
    5.0
    """
    square = _square(position - anchor)
    safe = jnp.where(square > 0, square, 1.0)
    return jnp.where(square > 0, jnp.sqrt(safe), 0.0)


def far(points: Float[Array, "points space"], anchor: Float[Array, " space"]) -> Float[Array, " points"]:
    """Distance of points from an anchor; NumPy stays NumPy."""
    difference = points - anchor
    xp = jnp if isinstance(difference, jax.Array) else np
    return xp.sqrt(_square(difference))


def _square(difference: Any) -> Any:
    """Squared length; coordinate by coordinate, which compiles to loops over the points."""
    return sum(difference[..., i] ** 2 for i in range(difference.shape[-1]))
