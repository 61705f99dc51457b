r"""Maximum likelihood of laws that begin at one place: exponential, log-normal and gamma.

With a known start the likelihood has one maximum. A start that is fitted, too, must lie below the smallest error, and
the likelihood is then not regular:

- *exponential*: it grows up to the smallest error, which therefore is the estimate;
- *log-normal, gamma with shape < 1*: it grows without limit at the smallest error, whatever the other errors are, and
  what is meant by its maximum is the highest one below that (Hill 1963);
- where no such maximum exists, the errors are either more one-sided than the family, or not skewed to the right:
  the likelihood then grows as the start goes to minus infinity, where both laws become Gaussian.

The profile (the maximum over the other parameters, for each start) is taken on a logarithmic grid of distances from
the smallest error, and refined by a bounded search between the neighbours of its highest interior maximum.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.special import digamma, gammaln

from locbounds.axes import ndarray
from locbounds.errors import InputError
from locbounds.noise import Exponential, Gamma, LogNormal, Noise

NEAREST, FARTHEST = 1e-6, 1e3  # of the start below the smallest error, in standard deviations of the errors
GRID = 91  # ten per decade
SHAPES = 1e-4, 1e10


class ContradictedError(InputError):
    """The errors exclude the family, or single out no law of it."""


def _exponential(t: ndarray, start: float) -> tuple[Noise, float]:
    scale = t.mean()
    return Exponential(scale, start), float(-np.log(scale) - 1)


def _log_normal(t: ndarray, start: float) -> tuple[Noise, float]:
    logs = np.log(t)
    mean, std = logs.mean(), logs.std()
    return LogNormal(np.exp(mean), std, start), float(-mean - np.log(std) - 0.5 * np.log(2 * np.pi) - 0.5)


def _gamma(t: ndarray, start: float) -> tuple[Noise, float]:
    """The shape k solves ``log k - digamma(k) = log(mean) - mean(log)``; the scale is mean/k."""
    mean, log = t.mean(), np.log(t).mean()
    gap = max(float(np.log(mean) - log), 1e-12)

    def equation(log_k: float) -> float:
        return log_k - float(digamma(np.exp(log_k))) - gap

    root: Any = brentq(equation, *np.log(SHAPES))
    k = float(np.exp(root))
    scale = mean / k
    return Gamma(k, scale, start), float((k - 1) * log - k - gammaln(k) - k * np.log(scale))


ONE_SIDED: dict[str, Callable[[ndarray, float], tuple[Noise, float]]] = {
    "exponential": _exponential,
    "log-normal": _log_normal,
    "gamma": _gamma,
}
"""From errors above the start, and the start, the law and the mean log-likelihood."""


def fit_one_sided(e: ndarray, family: str, start_m: float | None = None) -> tuple[Noise, int]:
    """Fit one of `ONE_SIDED`; see the module.

    Parameters
    ----------
    e : array
        Errors, m.
    family : str
        One of `ONE_SIDED`.
    start_m : float, optional
        Where the law begins, if that is known.

    Returns
    -------
    Noise, int
        The law and how many numbers were fitted.

    Raises
    ------
    ContradictedError
        Errors at or below a known start, or a profile without a maximum.

    Examples
    --------
    >>> e = 2.0 + np.random.default_rng(0).gamma(3.0, 1.0, 5000)
    >>> noise, parameters = fit_one_sided(e, "gamma")
    >>> round(float(noise.start), 1), parameters
    (2.0, 3)
    """
    law, others = ONE_SIDED[family], 1 if family == "exponential" else 2
    if start_m is not None:
        if e.min() <= start_m:
            raise ContradictedError(
                f"{np.mean(e <= start_m):.1%} of the errors are at or below {start_m:g} m",
                f"The {family} law has no density there: use a law with two sides, for example "
                "exponentially-modified-gaussian, an earlier start_m, or none (it is then fitted)",
            )
        return law(e - start_m, start_m)[0], others
    if family == "exponential":
        start = float(e.min())
        return law(e - start, start)[0], others + 1
    start = float(e.min() - np.exp(_best(e, law, family)))
    return law(e - start, start)[0], others + 1


def _best(e: ndarray, law: Callable[[ndarray, float], tuple[Noise, float]], family: str) -> float:
    """Logarithm of the distance of the start below the smallest error at the highest interior maximum."""
    lowest, above = float(e.min()), e - e.min()

    def profile(log_distance: float) -> float:
        distance = np.exp(log_distance)
        return law(above + distance, lowest - distance)[1]

    grid = np.log(np.std(e)) + np.linspace(np.log(NEAREST), np.log(FARTHEST), GRID)
    heights = np.array([profile(x) for x in grid])
    inside = 1 + np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:]))
    if not inside.size:
        grows = "to minus infinity, where it is Gaussian" if heights[-1] >= heights[0] else "to the smallest error"
        raise ContradictedError(
            f"no best start: the likelihood grows as it goes {grows}",
            f"Give start_m to the {family} law, or use another one",
        )
    k = int(inside[np.argmax(heights[inside])])
    if heights[-1] > heights[k]:
        raise ContradictedError(
            "no best start: the likelihood is highest as it goes to minus infinity, where the law is Gaussian",
            f"Give start_m to the {family} law, or use another one",
        )
    found: Any = minimize_scalar(lambda x: -profile(x), bounds=(grid[k - 1], grid[k + 1]), method="bounded")
    return float(found.x)
