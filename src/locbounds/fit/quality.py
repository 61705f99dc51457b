"""How well fitted noise describes a log: the distribution of every link, and what is left in time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import ndtr

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.fit import switching
from locbounds.fit.range_log import ErrorSequences, RangeLog
from locbounds.fit.sight_noise import SightNoiseFit
from locbounds.precision import double_precision

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAGS = (1, 2, 5, 10, 20, 50)
"""Default lags of the autocorrelation, in steps."""

PROBABILITIES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Probabilities at which measured and fitted quantiles are compared."""

WHITE = 0.05
"""Residual autocorrelation at lag 1 below which the errors count as explained."""


@dataclass(frozen=True)
class LinkQuality:
    """Errors of one link against its fitted law (its stationary mixture of LOS, NLOS and outliers).

    Attributes
    ----------
    name : str
    ranges : int
    mean_m, std_m : float
        Of the measured errors, m.
    fitted_mean_m, fitted_std_m : float
        Of the fitted law, m.
    quantiles_m, fitted_quantiles_m : tuple
        At `PROBABILITIES`, m.
    ks : float
        Kolmogorov-Smirnov distance: the largest difference of the two distribution functions.  (Not a test: correlated
        errors make its p-value meaningless.)
    nlos_share : float
        Mean posterior probability of NLOS over the link's ranges.
    """

    name: str
    ranges: int
    mean_m: float
    std_m: float
    fitted_mean_m: float
    fitted_std_m: float
    quantiles_m: tuple[float, ...]
    fitted_quantiles_m: tuple[float, ...]
    ks: float
    nlos_share: float


@dataclass(frozen=True)
class FitQuality:
    """Fit quality as numbers.

    Attributes
    ----------
    links : tuple of LinkQuality
    lags : tuple of int
        In steps.
    error_autocorrelation : tuple
        Of the errors, the mean of each link removed.
    model_autocorrelation : tuple
        What the fitted chain explains of it: changes of sight alone, at the log's median interval, links pooled.
    residual_autocorrelation : tuple
        Of the normal scores of the one-step prediction; all zero if the model were true.
    correlation_time : float
        1 + 2 x the sum of the residual autocorrelation up to its first value below `WHITE`, in steps: a number of
        successive ranges that tell about as much as one independent range.
    statement : str
        What that does to a bound, in one sentence.
    """

    links: tuple[LinkQuality, ...]
    lags: tuple[int, ...]
    error_autocorrelation: tuple[float, ...]
    model_autocorrelation: tuple[float, ...]
    residual_autocorrelation: tuple[float, ...]
    correlation_time: float
    statement: str


