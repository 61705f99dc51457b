"""Laws of range errors by maximum likelihood; likelihoods are those of densities in 1/m."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.fit.one_sided import ONE_SIDED, fit_one_sided
from locbounds.noise import (
    ExponentiallyModifiedGaussian,
    Gaussian,
    GaussianMixture,
    Laplace,
    Noise,
    StudentT,
    TruncatedGaussian,
    Uniform,
)
from locbounds.precision import double_precision

FEWEST = 20
BOX = 12.0  # limits of the logarithms of scales, in units of the errors' own spread
DEGREES = float(np.log(0.5)), float(np.log(200.0))
"""Limits of the logarithm; a Student t law with more degrees of freedom is Gaussian for all purposes."""


class LawFit(NamedTuple):
    """A family fitted to errors.

    Attributes
    ----------
    family
        Its name, as in scenario files.
    noise
        The law, in metres.
    parameters
        How many numbers were fitted.
    log_likelihood
        Sum over the errors, densities in 1/m.
    errors
        How many errors.
    """

    family: str
    noise: Noise
    parameters: int
    log_likelihood: float
    errors: int

    @property
    def aic(self) -> float:
        """Akaike's criterion, smaller is better; it takes the errors as independent."""
        return 2 * self.parameters - 2 * self.log_likelihood


def _gaussian(e: ndarray) -> tuple[Noise, int]:
    return Gaussian(e.mean(), e.std()), 2


def _laplace(e: ndarray) -> tuple[Noise, int]:
    middle = np.median(e)
    return Laplace(middle, np.abs(e - middle).mean()), 2


def _uniform(e: ndarray) -> tuple[Noise, int]:
    return Uniform(e.min(), e.max()), 2


def _student(x: Any) -> Noise:
    return StudentT(jnp.exp(x[2]), x[0], jnp.exp(x[1]))


def _modified(x: Any) -> Noise:
    return ExponentiallyModifiedGaussian(x[0], jnp.exp(x[1]), jnp.exp(x[2]))


def _mixture(x: Any) -> Noise:
    w = jax.nn.sigmoid(x[0])
    return GaussianMixture(jnp.stack([1 - w, w]), x[jnp.array([1, 2])], jnp.exp(x[jnp.array([3, 4])]))


def _cut(x: Any) -> Noise:
    return TruncatedGaussian(x[0], jnp.exp(x[1]), x[2], x[3])


def _metres(noise: Any, middle: float, scale: float) -> Noise:
    """A law of standardised errors ``(e - middle)/scale`` as one of errors in metres."""
    n = jax.tree.map(np.asarray, noise)
    if isinstance(n, StudentT):
        return StudentT(n.degrees, middle + scale * n.center, scale * n.scale)
    if isinstance(n, ExponentiallyModifiedGaussian):
        return ExponentiallyModifiedGaussian(middle + scale * n.center, scale * n.std, scale * n.scale)
    if isinstance(n, GaussianMixture):
        return GaussianMixture(n.weights, middle + scale * n.means, scale * n.stds)
    return TruncatedGaussian(middle + scale * n.center, scale * n.std, middle + scale * n.low, middle + scale * n.high)


CLOSED: dict[str, Callable[[ndarray], tuple[Noise, int]]] = {
    "gaussian": _gaussian,
    "laplace": _laplace,
    "uniform": _uniform,
}
SEARCHED: dict[str, Callable[[Any], Noise]] = {
    "student-t": _student,
    "exponentially-modified-gaussian": _modified,
    "gaussian-mixture": _mixture,
    "truncated-gaussian": _cut,
}
LAWS = tuple(CLOSED | SEARCHED | ONE_SIDED)


@cache
def _cost(family: str):
    def mean_log_density(x, u):
        return -jnp.mean(SEARCHED[family](x).log_prob(u))

    return jax.jit(jax.value_and_grad(mean_log_density))


