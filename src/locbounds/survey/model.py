"""A survey as a model: points, mean fingerprints, noise, and what silence means."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from locbounds.axes import Bool, Float, ndarray
from locbounds.errors import InputError
from locbounds.survey.fingerprints import RANGE, RSS, Fingerprints
from locbounds.survey.noise import Noise, estimate_noise

SILENCE = ("level", "censored")
SOME = 300  # points whose nearest fingerprints are looked at


@dataclass(frozen=True)
class SurveyModel:
    """N points, equally likely; at point i the measurement is ``mean[i]`` plus Gaussian noise.

    Attributes
    ----------
    names, units : tuple of str
        Columns, and ``"dB"`` or ``"m"``.
    position_m : array [points, space]
    mean : array [points, columns]
        dBm or m.
    noise : Noise
        The same everywhere.
    silence : str
        ``"level"``: an access point that is not heard reads as the weakest value of the survey, noise included.
        ``"censored"``: what falls below that level is not heard; the receiver tells no more than that.
    level : array [columns]
        The weakest value of each column that can be heard; -inf for ranges.
    samples : int
        Number of samples behind the means.
    filled : bool array [points, columns]
        Means that were never measured.
    notes : tuple of str

    Examples
    --------
    >>> heard = np.array([[-40.0, -60], [-43, -52], [-50, np.nan]])
    >>> survey = Fingerprints.at(np.array([[0.0, 0], [3, 0], [6, 0]]), heard)
    >>> model = survey_model(survey, noise_db=2.0)
    >>> model.mean.tolist(), model.whitened.shape
    ([[-40.0, -60.0], [-43.0, -52.0], [-50.0, -60.0]], (3, 2))
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    position_m: Float[ndarray, "points space"]
    mean: Float[ndarray, "points columns"]
    noise: Noise
    silence: str
    level: Float[ndarray, " columns"]
    samples: int
    filled: Bool[ndarray, "points columns"]
    notes: tuple[str, ...] = ()

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self.position_m)

    @property
    def whitened(self) -> Float[ndarray, "points columns"]:
        """Mean fingerprints in units of the noise; their distances decide every test between two points."""
        return self.noise.whitened(self.mean - self.mean.mean(axis=0))

    @property
    def noise_db(self) -> float:
        """Root mean square deviation of the RSS noise, dB; NaN without RSS."""
        return self.noise.level_db(self.units)

    def at_noise(self, factor: float | int) -> SurveyModel:
        """The same survey with all noise deviations multiplied."""
        return replace(self, noise=self.noise.scaled(factor))

    def columns(self, keep: ndarray) -> SurveyModel:
        """Only these columns."""
        index = np.arange(len(self.names))[keep]
        return replace(
            self,
            names=tuple(self.names[k] for k in index),
            units=tuple(self.units[k] for k in index),
            mean=self.mean[:, index],
            noise=self.noise.columns(index),
            level=self.level[index],
            filled=self.filled[:, index],
        )

    def dangers(self) -> tuple[str, ...]:
        """What is legal but dangerous, one sentence each."""
        some = self.whitened[:: -(-self.points // SOME)]
        square = np.sum(some**2, axis=1)[:, None] + np.sum(self.whitened**2, axis=1) - 2 * some @ self.whitened.T
        nearest = np.partition(square, 1, axis=1)[:, 1]
        own = 2 * float(np.mean(np.sum(~self.filled, axis=1))) * self.points / self.samples
        if np.median(nearest) > 2 * own:
            return ()
        return (
            "the most similar fingerprints differ hardly more than the noise of the survey's own averages "
            f"({self.samples / self.points:.1f} samples a point) makes them differ: the bound is lower than it would "
            "be for exact averages (take more samples a point, or merge points)",
        )

    def as_read(self, value: Float[ndarray, "n columns"]) -> Float[ndarray, "n columns"]:
        """Samples with something in every cell: the level where nothing was heard, the mean for a missing range."""
        fill = np.where(np.isfinite(self.level), self.level, self.mean.mean(axis=0))
        return np.where(np.isfinite(value), value, fill)


def survey_model(
    survey: Fingerprints,
    *,
    noise_db: float | int | str = "auto",
    shape: str = "each",
    silence: str = "level",
    twins: bool = False,
) -> SurveyModel:
    """The model of a survey.

    Parameters
    ----------
    survey
        Samples at points.
    noise_db
        Deviation of the RSS noise, dB, or ``"auto"``: from repeated samples. Ranges always take theirs from repeats.
    shape
        ``"common"``, ``"each"`` or ``"full"``; see :func:`locbounds.survey.estimate_noise`.
    silence
        ``"level"`` or ``"censored"``; see :class:`SurveyModel`.
    twins
        Keep addresses that belong to one access point; by default they are merged.

    Returns
    -------
    SurveyModel
        The mean of a point averages its samples; one that did not hear an RSS column counts with the column's level. A
        range that was never measured at a point is taken from the nearest point that has it.

    Raises
    ------
    InputError
        Too few points, nothing heard, no repeats for ``"auto"``, unknown options.

    Examples
    --------
    >>> heard = np.array([[-40.0, -60], [-42, -61], [-50, -55], [-53, np.nan]])
    >>> survey = Fingerprints.at(np.array([[0.0, 0], [0, 0], [3, 0], [3, 0]]), heard)
    >>> model = survey_model(survey)
    >>> model.mean.tolist(), round(model.noise_db, 2), model.level.tolist()
    ([[-41.0, -60.5], [-51.5, -58.0]], 1.53, [-61.0, -61.0])
    """
    if silence not in SILENCE:
        raise InputError(f'silence is "{silence}"', f"Choose one of {', '.join(SILENCE)}")
    if isinstance(noise_db, str) and noise_db != "auto":
        raise InputError(f'the noise level is "{noise_db}"', "Give a positive number of dB, or auto")
    if silence == "censored" and shape == "full":
        raise InputError(
            "censored access points with correlated noise are not implemented",
            "Choose --silence level, or a noise without correlations (--noise-shape each)",
        )
    given = None if isinstance(noise_db, str) else float(noise_db)
    survey = survey.checked()
    if not twins:
        survey = survey.without_twins(_deviation_of_differences(survey, given))
    noise = estimate_noise(survey, shape=shape, given_db=given)
    level = _levels(survey)
    heard = survey.heard
    counted = heard | np.isfinite(level)
    value = np.where(heard, survey.value, np.where(np.isfinite(level), level, 0.0))
    total, count, ever = np.zeros((3, survey.points, len(survey.names)))
    np.add.at(total, survey.point, value)
    np.add.at(count, survey.point, counted)
    np.add.at(ever, survey.point, heard)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    notes = list(survey.notes)
    lacking = ~np.isfinite(mean)
    if lacking.any():
        mean = _from_the_nearest(survey.position_m, mean)
        notes.append(
            f"{int(lacking.sum())} ranges never measured at a point are taken from the nearest one that has it."
        )
    return SurveyModel(
        survey.names,
        survey.units,
        survey.position_m,
        mean,
        noise,
        silence,
        level,
        survey.samples,
        ever == 0,
        tuple(notes),
    )


def _levels(survey: Fingerprints) -> ndarray:
    """The weakest RSS of the survey for every RSS column: one receiver has one threshold; -inf for ranges."""
    rss = np.array([unit == RSS for unit in survey.units])
    weakest = np.nanmin(survey.value[:, rss]) if rss.any() else np.nan
    return np.where(rss, weakest, -np.inf)


def _deviation_of_differences(survey: Fingerprints, given: float | None) -> ndarray:
    """Deviations by which twins are told; zero where nothing is known (only equal differences are then twins)."""
    rss = np.array([unit == RSS for unit in survey.units])
    if given is not None:
        return np.where(rss, given, 0.0)
    return estimate_noise(survey, shape="common").deviation * rss


def _from_the_nearest(place: ndarray, mean: ndarray) -> ndarray:
    from scipy.spatial import KDTree

    filled = mean.copy()
    for k in np.flatnonzero(~np.isfinite(mean).all(axis=0)):
        has = np.isfinite(mean[:, k])
        _, nearest = KDTree(place[has]).query(place[~has])
        filled[~has, k] = mean[has, k][nearest]
    return filled


__all__ = ["RANGE", "RSS", "SILENCE", "SurveyModel", "survey_model"]
