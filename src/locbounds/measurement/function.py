"""Any function of the position as a measurement."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.measurement.base import Measurement


class Function(Measurement):
    """A measurement given by a function, of one or several values.

    Parameters
    ----------
    h
        ``h(position [space])``: a number or [size], made of operations that JAX can differentiate (``jax.numpy``).
    size
        Number of values.
    unit
        ``"m"``, ``"dB"``, ``"rad"`` or ``""`` (unknown).
    dim
        Number of coordinates of a position; None: as the rest of the plan.

    Raises
    ------
    InputError
        If ``h`` cannot be called, or ``size`` is no positive number.

    Examples
    --------
    >>> product = Function(lambda p: p[0] * p[1])
    >>> float(product(np.array([2.0, 3.0])))
    6.0
    """

    h: Callable[..., Any] = eqx.field(static=True)
    size: int = eqx.field(static=True, default=1)
    unit: str = eqx.field(static=True, default="")
    dim: int | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        if not callable(self.h):
            raise InputError(f"the measurement function is {self.h!r}", "Give a function h(position)")
        if not (isinstance(self.size, int) and self.size > 0):
            raise InputError(f"a measurement has {self.size} values", "Give a positive whole number")

    def __call__(self, position: Float[Array, " space"]) -> Any:
        value = jnp.asarray(self.h(position), dtype=float)
        if value.size != self.size:
            raise InputError(
                f"h(position) returns {value.size} numbers, {self.size} were announced", f"Give size={value.size}"
            )
        return value.reshape(()) if self.size == 1 else value.reshape(self.size)

    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return np.full(len(points), np.inf)
