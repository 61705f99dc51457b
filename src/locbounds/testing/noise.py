"""What every noise promises: density, sampler, score, information and moments belong to one law."""

from typing import Any

import jax
import numpy as np

from locbounds.noise import Noise
from locbounds.testing.suite import run

INTEGRAL = 5e-3  # relative; kinks and edges of a density cost the quadrature this much at most
DIFFERENCE = 1e-4  # of central differences against the derivative
DRAWS, KS_LIMIT = 20_000, 2.2  # sqrt(n) D exceeds 2.2 with probability 1e-4
REACH, POINTS = 12.0, 40_001  # w = mean + std sinh(t), |t| < 12: 80,000 deviations to each side


def check_noise(noise: Noise) -> None:
    """Check a noise of your own.

    Parameters
    ----------
    noise
        An instance; one call per set of parameters worth testing.

    Raises
    ------
    Nonconforming
        Listing every check that fails.

    Notes
    -----
    ``elementwise``: log-density and draws have the shape asked for. ``normalised``: the density integrates to one.
    ``moments``: mean and variance are the density's. ``score``: minus the derivative of the log-density.
    ``information``: the mean square of the score, not finite where ``regularity`` says that it does not exist, and
    never below one over the variance. ``sampler``: draws follow the density, depend on the key only.
    ``components``: positive weights that sum to one, with the noise's mean and, within a tenth, its variance.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.testing import check_noise
    >>> check_noise(lb.Gaussian(2.0, 3.0))
    """
    run(noise, CHECKS)


def _scale(noise: Noise) -> tuple[float, float]:
    mean, variance = float(noise.mean), float(noise.variance)
    if np.isfinite(mean) and np.isfinite(variance) and variance > 0:
        return mean, float(np.sqrt(variance))
    w = np.asarray(noise.sample(jax.random.key(1), (DRAWS,)))
    low, middle, high = np.quantile(w, [0.25, 0.5, 0.75])
    return float(middle), float(max(high - low, 1e-12))


def _grid(noise: Noise) -> tuple[Any, Any, Any]:
    """Points, weights times density, and the log-density."""
    middle, scale = _scale(noise)
    t = np.linspace(-REACH, REACH, POINTS)
    w = middle + scale * np.sinh(t)
    log_p = np.asarray(noise.log_prob(w), dtype=float)
    return w, np.exp(log_p) * scale * np.cosh(t) * (t[1] - t[0]), log_p


def _elementwise(noise: Noise) -> str | None:
    w = float(noise.mean) + np.arange(6.0).reshape(3, 2) / 7 if np.isfinite(float(noise.mean)) else np.ones((3, 2))
    values = np.asarray(noise.log_prob(w))
    draws = np.shape(noise.sample(jax.random.key(0), (3, 2)))
    if values.shape != (3, 2) or draws != (3, 2):
        return f"log_prob of [3, 2] has shape {values.shape}, sample((3, 2)) {draws}"
    alone = [[float(noise.log_prob(np.asarray(x))) for x in row] for row in w]
    return None if np.allclose(values, alone, equal_nan=True) else "log_prob of an array is not that of its elements"


def _normalised(noise: Noise) -> str | None:
    total = float(_grid(noise)[1].sum())
    return None if abs(total - 1) < INTEGRAL else f"the density integrates to {total:.4f}"


def _moments(noise: Noise) -> str | None:
    w, p, _ = _grid(noise)
    mean, variance = float(noise.mean), float(noise.variance)
    if not (np.isfinite(mean) and np.isfinite(variance)):
        return None
    found = float((w * p).sum() / p.sum())
    if abs(found - mean) > INTEGRAL * np.sqrt(variance):
        return f"mean is {mean:.6g}, that of the density {found:.6g}"
    spread = float(((w - found) ** 2 * p).sum() / p.sum())
    if abs(spread - variance) > 4 * INTEGRAL * variance:
        return f"variance is {variance:.6g}, that of the density {spread:.6g}"
    return None


def _inside(noise: Noise) -> Any:
    """Draws at which the log-density is smooth enough for differences."""
    w = np.sort(np.asarray(noise.sample(jax.random.key(5), (200,))))
    return w[20:-20]


def _score(noise: Noise) -> str | None:
    w, step = _inside(noise), 1e-5 * _scale(noise)[1]
    log_p = [np.asarray(noise.log_prob(w + d)) for d in (step, -step)]
    expected, found = -(log_p[0] - log_p[1]) / (2 * step), np.asarray(noise.score(w))
    off = np.abs(found - expected) > DIFFERENCE * (np.abs(expected) + 1 / _scale(noise)[1])
    if off.mean() > 0.05:  # a kink may lie between two points
        k = int(np.argmax(off))
        return f"score({w[k]:.4g}) is {found[k]:.4g}, minus the derivative of log_prob {expected[k]:.4g}"
    return None


def _information(noise: Noise) -> str | None:
    value = float(noise.information()) if noise.regularity().finite else None
    if value is None:
        try:
            value = float(noise.information())
        except (ValueError, ArithmeticError):
            return None
        return (
            f"regularity says that it does not exist, information() returns {value:.4g}" if np.isfinite(value) else None
        )
    w, p, log_p = _grid(noise)
    there = np.isfinite(log_p) & (log_p > -600)
    found = float((np.asarray(noise.score(w[there])) ** 2 * p[there]).sum())
    if abs(value - found) > 2 * INTEGRAL * found:
        return f"information is {value:.6g}, the mean square of the score {found:.6g}"
    variance = float(noise.variance)
    if np.isfinite(variance) and value * variance < 1 - INTEGRAL:
        return f"information {value:.4g} is below one over the variance, {1 / variance:.4g}"
    return None


def _sampler(noise: Noise) -> str | None:
    draw = [np.asarray(noise.sample(jax.random.key(k), (DRAWS,))) for k in (3, 3, 4)]
    if not np.array_equal(draw[0], draw[1]):
        return "the same key gives other draws"
    if np.array_equal(draw[0], draw[2]):
        return "another key gives the same draws"
    w, p, _ = _grid(noise)
    cdf = np.interp(np.sort(draw[0]), w, np.cumsum(p) - 0.5 * p)
    distance = float(np.abs(cdf - (np.arange(DRAWS) + 0.5) / DRAWS).max() * np.sqrt(DRAWS))
    return None if distance < KS_LIMIT else f"draws do not follow the density: sqrt(n) x KS distance is {distance:.1f}"


def _components(noise: Noise) -> str | None:
    weights, means, variances = (np.asarray(x, dtype=float) for x in noise.components())
    if not weights.shape == means.shape == variances.shape or weights.ndim != 1:
        return f"shapes are {weights.shape}, {means.shape}, {variances.shape}, not [c] three times"
    if np.any(weights < 0) or abs(weights.sum() - 1) > 1e-6 or np.any(~(variances > 0)):
        return f"weights {weights} and variances {variances} are not those of a mixture"
    mean, variance = float(noise.mean), float(noise.variance)
    if not (np.isfinite(mean) and np.isfinite(variance)):
        return None
    own = float(weights @ means)
    spread = float(weights @ (variances + (means - own) ** 2))
    if abs(own - mean) > 0.05 * np.sqrt(variance) or abs(spread / variance - 1) > 0.1:
        return f"their mean and variance are {own:.4g} and {spread:.4g}, the noise's {mean:.4g} and {variance:.4g}"
    return None


CHECKS = {
    "elementwise": _elementwise,
    "normalised": _normalised,
    "moments": _moments,
    "score": _score,
    "information": _information,
    "sampler": _sampler,
    "components": _components,
}
