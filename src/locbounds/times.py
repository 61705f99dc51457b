"""When the steps happen."""

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import float64, traced


class Times(eqx.Module):
    """Times of the steps 0..K in seconds; step 0 is the prior's, measurements arrive at steps 1..K.

    Parameters
    ----------
    time_s
        [steps+1], strictly increasing.

    Raises
    ------
    InputError
        If there is no step, or times are not finite and strictly increasing.

    Examples
    --------
    >>> Times.uniform(step_s=0.2, steps=3).time_s.round(3).tolist()
    [0.0, 0.2, 0.4, 0.6]
    """

    time_s: Float[Array, " times"] = eqx.field(converter=float64)

    def __check_init__(self):
        if self.time_s.ndim != 1 or len(self.time_s) < 2:
            raise InputError(f"there are {max(self.time_s.size - 1, 0)} steps", "Give at least one step after step 0")
        if traced(self.time_s):
            return
        bad = np.flatnonzero(~(np.diff(self.time_s) > 0))
        if bad.size or not np.all(np.isfinite(self.time_s)):
            k = int(bad[0]) + 1 if bad.size else int(np.flatnonzero(~np.isfinite(self.time_s))[0])
            raise InputError(
                f"time of step {k} is {self.time_s[k]} s after {self.time_s[max(k - 1, 0)]} s",
                "Times must be finite and strictly increasing: sort them and merge duplicates",
            )

    @classmethod
    def uniform(cls, *, step_s: float, steps: int) -> "Times":
        """Equal intervals of ``step_s`` seconds."""
        if not (steps >= 1 and int(steps) == steps):
            raise InputError(f"the number of steps is {steps}", "Give a whole number of at least 1")
        if not (np.isfinite(step_s) and step_s > 0):
            raise InputError(f"the step is {step_s} s", "Give a positive number of seconds")
        return cls(step_s * np.arange(int(steps) + 1))

    @property
    def steps(self) -> int:
        """Number of measurement steps K."""
        return len(self.time_s) - 1

    @property
    def intervals(self) -> Float[Array, " steps"]:
        """Seconds between successive steps."""
        return self.time_s[1:] - self.time_s[:-1]
