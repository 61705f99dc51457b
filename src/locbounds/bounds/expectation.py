"""The expectation over the geometry, as a value handed to a bound.

A range enters a bound only through its gradient at the mobile's positions. An expectation says at which positions:
over tracks drawn from the prior and the motion model (a Bayesian bound), or along one given track (a conditional
number, labelled as such).
"""

from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import float64, traced
from locbounds.scenario import Link, Scenario, alike
from locbounds.simulation import draw_states


class Expectation(eqx.Module):
    """Where the gradients of the measurements are taken."""

    @property
    @abstractmethod
    def random(self) -> bool:
        """Whether positions are drawn."""

    @property
    @abstractmethod
    def label(self) -> str:
        """What the number is conditional on; empty for a Bayesian bound."""

    @abstractmethod
    def positions(self, scenario: Scenario, key: Array, paths: int) -> Float[Array, "paths steps space"]:
        """Positions at steps 1..K of independent tracks (of the one track if not random)."""

    @abstractmethod
    def check(self, scenario: Scenario) -> None:
        """Raise an InputError if it does not fit a scenario."""


class Prior(Expectation):
    """Tracks drawn from the prior and the motion model: the Bayesian bound.

    Examples
    --------
    >>> Prior().random
    True
    """

    @property
    def random(self) -> bool:
        return True

    @property
    def label(self) -> str:
        return ""

    def positions(self, scenario: Scenario, key: Array, paths: int) -> Float[Array, "paths steps space"]:
        return scenario.motion.position(draw_states(key, scenario, paths))[:, 1:]

    def check(self, scenario: Scenario) -> None:
        pass


class AlongTrack(Expectation):
    """One given track: a conditional number, not a bound on the error over random tracks.

    Parameters
    ----------
    track
        Positions in metres at steps 0..K, [steps+1, space].
    label
        How results name the track.

    Raises
    ------
    InputError
        If positions are not finite; when used, if their number differs from the scenario's steps or a position
        coincides with an anchor.

    Examples
    --------
    >>> AlongTrack([[0.0, 0.0], [1.0, 0.0]], label="a walk").label
    'a walk'
    """

    track: Float[Array, "times space"] = eqx.field(converter=float64)
    name: str = eqx.field(static=True)

    def __init__(self, track, label: str = "one given track"):
        self.track = track
        self.name = label

    def __check_init__(self):
        if self.track.ndim != 2:
            raise InputError(f"the track has shape {self.track.shape}", "Give [steps+1, space] positions in metres")
        if not traced(self.track) and not np.all(np.isfinite(self.track)):
            raise InputError("the track holds numbers that are not finite", "Give every position at steps 0..K")

    @property
    def random(self) -> bool:
        return False

    @property
    def label(self) -> str:
        return self.name

    def positions(self, scenario: Scenario, key: Array, paths: int) -> Float[Array, "paths steps space"]:
        return jnp.asarray(self.track)[None, 1:]

    def check(self, scenario: Scenario) -> None:
        if self.track.shape != (scenario.steps + 1, scenario.dim):
            raise InputError(
                f"the track has shape {self.track.shape}, the scenario needs {(scenario.steps + 1, scenario.dim)}",
                "Give one position per step 0..K",
            )
        if traced(self.track, scenario):
            return
        for link in scenario.links:
            at = np.flatnonzero(np.all(self.track[1:] == link.measurement.anchor, axis=1))
            if at.size:
                raise InputError(
                    f"at step {at[0] + 1} the track is exactly at anchor {link.name}, where a range has no direction",
                    "Move the track or the anchor, or give the anchor its height (3-D)",
                )


def directions(
    scenario: Scenario, expectation: Expectation, key: Array, paths: int
) -> Float[Array, "links paths steps space"]:
    """Gradients of every link's measurement with respect to position."""
    x = expectation.positions(scenario, key, paths)

    def of_link(link: Link) -> Array:
        return jax.vmap(jax.vmap(jax.grad(link.measurement)))(x)

    order, parts = zip(*((index, jax.vmap(of_link)(links)) for index, links in alike(scenario.links)), strict=True)
    return jnp.concatenate(parts)[np.argsort(np.concatenate(order))]
