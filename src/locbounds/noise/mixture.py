"""Mixture of any noises."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.noise.base import Noise
from locbounds.noise.regularity import Regularity, declared
from locbounds.noise.singularity import Pieces, Singularity, scaled, union_pieces
from locbounds.precision import float64, traced


class Mixture(Noise):
    """One of several noises, drawn afresh at every measurement.

    Parameters
    ----------
    weights
        Shares of the parts, [components], positive, summing to one.
    parts
        The noises.

    Raises
    ------
    InputError
        If there are not as many weights as parts, or the weights are no shares.

    Notes
    -----
    Filters see the Gaussian mixture of the parts' own components.

    Examples
    --------
    Wide outliers make the linear edges of a triangle two kinks in a positive density, which are harmless:

    >>> import locbounds as lb
    >>> triangle = lb.Uniform(0.0, 1.0) + lb.Uniform(0.0, 1.0)
    >>> triangle.regularity().status, Mixture([0.99, 0.01], [triangle, lb.Gaussian(0.0, 9.0)]).regularity().status
    ('irregular', 'regular')
    """

    weights: Float[Array, " c"] = eqx.field(converter=float64)
    parts: tuple[Noise, ...] = eqx.field(converter=tuple)

    def __init__(self, weights, parts):
        self.weights, self.parts = weights, parts

    def __check_init__(self):
        if np.shape(self.weights) != (len(self.parts),) or not self.parts:
            raise InputError(
                f"a mixture of {len(self.parts)} noises has weights of shape {np.shape(self.weights)}",
                "Give one weight per noise",
            )
        if traced(self.weights):
            return
        if not (np.all(self.weights > 0) and abs(self.weights.sum() - 1) < 1e-9):
            raise InputError(f"mixture weights are {self.weights}", "Give positive weights that sum to one")

    @property
    def mean(self) -> Scalar:
        return sum(w * part.mean for w, part in zip(self.weights, self.parts, strict=True))

    @property
    def variance(self) -> Scalar:
        mean = self.mean
        return sum(
            w * (part.variance + (part.mean - mean) ** 2) for w, part in zip(self.weights, self.parts, strict=True)
        )

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        logs = jnp.stack([part.log_prob(w) for part in self.parts], -1) + jnp.log(jnp.asarray(self.weights))
        there = jnp.max(logs, -1) > -jnp.inf
        return jnp.where(there, logsumexp(jnp.where(there[..., None], logs, 0.0), axis=-1), -jnp.inf)

    def score(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        logs = jnp.stack([part.log_prob(w) for part in self.parts], -1) + jnp.log(jnp.asarray(self.weights))
        there = logs > -jnp.inf
        shares = jax.nn.softmax(jnp.where(jnp.any(there, -1, keepdims=True), logs, 0.0), axis=-1)
        scores = jnp.stack([part.score(w) for part in self.parts], -1)
        return jnp.sum(jnp.where(there, shares * jnp.where(there, scores, 0.0), 0.0), -1)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        pick, *keys = jax.random.split(key, len(self.parts) + 1)
        c = jnp.searchsorted(jnp.cumsum(jnp.asarray(self.weights))[:-1], jax.random.uniform(pick, shape), side="right")
        draws = jnp.stack([part.sample(k, shape) for k, part in zip(keys, self.parts, strict=True)])
        return jnp.take_along_axis(draws, c[None], axis=0)[0]

    def support(self) -> Pieces:
        return union_pieces(piece for part in self.parts for piece in part.support())

    def singularities(self) -> tuple[Singularity, ...] | None:
        lists = [part.singularities() for part in self.parts]
        if any(found is None for found in lists):
            return None
        return tuple(s for w, found in zip(self.weights, lists, strict=True) for s in scaled(found or (), float(w)))

    def corners(self) -> Float[Array, " k"]:
        return jnp.concatenate([jnp.asarray(part.corners()) for part in self.parts])

    def landmarks(self) -> Float[Array, " k"]:
        return jnp.sort(jnp.concatenate([jnp.asarray(part.landmarks()) for part in self.parts]))

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        w = jnp.asarray(w)
        return sum((s * part.cdf(w) for s, part in zip(self.weights, self.parts, strict=True)), jnp.zeros(w.shape))

    def components(self) -> tuple[Float[Array, " c"], Float[Array, " c"], Float[Array, " c"]]:
        each = [part.components() for part in self.parts]
        shares = [jnp.asarray(s * w) for s, (w, _, _) in zip(self.weights, each, strict=True)]
        means, variances = ([jnp.asarray(part[k]) for part in each] for k in (1, 2))
        return jnp.concatenate(shares), jnp.concatenate(means), jnp.concatenate(variances)

    def regularity(self) -> Regularity:
        if traced(self):
            return Regularity(None, "Mixture: its numbers are being traced by JAX")
        name = f"mixture of {', '.join(type(part).__name__ for part in self.parts)}"
        places = self.singularities()
        if places is not None:
            return declared(places, self.support(), name)
        if all(part.regularity().finite for part in self.parts):
            return Regularity(True, f"{name}: every part is regular, and information is convex")
        return Regularity(None, f"{name}: a part is not known to be regular, and its singularities are not declared")
