"""Which access points matter: how much the bound rises without one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.errors import InputError
from locbounds.survey.assignment import Matching, confusion
from locbounds.survey.bound import SurveyBound, survey_bound
from locbounds.survey.model import SurveyModel
from locbounds.survey.noise import Noise

SMALL = 200  # points up to which every assignment is solved anew
LEVELS = 12  # of the grid of distances


class Importance(NamedTuple):
    """What removing one column does.

    Attributes
    ----------
    name, unit : str
    heard : float
        Share of the points at which it was heard.
    deviation : float
        Of its noise, dB or m.
    rmse_without_m : float
        The bound without it.
    rise_m : float
        Difference to the bound with all columns.
    exact : bool
        Assignments were solved anew; otherwise those of the full survey are kept, and the rise is at least this.
    """

    name: str
    unit: str
    heard: float
    deviation: float
    rmse_without_m: float
    rise_m: float
    exact: bool


def access_points(model: SurveyModel, bound: SurveyBound | None = None, *, scale: float = 1.0) -> list[Importance]:
    """The columns, ranked by how much the bound rises when one is removed.

    Parameters
    ----------
    model
        The survey.
    bound
        Of the survey, for more than 200 points: its matchings are kept (any feasible matching is valid, so that the
        value without the column is a bound too), and only their error probabilities are computed anew.
    scale
        Noise level relative to the model's.

    Returns
    -------
    list of Importance
        The most important first. Both values of a rise are computed in the same way, on the same grid of distances.

    Notes
    -----
    Without column k a squared distance of whitened fingerprints falls by ``(L d)_k^2 / L_kk``, with the difference d
    of the two fingerprints and the inverse covariance L; for independent noise by the column's own term.

    Examples
    --------
    >>> from locbounds.survey import Fingerprints, survey_model
    >>> x = np.arange(6.0)[:, None]
    >>> heard = np.hstack([-50 - 2 * x, -60 - 0.1 * x])
    >>> ranked = access_points(survey_model(Fingerprints.at(x, heard, names=("near", "far")), noise_db=2.0))
    >>> [r.name for r in ranked], ranked[0].rise_m > ranked[1].rise_m > 0
    (['near', 'far'], True)
    """
    if len(model.names) < 2:
        raise InputError("the survey has one column", "Two are needed to ask which one matters")
    again = model.points <= SMALL
    if again:
        full = survey_bound(model, levels=LEVELS, scale=scale).rmse_m
        without = [_solved_anew(model, k, scale) for k in range(len(model.names))]
    else:
        bound = bound or survey_bound(model, scale=scale)
        full, without = _with_kept_matchings(model, bound, scale)
    rows = [
        Importance(
            name,
            model.units[k],
            float(1 - model.filled[:, k].mean()),
            float(model.noise.deviation[k]) * scale,
            float(without[k]),
            float(without[k] - full),
            again,
        )
        for k, name in enumerate(model.names)
    ]
    return sorted(rows, key=lambda r: -r.rise_m)


def _solved_anew(model: SurveyModel, k: int, scale: float) -> float:
    keep = np.arange(len(model.names)) != k
    return survey_bound(model.columns(keep), levels=LEVELS, scale=scale).rmse_m


def _with_kept_matchings(model: SurveyModel, bound: SurveyBound, scale: float) -> tuple[float, list[float]]:
    total, totals = 0.0, np.zeros(len(model.names))
    for part in bound.axes.values():
        grid = np.array([m.distance_m for m in part.matchings])
        area = np.diff(np.square(np.concatenate([[0.0], grid]))) / 4
        values = np.array([_values(model, m, scale) for m in part.matchings]).reshape(len(grid), -1)
        values = np.maximum.accumulate(values[::-1], axis=0)[::-1]
        sums = area @ values if len(grid) else np.zeros(len(model.names) + 1)
        total += sums[0]
        totals += sums[1:]
    return float(np.sqrt(total)), np.sqrt(totals).tolist()


def _values(model: SurveyModel, matching: Matching, scale: float) -> np.ndarray:
    """A(h) of a matching with all columns, then without each."""
    difference = model.mean[matching.left] - model.mean[matching.right]
    square, fall = fall_without_each(model.noise, difference)
    left = np.maximum(np.column_stack([square, square[:, None] - fall]), 0.0)
    return 2 * confusion(np.sqrt(left) / scale).sum(axis=0) / model.points


def fall_without_each(noise: Noise, difference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared whitened distances of fingerprint differences, and by how much each falls without one column."""
    scaled = difference / noise.deviation
    if noise.correlation is None:
        return np.sum(scaled**2, axis=1), scaled**2
    inverse = np.linalg.inv(noise.correlation)
    product = scaled @ inverse
    return np.sum(scaled * product, axis=1), product**2 / np.diagonal(inverse)
