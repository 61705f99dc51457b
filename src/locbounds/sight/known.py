"""Sight that is known."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Int
from locbounds.errors import InputError
from locbounds.sight.base import Sight


class KnownSight(Sight):
    """A known schedule of sight conditions, as a chain that moves with certainty.

    Parameters
    ----------
    modes
        Sight at steps 1..K, [steps], 0 = LOS, 1 = NLOS.
    conditions
        Number of sight conditions.

    Raises
    ------
    InputError
        If an entry is no condition, or the schedule's length differs from the scenario's steps.

    Examples
    --------
    >>> np.asarray(KnownSight([0, 1]).transitions(np.ones(2)))[:, 0].tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """

    modes: Int[Array, " steps"] = eqx.field(converter=np.asarray)
    start: Float[Array, " modes"]

    def __init__(self, modes, conditions: int = 2):
        self.modes = np.asarray(modes)
        if self.modes.ndim != 1 or not np.isin(self.modes, np.arange(conditions)).all():
            what = "0 (LOS) or 1 (NLOS)" if conditions == 2 else f"0 to {conditions - 1}"
            raise InputError(f"a known sight schedule must hold {what} per step", "Correct the schedule")
        self.modes = self.modes.astype(np.int64)
        self.start = np.full(conditions, 1 / conditions)

    def transitions(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps modes modes"]:
        if len(intervals) != len(self.modes):
            raise InputError(
                f"the known sight schedule has {len(self.modes)} steps, the scenario {len(intervals)}",
                "Give one sight per step 1..K",
            )
        n = len(self.start)
        return jnp.broadcast_to(jnp.eye(n)[self.modes][:, None, :], (len(self.modes), n, n))
