r"""Several samples of one epoch, each with its own bias or all with the same one.

With a bias b_i of its own in every sample, M samples are independent and their information is M times that of one.
With one bias for the epoch they are dependent, ``p(w_1..w_M) = int p_b(b) prod p_n(w_i - b) db``, and averaging does
not remove the bias: the information stays below that of the bias alone (Stam 1959), however many samples there are.
Taking a common bias for independent ones is therefore optimistic by up to a factor M.

For Gaussian sample noise the mean of the samples is sufficient (the differences between samples do not
depend on the shift), so that the epoch is *one* sample with noise ``Gaussian(mean, std / sqrt(M)) + bias``, exactly:
:meth:`Epoch.as_noise`, for use in scenarios. Otherwise the joint density moves with the shift like that of one sample:
its edges along the shift are those of noise plus bias, with the same exponents, and so is its regularity.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp

from locbounds.axes import Array, Float
from locbounds.errors import InputError, RefusedError
from locbounds.noise.base import Noise
from locbounds.noise.gaussian import Gaussian
from locbounds.noise.regularity import Regularity
from locbounds.precision import double_precision

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
GROUPS = 32


class Information(NamedTuple):
    """Information of one epoch about a shift, 1/m^2, and its standard error (0 where it is exact)."""

    value: float
    stderr: float


class Epoch(eqx.Module):
    """M samples taken at one time.

    Parameters
    ----------
    noise
        Noise of each sample.
    bias
        Law of the bias.
    samples
        M, at least 1.
    common
        One bias for all samples of the epoch (True), or one for each.

    Raises
    ------
    InputError
        If the number of samples is no whole number of at least one.

    Examples
    --------
    Ten samples help little against a bias that they share:

    >>> own, common = (Epoch(Gaussian(0.0, 1.6), Gaussian(0.0, 3.0), 10, common=c) for c in (False, True))
    >>> [round(epoch.information().value ** -0.5, 2) for epoch in (own, common)]
    [1.08, 3.04]
    """

    noise: Noise
    bias: Noise
    samples: int = eqx.field(static=True)
    common: bool = eqx.field(static=True)

    def __init__(self, noise: Noise, bias: Noise, samples: int, *, common: bool = True):
        self.noise, self.bias, self.samples, self.common = noise, bias, samples, common

    def __check_init__(self):
        if isinstance(self.samples, bool) or not isinstance(self.samples, int) or self.samples < 1:
            raise InputError(f"an epoch has {self.samples!r} samples", "Give a whole number of at least one")

    def as_noise(self) -> Noise:
        """The law of the epoch's mean, which is sufficient where the sample noise is Gaussian and the bias common.

        Raises
        ------
        RefusedError
            Where the mean is not sufficient.
        """
        if self.samples == 1:
            return self.noise + self.bias
        if not self.common or type(self.noise) is not Gaussian:
            raise RefusedError(
                "the mean of these samples is not sufficient: one sample cannot stand for the epoch",
                "Use Gaussian sample noise with a common bias, or the samples one by one",
            )
        return Gaussian(self.noise.mean, self.noise.std / np.sqrt(self.samples)) + self.bias

    def log_prob(self, w: Float[Array, "*n samples"]) -> Float[Array, "*n"]:
        """Joint log-density of the samples."""
        if not self.common:
            return jnp.sum((self.noise + self.bias).log_prob(w), -1)
        places = self.bias.landmarks()
        half = 0.5 * jnp.diff(places)
        b = (0.5 * (places[1:] + places[:-1])[:, None] + half[:, None] * _NODES).ravel()
        log_weight = (jnp.log(jnp.maximum(half, 1e-300))[:, None] + jnp.log(_WEIGHTS)).ravel() + self.bias.log_prob(b)
        each = jnp.sum(self.noise.log_prob(jnp.asarray(w)[..., None, :] - b[:, None]), -1)
        return logsumexp(each + log_weight, axis=-1)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "... samples"]:
        """Independent epochs."""
        one, two = jax.random.split(key)
        bias = self.bias.sample(two, (*shape, 1 if self.common else self.samples))
        return self.noise.sample(one, (*shape, self.samples)) + bias

    def regularity(self) -> Regularity:
        """That of one sample, noise plus bias; see the module."""
        return (self.noise + self.bias).regularity()

    def information(self, *, draws: int = 4096, seed: int = 0) -> Information:
        """Fisher information about a shift of the whole epoch.

        Parameters
        ----------
        draws, seed
            For sample noises that are not Gaussian, and a common bias: the mean of the squared score over draws.
        """
        return _information(self, draws, seed)


@double_precision
def _information(epoch: Epoch, draws: int, seed: int) -> Information:
    if epoch.regularity().finite is False:
        return Information(np.inf, 0.0)
    if not epoch.common:
        return Information(epoch.samples * float((epoch.noise + epoch.bias).information()), 0.0)
    if epoch.samples == 1 or type(epoch.noise) is Gaussian:
        return Information(float(epoch.as_noise().information()), 0.0)
    squares = np.asarray(_squared_scores(epoch, seed, max(draws // GROUPS, 1)))
    return Information(float(squares.mean()), float(squares.std(ddof=1) / np.sqrt(squares.size)))


@eqx.filter_jit
def _squared_scores(epoch: Epoch, seed: int, each: int) -> Array:
    def group(key: Array) -> Array:
        w = epoch.sample(key, (each,))
        return jax.jvp(epoch.log_prob, (w,), (jnp.ones_like(w),))[1] ** 2

    return jax.lax.map(group, jax.random.split(jax.random.key(seed), GROUPS))
