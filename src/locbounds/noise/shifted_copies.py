r"""How well a noise tells two shifts apart: what Weiss-Weinstein and Ziv-Zakai bounds are made of.

Both numbers exist for every density, also where the Fisher information does not.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.noise.base import Noise
from locbounds.precision import double_precision, traced

BISECTIONS = 50
_U = np.linspace(-3.4, 3.4, 49)  # double-exponential nodes: integrable singularities at the ends do no harm
_X = np.tanh(0.5 * np.pi * np.sinh(_U))
_W = (_U[1] - _U[0]) * 0.5 * np.pi * np.cosh(_U) / np.cosh(0.5 * np.pi * np.sinh(_U)) ** 2


@double_precision
def bhattacharyya(noise: Noise, shifts: Float[Array, "*n"], *, exponent: float = 0.5) -> Float[Array, "*n"]:
    r"""Bhattacharyya coefficient between a noise and its shifted copies (Chernoff's, for any exponent).

    ``rho(h) = int p(w)^s p(w - h)^(1 - s) dw``, with ``rho(0) = 1`` and ``rho = 0`` where the supports do not meet.

    Parameters
    ----------
    noise
        Any noise.
    shifts
        h in metres, of any shape and sign.
    exponent
        s, between 0 and 1. The coefficient is symmetric in h for 1/2.

    Returns
    -------
    array
        Of the shape of ``shifts``.

    Raises
    ------
    InputError
        If the exponent is not inside (0, 1) or a shift not finite.

    Notes
    -----
    Double-exponential quadrature between the landmarks of both copies, relative accuracy about 1e-9; it can be
    differentiated and compiled by JAX.

    Examples
    --------
    >>> import locbounds as lb
    >>> bhattacharyya(lb.Uniform(0.0, 4.0), np.array([0.0, 1.0, -1.0, 5.0]))
    array([1.  , 0.75, 0.75, 0.  ])
    """
    if not 0 < exponent < 1:
        raise InputError(f"the exponent is {exponent}", "Give a number between 0 and 1, for example 0.5")
    _check(shifts)
    return _over_shifts(_coefficient, noise, jnp.asarray(shifts, dtype=float), jnp.asarray(exponent, dtype=float))


@double_precision
def minimum_error(noise: Noise, shifts: Float[Array, "*n"], *, probability: float = 0.5) -> Float[Array, "*n"]:
    r"""Smallest probability of error in deciding between a noise and its shifted copy.

    ``P(h) = int min(q p(w), (1 - q) p(w - h)) dw``: the error of the likelihood ratio test; 1/2 at h = 0 for q = 1/2.

    Parameters
    ----------
    noise
        Any noise.
    shifts
        h in metres, of any shape and sign.
    probability
        q, the prior probability of the noise that is not shifted.

    Returns
    -------
    array
        Of the shape of ``shifts``.

    Raises
    ------
    InputError
        If the probability is not inside (0, 1) or a shift not finite.

    Examples
    --------
    >>> import locbounds as lb
    >>> minimum_error(lb.Uniform(0.0, 4.0), np.array([0.0, 1.0, 5.0]))
    array([0.5  , 0.375, 0.   ])
    """
    if not 0 < probability < 1:
        raise InputError(f"the prior probability is {probability}", "Give a number between 0 and 1, for example 0.5")
    _check(shifts)
    return _over_shifts(_error, noise, jnp.asarray(shifts, dtype=float), jnp.asarray(probability, dtype=float))


def _check(shifts: Any) -> None:
    if not traced(shifts) and not np.all(np.isfinite(shifts)):
        raise InputError("a shift is not finite", "Give metres")


@partial(jax.jit, static_argnums=0)
def _over_shifts(kernel: Any, noise: Noise, shifts: Array, number: Array) -> Array:
    values = jax.lax.map(lambda h: kernel(noise, h, number), shifts.ravel(), batch_size=8)
    return values.reshape(shifts.shape)


def panels(noise: Noise, h: Array) -> tuple[Array, Array]:
    """Lower and upper ends of panels on which a noise and its copy shifted by h are smooth."""
    places = jnp.concatenate([noise.landmarks(), noise.corners()])
    places = jnp.clip(places, noise.landmarks()[0], noise.landmarks()[-1])
    both = jnp.sort(jnp.concatenate([places, places + h]))
    return both[:-1], both[1:]


def integral(f: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Integral of a function over panels with these ends; integrable singularities there do no harm.

    Parameters
    ----------
    f
        ``[panels, nodes] -> [..., panels, nodes]``, several integrands at once along further leading axes.

    Examples
    --------
    >>> from locbounds.precision import double_precision
    >>> print(double_precision(integral)(lambda w: w**2, np.array([0.0, 1.0]), np.array([1.0, 3.0])).round(9))
    9.0
    """
    half = 0.5 * (high - low)
    w = (0.5 * (low + high))[:, None] + half[:, None] * _X
    return jnp.sum(half[:, None] * _W * f(w), axis=(-2, -1))


def _coefficient(noise: Noise, h: Array, s: Array) -> Array:
    def f(w: Array) -> Array:
        one, two = noise.log_prob(w), noise.log_prob(w - h)
        there = (one > -jnp.inf) & (two > -jnp.inf)
        return jnp.exp(
            jnp.where(there, s * jnp.where(there, one, 0.0) + (1 - s) * jnp.where(there, two, 0.0), -jnp.inf)
        )

    return integral(f, *panels(noise, h))


def _error(noise: Noise, h: Array, q: Array) -> Array:
    def logs(w: Array) -> tuple[Array, Array]:
        return noise.log_prob(w) + jnp.log(q), noise.log_prob(w - h) + jnp.log1p(-q)

    def first_larger(w: Array) -> Array:
        one, two = logs(w)
        return one > two

    low, high = panels(noise, h)
    nudge = 1e-9 * (high - low)
    before, after = first_larger(low + nudge), first_larger(high - nudge)

    def halve(_: Any, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
        a, b = bracket
        middle = 0.5 * (a + b)
        same = first_larger(middle) == before
        return jnp.where(same, middle, a), jnp.where(same, b, middle)

    crossing = jax.lax.fori_loop(0, BISECTIONS, halve, (low + nudge, high - nudge))[0]
    crossing = jnp.where(before == after, 0.5 * (low + high), crossing)
    crossing = jax.lax.stop_gradient(crossing)

    def smaller(w: Array) -> Array:
        return jnp.exp(jnp.minimum(*logs(w)))

    return integral(smaller, low, crossing) + integral(smaller, crossing, high)
