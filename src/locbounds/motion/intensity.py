"""How strongly a motion is disturbed: one number, or one per axis."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import float64, traced


def per_axis(intensity: Any, dim: int) -> Float[Array, " space"]:
    """One number for every axis.

    >>> per_axis(0.5, 2).tolist()
    [0.5, 0.5]
    """
    if dim not in (2, 3):
        raise InputError(f"motion has {dim} dimensions", "Use 2 or 3")
    broadcast = jnp.broadcast_to if traced(intensity) else np.broadcast_to
    return broadcast(float64(intensity), (dim,))


def check_intensity(intensity: Any, what: str) -> None:
    """Raise an InputError unless every number is finite and not negative."""
    if not traced(intensity) and not (np.all(np.isfinite(intensity)) and np.all(intensity >= 0)):
        raise InputError(f"{what} is {intensity}", "Give a finite number that is not negative")
