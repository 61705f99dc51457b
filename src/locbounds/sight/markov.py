"""Two-state (or larger) Markov chain per step."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import float64, traced
from locbounds.sight.base import Sight, check_probabilities, stationary

EQUAL_STEPS = 1e-6  # intervals that differ by less than this fraction count as equal


class MarkovSight(Sight):
    """Markov chain with one transition matrix per step, for equal intervals.

    Parameters
    ----------
    start
        Law of the sight at step 0, [modes]; None takes the chain's stationary law.
    transition
        [modes, modes], ``transition[i, j] = Pr(next = j | now = i)``.

    Raises
    ------
    InputError
        If a row is not a probability law; and from :meth:`transitions` if the intervals differ
        (give dwell times instead, see :class:`DwellSight`).

    Examples
    --------
    >>> chain = MarkovSight.stay(0.9)
    >>> chain.transition.round(3).tolist(), chain.start.tolist()
    ([[0.9, 0.1], [0.1, 0.9]], [0.5, 0.5])
    """

    start: Float[Array, " modes"] = eqx.field(converter=float64)
    transition: Float[Array, "modes modes"] = eqx.field(converter=float64)

    def __init__(self, start, transition):
        self.transition = transition if traced(transition) else float64(transition)
        self.start = stationary(float64(transition)) if start is None else start

    def __check_init__(self):
        if not traced(self.transition):
            if self.transition.ndim != 2 or self.transition.shape[0] != self.transition.shape[1]:
                raise InputError(f"sight transition has shape {self.transition.shape}", "Give a square matrix")
            check_probabilities(self.transition, "sight transition")
        if not traced(self.start):
            if self.start.shape != self.transition.shape[:1]:
                raise InputError(
                    f"sight start has shape {self.start.shape} for {len(self.transition)} modes",
                    "Give one probability per mode",
                )
            check_probabilities(self.start, "sight start")

    @classmethod
    def stay(cls, stay, start=None) -> "MarkovSight":
        """Chain from the probability of keeping the sight over one step.

        Parameters
        ----------
        stay
            One number for both modes, or (LOS, NLOS).
        start
            Law at step 0; None takes the stationary law.

        Raises
        ------
        InputError
            If ``stay`` is no probability.
        """
        if traced(stay):
            los, nlos = jnp.broadcast_to(jnp.asarray(stay), (2,))
            return cls(start, jnp.array([[los, 1 - los], [1 - nlos, nlos]]))
        los, nlos = np.broadcast_to(float64(stay), (2,))
        if not (0 <= los <= 1 and 0 <= nlos <= 1):  # NaN too
            raise InputError(
                f"the probability of keeping the sight is {stay}",
                "Give a number from 0 to 1, or one for LOS and one for NLOS; mean seconds are for DwellSight",
            )
        return cls(start, [[los, 1 - los], [1 - nlos, nlos]])

    @classmethod
    def independent(cls, law) -> "MarkovSight":
        """Modes drawn afresh at every step.

        Parameters
        ----------
        law
            Probability of every mode, [modes].

        >>> MarkovSight.independent([0.8, 0.2]).transition.tolist()
        [[0.8, 0.2], [0.8, 0.2]]
        """
        law = float64(law)
        return cls(law, (jnp if traced(law) else np).broadcast_to(law, (len(law), len(law))))

    def transitions(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps modes modes"]:
        if not traced(intervals) and np.ptp(intervals) > EQUAL_STEPS * np.max(intervals):
            raise InputError(
                f"the sight chain is given per step, but the intervals vary from {np.min(intervals):.4g} "
                f"to {np.max(intervals):.4g} s",
                "Give mean dwell times instead (dwell_s in a scenario file, DwellSight in Python)",
            )
        broadcast = jnp.broadcast_to if traced(self.transition) else np.broadcast_to
        return broadcast(self.transition, (len(intervals), *self.transition.shape))
