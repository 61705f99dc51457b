"""Sight that is known."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import NLOS, Array, Float, Int
from locbounds.errors import InputError
from locbounds.sight.base import Sight


class KnownSight(Sight):
    """A known schedule of sight conditions, as a chain that moves with certainty.

    Parameters
    ----------
    modes
        Sight at steps 1..K, [steps], 0 = LOS, 1 = NLOS.

    Raises
    ------
    InputError
        If an entry is neither 0 nor 1, or the schedule's length differs from the scenario's steps.

    Examples
    --------
    >>> np.asarray(KnownSight([0, 1]).transitions(np.ones(2)))[:, 0].tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """

    modes: Int[Array, " steps"] = eqx.field(converter=np.asarray)
    start: Float[Array, " modes"]

    def __init__(self, modes):
        self.modes = np.asarray(modes)
        if self.modes.ndim != 1 or not np.isin(self.modes, (0, NLOS)).all():
            raise InputError("a known sight schedule must hold 0 (LOS) or 1 (NLOS) per step", "Correct the schedule")
        self.modes = self.modes.astype(np.int64)
        self.start = np.array([0.5, 0.5])

    def transitions(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps modes modes"]:
        if len(intervals) != len(self.modes):
            raise InputError(
                f"the known sight schedule has {len(self.modes)} steps, the scenario {len(intervals)}",
                "Give one sight per step 1..K",
            )
        rows = jnp.eye(2)[self.modes]
        return jnp.broadcast_to(rows[:, None, :], (len(self.modes), 2, 2))
