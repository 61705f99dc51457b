"""Nearest neighbours in the space of fingerprints, on samples that the survey has not seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.survey.fingerprints import Fingerprints
from locbounds.survey.model import SurveyModel

NEIGHBOURS = 4
WEIGHTS = {"knn": "uniform", "wknn": "distance"}

Estimator = Callable[[SurveyModel, Float[ndarray, "samples columns"]], Float[ndarray, "samples space"]]


class Errors(NamedTuple):
    """Squared errors of an estimator on held-out samples.

    Attributes
    ----------
    position_m : array [samples, space]
        Where they were taken.
    square_m2 : array [samples]
    group : int array [samples]
        Samples of one point (or walk) share their error: the unit of the standard error.
    """

    position_m: Float[ndarray, "samples space"]
    square_m2: Float[ndarray, " samples"]
    group: ndarray

    @property
    def rmse_m(self) -> float:
        """Root mean square error, m."""
        return float(np.sqrt(self.square_m2.mean()))

    @property
    def stderr_m(self) -> float:
        """Standard error of :attr:`rmse_m` from the spread over groups; NaN for a single group."""
        _, group = np.unique(self.group, return_inverse=True)
        count = np.bincount(group)
        if len(count) < 2:
            return float("nan")
        excess = np.bincount(group, self.square_m2 - self.square_m2.mean())
        variance = len(count) / (len(count) - 1) * np.sum(excess**2) / len(self.square_m2) ** 2
        return float(np.sqrt(variance)) / (2 * self.rmse_m) if self.rmse_m > 0 else 0.0


def nearest_neighbours(id: str, *, neighbours: int = NEIGHBOURS) -> Estimator:
    """k-NN or weighted k-NN, from scikit-learn.

    Parameters
    ----------
    id
        ``"knn"``: the mean position of the k most similar points; ``"wknn"``: weighted by one over the distance.
    neighbours
        k; fewer where the survey has fewer points.

    Returns
    -------
    callable
        (model, samples [samples, columns] with NaN where nothing was heard) -> positions [samples, space]. Columns
        are divided by the root mean square noise of their unit, so that dB and metres can be compared.

    Examples
    --------
    >>> from locbounds.survey import survey_model
    >>> x = np.arange(5.0)[:, None]
    >>> model = survey_model(Fingerprints.at(x, -50 - 3 * np.hstack([x, -x])), noise_db=1.0)
    >>> nearest_neighbours("knn", neighbours=2)(model, np.array([[-54.5, -45.5]])).tolist()
    [[1.5]]
    """
    if id not in WEIGHTS:
        raise InputError(f'unknown estimator "{id}"', f"Known: {', '.join(WEIGHTS)}")
    if neighbours < 1:
        raise InputError(f"{neighbours} neighbours", "Give at least 1")

    def estimate(model: SurveyModel, value: Float[ndarray, "samples columns"]) -> Float[ndarray, "samples space"]:
        from sklearn.neighbors import KNeighborsRegressor

        unit = _unit(model)
        regression = KNeighborsRegressor(min(neighbours, model.points), weights=WEIGHTS[id])
        regression.fit(model.mean / unit, model.position_m)
        return np.asarray(regression.predict(model.as_read(value) / unit), float)

    return estimate


def _unit(model: SurveyModel) -> Float[ndarray, " columns"]:
    units = np.array(model.units)
    deviation = model.noise.deviation
    return np.array([np.sqrt(np.mean(deviation[units == u] ** 2)) for u in units])


def simulated(
    estimate: Estimator, model: SurveyModel, *, draws: int, seed: int = 0, scale: float = 1.0
) -> tuple[float, float]:
    """Root mean square error on fingerprints drawn from the model, at its points; and its standard error, m.

    Parameters
    ----------
    estimate
        (model, samples) -> positions.
    model, scale
        The survey, and the noise level relative to it.
    draws
        About so many, equally many at each point (or one at some of them).
    seed
        Of the draws.
    """
    rng = np.random.default_rng([seed, 0xF1])
    n = model.points
    point = np.repeat(np.arange(n), max(2, round(draws / n))) if draws >= 2 * n else rng.choice(n, draws, replace=False)
    z = rng.standard_normal((len(point), len(model.names)))
    if model.noise.correlation is not None:
        z = z @ np.linalg.cholesky(model.noise.correlation).T
    value = model.mean[point] + scale * model.noise.deviation * z
    if model.silence == "censored":
        value = np.where(value > model.level, value, np.nan)
    square = np.sum(np.square(estimate(model, value) - model.position_m[point]), axis=1)
    if draws >= 2 * n:
        within = square.reshape(n, -1)
        stderr = np.sqrt(np.sum(within.var(axis=1, ddof=1) / within.shape[1])) / n
    else:
        stderr = square.std(ddof=1) / np.sqrt(len(square))
    rmse = float(np.sqrt(square.mean()))
    return rmse, float(stderr / (2 * rmse)) if rmse > 0 else 0.0


def held_out_errors(estimate: Estimator, model: SurveyModel, test: Fingerprints) -> Errors:
    """Errors of an estimator that knows the survey, on other samples.

    Parameters
    ----------
    estimate
        (model, samples) -> positions.
    model
        The survey.
    test
        Samples with their true positions; columns are matched by name.

    Raises
    ------
    InputError
        If the test samples lack all columns of the survey.
    """
    value = aligned(model, test)
    where = test.position_m[test.point]
    square = np.sum(np.square(estimate(model, value) - where), axis=1)
    walks = np.array(test.group)
    group = np.unique(walks, return_inverse=True)[1] if len(set(test.group)) > 1 else test.point
    return Errors(where, square, group)


def aligned(model: SurveyModel, test: Fingerprints) -> Float[ndarray, "samples columns"]:
    """The columns of the survey, from test samples that may have others."""
    at = {name: k for k, name in enumerate(test.names)}
    if not any(name in at for name in model.names):
        raise InputError("the test samples hear none of the survey's access points", "Compare the column names")
    return np.stack(
        [test.value[:, at[name]] if name in at else np.full(test.samples, np.nan) for name in model.names], axis=1
    )
