"""Which closed form serves the sum of two noises; accurate convolution where there is none."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from locbounds.errors import InputError
from locbounds.noise.base import Noise
from locbounds.noise.exponential import Exponential
from locbounds.noise.exponentially_modified import ExponentiallyModifiedGaussian
from locbounds.noise.gaussian import Gaussian
from locbounds.noise.gaussian_mixture import GaussianMixture
from locbounds.noise.mixture import Mixture
from locbounds.noise.sum_of_two import TruncatedGaussianSum, UniformSum
from locbounds.noise.truncated_gaussian import TruncatedGaussian
from locbounds.noise.uniform import Uniform
from locbounds.precision import double_precision, traced


@double_precision
def add(a: Noise, b: Any) -> Noise:
    """Law of the sum of two independent noises.

    Parameters
    ----------
    a, b
        Noises in metres.

    Returns
    -------
    Noise
        Gaussian, Gaussian mixture, exponentially modified Gaussian, sums of truncated Gaussian and uniform noises, and
        mixtures of these are closed forms; everything else is a :class:`~locbounds.noise.convolution.Convolution`.

    Raises
    ------
    InputError
        If ``b`` is no noise.

    Examples
    --------
    >>> add(Gaussian(1.0, 3.0), Gaussian(2.0, 4.0)).std
    array(5.)
    """
    if not isinstance(b, Noise):
        raise InputError(f"cannot add {b!r} to a noise", "Add a noise; a constant belongs into its mean or start")
    found = _closed(a, b) or _closed(b, a)
    if found is not None:
        return found
    from locbounds.noise.convolution import Convolution

    return Convolution(a, b)


def _mixture(noise: Noise) -> tuple[Any, Any, Any] | None:
    if type(noise) is Gaussian:
        xp = jnp if traced(noise) else np
        return xp.ones(1), xp.reshape(noise.mean, (1,)), xp.reshape(noise.std, (1,))
    return (noise.weights, noise.means, noise.stds) if isinstance(noise, GaussianMixture) else None


def mixture_sum(a: tuple[Any, Any, Any], b: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    """Weights, means and deviations of the sum of two Gaussian mixtures: every pair of components."""
    (w0, m0, s0), (w1, m1, s1) = a, b
    xp = jnp if traced(a, b) else np
    return xp.outer(w0, w1).ravel(), xp.add.outer(m0, m1).ravel(), xp.sqrt(xp.add.outer(s0**2, s1**2)).ravel()


def _cut(noise: Noise) -> TruncatedGaussian | None:
    if type(noise) is Gaussian:
        return TruncatedGaussian(noise.mean, noise.std)
    return noise if isinstance(noise, TruncatedGaussian) else None


def _closed(a: Noise, b: Noise) -> Noise | None:
    if type(a) is Gaussian and type(b) is Gaussian:
        xp = jnp if traced(a, b) else np
        return Gaussian(a.mean + b.mean, xp.sqrt(a.std**2 + b.std**2))
    one, two = _mixture(a), _mixture(b)
    if one is not None and two is not None:
        return GaussianMixture(*mixture_sum(one, two))
    if type(a) is Gaussian and isinstance(b, Exponential):
        return ExponentiallyModifiedGaussian(a.mean + b.start, a.std, b.scale)
    if type(a) is Gaussian and isinstance(b, ExponentiallyModifiedGaussian):
        xp = jnp if traced(a, b) else np
        return ExponentiallyModifiedGaussian(a.mean + b.center, xp.sqrt(a.std**2 + b.std**2), b.scale)
    if isinstance(b, Mixture):
        return Mixture(b.weights, [add(a, part) for part in b.parts])
    if isinstance(b, GaussianMixture):
        gaussians = [Gaussian(mean, std) for mean, std in zip(b.means, b.stds, strict=True)]
        return Mixture(b.weights, [add(a, part) for part in gaussians])
    cut = _cut(a)
    bounded = a if isinstance(a, Uniform) else cut
    if isinstance(b, Uniform) and bounded is not None:
        return UniformSum(bounded, b)
    other = _cut(b)
    if cut is not None and other is not None:
        return TruncatedGaussianSum(cut, other)
    return None
