"""Two-state Markov chain in continuous time."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import float64, traced
from locbounds.sight.base import Sight, check_probabilities


class DwellSight(Sight):
    """Two-state chain in continuous time, given by the mean time a link stays LOS and NLOS.

    The transition matrix over ``dt`` seconds is ``expm(G dt)`` with
    ``G = [[-1/d0, 1/d0], [1/d1, -1/d1]]``, in closed form.

    Parameters
    ----------
    start
        Law at step 0, [modes]; None takes the stationary law, ``d / sum(d)``.
    dwell_s
        Mean dwell times in seconds, (LOS, NLOS), positive.

    Raises
    ------
    InputError
        If a dwell time is not positive or the start is not a probability law.

    Examples
    --------
    >>> np.asarray(DwellSight(None, [2.0, 2.0]).transitions(np.array([1e9])))[0].round(3).tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """

    start: Float[Array, " modes"] = eqx.field(converter=float64)
    dwell_s: Float[Array, " modes"] = eqx.field(converter=float64)

    def __init__(self, start, dwell_s):
        self.dwell_s = dwell_s
        if start is None:
            dwell = float64(dwell_s)
            usable = traced(dwell) or np.all((dwell > 0) & (dwell < np.inf))
            start = dwell / dwell.sum() if usable else np.array([0.5, 0.5])  # what is not usable is refused below
        self.start = start

    def __check_init__(self):
        if not traced(self.dwell_s) and (
            self.dwell_s.shape != (2,) or not np.all(np.isfinite(self.dwell_s)) or np.any(self.dwell_s <= 0)
        ):
            raise InputError(f"dwell times are {self.dwell_s} s", "Give two positive numbers of seconds (LOS, NLOS)")
        if not traced(self.start):
            check_probabilities(self.start, "sight start")

    def transitions(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps modes modes"]:
        rate = 1.0 / jnp.asarray(self.dwell_s)
        total = rate.sum()
        leave = rate / total * -jnp.expm1(-total * jnp.asarray(intervals)[:, None])  # Pr(other mode | now), [steps, 2]
        return jnp.stack(
            [jnp.stack([1 - leave[:, 0], leave[:, 0]], -1), jnp.stack([leave[:, 1], 1 - leave[:, 1]], -1)], -2
        )
