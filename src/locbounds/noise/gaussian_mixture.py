"""Gaussian mixture noise, for example a sight condition with rare outliers."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp, ndtr

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.noise.base import BREAKS, Noise
from locbounds.noise.regularity import Regularity
from locbounds.noise.singularity import Singularity
from locbounds.precision import float64, traced

_BREAKS = np.array([-10, -8, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6, 8, 10.0])  # in deviations of a component
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@jax.custom_jvp
def _quantile(w: Array, weights: Array, means: Array, stds: Array) -> Array:
    """The draw ``w`` itself; it moves with the parameters so that its probability ``F(w)`` stays what it is."""
    return w


@_quantile.defjvp
def _quantile_jvp(primals, tangents):
    w, weights, means, stds = primals
    _, d_weights, d_means, d_stds = tangents
    u = (w[..., None] - means) / stds
    log_density = -0.5 * u**2 - jnp.log(stds) - 0.5 * jnp.log(2 * jnp.pi)
    share = jax.nn.softmax(log_density + jnp.log(weights), axis=-1)
    density = jnp.exp(logsumexp(log_density + jnp.log(weights), axis=-1))
    moves = jnp.sum(share * (d_means + u * d_stds), -1)  # -dF / density, its part by means and deviations
    # the shares' part; with F or 1 - F, whichever is small, as the changes of the weights sum to zero
    tail = jnp.where(w[..., None] < jnp.sum(weights * means), ndtr(u), -ndtr(-u))
    return w, tangents[0] + moves - jnp.sum(tail * d_weights, -1) / density


class GaussianMixture(Noise):
    """Mixture of Gaussians, drawn afresh at every measurement.

    Parameters
    ----------
    weights
        Shares of the components, [components], positive, summing to one.
    means, stds
        Means and standard deviations in metres, [components].

    Raises
    ------
    InputError
        If shapes differ, weights do not sum to one or a deviation is not positive.

    Examples
    --------
    Two equal components are one Gaussian:

    >>> float(GaussianMixture([0.3, 0.7], [0.0, 0.0], [2.0, 2.0]).information())  # doctest: +ELLIPSIS
    0.25...
    """

    weights: Float[Array, " c"] = eqx.field(converter=float64)
    means: Float[Array, " c"] = eqx.field(converter=float64)
    stds: Float[Array, " c"] = eqx.field(converter=float64)

    def __init__(self, weights, means, stds):
        self.weights, self.means, self.stds = weights, means, stds

    def __check_init__(self):
        if traced(self.weights, self.means, self.stds):
            return
        if not (self.weights.ndim == 1 and self.weights.shape == self.means.shape == self.stds.shape):
            raise InputError(
                f"mixture shapes differ: weights {self.weights.shape}, means {self.means.shape}, "
                f"deviations {self.stds.shape}",
                "Give one weight, one mean and one deviation per component",
            )
        if not (np.all(self.weights > 0) and abs(self.weights.sum() - 1) < 1e-9):
            raise InputError(f"mixture weights are {self.weights}", "Give positive weights that sum to one")
        if not (np.all(np.isfinite(self.stds)) and np.all(self.stds > 0) and np.all(np.isfinite(self.means))):
            raise InputError(
                f"mixture means {self.means}, deviations {self.stds}", "Give finite means and positive deviations"
            )

    @property
    def mean(self) -> Scalar:
        return (self.weights * self.means).sum()

    @property
    def variance(self) -> Scalar:
        return (self.weights * (self.stds**2 + self.means**2)).sum() - self.mean**2

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        u = (jnp.asarray(w)[..., None] - self.means) / self.stds
        return logsumexp(-0.5 * u**2 + jnp.log(self.weights / self.stds), axis=-1) - 0.5 * jnp.log(2 * jnp.pi)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        pick, draw = jax.random.split(key)
        c = jnp.searchsorted(jnp.cumsum(self.weights)[:-1], jax.random.uniform(pick, shape), side="right")
        w = jnp.asarray(self.means)[c] + jnp.asarray(self.stds)[c] * jax.random.normal(draw, shape)
        return _quantile(jax.lax.stop_gradient(w), *map(jnp.asarray, (self.weights, self.means, self.stds)))

    def landmarks(self) -> Float[Array, " k"]:
        return jnp.sort((jnp.asarray(self.means)[:, None] + jnp.asarray(self.stds)[:, None] * BREAKS).ravel())

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return jnp.sum(self.weights * ndtr((jnp.asarray(w)[..., None] - self.means) / self.stds), -1)

    def information(self) -> Scalar:
        edges = jnp.sort((self.means[:, None] + self.stds[:, None] * _BREAKS).ravel())
        half = 0.5 * jnp.diff(edges)
        w = 0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * _NODES
        return jnp.sum(half[:, None] * _WEIGHTS * jnp.exp(self.log_prob(w)) * self.score(w) ** 2)

    def components(self) -> tuple[Float[Array, " c"], Float[Array, " c"], Float[Array, " c"]]:
        return jnp.asarray(self.weights), jnp.asarray(self.means), jnp.asarray(self.stds) ** 2

    def singularities(self) -> tuple[Singularity, ...]:
        return ()

    def regularity(self) -> Regularity:
        return Regularity(True, "mixture of Gaussian densities: smooth on the whole line")
