"""Between the points: mean fingerprints by a Gaussian process. Estimates, not bounds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.survey.model import SurveyModel

MOST_POINTS = 1_000  # of a survey: the cost grows with the cube
MOST_DENSE = 3_000  # points of the dense grid
FIXED: dict[str, Any] = {"optimizer": None}  # the kernel stays as it is
FINER = 3  # spacing of the dense grid: this part of the median distance to the nearest survey point


class DenseSurvey(NamedTuple):
    """A survey interpolated to a dense grid.

    Attributes
    ----------
    model : SurveyModel
        Points of the grid with interpolated means, and the noise of the survey.
    variance : array [points]
        Of the interpolation and of what varies between neighbouring points beyond it, relative to each column's
        variance over the survey; the same for all columns.
    column_variance : array [columns]
        That variance, dB^2 or m^2.
    kernel : object
        That was fitted, of scikit-learn.
    """

    model: SurveyModel
    variance: Float[ndarray, " points"]
    column_variance: Float[ndarray, " columns"]
    kernel: Any

    def locate(self, value: Float[ndarray, "samples columns"]) -> Float[ndarray, "samples space"]:
        """Mean position given samples (NaN: not heard), over the dense grid; the map's own variance counts as noise."""
        model = self.model
        spread = model.noise.deviation**2 + self.variance[:, None] * self.column_variance
        z = model.as_read(value)
        half = z**2 @ (0.5 / spread).T - z @ (model.mean / spread).T + np.sum(0.5 * model.mean**2 / spread, axis=1)
        log = -half - 0.5 * np.sum(np.log(spread), axis=1)
        weight = np.exp(log - log.max(axis=1, keepdims=True))
        return weight @ model.position_m / weight.sum(axis=1, keepdims=True)


def interpolated(model: SurveyModel, *, like: DenseSurvey | None = None) -> DenseSurvey:
    """Mean fingerprints on a grid three times denser than the survey, by a Gaussian process per column.

    Parameters
    ----------
    model
        A survey of at most 1,000 points. Correlations of the noise are kept in the result's model.
    like
        Take the kernel of this one instead of fitting it, for example for parts of one survey.

    Returns
    -------
    DenseSurvey
        The grid covers what lies no farther from a survey point than these lie from each other.

    Raises
    ------
    InputError
        If the survey is too large or has too few points to fit a map.

    Notes
    -----
    All columns share one kernel (Matern 3/2 plus white noise), fitted by scikit-learn to the standardised columns
    together. The bound and the least error on the dense grid approximate those of a device that may stand between the
    points, as far as the map is right: an estimate, since the map is one.

    Examples
    --------
    >>> from locbounds.survey import Fingerprints, survey_model
    >>> x = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), -1).reshape(-1, 2)
    >>> heard = -40 - 3 * np.hypot(x[:, :1] - [0, 4], x[:, 1:] - [0, 3])
    >>> dense = interpolated(survey_model(Fingerprints.at(x, heard), noise_db=1.0))
    >>> dense.model.points > 5 * len(x), bool(dense.variance.max() < 0.5)
    (True, True)
    """
    from scipy.spatial import KDTree

    n = model.points
    if n > MOST_POINTS:
        raise InputError(f"a Gaussian process on {n:,} points", f"Merge points (--merge M) to at most {MOST_POINTS:,}")
    if n < 8:
        raise InputError(f"a map from {n} points", "Survey at least 8 points")
    place = model.position_m
    tree = KDTree(place)
    spacing = float(np.median(tree.query(place, k=2)[0][:, 1]))
    grid, step = _grid(place, tree, spacing)
    mean, deviation = model.mean.mean(axis=0), model.mean.std(axis=0)
    varies = deviation > 0
    standard = (model.mean[:, varies] - mean[varies]) / deviation[varies]
    process = _fit(place, standard, spacing, None if like is None else like.kernel)
    found, std = process.predict(grid, return_std=True)
    std = std.reshape(len(grid), -1)[:, 0]
    dense = np.broadcast_to(mean, (len(grid), len(mean))).copy()
    dense[:, varies] = mean[varies] + deviation[varies] * found.reshape(len(grid), -1)
    note = f"Interpolated to {len(grid):,} points, {step:.2g} m apart, by a Gaussian process."
    dense_model = replace(
        model,
        position_m=grid,
        mean=np.maximum(dense, np.where(np.isfinite(model.level), model.level, -np.inf)),
        filled=np.zeros(dense.shape, bool),
        notes=(*model.notes, note),
    )
    return DenseSurvey(dense_model, std**2, deviation**2, process.kernel_)


def _fit(place: ndarray, columns: ndarray, spacing: float, known: Any) -> Any:
    import warnings

    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    if known is not None:
        return GaussianProcessRegressor(known, **FIXED).fit(place, columns)
    reach = float(np.linalg.norm(np.ptp(place, axis=0)))
    kernel = ConstantKernel(1.0, (0.05, 20.0)) * Matern(3 * spacing, (0.3 * spacing, 3 * reach), nu=1.5)
    kernel = kernel + WhiteKernel(0.1, (1e-6, 2.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a parameter at its limit is an answer too
        return GaussianProcessRegressor(kernel).fit(place, columns)


def _grid(place: ndarray, tree, spacing: float) -> tuple[ndarray, float]:
    """Grid points near the survey; coarser, if they would be too many. Heights keep those of the survey."""
    step = spacing / FINER
    levels = np.unique(place[:, 2].round(1)) if place.shape[1] == 3 else None
    while True:
        sides = [np.arange(lo, hi + step / 2, step) for lo, hi in zip(place.min(0)[:2], place.max(0)[:2], strict=True)]
        if levels is not None:
            sides = [*sides, levels]
        if np.prod([len(side) for side in sides]) <= 50 * MOST_DENSE:
            grid = np.stack(np.meshgrid(*sides, indexing="ij"), -1).reshape(-1, place.shape[1])
            grid = grid[tree.query(grid)[0] <= spacing]
            if len(grid) <= MOST_DENSE:
                return grid, step
        step *= 1.2