def _distribution(fit: SightNoiseFit, e: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """The fitted stationary distribution function."""
    total = np.zeros(len(e))
    for sight, share in enumerate((1 - fit.nlos_share, fit.nlos_share)):
        for w, m, s in zip(*fit.law(sight), strict=True):
            total += share * w * ndtr((e - m) / s)
    return total


def _density(fit: SightNoiseFit, sight: int, e: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """The part of one sight in the fitted stationary density, 1/m."""
    share = (1 - fit.nlos_share, fit.nlos_share)[sight]
    parts = (w * np.exp(-0.5 * ((e - m) / s) ** 2) / s for w, m, s in zip(*fit.law(sight), strict=True))
    return share * np.sum(list(parts), axis=0) / np.sqrt(2 * np.pi)


def _moments(fit: SightNoiseFit) -> tuple[float, float, float]:
    """Mean and variance of the stationary law, and the part of the variance that is between the sights."""
    shares = np.array([1 - fit.nlos_share, fit.nlos_share])
    laws = [fit.law(0), fit.law(1)]
    means = np.array([w @ m for w, m, _ in laws])
    seconds = np.array([w @ (m**2 + s**2) for w, m, s in laws])
    mean = float(shares @ means)
    return mean, float(shares @ seconds) - mean**2, float(shares @ (means - mean) ** 2)


def autocorrelation(x: Float[ndarray, "sequences steps"], lags: tuple[int, ...]) -> tuple[float, ...]:
    """Autocorrelation at lags in steps, pooled over sequences; pairs with a missing value (NaN) are left out.

    The products of the pairs over the geometric mean of the squares of their first and second members: never outside
    -1..1, however few pairs there are and whatever else the sequences hold. NaN without a pair.

    Examples
    --------
    >>> autocorrelation(np.array([[1.0, -1.0, 1.0, -1.0, np.nan]]), (1, 2))
    (-1.0, 1.0)
    """
    there = np.isfinite(x)
    found = []
    for lag in lags:
        pairs = there[:, lag:] & there[:, :-lag] if lag < x.shape[1] else np.zeros(1, bool)
        if not pairs.any():
            found.append(float("nan"))
            continue
        later, earlier = x[:, lag:][pairs], x[:, :-lag][pairs]
        size = np.sqrt((later**2).sum() * (earlier**2).sum())
        found.append(float(np.clip((later * earlier).sum() / size, -1, 1)) if size > 0 else float("nan"))
    return tuple(found)


@cache
def _kernel(stationary: bool, outliers: bool):
    return jax.jit(jax.vmap(partial(switching.smooth, stationary=stationary, outliers=outliers), (None, 0, 0, 0)))


class Smoothed(NamedTuple):
    """What a fit makes of every error of a log.

    Attributes
    ----------
    nlos : array [sequences, steps]
        Posterior probability of NLOS, given all errors (and labels) of the sequence.
    score : array [sequences, steps]
        Normal scores of the one-step prediction; white and standard normal if the fit were true; NaN where missing.
    """

    nlos: Float[ndarray, "sequences steps"]
    score: Float[ndarray, "sequences steps"]


@double_precision
def smooth_errors(fit: SightNoiseFit, errors: ErrorSequences) -> Smoothed:
    """Posterior of the sight and prediction residuals for the errors of a log."""
    posterior, score = _kernel(fit.stationary, fit.outliers)(jnp.asarray(fit.theta), *map(jnp.asarray, errors[:3]))
    return Smoothed(np.asarray(posterior)[..., 1], np.asarray(score))


def fit_quality(
    log: RangeLog, fits: SightNoiseFit | Mapping[str, SightNoiseFit], *, lags: tuple[int, ...] = LAGS
) -> FitQuality:
    """Compare a log with noise fitted to it (or to another log).

    Parameters
    ----------
    log : RangeLog
        With true positions.
    fits : SightNoiseFit or mapping of anchor name to SightNoiseFit
        One fit for all links, or one for each.
    lags : tuple of int
        Lags of the autocorrelation, in steps.

    Returns
    -------
    FitQuality
    """
    errors = log.errors()
    own = {name: fits[name] if isinstance(fits, Mapping) else fits for name in log.anchor_names}
    if not lags or min(lags) < 1:
        raise InputError(f"lags are {lags}", "Give whole numbers of steps from 1")
    centred = errors.error_m.copy()
    scores = np.full(centred.shape, np.nan)
    links, model = [], np.zeros(len(lags))
    tick = float(np.nanmedian(np.diff(errors.time_s, axis=1)))
    total = 0.0
    for m, (name, fit) in enumerate(own.items()):
        rows = errors.link == m
        part = ErrorSequences(*(a[rows] for a in errors))
        there = np.isfinite(part.error_m)
        e = np.sort(part.error_m[there])
        if not len(e):
            continue
        centred[rows] -= e.mean()
        smoothed = smooth_errors(fit, part)
        scores[rows] = smoothed.score
        f, n = _distribution(fit, e), len(e)
        mean, variance, between = _moments(fit)
        rate = 1 / fit.los_dwell_s + 1 / fit.nlos_dwell_s
        model += n * between / variance * np.exp(-rate * tick * np.array(lags))
        total += n
        grid = np.linspace(e[0] - 1, e[-1] + 1, 20001)
        links.append(
            LinkQuality(
                name=name,
                ranges=n,
                mean_m=float(e.mean()),
                std_m=float(e.std()),
                fitted_mean_m=mean,
                fitted_std_m=float(np.sqrt(variance)),
                quantiles_m=tuple(np.quantile(e, PROBABILITIES).tolist()),
                fitted_quantiles_m=tuple(np.interp(PROBABILITIES, _distribution(fit, grid), grid).tolist()),
                ks=float(max((np.arange(1, n + 1) / n - f).max(), (f - np.arange(n) / n).max())),
                nlos_share=float(smoothed.nlos[there].mean()),
            )
        )
    longest = min(200, errors.error_m.shape[1] - 1)
    measured = autocorrelation(scores, tuple(range(1, longest + 1)))
    curve = np.nan_to_num(measured)
    last = int(np.argmax(curve < WHITE)) if (curve < WHITE).any() else len(curve)
    time = float(1 + 2 * curve[:last].sum())
    return FitQuality(
        links=tuple(links),
        lags=tuple(lags),
        error_autocorrelation=autocorrelation(centred, lags),
        model_autocorrelation=tuple((model / total).tolist()),
        residual_autocorrelation=autocorrelation(scores, lags),
        correlation_time=time,
        statement=_statement(measured[0] if measured else float("nan"), time),
    )


def _statement(first: float, time: float) -> str:
    at = f"(autocorrelation {first:.2f} at one step"
    if not np.isfinite(first):
        return "Too few successive ranges of one link to say whether the errors left by the fit are white."
    if first < WHITE:
        return f"The errors left by the fit are nearly white {at}), as the bound assumes."
    digits = 0 if time >= 9.5 else 1
    return (
        f"The errors left by the fit are not white {at}; about {time:.{digits}f} successive ranges of a link tell as "
        "much as one independent range), while the bound takes every range as new information: it is optimistic, and "
        f"the accuracy possible with such ranges is worse, for a slow mobile by up to about {np.sqrt(time):.1f} times."
    )


def quality_figure(
    log: RangeLog, fits: SightNoiseFit | Mapping[str, SightNoiseFit], quality: FitQuality | None = None
) -> Figure:
    """Histogram of the errors with the fitted density, one panel per link, and the autocorrelations.

    Returns
    -------
    matplotlib.figure.Figure
        Not tied to any window; save it with ``savefig``.
    """
    from matplotlib.figure import Figure

    quality = quality or fit_quality(log, fits)
    errors = log.errors()
    columns = min(3, len(quality.links))
    rows = -(-len(quality.links) // columns)
    figure = Figure(figsize=(4 * columns, 2.6 * rows + 3), layout="constrained")
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=[1] * rows + [1.15])
    for i, link in enumerate(quality.links):
        axes = figure.add_subplot(grid[i // columns, i % columns])
        fit = fits[link.name] if isinstance(fits, Mapping) else fits
        e = errors.error_m[errors.link == log.anchor_names.index(link.name)]
        e = e[np.isfinite(e)]
        low, high = np.quantile(e, [0.001, 0.99])
        x = np.linspace(low, high, 400)
        share = np.mean((e >= low) & (e <= high))
        counts, edges = np.histogram(e, bins=80, range=(low, high), density=True)
        axes.stairs(counts * share, edges, fill=True, color="0.85", label="measured")
        for sight, (label, colour) in enumerate((("LOS", "tab:blue"), ("NLOS", "tab:orange"))):
            axes.plot(x, _density(fit, sight, x), color=colour, lw=1, label=f"fitted, {label} part")
        axes.plot(x, _density(fit, 0, x) + _density(fit, 1, x), color="black", lw=1.2, label="fitted")
        axes.set_title(f"{link.name}: {link.ranges} ranges, NLOS {link.nlos_share:.0%}, KS {link.ks:.3f}", fontsize=9)
        axes.set_xlabel("range error / m")
        if i == 0:
            axes.set_ylabel("density / (1/m)")
            axes.legend(fontsize=7)
    axes = figure.add_subplot(grid[rows, :])
    for label, values, marker in (
        ("errors", quality.error_autocorrelation, "o-"),
        ("explained by changes of sight", quality.model_autocorrelation, "s--"),
        ("left by the fit", quality.residual_autocorrelation, "^-"),
    ):
        axes.plot(quality.lags, values, marker, label=label)
    axes.axhline(0, color="0.6", lw=0.8)
    axes.set(xscale="log", xlabel="lag / steps", ylabel="autocorrelation")
    axes.set_xticks(quality.lags, [str(lag) for lag in quality.lags])
    axes.minorticks_off()
    axes.legend(fontsize=8)
    return figure
