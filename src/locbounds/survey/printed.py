"""The survey-set formula of the chapter by McGuire and Plataniotis, as printed: not a bound."""

from __future__ import annotations

import numpy as np

from locbounds.errors import InputError
from locbounds.survey.assignment import confusion
from locbounds.survey.model import SurveyModel

ROWS = 256


def printed_mse(model: SurveyModel, *, scale: float | int = 1.0, squared: bool = False, every: int = 1) -> float:
    """Equation (31) of the chapter, m^2.

    Parameters
    ----------
    model
        The survey.
    scale
        Noise level relative to the model's.
    squared
        Take sigma^2 where (32) prints it. The probability of error has sigma there; the two agree at 1 dB.

    every
        Of the average over the points, take every so many points only.

    Notes
    -----
    **Not a lower bound**: the maximum is taken for every point by itself, so that one point may serve all others as the
    alternative, and errors of at least h/2 are charged with alternatives h/2 away, which an estimator between the two
    avoids. With two points it is the error of choosing the more likely one, which is above the least mean square error.

    The integral is a finite sum: per point, over the distances to all others.

    Examples
    --------
    Two indistinguishable points 2 m apart: the formula says 2 m^2, the middle of the two has an error of 1 m^2.

    >>> from locbounds.survey import Fingerprints, survey_model
    >>> heard = np.array([[-40.0, -70.0], [-40.0, -70.0], [-70.0, -40.0]])
    >>> survey = Fingerprints.at(np.array([[0.0, 0], [2, 0], [50, 0]]), heard)
    >>> round(printed_mse(survey_model(survey, noise_db=1.0)) * 3 / 2, 6)
    2.0
    """
    x, place = model.whitened, model.position_m
    if squared:
        if model.noise.correlation is not None or np.ptp(model.noise.deviation) > 0:
            raise InputError("(32) is printed for one noise level", "Use the noise shape common")
        scale = scale**2 * float(model.noise.deviation[0])
    total, chosen = 0.0, np.arange(0, model.points, every)
    for start in range(0, len(chosen), ROWS):
        rows = chosen[start : start + ROWS]
        d = np.sum(x[rows] ** 2, axis=1)[:, None] + np.sum(x**2, axis=1) - 2 * x[rows] @ x.T
        p = confusion(np.sqrt(np.maximum(d, 0.0)) / scale)
        apart = np.sqrt(np.sum(np.square(place[rows, None] - place), axis=-1))
        order = np.argsort(apart, axis=1)
        e = np.take_along_axis(apart, order, axis=1)
        reached = np.take_along_axis(p, order, axis=1)
        reached = np.maximum.accumulate(reached[:, ::-1], axis=1)[:, ::-1]  # the largest P at this distance or beyond
        total += float(np.sum(reached[:, 1:] * np.diff(np.square(e), axis=1)))
    return total / len(chosen)