def _starts(family: str, u: ndarray) -> tuple[list[ndarray], list[tuple[float, float]]]:
    """Where the search starts, and its box, for standardised errors."""
    free, scale = (-BOX, BOX), (-BOX, BOX)
    if family == "student-t":
        return [np.array([0.0, np.log(0.7), np.log(4.0)])], [free, scale, DEGREES]
    if family == "exponentially-modified-gaussian":
        return [np.array([-0.5, np.log(0.6), np.log(s)]) for s in (0.3, 1.0)], [free, (-6.0, BOX), (-9.0, BOX)]
    if family == "gaussian-mixture":
        low, high = np.quantile(u, [0.3, 0.9])
        first = [
            np.array([0.0, low, high, np.log(0.5), np.log(0.8)]),
            np.array([-1.5, 0.0, 0.3, np.log(0.6), np.log(2.5)]),
        ]
        return first, [(-9.0, 9.0), free, free, (-6.0, BOX), (-6.0, BOX)]
    ends = float(u.min()), float(u.max())
    start = np.array([u.mean(), np.log(u.std()), *ends])
    return [start], [(ends[0] - 20, ends[1] + 20), (-4.0, 5.0), (ends[0], ends[0]), (ends[1], ends[1])]


@double_precision
def fit_noise_law(error_m, family: str, *, start_m: float | None = None) -> LawFit:
    """Fit one family of noises to range errors by maximum likelihood.

    Parameters
    ----------
    error_m : array
        Measured minus true ranges, m; NaN is left out.
    family : str
        One of `LAWS`.
    start_m : float, optional
        Smallest value of the one-sided families. Left out, it is fitted too: see `fit_one_sided`.

    Returns
    -------
    LawFit

    Raises
    ------
    InputError
        An unknown family, fewer than `FEWEST` errors, or errors all equal.
    ContradictedError
        Errors that the family does not allow, or to which it has no best law.

    Examples
    --------
    >>> e = np.random.default_rng(0).laplace(1.0, 2.0, 5000)
    >>> round(float(fit_noise_law(e, "laplace").noise.scale), 1)
    2.0
    """
    e = np.asarray(error_m, float).ravel()
    e = e[np.isfinite(e)]
    _check(e, family)
    if family in ONE_SIDED:
        noise, parameters = fit_one_sided(e, family, start_m)
    elif family in CLOSED:
        noise, parameters = CLOSED[family](e)
    else:
        middle = float(np.median(e))
        scale = float(np.std(e))
        u = (e - middle) / scale
        starts, box = _starts(family, u)
        cost, data = _cost(family), jnp.asarray(u)

        def both(x):
            value, slope = cost(jnp.asarray(x), data)
            return float(value), np.where([low < high for low, high in box], np.asarray(slope), 0.0)

        found = [minimize(both, x, jac=True, method="L-BFGS-B", bounds=box, options={"ftol": 1e-13}) for x in starts]
        best = min(found, key=lambda f: f.fun)
        noise, parameters = _metres(SEARCHED[family](jnp.asarray(best.x)), middle, scale), len(best.x)
        if isinstance(noise, TruncatedGaussian):  # not off by rounding, which would make an extreme impossible
            noise = TruncatedGaussian(noise.center, noise.std, e.min(), e.max())
    return LawFit(family, noise, parameters, float(log_densities(noise, e).sum()), len(e))


def _check(e: ndarray, family: str) -> None:
    if family not in LAWS:
        from difflib import get_close_matches

        near = get_close_matches(family, LAWS, n=1, cutoff=0.4)
        raise InputError(
            f"unknown noise family {family!r}", f"{f'Did you mean {near[0]}? ' if near else ''}Known: {', '.join(LAWS)}"
        )
    if len(e) < FEWEST:
        raise InputError(f"there are {len(e)} errors to fit a noise to", f"Give at least {FEWEST}")
    if not e.std() > 0:
        raise InputError("all range errors are equal", "Fit to measured ranges")


@double_precision
def log_densities(noise: Noise, e: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Log-density of every error; minus infinity where the law has none."""
    return np.asarray(noise.log_prob(jnp.asarray(e)))
