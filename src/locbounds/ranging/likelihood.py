"""Likelihoods of a distance, tabulated: many particles look them up, hard edges stay hard."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.noise import Noise
from locbounds.precision import double_precision

POINTS = 8192
FAR = 14.0  # deviations: how far a table of an unbounded law reaches on either side


class Table(NamedTuple):
    """Log-density of one sample's error on an even grid.

    Attributes
    ----------
    low, step
        First place and distance of the places.
    values
        Densities where the support is bounded (they vanish at its ends), else their logarithms.
    bounded
        Which of the two.
    """

    low: Float[Array, ""]
    step: Float[Array, ""]
    values: Float[Array, " points"]
    bounded: Bool[Array, ""]

    def log_prob(self, e: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Log-density of an error, minus infinity outside a bounded support."""
        x = (e - self.low) / self.step
        i = jnp.clip(jnp.floor(x), 0, POINTS - 2).astype(int)
        a, b = self.values[i], self.values[i + 1]
        value = a + (x - i) * (b - a)
        inside = self.bounded & (x >= 0) & (x <= POINTS - 1) & (value > 0)
        hard = jnp.where(inside, jnp.log(jnp.where(inside, value, 1.0)), -jnp.inf)
        return jnp.where(self.bounded, hard, value)  # a soft law goes on with the last slope


@double_precision
def table(noise: Noise) -> Table:
    """The table of a noise.

    >>> import locbounds as lb
    >>> t = table(lb.Uniform(0.0, 2.0))
    >>> [float(x) for x in jnp.exp(t.log_prob(jnp.array([-0.1, 1.0, 2.1])))]
    [0.0, 0.5, 0.0]
    """
    pieces = noise.support()
    low, high = min(a for a, _ in pieces), max(b for _, b in pieces)
    bounded = bool(np.isfinite(low) and np.isfinite(high))
    mean, std = float(noise.mean), float(noise.variance) ** 0.5
    low, high = max(low, mean - FAR * std), min(high, mean + FAR * std)
    places = np.linspace(low, high, POINTS)
    log_p = np.asarray(noise.log_prob(jnp.asarray(places)))
    values = np.exp(log_p) if bounded else np.maximum(log_p, -700.0)
    return Table(jnp.asarray(low), jnp.asarray(places[1] - places[0]), jnp.asarray(values), jnp.asarray(bounded))


def limits(noise: Noise) -> tuple[float, float]:
    """Ends of the support."""
    pieces: Any = noise.support()
    return min(a for a, _ in pieces), max(b for _, b in pieces)
