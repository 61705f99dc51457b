"""Which law range errors follow: maximum likelihood of every family, compared on errors that were held out.

The errors are taken as one law, whatever the order in time; standard errors of comparisons take the errors of one
group (a track, a place) as dependent. Likelihoods are those of densities in 1/m.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.noise import (
    Exponential,
    ExponentiallyModifiedGaussian,
    Gamma,
    Gaussian,
    GaussianMixture,
    Laplace,
    LogNormal,
    Noise,
    StudentT,
    TruncatedGaussian,
    Uniform,
)
from locbounds.precision import double_precision

FEWEST = 20
BOX = 12.0  # limits of the logarithms of scales, in units of the errors' own spread
DEGREES = (
    float(np.log(0.5)),
    float(np.log(200.0)),
)  # a Student t law with more degrees of freedom is Gaussian for all purposes


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


@dataclass(frozen=True)
class LawComparison:
    """One family in a comparison.

    Attributes
    ----------
    fit : LawFit or None
        None where the errors contradict the family.
    family : str
    held_out : float
        Mean log-likelihood of a held-out error; minus infinity where the law calls one of them impossible.
    behind, behind_stderr : float
        How far it lies behind the winner per held-out error, and the standard error of that over groups.
    impossible : int
        Held-out errors outside the law's support.
    ks : float
        Largest difference of the distribution functions of law and held-out errors.
    regularity : str
        Whether a Cramér-Rao bound exists with this law.
    note : str
    """

    family: str
    fit: LawFit | None
    held_out: float = -np.inf
    behind: float = np.inf
    behind_stderr: float = np.nan
    impossible: int = 0
    ks: float = np.nan
    regularity: str = ""
    note: str = ""
    per_error: ndarray = field(default_factory=lambda: np.empty(0), repr=False)


def _gaussian(e: ndarray, start: float) -> tuple[Noise, int]:
    return Gaussian(e.mean(), e.std()), 2


def _laplace(e: ndarray, start: float) -> tuple[Noise, int]:
    middle = np.median(e)
    return Laplace(middle, np.abs(e - middle).mean()), 2


def _uniform(e: ndarray, start: float) -> tuple[Noise, int]:
    return Uniform(e.min(), e.max()), 2


def _exponential(e: ndarray, start: float) -> tuple[Noise, int]:
    return Exponential((e - start).mean(), start), 1


def _log_normal(e: ndarray, start: float) -> tuple[Noise, int]:
    logs = np.log(e - start)
    return LogNormal(np.exp(logs.mean()), logs.std(), start), 2


def _student(x: Any) -> Noise:
    return StudentT(jnp.exp(x[2]), x[0], jnp.exp(x[1]))


def _modified(x: Any) -> Noise:
    return ExponentiallyModifiedGaussian(x[0], jnp.exp(x[1]), jnp.exp(x[2]))


def _mixture(x: Any) -> Noise:
    w = jax.nn.sigmoid(x[0])
    return GaussianMixture(jnp.stack([1 - w, w]), x[jnp.array([1, 2])], jnp.exp(x[jnp.array([3, 4])]))


def _gamma(x: Any) -> Noise:
    return Gamma(jnp.exp(x[0]), jnp.exp(x[1]), 0.0)


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
    if isinstance(n, Gamma):
        return Gamma(n.shape, scale * n.scale, middle)
    ends = middle + scale * n.low, middle + scale * n.high
    return TruncatedGaussian(middle + scale * n.center, scale * n.std, *ends)


CLOSED: dict[str, Callable[[ndarray, float], tuple[Noise, int]]] = {
    "gaussian": _gaussian,
    "laplace": _laplace,
    "uniform": _uniform,
    "exponential": _exponential,
    "log-normal": _log_normal,
}
SEARCHED: dict[str, Callable[[Any], Noise]] = {
    "student-t": _student,
    "exponentially-modified-gaussian": _modified,
    "gaussian-mixture": _mixture,
    "truncated-gaussian": _cut,
    "gamma": _gamma,
}
ONE_SIDED = ("exponential", "log-normal", "gamma")
LAWS = tuple(CLOSED | SEARCHED)


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
    if family == "gamma":
        return [np.array([np.log(u.mean() ** 2 / u.var()), np.log(u.var() / u.mean())])], [(-6.0, BOX), scale]
    ends = float(u.min()), float(u.max())
    start = np.array([u.mean(), np.log(u.std()), *ends])
    return [start], [(ends[0] - 20, ends[1] + 20), (-4.0, 5.0), (ends[0], ends[0]), (ends[1], ends[1])]


@double_precision
def fit_noise_law(error_m, family: str, *, start_m: float = 0.0) -> LawFit:
    """Fit one family of noises to range errors by maximum likelihood.

    Parameters
    ----------
    error_m : array
        Measured minus true ranges, m; NaN is left out.
    family : str
        One of `LAWS`.
    start_m : float
        Smallest value of the one-sided families, which is not fitted: the likelihood of a free one has no maximum.

    Returns
    -------
    LawFit

    Raises
    ------
    InputError
        An unknown family, fewer than `FEWEST` errors, errors all equal, or errors outside the family's support.

    Examples
    --------
    >>> e = np.random.default_rng(0).laplace(1.0, 2.0, 5000)
    >>> round(float(fit_noise_law(e, "laplace").noise.scale), 1)
    2.0
    """
    e = np.asarray(error_m, float).ravel()
    e = e[np.isfinite(e)]
    _check(e, family, start_m)
    if family in CLOSED:
        noise, parameters = CLOSED[family](e, start_m)
    else:
        middle = start_m if family == "gamma" else float(np.median(e))
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
    return LawFit(family, noise, parameters, float(log_densities(noise, e).sum()), len(e))


def _check(e: ndarray, family: str, start: float) -> None:
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
    if family in ONE_SIDED and e.min() <= start:
        share = np.mean(e <= start)
        raise InputError(
            f"{share:.1%} of the errors are at or below {start:g} m, where the {family} law has no density",
            "Use a law with two sides, for example exponentially-modified-gaussian, or an earlier start",
        )


@double_precision
def log_densities(noise: Noise, e: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Log-density of every error; minus infinity where the law has none."""
    return np.asarray(noise.log_prob(jnp.asarray(e)))


