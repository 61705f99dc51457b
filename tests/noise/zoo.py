"""Densities whose Fisher information about a shift is known to be finite or infinite, with the reason.

The criterion is that of Hájek: finite exactly where the root of the density has a square integrable derivative.
"""

from functools import cache
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

import locbounds as lb


class Specimen(NamedTuple):
    """A density, the truth about it, and where and why, if that is at a place: kind and exponent of a finding."""

    build: object
    finite: bool | None
    place: float | None = None
    kind: str = ""
    exponent: float = np.nan


def own(function, low=-np.inf, high=np.inf, **options):
    return lambda: lb.FromLogDensity(function, support=(low, high), normalise=True, **options)


def uniform(low, high):
    return lb.Uniform(low, high)


def two_triangles():
    return lb.Mixture([0.5, 0.5], [uniform(0.0, 1.0) + uniform(0.0, 1.0), uniform(1.0, 2.0) + uniform(1.0, 2.0)])


def numpyro(name, *numbers):
    import numpyro.distributions as dist

    return lb.FromNumPyro(getattr(dist, name)(*numbers))


DECLARED = {
    "gaussian": Specimen(lambda: lb.Gaussian(1.0, 2.0), True),
    "gaussian mixture": Specimen(lambda: lb.GaussianMixture([0.5, 0.5], [0.0, 9.0], [1.0, 2.0]), True),
    "modified gaussian": Specimen(lambda: lb.ExponentiallyModifiedGaussian(0.0, 1.0, 5.0), True),
    "student": Specimen(lambda: lb.StudentT(3.0, 0.0, 1.0), True),
    "cauchy": Specimen(lambda: lb.StudentT(1.0, 0.0, 1.0), True),
    "laplace": Specimen(lambda: lb.Laplace(2.0, 1.0), True, 2.0, "kink", 1.0),
    "uniform": Specimen(lambda: uniform(0.0, 3.0), False, 0.0, "jump", 0.0),
    "exponential": Specimen(lambda: lb.Exponential(2.0, 1.0), False, 1.0, "jump", 0.0),
    "cut gaussian": Specimen(lambda: lb.TruncatedGaussian(0.0, 1.0, -2.0, 2.0), False, 2.0, "jump", 0.0),
    "half gaussian": Specimen(lambda: lb.TruncatedGaussian(0.0, 1.0, 0.0), False, 0.0, "jump", 0.0),
    "gamma 0.5": Specimen(lambda: lb.Gamma(0.5, 1.0), False, 0.0, "pole", -0.5),
    "gamma 1": Specimen(lambda: lb.Gamma(1.0, 1.0), False, 0.0, "jump", 0.0),
    "gamma 1.5": Specimen(lambda: lb.Gamma(1.5, 1.0), False, 0.0, "edge", 0.5),
    "gamma 2": Specimen(lambda: lb.Gamma(2.0, 1.0, -3.0), False, -3.0, "edge", 1.0),
    "gamma 2.5": Specimen(lambda: lb.Gamma(2.5, 1.0), True, 0.0, "edge", 1.5),
    "log-normal": Specimen(lambda: lb.LogNormal(1.0, 0.5), True),
    "RSS of Prieto": Specimen(
        lambda: lb.TruncatedGaussian(0.0, 1.6, -3.2, 3.2) + lb.TruncatedGaussian(0.0, 3.0, -6.0, 6.0),
        False, -9.2, "edge", 1.0,
    ),
    "ToA of Prieto": Specimen(
        lambda: lb.TruncatedGaussian(0.0, 3.5, -7.0, 7.0) + uniform(0.0, 3.0), False, 10.0, "edge", 1.0
    ),
    "triangle": Specimen(lambda: uniform(0.0, 1.0) + uniform(0.0, 1.0), False, 2.0, "edge", 1.0),
    "triangle with outliers": Specimen(
        lambda: lb.Mixture([0.9, 0.1], [uniform(0.0, 1.0) + uniform(0.0, 1.0), lb.Gaussian(0.0, 9.0)]),
        True, 1.0, "kink", 1.0,
    ),
    "uniform with outliers": Specimen(
        lambda: lb.Mixture([0.9, 0.1], [uniform(0.0, 1.0), lb.Gaussian(0.0, 9.0)]), False, 1.0, "jump", 0.0
    ),
    "uniform bias on gaussian": Specimen(lambda: lb.Gaussian(0.0, 1.0) + uniform(0.0, 9.0), True),
    "three uniforms": Specimen(
        lambda: uniform(0.0, 1.0) + uniform(0.0, 1.0) + uniform(0.0, 1.0), True, 3.0, "edge", 2.0
    ),
    "two triangles that touch": Specimen(two_triangles, False, 2.0, "zero", 1.0),
    "uniform in two pieces": Specimen(
        lambda: lb.Mixture([0.25, 0.75], [uniform(0.0, 1.0), uniform(1.0, 4.0)]), False, 4.0, "jump", 0.0
    ),
    "gamma sum": Specimen(lambda: lb.Gamma(0.7, 1.0) + lb.Gamma(0.9, 2.0), False, 0.0, "edge", 0.6),
    "smoother gamma sum": Specimen(lambda: lb.Gamma(1.4, 1.0) + lb.Gamma(1.8, 2.0), True, 0.0, "edge", 2.2),
    "declared by the user": Specimen(
        own(lambda w: jnp.log(w), 0.0, 2.0, singular=[lb.Singularity(0.0, 1.0, 0.0, 0.5),
                                                       lb.Singularity(2.0, 0.0, 1.0, 0.0)]),
        False, 2.0, "jump", 0.0,
    ),
}  # fmt: skip

