"""The two densities of Prieto et al. (2011) and other closed forms against quadrature in extended precision.

The reference integrates ``p_1(x) p_2(e - x)`` over x in the 64-bit mantissas of x87 long doubles, at the same double e
and the same double parameters; it shares no formula with the closed forms.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import locbounds as lb
from compiling import QUICKLY
from locbounds.precision import double_precision

RELATIVE = 1e-10
L = np.longdouble

extended = pytest.mark.skipif(np.finfo(L).eps > 1e-18, reason="long double is not extended here")


def legendre(n):
    """Nodes and weights in long double, by Newton's method from the double ones."""
    x = np.polynomial.legendre.leggauss(n)[0].astype(L)
    for _ in range(3):
        before, now = np.ones_like(x), x.copy()
        for k in range(2, n + 1):
            before, now = now, ((2 * k - 1) * x * now - (k - 1) * before) / L(k)
        slope = n * (x * now - before) / (x * x - 1)
        x = x - now / slope
    return x, 2 / ((1 - x * x) * slope**2)


NODES, WEIGHTS = legendre(60)


def integral(f, low, high, panels=40):
    edges = low + (high - low) * np.arange(panels + 1).astype(L) / panels
    half = (edges[1:] - edges[:-1]) / 2
    x = (edges[1:] + edges[:-1])[:, None] / 2 + half[:, None] * NODES
    return (half[:, None] * WEIGHTS * f(x)).sum()


def gauss(center, std, low, high):
    """Density of a cut Gaussian and its limits, in long double; the limits stand for infinity where there is none."""
    center, std, low, high = map(L, (center, std, low, high))

    def bell(x):
        return np.exp(-(((x - center) / std) ** 2) / 2)

    mass = integral(bell, low, high)
    return lambda x: bell(x) / mass, low, high


def flat(low, high):
    low, high = L(low), L(high)
    return lambda x: np.ones_like(x) / (high - low), low, high


def convolved(one, two, e):
    (p, l1, h1), (q, l2, h2) = one, two
    e = L(e)
    low, high = max(l1, e - h2), min(h1, e - l2)
    return integral(lambda x: p(x) * q(e - x), low, high)


SIGNAL_STRENGTH = lb.TruncatedGaussian(0.0, 1.6, -3.2, 3.2) + lb.TruncatedGaussian(0.0, 3.0, -6.0, 6.0)
EXCHANGED = lb.TruncatedGaussian(0.0, 3.0, -6.0, 6.0) + lb.TruncatedGaussian(0.0, 1.6, -3.2, 3.2)
ARRIVAL = lb.TruncatedGaussian(0.0, 3.5, -7.0, 7.0) + lb.Uniform(0.0, 3.0)
LONG_BIAS = lb.TruncatedGaussian(0.0, 0.5, -1.0, 1.0) + lb.Uniform(0.1, 3.0)
OFF_CENTRE = lb.TruncatedGaussian(0.3, 0.7, 1.1, 5.3) + lb.TruncatedGaussian(-8.0, 1.3, -7.9, 0.1)
CASES = {
    "RSS": (SIGNAL_STRENGTH, gauss(0, 1.6, -3.2, 3.2), gauss(0, 3.0, -6, 6)),
    "RSS, deviations exchanged": (EXCHANGED, gauss(0, 3.0, -6, 6), gauss(0, 1.6, -3.2, 3.2)),
    "ToA, short bias": (ARRIVAL, gauss(0, 3.5, -7, 7), flat(0, 3)),
    "ToA, long bias": (LONG_BIAS, gauss(0, 0.5, -1, 1), flat(0.1, 3.0)),
    "in the tails": (OFF_CENTRE, gauss(0.3, 0.7, 1.1, 5.3), gauss(-8.0, 1.3, -7.9, 0.1)),
}


def ends(one, two):
    return float(one[1] + two[1]), float(one[2] + two[2])


def places(one, two):
    """Down to 1e-6 of the support from either end."""
    low, high = ends(one, two)
    near = (high - low) * np.array([1e-6, 1e-5, 1e-3, 0.03, 0.1, 0.2, 0.31, 0.43, 0.5])
    return np.concatenate([low + near, high - near])


@pytest.fixture(params=CASES, scope="module")
def case(request):
    return CASES[request.param]


log_prob = double_precision(jax.jit(lambda noise, w: noise.log_prob(w)))


@extended
def test_closed_forms_hold_to_ten_digits_next_to_the_edges(case):
    noise, one, two = case
    w = places(one, two)
    expected = np.array([float(np.log(convolved(one, two, e))) for e in w])
    np.testing.assert_allclose(np.exp(log_prob(noise, w) - expected), 1.0, rtol=RELATIVE)


def test_nothing_outside_the_support(case):
    noise, one, two = case
    low, high = ends(one, two)
    assert np.all(
        log_prob(noise, np.array([low - 1e-9, high + 1e-9, low - 50.0, high + 50.0, *[low - 1.0] * 14])) == -np.inf
    )


