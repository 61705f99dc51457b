"""Motion that switches between models."""

import equinox as eqx

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError, RefusedError
from locbounds.motion.base import Motion
from locbounds.sight import Sight


class SwitchingMotion(Motion):
    """A Markov chain chooses the motion of every step, for example straight on, left turn, right turn.

    The step from k-1 to k follows the motion of mode r_k.

    Parameters
    ----------
    motions
        One motion per mode, all with the same state.
    sight
        The chain of the modes.
    chain
        Name of the chain. Links with the same chain name switch together with the motion; None: a chain of its own.

    Raises
    ------
    InputError
        If there are not as many motions as modes, or their states differ.

    Examples
    --------
    >>> import locbounds as lb
    >>> turns = [lb.CoordinatedTurn(rate, 0.1) for rate in (0.0, 0.2, -0.2)]
    >>> chain = lb.MarkovSight(None, [[0.9, 0.05, 0.05], [0.1, 0.9, 0.0], [0.1, 0.0, 0.9]])
    >>> lb.SwitchingMotion(turns, chain).state_size
    4
    """

    motions: tuple[Motion, ...] = eqx.field(converter=tuple)
    sight: Sight
    chain: str | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check_alike(self.motions)
        if len(self.motions) != len(self.sight.start):
            raise InputError(
                f"there are {len(self.motions)} motions for {len(self.sight.start)} modes", "Give one motion per mode"
            )

    @property
    def state_names(self) -> tuple[str, ...]:
        return self.motions[0].state_names

    @property
    def position_index(self) -> tuple[int, ...]:
        return self.motions[0].position_index

    def transition(self, dt: Scalar) -> Float[Array, "state state"]:
        raise RefusedError("the motion switches: F depends on the mode", "Use lb.bcrb and lb.simulate, which know that")

    def covariance(self, dt: Scalar) -> Float[Array, "state state"]:
        raise RefusedError("the motion switches: Q depends on the mode", "Use lb.bcrb and lb.simulate, which know that")


def check_alike(motions: tuple[Motion, ...]) -> None:
    """Raise an InputError unless all motions move the same state."""
    if not motions:
        raise InputError("there is no motion", "Give one per mode")
    first = motions[0]
    for motion in motions:
        if isinstance(motion, SwitchingMotion):
            raise InputError("a switching motion cannot switch within another", "List all motions in one")
        if (motion.state_names, motion.position_index) != (first.state_names, first.position_index):
            raise InputError(
                f"the motions have different states: {first.state_names} and {motion.state_names}",
                "Use the same state in every mode",
            )
