"""A measurement that depends on the sight condition."""

import equinox as eqx

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError, RefusedError
from locbounds.measurement.nature import Anchored


class BySight(eqx.Module):
    """One measurement per sight condition, for example the range over a reflector in NLOS (to the anchor's image).

    Parameters
    ----------
    measurements
        One per sight condition, (LOS, NLOS, ...).

    Raises
    ------
    InputError
        If there is none, or they differ in their number of coordinates.

    Examples
    --------
    A wall at x = 10 reflects the signal of the anchor at the origin:

    >>> import numpy as np
    >>> from locbounds.measurement import Range
    >>> reflected = BySight([Range([0.0, 0.0]), Range([20.0, 0.0])])
    >>> [float(reflected.under(r)(np.array([8.0, 0.0]))) for r in (0, 1)]
    [8.0, 12.0]
    """

    measurements: tuple[Anchored, ...] = eqx.field(converter=tuple)

    def __check_init__(self):
        if len({m.dim for m in self.measurements}) != 1:
            raise InputError("the measurements have different numbers of coordinates", "Give one per sight condition")

    @property
    def anchor(self) -> Float[Array, " space"]:
        """Position of the anchor: that of the first sight condition."""
        return self.measurements[0].anchor

    def under(self, mode: int) -> Anchored:
        """The measurement under one sight condition."""
        return self.measurements[mode]

    def __call__(self, position: Float[Array, " space"]) -> Scalar:
        raise RefusedError(
            "the measurement depends on the sight condition", "Use lb.bcrb and lb.simulate, which know that"
        )