@double_precision
@partial(jax.jit, compiler_options=QUICKLY)
def moments(noise):
    return noise.expect(lambda w: 1.0 + 0 * w), noise.expect(lambda w: (w - noise.mean) ** 2), noise.variance


def test_mass_and_moments(case):
    mass, variance, stated = moments(case[0])
    assert mass == pytest.approx(1, abs=1e-12)
    assert variance == pytest.approx(float(stated), rel=1e-10)


def test_the_printed_formulas_of_the_paper():
    """Eqs. 5 and 9, each with its two cases in one formula: differences of distribution functions, away from edges."""
    E = 2 * stats.norm.cdf(2.0) - 1
    w = np.linspace(-5.9, 5.9, 18)
    s1, s2 = 1.6, 3.0
    total, s = np.hypot(s1, s2), s1 * s2 / np.hypot(s1, s2)
    mu = w * s1**2 / total**2
    low, high = np.maximum(-2 * s1, w - 2 * s2), np.minimum(2 * s1, w + 2 * s2)
    expected = stats.norm.pdf(w, 0, total) * (stats.norm.cdf((high - mu) / s) - stats.norm.cdf((low - mu) / s)) / E**2
    np.testing.assert_allclose(np.exp(log_prob(SIGNAL_STRENGTH, w)), expected, rtol=1e-12)
    sigma, g = 3.5, 3.0
    expected = (
        stats.norm.cdf(np.minimum(w, 2 * sigma) / sigma) - stats.norm.cdf(np.maximum(w - g, -2 * sigma) / sigma)
    ) / (g * E)
    np.testing.assert_allclose(np.exp(log_prob(ARRIVAL, w)), expected, rtol=1e-12)


MODIFIED = {"one-sided": (0.0, 1.0, 5.0), "nearly Gaussian": (2.0, 3.0, 0.1)}


@extended
@pytest.mark.parametrize("name", MODIFIED)
def test_exponentially_modified_gaussian_to_ten_digits_in_both_tails(name):
    center, std, scale = MODIFIED[name]
    noise = lb.ExponentiallyModifiedGaussian(center, std, scale)
    w = center + std * np.array([-30.0, -20, -9, -6, -3, -1, -0.1, 0, 0.3, 1, 2, 4, 8, 12, 20, 30, 33, 38])

    def exact(e):
        def integrand(t):
            u = (L(e) - L(center) - t) / L(std)
            return np.exp(-u * u / 2 - t / L(scale))

        # the integrand's exponent is a parabola in t: its mode, and sixty deviations around it
        mode = max(L(0), L(e) - L(center) - L(std) ** 2 / L(scale))
        reach = 14 * L(std) if e > center - 8 * std else 60 * L(std) ** 2 / (L(center) - L(e))
        total = integral(integrand, max(L(0), mode - reach), mode + reach)
        return np.log(total) - np.log(L(std) * L(scale)) - np.log(2 * L(np.pi)) / 2

    expected = np.array([exact(e) for e in w])
    np.testing.assert_allclose(np.exp((log_prob(noise, w) - expected).astype(float)), 1.0, rtol=RELATIVE)


def test_the_papers_information_grows_with_the_logarithm_of_the_number_of_draws():
    """Derived: near an edge p ~ c t, score^2 ~ 1/t^2. A mean of N squared scores sees t down to 1/sqrt(c N), so that it
    grows by c/2 ln N per edge, and E[score^2 ; t > d] by c ln(1/d) per edge exactly.

    c of the signal strength: p_1 and p_2 jump by h_1 and h_2 at their ends, so that p = h_1 h_2 t there.
    """
    h1, h2 = stats.norm.pdf(2.0) / 1.6, stats.norm.pdf(2.0) / 3.0
    E = 2 * stats.norm.cdf(2.0) - 1
    c = h1 * h2 / E**2
    found = {s.place: s for s in SIGNAL_STRENGTH.singularities() or ()}
    assert found[-9.2].right == pytest.approx(c, rel=1e-12)
    assert (found[-9.2].exponent, found[9.2].exponent) == (1, 1)
    assert found[9.2].left == pytest.approx(c, rel=1e-12)

    @double_precision
    @jax.jit
    def above(noise, depth):  # E[score^2 ; w within depth to 1000 depth of the lower edge], in the logarithm of t
        nodes, weights = np.polynomial.legendre.leggauss(60)
        log_t = np.log(1e3) * 0.5 * (nodes + 1)
        t = depth * np.exp(log_t)
        w = -9.2 + t
        return 0.5 * np.log(1e3) * (weights * t * jnp.exp(noise.log_prob(w)) * noise.score(w) ** 2).sum()

    growth = float(above(SIGNAL_STRENGTH, np.float64(1e-7)))
    assert growth == pytest.approx(c * np.log(1e3), rel=1e-3)  # the next term of p is of relative size t
