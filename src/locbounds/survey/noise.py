"""The noise of fingerprints: its deviations and correlations, from repeated samples at the same point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.survey.fingerprints import RANGE, RSS, Fingerprints

SHAPES = ("common", "each", "full")
QUANTUM_DB = 1.0  # RSS comes in whole dB: a deviation below its rounding error cannot be told from zero


@dataclass(frozen=True)
class Noise:
    """Gaussian noise of a fingerprint, the same everywhere.

    Attributes
    ----------
    deviation : array [columns]
        dB or m.
    correlation : array [columns, columns] or None
        None: independent.
    source : str
        Where it comes from, in words.

    Examples
    --------
    >>> noise = Noise(np.array([2.0, 4.0]), None, "given")
    >>> noise.whitened(np.array([[2.0, 4.0]])).tolist(), noise.scaled(0.5).deviation.tolist()
    ([[1.0, 1.0]], [1.0, 2.0])
    """

    deviation: Float[ndarray, " columns"]
    correlation: Float[ndarray, "columns columns"] | None
    source: str

    def __post_init__(self):
        if not (np.isfinite(self.deviation).all() and (self.deviation > 0).all()):
            worst = float(np.min(self.deviation))
            raise InputError(f"a deviation of the noise is {worst:g}", "Give a positive noise level (--noise DB)")

    def scaled(self, factor: float | int) -> Noise:
        """The same noise, all deviations multiplied."""
        return replace(self, deviation=self.deviation * factor)

    def whitened(self, value: Float[ndarray, "*n columns"]) -> Float[ndarray, "*n columns"]:
        """Fingerprints in units in which the noise is independent with deviation one."""
        scaled = value / self.deviation
        if self.correlation is None:
            return scaled
        return np.linalg.solve(np.linalg.cholesky(self.correlation), scaled.T).T

    def columns(self, keep: ndarray) -> Noise:
        """Only these columns."""
        index = np.arange(len(self.deviation))[keep]
        correlation = None if self.correlation is None else self.correlation[np.ix_(index, index)]
        return replace(self, deviation=self.deviation[index], correlation=correlation)

    def level_db(self, units: tuple[str, ...]) -> float:
        """Root mean square deviation of the RSS columns, dB; NaN if there are none."""
        rss = self.deviation[[unit == RSS for unit in units]]
        return float(np.sqrt(np.mean(rss**2))) if len(rss) else float("nan")


def estimate_noise(survey: Fingerprints, *, shape: str = "each", given_db: float | None = None) -> Noise:
    """Noise from repeated samples: what varies between samples of the same point.

    Parameters
    ----------
    survey
        With several samples at some points, unless ``given_db`` says all that is asked.
    shape
        ``"common"``: one deviation per unit, pooled. ``"each"``: one per column; a column with few repeats is pulled
        towards the pooled one, by an empirical-Bayes weight. ``"full"``: also the correlations between columns of one
        sample, shrunk towards independence as far as their sampling errors ask.
    given_db
        Deviation of every RSS column, dB, instead of an estimate; ``shape`` then only tells correlations.

    Raises
    ------
    InputError
        If no point has two samples of anything.

    Notes
    -----
    Repeats of one visit share whatever changes slowly (people, doors, the holder's body): the deviation is that of a
    device that comes back at once, and too small for one that comes back another day.

    Shrinkage of the correlations: the weight that minimises the expected squared error of all off-diagonal entries
    together, sum of their sampling variances over the sum of their squares.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> where = np.repeat(np.arange(50.0), 4)[:, None]
    >>> heard = np.column_stack([where[:, 0] + 2 * rng.standard_normal(200), 3 * rng.standard_normal(200)])
    >>> estimate_noise(Fingerprints.at(where, heard)).deviation.round(1).tolist()
    [1.9, 3.0]
    """
    if shape not in SHAPES:
        raise InputError(f'the shape of the noise is "{shape}"', f"Choose one of {', '.join(SHAPES)}")
    if given_db is not None and not (np.isfinite(given_db) and given_db > 0):
        raise InputError(f"the noise level is {given_db:g} dB", "Give a positive number of dB, or auto")
    rss = np.array([unit == RSS for unit in survey.units])
    if given_db is not None and rss.all() and shape != "full":
        return Noise(np.full(len(rss), float(given_db)), None, "given")
    residual, freedom = _residuals(survey)
    squares = np.nansum(residual**2, axis=0)
    deviation = np.empty(len(rss))
    for unit in (RSS, RANGE):
        columns = np.array([u == unit for u in survey.units])
        if not columns.any():
            continue
        if given_db is not None and unit == RSS:
            deviation[columns] = given_db
            continue
        if freedom[columns].sum() < 1:
            raise InputError(
                "no point has two samples, so that repeats cannot tell the noise",
                "Give the noise level (--noise DB), or merge samples that are close together (--merge M)",
            )
        pooled = squares[columns].sum() / freedom[columns].sum()
        floor = QUANTUM_DB**2 / 12 if unit == RSS else 0.0
        pooled = max(pooled, floor)
        each = pooled if shape == "common" else _shrunk(squares[columns], freedom[columns], pooled, floor)
        deviation[columns] = np.sqrt(each)
    if (deviation <= 0).any():
        raise InputError("all repeated samples are equal: the noise would be zero", "Give the noise level (--noise DB)")
    source = f"{int(freedom.sum()):,} degrees of freedom of repeated samples" if given_db is None else "given"
    return Noise(deviation, _correlation(residual) if shape == "full" else None, source)


def _residuals(survey: Fingerprints) -> tuple[ndarray, ndarray]:
    """Deviations from the mean of what was heard at a point (NaN: not heard, or heard once), and degrees of freedom."""
    heard, value = survey.heard, np.where(survey.heard, survey.value, 0.0)
    count, total = np.zeros((2, survey.points, len(survey.names)))
    np.add.at(count, survey.point, heard)
    np.add.at(total, survey.point, value)
    mean = total / np.maximum(count, 1)
    several = heard & (count[survey.point] > 1)
    residual = np.where(several, value - mean[survey.point], np.nan)
    return residual, np.maximum(count - 1, 0).sum(axis=0)


def _shrunk(squares: ndarray, freedom: ndarray, pooled: float, floor: float) -> ndarray:
    """Variances per column, pulled towards the pooled one by the prior's degrees of freedom, found by moments.

    With variances spread around the pooled one with a squared coefficient of variation c, Var(s^2) / pooled^2 is
    c + (1 + c) 2 / freedom; the conjugate prior with that c has 4 + 2 / c degrees of freedom.
    """
    own = squares / np.maximum(freedom, 1)
    enough = freedom >= 4
    if enough.sum() < 2:
        return np.full(len(squares), pooled)
    weight = freedom[enough] / freedom[enough].sum()
    spread = float(np.sum(weight * (own[enough] / pooled - 1) ** 2))
    expected = float(np.sum(weight * 2 / freedom[enough]))
    c = max(spread - expected, 0.0) / (1 + expected)
    if c == 0:
        return np.full(len(squares), pooled)
    prior = 4 + 2 / c
    return np.maximum((freedom * own + prior * pooled) / (freedom + prior), floor)


def _correlation(residual: ndarray) -> ndarray | None:
    """Correlations of the columns in one sample, shrunk towards zero; missing values count as no evidence."""
    r = np.nan_to_num(residual)
    norm = np.sqrt(np.sum(r**2, axis=0))
    r = r / np.where(norm > 0, norm, 1.0)
    raw = r.T @ r
    products = (r**2).T @ (r**2) - raw**2 / np.maximum(len(r), 1)  # sampling variance of each raw entry
    off = ~np.eye(len(raw), dtype=bool)
    total = float(np.sum(raw[off] ** 2))
    shrink = min(1.0, float(np.sum(products[off])) / total) if total > 0 else 1.0
    if shrink == 1.0:
        return None
    correlation = (1 - shrink) * raw
    np.fill_diagonal(correlation, 1.0)
    return correlation