@double_precision
def compare_noise_laws(
    error_m,
    held_out_m,
    *,
    groups=None,
    families: Sequence[str] = LAWS,
    start_m: float = 0.0,
) -> list[LawComparison]:
    """Fit families to errors and compare them on others.

    Parameters
    ----------
    error_m, held_out_m : array
        Errors to fit to, and to compare on, m; NaN is left out.
    groups : array, optional
        The group (track, place) of every held-out error: errors within a group are taken as dependent.
    families : sequence of str
        Which of `LAWS`.
    start_m : float
        Smallest value of the one-sided families.

    Returns
    -------
    list of LawComparison
        The best one first, by held-out likelihood; those that the errors contradict last, with the reason.

    Raises
    ------
    InputError
        As `fit_noise_law`, except for contradicted families.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> rows = compare_noise_laws(rng.laplace(0, 1, 4000), rng.laplace(0, 1, 2000), families=("gaussian", "laplace"))
    >>> [row.family for row in rows]
    ['laplace', 'gaussian']
    """
    held = np.asarray(held_out_m, float).ravel()
    there = np.isfinite(held)
    group = np.arange(len(held)) if groups is None else np.unique(np.asarray(groups).ravel(), return_inverse=True)[1]
    held, group = held[there], group[there]
    if not len(held):
        raise InputError("no errors are held out", "Hold some tracks out, for example --hold-out 4")
    rows = [_compared(error_m, held, family, start_m) for family in families]
    rows.sort(key=lambda row: (row.fit is None, -row.held_out, row.impossible))
    best = rows[0].per_error
    return [_behind(row, best, group) for row in rows]


def _compared(error_m, held: ndarray, family: str, start: float) -> LawComparison:
    try:
        fit = fit_noise_law(error_m, family, start_m=start)
    except InputError as error:
        if "has no density" not in error.cause:
            raise
        return LawComparison(family, None, note=error.cause.partition(", where")[0])
    each = log_densities(fit.noise, held)
    impossible = int((each == -np.inf).sum())
    x = np.sort(held)
    F, n = np.asarray(fit.noise.cdf(jnp.asarray(x))), len(x)
    ks = float(max((np.arange(1, n + 1) / n - F).max(), (F - np.arange(n) / n).max()))
    note = f"{impossible} of the held-out errors outside its support" if impossible else ""
    status = fit.noise.regularity().status
    return LawComparison(
        family, fit, float(each.mean()), impossible=impossible, ks=ks, regularity=status, note=note, per_error=each
    )


def _behind(row: LawComparison, best: ndarray, group: ndarray) -> LawComparison:
    from dataclasses import replace

    if row.fit is None or row.impossible or not np.all(np.isfinite(best)):
        return row
    gap = best - row.per_error
    sums = np.bincount(group, weights=gap - gap.mean())
    k = len(sums)
    stderr = float(np.sqrt((sums**2).sum() * k / max(k - 1, 1)) / len(gap)) if k > 1 else float("nan")
    return replace(row, behind=float(gap.mean()), behind_stderr=stderr)
