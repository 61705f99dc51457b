"""The least mean square error of the discretised problem, by Monte Carlo with its standard error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.blocks import check_seed
from locbounds.errors import InputError
from locbounds.survey.model import SurveyModel

PAIRS = 3000  # points up to which all pairs are drawn from
BLOCK = 2**22  # numbers in one table of posterior probabilities
DRAWS = 20_000


class DiscreteMmse(NamedTuple):
    """Least mean square error over the points of a survey.

    Attributes
    ----------
    mse_m2, stderr_m2 : float
        Of the position, m^2.
    axes_m2, axes_stderr_m2 : arrays [space]
        Per axis.
    at_m2 : array [points]
        Mean square error at each point (NaN where none was drawn).
    draws : int
    how : str
        ``"points"`` or ``"pairs"``: from where the draws of ``mse_m2`` are.
    """

    mse_m2: float
    stderr_m2: float
    axes_m2: Float[ndarray, " space"]
    axes_stderr_m2: Float[ndarray, " space"]
    at_m2: Float[ndarray, " points"]
    draws: int
    how: str

    @property
    def rmse_m(self) -> float:
        """Root of the mean square error, m."""
        return float(np.sqrt(self.mse_m2))

    @property
    def rmse_stderr_m(self) -> float:
        """Standard error of :attr:`rmse_m`, m."""
        return self.stderr_m2 / (2 * self.rmse_m) if self.mse_m2 > 0 else 0.0


def discrete_mmse(
    model: SurveyModel, *, draws: int = DRAWS, seed: int = 0, scale: float | int = 1.0, most_points: int | None = None
) -> DiscreteMmse:
    """Draw fingerprints from the model and average the posterior variance of the position.

    Parameters
    ----------
    model
        Points, mean fingerprints and noise; with ``silence="censored"`` what falls below the level is not heard, and
        the posterior knows that.
    draws
        About so many: equally many (at least two) at every point, which removes the variance between points.
    seed
        Of all draws.
    scale
        Noise level relative to the model's.
    most_points
        Draw at so many points only, chosen at random; by default at all if there are no more than ``draws / 2``.

    Returns
    -------
    DiscreteMmse
        The posterior variance, not the squared error, is averaged: the same mean with less noise.

    Notes
    -----
    Two estimates are made, and the one with the smaller relative standard error is returned. Draws at the points see
    confusions as often as they happen: too seldom at low noise. Draws between two points, a pair chosen by how much
    its confusion would cost, see nothing else: with f_i the density of the fingerprint at point i::

        E[error^2] = sum over i < j of |theta_i - theta_j|^2 / N * int f_i f_j / (sum over k of f_k) dz

    and sqrt(f_i f_j) is exp(-d_ij^2 / 8) times a normal law around the middle of the two fingerprints, so that what is
    left to average, sqrt(f_i f_j) / sum f_k, is at most one half. (Up to 3,000 points, without censoring.)

    The posterior mean is the best estimator, so that this number, not the bound, is what can be reached on the survey
    points. It costs draws * points * columns; the bound has no random error and certificates.

    Examples
    --------
    >>> from locbounds.survey import Fingerprints, survey_model
    >>> heard = np.array([[-40.0, -70.0], [-40.0, -70.0], [-70.0, -40.0]])
    >>> survey = Fingerprints.at(np.array([[0.0, 0], [3, 0], [50, 0]]), heard)
    >>> least = discrete_mmse(survey_model(survey, noise_db=2.0), draws=300)
    >>> round(least.mse_m2, 3), round(least.stderr_m2, 3)
    (1.5, 0.0)
    """
    if draws < 4:
        raise InputError(f"{draws} draws", "Give at least 4")
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"the noise scale is {scale:g}", "Give a positive number")
    rng = np.random.default_rng([check_seed(seed), 0x5BE7])
    n = model.points
    most = min(n, most_points or max(draws // 2, 2))
    chosen = np.arange(n) if most == n else np.sort(rng.choice(n, most, replace=False))
    each = max(2, round(draws / most))
    scaled = model.at_noise(scale)
    posterior = _censored(scaled) if model.silence == "censored" else _gaussian(scaled)
    place = model.position_m - model.position_m.mean(axis=0)
    variance, error = np.empty((2, most, each, place.shape[1]))
    step = max(1, BLOCK // (n * each))
    for start in range(0, most, step):
        part = chosen[start : start + step]
        weight = posterior(part, each, rng)
        mean = weight @ place
        variance[start : start + step] = weight @ np.square(place) - np.square(mean)
        error[start : start + step] = np.square(mean - place[part, None])
    at = np.full(n, np.nan)
    at[chosen] = error.sum(axis=-1).mean(axis=1)
    everything = np.concatenate([variance.sum(axis=-1, keepdims=True), variance], axis=-1)
    mean, stderr = (
        everything.mean(axis=(0, 1)),
        np.array([_stderr(v, most == n) for v in np.moveaxis(everything, -1, 0)]),
    )
    how = "points"
    if n <= PAIRS and model.silence != "censored":
        other = _between_points(scaled.whitened, place, draws, rng)
        if other[1][0] * mean[0] <= stderr[0] * other[0][0]:
            (mean, stderr), how = other, "pairs"
    return DiscreteMmse(
        float(mean[0]), float(stderr[0]), mean[1:], stderr[1:], at, most * each if how == "points" else draws, how
    )


def _between_points(x: ndarray, place: ndarray, draws: int, rng: np.random.Generator) -> tuple[ndarray, ndarray]:
    """Mean square error (in all, then per axis) and its standard error, from draws between pairs of points."""
    n = len(x)
    i, j = np.triu_indices(n, 1)
    square = np.sum(x**2, axis=1)
    d2 = np.maximum(square[i] + square[j] - 2 * (x @ x.T)[i, j], 0.0)
    apart2 = np.sum(np.square(place[:, None] - place), axis=-1)[i, j]
    cost = apart2 * np.exp(-(d2 - d2.min()) / 8)
    scale = cost.sum() / n * np.exp(-d2.min() / 8)
    if not scale > 0:
        return np.zeros(place.shape[1] + 1), np.zeros(place.shape[1] + 1)
    pair = np.searchsorted(np.cumsum(cost) / cost.sum(), (np.arange(draws) + rng.random(draws)) / draws)
    i, j = i[np.minimum(pair, len(i) - 1)], j[np.minimum(pair, len(j) - 1)]
    share = np.square(place[i] - place[j])
    share = np.concatenate([np.ones((draws, 1)), share / share.sum(axis=1, keepdims=True)], axis=1)
    ratio = np.empty(draws)
    step = max(1, BLOCK // n)
    for start in range(0, draws, step):
        a, b = i[start : start + step], j[start : start + step]
        z = (x[a] + x[b]) / 2 + rng.standard_normal((len(a), x.shape[1]))
        log = z @ x.T - square / 2
        at = np.arange(len(a))
        top = log.max(axis=1)
        ratio[start : start + step] = np.exp((log[at, a] + log[at, b]) / 2 - top) / np.exp(log - top[:, None]).sum(
            axis=1
        )
    value = share * ratio[:, None] * scale
    return value.mean(axis=0), value.std(axis=0, ddof=1) / np.sqrt(draws)


def _stderr(value: ndarray, every_point: bool) -> float:
    """Standard error of the mean of [points, draws]: within points, and between them where not all were drawn."""
    points, each = value.shape
    if every_point:
        return float(np.sqrt(np.sum(value.var(axis=1, ddof=1) / each)) / points)
    return float(value.mean(axis=1).std(ddof=1) / np.sqrt(points))


def _softmax(log: ndarray) -> ndarray:
    log -= log.max(axis=-1, keepdims=True)
    np.exp(log, out=log)
    log /= log.sum(axis=-1, keepdims=True)
    return log


def _gaussian(model: SurveyModel):
    x = model.whitened
    half = np.sum(x**2, axis=1) / 2

    def posterior(points: ndarray, each: int, rng: np.random.Generator) -> ndarray:
        z = x[points, None] + rng.standard_normal((len(points), each, x.shape[1]))
        return _softmax(z @ x.T - half)

    return posterior


def _censored(model: SurveyModel):
    from scipy.special import log_ndtr

    deviation = model.noise.deviation
    x = model.mean / deviation
    level = model.level / deviation
    silent = log_ndtr(level - x)
    half = x**2 / 2

    def posterior(points: ndarray, each: int, rng: np.random.Generator) -> ndarray:
        z = x[points, None] + rng.standard_normal((len(points), each, x.shape[1]))
        heard = z > level
        return _softmax(np.where(heard, z, 0.0) @ x.T - heard @ half.T + ~heard @ silent.T)

    return posterior