BLACK_BOX = {
    "logistic": Specimen(lambda: numpyro("Logistic", 0.0, 2.0), True),
    "gumbel": Specimen(lambda: numpyro("Gumbel", 1.0, 2.0), True),
    "weibull 1.5": Specimen(lambda: numpyro("Weibull", 1.0, 1.5), False, 0.0, "edge", 0.5),
    "weibull 3": Specimen(lambda: numpyro("Weibull", 1.0, 3.0), True, 0.0, "edge", 2.0),
    "asymmetric laplace": Specimen(lambda: numpyro("AsymmetricLaplace", 1.0, 1.0, 2.0), True, 1.0, "kink", 1.0),
    "beta 2 2": Specimen(own(lambda w: jnp.log(w) + jnp.log1p(-w), 0.0, 1.0), False, 0.0, "edge", 1.0),
    "beta 3 3": Specimen(own(lambda w: 2 * (jnp.log(w) + jnp.log1p(-w)), 0.0, 1.0), True, 0.0, "edge", 2.0),
    "cosine": Specimen(own(lambda w: jnp.log(jnp.cos(w)), -np.pi / 2, np.pi / 2), False, np.pi / 2, "edge", 1.0),
    "raised cosine": Specimen(
        own(lambda w: 2 * jnp.log(jnp.cos(w)), -np.pi / 2, np.pi / 2), True, np.pi / 2, "edge", 2.0
    ),
    "zero inside, t^2": Specimen(own(lambda w: 2 * jnp.log(jnp.abs(w - 0.3)) - w**2), True),
    "zero inside, |t|": Specimen(own(lambda w: jnp.log(jnp.abs(w - 0.3)) - w**2), False, 0.3, "zero", 1.0),
    "zero inside, |t|^1.5": Specimen(own(lambda w: 1.5 * jnp.log(jnp.abs(w - 0.3)) - w**2), True, 0.3, "zero", 1.5),
    "cusp |t|^0.4": Specimen(own(lambda w: -jnp.abs(w - 0.7) ** 0.4), False, 0.7, "cusp", 0.4),
    "cusp |t|^0.75": Specimen(own(lambda w: -jnp.abs(w - 0.7) ** 0.75), True, 0.7, "cusp", 0.75),
    "flat top |t|^3": Specimen(own(lambda w: -jnp.abs(w - 0.7) ** 3), True),
    "jump inside": Specimen(own(lambda w: -(w**2) + jnp.where(w > 0.7, 0.5, 0.0)), False, 0.7, "jump", 0.0),
    "two-piece gaussian": Specimen(own(lambda w: -(w**2) / jnp.where(w > 0, 8.0, 2.0)), True),
    "kink in a tail": Specimen(own(lambda w: -jnp.where(w > 2.0, 5.0 * w - 6.0, w**2)), True, 2.0, "kink", 1.0),
    "smoothed bump": Specimen(own(lambda w: -1 / (1 - w**2), -1.0, 1.0), True),
}  # fmt: skip

UNDECIDED = {
    # finite: E ~ int dt / (t log(t)^2); its exponent 1 + 2 / log(1/t) creeps towards 1
    "t / log(t)^2": Specimen(
        own(lambda w: jnp.log(w) - 2 * jnp.log(1 - jnp.log(w)) + 2 * jnp.log1p(-w), 0.0, 1.0), True
    ),
    # infinite: its exponent 1 - 1 / log(1/t) creeps towards 1 as well
    "t log(1/t)": Specimen(own(lambda w: jnp.log(w) + jnp.log(1 - jnp.log(w)) + 2 * jnp.log1p(-w), 0.0, 1.0), False),
    # finite, about 1e10: a step that is smooth over 1e-11, which no number of evaluations distinguishes from a jump
    "very steep step": Specimen(own(lambda w: -(w**2) + 0.5 * jnp.tanh((w - 0.7) / 1e-11)), True),
    # infinite: continuous, nowhere differentiable
    "weierstrass": Specimen(own(lambda w: -(w**2) + sum(0.6**k * jnp.cos(3.0**k * w) for k in range(25))), False),
}


@cache
def noise(name):
    """The specimen's law, built once."""
    return (DECLARED | BLACK_BOX | UNDECIDED)[name].build()
