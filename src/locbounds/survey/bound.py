"""The rigorous bound of a survey: a discrete Ziv-Zakai bound, one assignment problem per distance.

For a uniform prior on N points and any unit vector a (docs/theory/survey.md derives it),

    E[(a . error)^2] >= 1/2 int_0^inf h A(h) dh,
    A(h) = (1/N) max over partial injections pi of sum_i 2 P[i, pi(i)] [a . (theta_pi(i) - theta_i) >= h],

P[i, j] the least error probability between the points i and j; on the error's length the same with half the weight and
the distance of the points. A is nonincreasing and constant between distances that occur, so that its value at the
right end of an interval is a lower one on all of it.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.registry import method
from locbounds.survey.assignment import Matching
from locbounds.survey.candidates import SEGMENTS, Candidates, find_candidates
from locbounds.survey.model import SurveyModel
from locbounds.survey.solvers import AllPairs, SomePairs
from locbounds.verdict import Status, Verdict

ALL_PAIRS = 600  # up to so many points every pair takes part
AXES = ("x", "y", "z")
RTOL, LEVELS = 5e-3, 48  # of a small survey: distances at which an assignment is solved, at most
LARGE_RTOL, LARGE_LEVELS = 2e-2, 16  # of a large one


class Part(NamedTuple):
    """The bound along one axis, or on the error's length.

    Attributes
    ----------
    mse_m2 : float
        Lower bound on the mean square error: the larger of the next two.
    ziv_zakai_m2, pairs_m2 : float
        The integral over assignments; the bound of a helper who names two points (:mod:`locbounds.survey.pairs`).
    lost_to_grid_m2, lost_to_pairs_m2 : float
        By how much a finer grid of distances, and more pairs or better matchings, could raise ``mse_m2`` at most.
    matchings : tuple of Matching
        Certificates, by increasing distance.
    """

    ziv_zakai_m2: float
    pairs_m2: float
    lost_to_grid_m2: float
    lost_to_pairs_m2: float
    matchings: tuple[Matching, ...]

    @property
    def mse_m2(self) -> float:
        return max(self.ziv_zakai_m2, self.pairs_m2)


class SurveyBound(NamedTuple):
    """Bound on the mean square position error in a survey.

    Attributes
    ----------
    axes : dict
        Per axis, ``"x"``, ``"y"`` (and ``"z"``).
    length : Part
        On the error's length directly.
    verdict : Verdict
    noise_db : float
        Noise level, dB; NaN without RSS.
    """

    axes: dict[str, Part]
    length: Part
    verdict: Verdict
    noise_db: float

    @property
    def mse_m2(self) -> float:
        """The larger of the sum over the axes and the bound on the length, m^2."""
        return max(sum(part.mse_m2 for part in self.axes.values()), self.length.mse_m2)

    @property
    def rmse_m(self) -> float:
        """Root of :attr:`mse_m2`, m."""
        return float(np.sqrt(self.mse_m2))

    @property
    def _parts(self) -> tuple[Part, ...]:
        axes = tuple(self.axes.values())
        return axes if sum(part.mse_m2 for part in axes) >= self.length.mse_m2 else (self.length,)

    @property
    def lost_to_grid_m2(self) -> float:
        """By how much a finer grid of distances could raise :attr:`mse_m2`, at most."""
        return sum(part.lost_to_grid_m2 for part in self._parts)

    @property
    def lost_to_pairs_m2(self) -> float:
        """By how much more pairs or better matchings could raise :attr:`mse_m2`, at most."""
        return sum(part.lost_to_pairs_m2 for part in self._parts)

    def __str__(self) -> str:
        lost = np.sqrt(self.mse_m2 + self.lost_to_grid_m2 + self.lost_to_pairs_m2) - self.rmse_m
        return f"survey bound: position RMSE >= {self.rmse_m:.3f} m (at most {lost:.3f} m lost); {self.verdict}"


def survey_bound(
    model: SurveyModel,
    *,
    rtol: float | None = None,
    levels: int | None = None,
    candidates: dict[int, Candidates] | None = None,
    scale: float | int = 1.0,
) -> SurveyBound:
    """The rigorous bound on the mean square error of any estimator in a survey.

    Parameters
    ----------
    model
        Points, mean fingerprints and noise.
    rtol
        Distances are added until a finer grid could raise the mean square error by no more than this share; by
        default 0.005, and 0.02 for a large survey.
    levels
        Distances at most, per axis; by default 48, and 16 for a large survey.
    candidates
        Of :func:`survey_candidates`, if they are to be used for several noise levels; by default they are found here
        when the survey has more than 600 points (up to that, all pairs take part).
    scale
        Noise level relative to the model's.

    Returns
    -------
    SurveyBound
        Per axis and on the length, with a matching at every distance as its certificate.

    Raises
    ------
    RefusedError
        If the survey is no survey (fewer than two points).

    Notes
    -----
    Every estimator that sees one fingerprint drawn from the model, at a point drawn uniformly from the survey's, obeys
    it. It is a bound for the *discretised* problem: it goes to zero with the noise, while the error of a device
    between two points does not.

    With censored access points the bound is that for the uncensored values, which tell more.

    Examples
    --------
    Two points 3 m apart that cannot be told apart: any estimator is wrong by 1.5 m or more.

    >>> from locbounds.survey import Fingerprints, survey_model
    >>> heard = np.array([[-40.0, -70.0], [-40.0, -70.0], [-70.0, -40.0]])
    >>> survey = Fingerprints.at(np.array([[0.0, 0], [3, 0], [50, 0]]), heard)
    >>> bound = survey_bound(survey_model(survey, noise_db=2.0))
    >>> round(bound.axes["x"].mse_m2, 3), bound.verdict.status.value
    (1.5, 'valid under')
    """
    large = candidates is not None or model.points > ALL_PAIRS
    rtol = (LARGE_RTOL if large else RTOL) if rtol is None else rtol
    levels = (LARGE_LEVELS if large else LEVELS) if levels is None else levels
    if not (0 < rtol < 1):
        raise InputError(f"rtol is {rtol:g}", "Give a number between 0 and 1")
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"the noise scale is {scale:g}", "Give a positive number")
    scale = float(scale)
    verdict = method("survey").verdict(model)
    if verdict.status is Status.REFUSED:
        raise RefusedError("; ".join(verdict.reasons), "See locbounds explain survey")
    x, place = model.whitened, model.position_m
    if candidates is None and large:
        candidates = survey_candidates(model)
    moving = [k for k in range(place.shape[1]) if np.ptp(place[:, k]) > 0]

    def solver(axis: int | None) -> AllPairs | SomePairs:
        if candidates is None:
            return AllPairs(x / scale, place, axis)
        return SomePairs(x, place, candidates, axis, scale)

    nothing = Part(0.0, 0.0, 0.0, 0.0, ())
    axes = {
        AXES[k]: integrate(solver(k), float(np.ptp(place[:, k])), rtol=rtol, levels=levels) if k in moving else nothing
        for k in range(place.shape[1])
    }
    reach = float(np.linalg.norm(np.ptp(place, axis=0)))
    length = integrate(solver(None), reach, rtol=rtol, levels=levels)
    return SurveyBound(axes, length, verdict, model.noise_db * scale)


def survey_candidates(model: SurveyModel) -> dict[int, Candidates]:
    """Candidates along every axis of a large survey, for several calls of :func:`survey_bound`."""
    place = model.position_m
    if model.points < 2 * SEGMENTS:
        raise InputError(f"the survey has {model.points} points", "Leave candidates out: all pairs take part then")
    axes = [k for k in range(place.shape[1]) if np.ptp(place[:, k]) > 0]
    return {k: find_candidates(model.whitened, place, k) for k in axes}


def integrate(solver: AllPairs | SomePairs, reach_m: float, *, rtol: float = RTOL, levels: int = LEVELS) -> Part:
    """``1/2 int h A(h) dh`` from below, on a grid that is refined where it loses most.

    Parameters
    ----------
    solver
        Gives a matching at a distance.
    reach_m
        No pair is farther apart.
    rtol, levels
        Stop when refining could gain no more than this share, or after so many matchings.
    """
    distances = solver.distances
    smallest = float(distances[0]) if distances is not None else 1e-6 * reach_m
    top = float(distances[-1]) if distances is not None else reach_m
    first = solver.solve(smallest)
    solved = {smallest: first}
    if top > smallest:
        solved[top] = solver.solve(top)
    if distances is not None and len(distances) <= levels:
        solved = {h: solver.solve(h) for h in distances.tolist()}
    while len(solved) < levels and (distances is None or len(solved) < len(distances)):
        grid = sorted(solved)
        low = _nonincreasing([solved[h].value for h in grid])
        area = np.diff(np.square([0.0, *grid])) / 4
        total = float(np.sum(low * area))
        gain = np.maximum(low[:-1] - low[1:], 0.0) * area[1:]
        exact = np.array([_between(distances, a, b) == 0 for a, b in itertools.pairwise(grid)], bool)
        gain = np.where(exact, 0.0, gain) if len(gain) else gain
        if not len(gain) or gain.sum() <= rtol * total:
            break
        k = int(gain.argmax())
        h = _middle(distances, grid[k], grid[k + 1])
        solved[h] = solver.solve(h)
    grid = sorted(solved)
    low = _nonincreasing([solved[h].value for h in grid])
    up = np.minimum.accumulate([solved[h].upper for h in grid])
    area = np.diff(np.square([0.0, *grid])) / 4
    # On (a, b] A is at most its value just right of a: A(b) where no distance lies between, else A(a).
    exact = np.array([True, *(_between(distances, a, b) == 0 for a, b in itertools.pairwise(grid))])
    before = np.concatenate([low[:1], low[:-1]])
    grid_loss = float(np.sum(np.where(exact, 0.0, before - low) * area))
    most = float(np.sum(np.where(exact, up, np.concatenate([up[:1], up[:-1]])) * area))
    value = float(np.sum(low * area))
    pairs, most_pairs = solver.pairs()
    best = max(value, pairs)
    grid_loss = min(grid_loss, max(value + grid_loss - best, 0.0))
    pair_loss = max(most, most_pairs) - best - grid_loss
    return Part(value, pairs, grid_loss, max(pair_loss, 0.0), tuple(solved[h] for h in grid))


def _nonincreasing(values: list[float]) -> Float[ndarray, " n"]:
    """A(h) is at least every value found at a larger h."""
    return np.maximum.accumulate(np.array(values)[::-1])[::-1]


def _between(distances: ndarray | None, a: float, b: float) -> int:
    if distances is None:
        return 1
    return int(np.searchsorted(distances, b) - np.searchsorted(distances, a, side="right"))


def _middle(distances: ndarray | None, a: float, b: float) -> float:
    """A distance that halves the area between a and b; one that occurs, if they are known."""
    h = float(np.sqrt((a**2 + b**2) / 2))
    if distances is None:
        return h
    inside = distances[np.searchsorted(distances, a, side="right") : np.searchsorted(distances, b)]
    return float(inside[min(int(np.searchsorted(inside, h)), len(inside) - 1)])
