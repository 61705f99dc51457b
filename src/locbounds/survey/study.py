"""Everything about one survey: bounds, what is reachable, what estimators reach, over noise levels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from locbounds.errors import InputError
from locbounds.survey.bound import ALL_PAIRS, SurveyBound, survey_bound, survey_candidates
from locbounds.survey.fingerprints import Fingerprints
from locbounds.survey.hold_out import folds, refuse_outside, split
from locbounds.survey.importance import Importance, access_points
from locbounds.survey.interpolate import MOST_POINTS, interpolated
from locbounds.survey.mmse import DiscreteMmse, discrete_mmse
from locbounds.survey.model import SurveyModel, survey_model
from locbounds.survey.neighbours import NEIGHBOURS, Errors, aligned, held_out_errors, nearest_neighbours, simulated
from locbounds.survey.printed import printed_mse

VALID, NOT_A_BOUND, ESTIMATE = "valid under", "as printed, not a bound", "estimate"
LEVELS_DB = (0.5, 1.0, 1.5, 2.1, 3.0, 4.0, 6.0, 8.0, 11.0, 16.0)  # of a curve
LEVELS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 16.0)  # the same without RSS, relative to the measured noise
LARGE_LEVELS = (1.0, 2.0, 4.0)  # of a large survey, relative to its noise
DRAWS = 20_000
LARGE_DRAWS = 2_000  # of a survey with more points than all pairs are taken of
PRINTED = 2_000  # points over which the chapter's formula is averaged, at most
VISIBLE = 0.01  # of the extent: an error that a map can show
NAMES = {
    "survey": "rigorous bound",
    "survey-length": "rigorous bound on the length",
    "survey-printed": "chapter's formula (not a bound)",
    "mmse": "least error of the discretised problem",
    "knn-model": "k-NN, model",
    "wknn-model": "weighted k-NN, model",
    "knn": "k-NN, held out",
    "wknn": "weighted k-NN, held out",
    "gp": "Gaussian process map, held out",
    "survey-gp": "bound on the interpolated map",
    "mmse-gp": "least error on the interpolated map",
}
COLUMNS = ("method", "noise_db", "rmse_m", "stderr_m", "valid")
CURVE_COLUMNS = ("set", "method", "noise_db", "noise_factor", "rmse_m", "stderr_m", "valid")


class Row(NamedTuple):
    """One number: a method at a noise level."""

    method: str
    noise_db: float
    rmse_m: float
    stderr_m: float
    valid: str
    factor: float = 1.0


class SurveyStudy(NamedTuple):
    """What :func:`study` found.

    Attributes
    ----------
    model, bound, least
        The survey, its bound and its least error at its own noise level.
    rows, curve : tuples of Row
        At that level; over levels.
    held_out : dict
        Errors of every estimator on held-out samples.
    visible, visible_factor : DiscreteMmse, float
        The least error at the lowest noise level, relative to the survey's, at which it is one per cent of the survey's
        extent or more: what a map of it shows.
    ranking : tuple of Importance
        At that level.
    notes : tuple of str
    """

    model: SurveyModel
    bound: SurveyBound
    least: DiscreteMmse
    rows: tuple[Row, ...]
    curve: tuple[Row, ...]
    held_out: dict[str, Errors]
    visible: DiscreteMmse
    visible_factor: float
    ranking: tuple[Importance, ...]
    notes: tuple[str, ...]


def study(
    survey: Fingerprints,
    labels: Mapping[str, Sequence[str]] | None = None,
    *,
    test: str | Fingerprints = "points",
    noise_db: float | int | str = "auto",
    shape: str = "each",
    silence: str = "level",
    merge_m: float | int | None = None,
    neighbours: int = NEIGHBOURS,
    twins: bool = False,
    map: bool = True,
    levels: Sequence[float] | None = None,
    seed: int = 0,
    announce: Callable[[str], None] = lambda text: None,
) -> SurveyStudy:
    """Bound, least error and estimators for one survey.

    Parameters
    ----------
    survey, labels
        As read by :func:`locbounds.read_survey`.
    test
        What estimators are tested on: ``"points"`` (ten folds; whole walks where there are several), ``"samples"`` (the
        same of each point's samples), ``"COLUMN=VALUE"``, ``"COLUMN:N"`` (its last N values), or other fingerprints.
        Rows held out by a column are not part of the survey, for the bound neither.
    noise_db, shape, silence, twins
        See :func:`survey_model`.
    merge_m
        Merge samples within cells of so many metres.
    neighbours
        k.
    map
        Also interpolate between the points (up to 1,000 points).
    levels
        Noise levels of the curve, relative to the survey's.
    seed
        Of all random numbers.
    announce
        Told what is being done.

    Raises
    ------
    InputError
        Whatever is wrong with the survey, the test samples or an option.

    Examples
    --------
    >>> x = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0)), -1).reshape(-1, 2)
    >>> heard = -40 - 5 * np.hypot(x[:, :1] - [0, 4], x[:, 1:] - [0, 3])
    >>> found = study(Fingerprints.at(x, heard), noise_db=2.0, map=False, levels=[1.0])
    >>> [row.method for row in found.rows][:3], found.bound.rmse_m < found.least.rmse_m
    (['survey', 'survey-x', 'survey-y'], True)
    """
    labels = labels or {}
    announce("reading the survey")
    known, held = (survey, None)
    if isinstance(test, Fingerprints):
        held = test
    elif test not in ("points", "samples"):
        known, held = split(survey, labels, test)
    if merge_m is not None:
        known = known.merged(merge_m)
    options = {"noise_db": noise_db, "shape": shape, "silence": silence, "twins": twins}
    model = survey_model(known, **options)
    if held is not None:
        refuse_outside(known, held)
    large = model.points > ALL_PAIRS
    announce(f"bound of {model.points:,} points and {len(model.names)} columns")
    candidates = survey_candidates(model) if large else None
    bound = survey_bound(model, candidates=candidates)
    notes = [*model.notes, *model.dangers(), f"Noise: {_in_words(model)}."]
    announce("least error")
    least = discrete_mmse(model, draws=LARGE_DRAWS if large else DRAWS, seed=seed)
    estimators = {id: nearest_neighbours(id, neighbours=neighbours) for id in ("knn", "wknn")}
    dense = None
    if map and 8 <= model.points <= MOST_POINTS:
        announce("interpolating")
        dense = interpolated(model)
        notes.append(dense.model.notes[-1])
    rows = _at_own_level(model, bound, least, large)
    announce("held-out samples")
    errors = _held_out(known, held, test, model, estimators, options, dense, announce)
    rows += [Row(id, model.noise_db, e.rmse_m, e.stderr_m, ESTIMATE) for id, e in errors.items()]
    if dense is not None:
        rows += _on_the_map(dense.model, seed)
    curve = []
    for factor in _levels(model, levels, large):
        announce(f"noise level {factor:.3g} of the survey's")
        known_bound, known_least = (bound, least) if factor == 1 else (None, None)
        curve += _at_level(model, candidates, estimators, factor, large, seed, known_bound, known_least)
    announce("which access points matter")
    factor, seen = _visible(model, least, curve, large, seed)
    at_factor = bound if factor == 1 or not large else survey_bound(model, candidates=candidates, scale=factor)
    ranking = tuple(access_points(model, at_factor, scale=factor)) if len(model.names) > 1 else ()
    return SurveyStudy(
        model, bound, least, tuple(rows), tuple(curve), errors, seen, factor, ranking, tuple(dict.fromkeys(notes))
    )


def _visible(model, least: DiscreteMmse, curve, large: bool, seed: int) -> tuple[float, DiscreteMmse]:
    smallest = VISIBLE * float(np.linalg.norm(np.ptp(model.position_m, axis=0)))
    if least.rmse_m >= smallest:
        return 1.0, least
    higher = sorted((r.rmse_m < smallest, r.factor) for r in curve if r.method == "mmse" and r.factor > 1)
    if not higher:
        return 1.0, least
    factor = higher[0][1] if not higher[0][0] else higher[-1][1]
    return factor, discrete_mmse(model, draws=LARGE_DRAWS if large else DRAWS, seed=seed, scale=factor)


def _in_words(model: SurveyModel) -> str:
    deviation, units = model.noise.deviation, np.array(model.units)
    parts = []
    for unit in dict.fromkeys(model.units):
        d = deviation[units == unit]
        parts.append(f"{np.sqrt(np.mean(d**2)):.3g} {unit} rms ({d.min():.3g} to {d.max():.3g})")
    return f"{' and '.join(parts)}; {model.noise.source}"


def _at_own_level(model: SurveyModel, bound: SurveyBound, least: DiscreteMmse, large: bool) -> list[Row]:
    level = model.noise_db
    rows = [Row("survey", level, bound.rmse_m, 0.0, VALID)]
    rows += [Row(f"survey-{a}", level, float(np.sqrt(p.mse_m2)), 0.0, VALID) for a, p in bound.axes.items()]
    rows += [Row("survey-length", level, float(np.sqrt(bound.length.mse_m2)), 0.0, VALID)]
    rows += [_printed(model, 1.0)]
    return [*rows, Row("mmse", level, least.rmse_m, least.rmse_stderr_m, ESTIMATE)]


def _printed(model: SurveyModel, factor: float) -> Row:
    value = printed_mse(model, scale=factor, every=-(-model.points // PRINTED))
    return Row("survey-printed", model.noise_db * factor, float(np.sqrt(value)), 0.0, NOT_A_BOUND, factor)


def _on_the_map(dense: SurveyModel, seed: int) -> list[Row]:
    bound, least = survey_bound(dense), discrete_mmse(dense, draws=LARGE_DRAWS, seed=seed)
    return [
        Row("survey-gp", dense.noise_db, bound.rmse_m, 0.0, ESTIMATE),
        Row("mmse-gp", dense.noise_db, least.rmse_m, least.rmse_stderr_m, ESTIMATE),
    ]


def _held_out(known, held, test, model, estimators, options, dense, announce) -> dict[str, Errors]:
    """Errors of the estimators on samples that the survey does not contain."""
    parts: dict[str, list[Errors]] = {}
    sets = [(known, held)] if held is not None else folds(known, str(test))
    for k, (train, rest) in enumerate(sets):
        announce(f"held-out samples, part {k + 1}")
        trained = model if train is known else survey_model(train, **options)
        for id, estimate in estimators.items():
            parts.setdefault(id, []).append(held_out_errors(estimate, trained, rest))
        if dense is not None and trained.points >= 8:
            part = interpolated(trained, like=dense)
            square = np.sum(np.square(part.locate(aligned(trained, rest)) - rest.position_m[rest.point]), axis=1)
            parts.setdefault("gp", []).append(parts["knn"][-1]._replace(square_m2=square))
    if not parts:
        raise InputError("nothing could be held out", "Hold out by a column: --test COLUMN=VALUE")
    return {id: _joined(errors) for id, errors in parts.items()}


def _joined(parts: list[Errors]) -> Errors:
    start = np.cumsum([0, *(int(e.group.max()) + 1 for e in parts[:-1])])
    return Errors(
        np.concatenate([e.position_m for e in parts]),
        np.concatenate([e.square_m2 for e in parts]),
        np.concatenate([e.group + s for e, s in zip(parts, start, strict=True)]),
    )


def _levels(model: SurveyModel, levels: Sequence[float] | None, large: bool) -> list[float]:
    if levels is not None:
        return list(levels)
    if large:
        return list(LARGE_LEVELS)
    return [db / model.noise_db for db in LEVELS_DB] if np.isfinite(model.noise_db) else list(LEVELS)


def _at_level(model, candidates, estimators, factor: float, large: bool, seed: int, bound, least) -> list[Row]:
    level = model.noise_db * factor
    bound = bound or survey_bound(model, candidates=candidates, scale=factor)
    least = least or discrete_mmse(model, draws=LARGE_DRAWS if large else DRAWS // 2, seed=seed, scale=factor)
    rows = [
        Row("survey", level, bound.rmse_m, 0.0, VALID, factor),
        _printed(model, factor),
        Row("mmse", level, least.rmse_m, least.rmse_stderr_m, ESTIMATE, factor),
    ]
    for id, estimate in estimators.items():
        rmse, error = simulated(estimate, model, draws=LARGE_DRAWS, seed=seed, scale=factor)
        rows.append(Row(f"{id}-model", level, rmse, error, ESTIMATE, factor))
    return rows


def curve_rows(name: str, found: SurveyStudy) -> list[tuple]:
    """The curve as rows of :data:`CURVE_COLUMNS`, then the estimators on held-out samples."""
    rows = [*found.curve, *(r for r in found.rows if r.method in found.held_out)]
    return [(name, r.method, r.noise_db, r.factor, r.rmse_m, r.stderr_m, r.valid) for r in rows]


def name_of(method: str) -> str:
    """What a method is, in words.

    >>> name_of("survey-x")
    'rigorous bound along x'
    """
    return NAMES.get(method) or f"rigorous bound along {method.rpartition('-')[2]}"


def in_metres(row: Row) -> str:
    """RMSE with its standard error, for people."""
    if row.rmse_m < 1e-3:
        return "below 1 mm"
    return f"{row.rmse_m:.3f} m" + (f" ± {row.stderr_m:.3f}" if row.stderr_m > 0 else "")


def lost_in_words(bound: SurveyBound) -> str:
    """How much finer distances, more pairs or better matchings could raise the bound."""
    most = float(np.sqrt(bound.mse_m2 + bound.lost_to_grid_m2 + bound.lost_to_pairs_m2))
    grid = float(np.sqrt(bound.mse_m2 + bound.lost_to_grid_m2)) - bound.rmse_m
    return (
        f"Lost to the grid of distances: at most {grid:.3g} m; to pairs left out and to unfinished matchings: at most "
        f"{most - grid - bound.rmse_m:.3g} m."
    )
