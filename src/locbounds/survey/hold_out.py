"""Which samples test an estimator: held-out points, samples, walks, or rows that a column names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from locbounds.axes import ndarray
from locbounds.errors import InputError
from locbounds.survey.fingerprints import Fingerprints

FOLDS = 10
GAPS, EXTENTS = 2.0, 0.1  # a test point is outside if it is farther from the survey than both: largest gaps, extents


def split(survey: Fingerprints, labels: Mapping[str, Sequence[str]], test: str) -> tuple[Fingerprints, Fingerprints]:
    """Samples of the survey and samples held out.

    Parameters
    ----------
    survey, labels
        As read.
    test
        ``"COLUMN=VALUE"`` (several values: ``COLUMN=A|B``), or ``"COLUMN:N"``: the last N values of a column.

    Raises
    ------
    InputError
        Unknown column or value, or nothing left.
    """
    equal = "=" in test
    column, _, value = test.partition("=" if equal else ":")
    if column not in labels:
        raise InputError(
            f"there is no column {column} to hold samples out by",
            f"The columns are {', '.join(labels) or 'access points only'}; or --test points, samples, FILE.csv",
        )
    of = np.array(labels[column], dtype=object)
    known = list(dict.fromkeys(of.tolist()))
    if equal:
        chosen = value.split("|")
        unknown = [v for v in chosen if v not in known]
        if unknown:
            raise InputError(f"no sample has {column} = {unknown[0]}", f"It has {', '.join(known[:8])}")
    else:
        if not value.isdigit() or not 1 <= int(value) < len(known):
            raise InputError(
                f"cannot hold out {value or 'nothing'} of {len(known)} values of {column}",
                f"Give a number from 1 to {len(known) - 1}, as in {column}:1",
            )
        chosen = known[-int(value) :]
    held = np.isin(of, chosen)
    if held.all():
        raise InputError("all samples are held out", "Leave some to survey with")
    return survey.rows(~held), survey.rows(held)


def folds(survey: Fingerprints, how: str, *, seed: int = 0) -> Iterator[tuple[Fingerprints, Fingerprints]]:
    """Ten times: nine tenths of the points (or, with ``"samples"``, of each point's samples), and the rest.

    Points are held out with all their samples; walks, if the survey has several, as wholes. A sample is only held out
    if its point keeps another one.

    Raises
    ------
    InputError
        If no point has two samples, for ``"samples"``.
    """
    rng = np.random.default_rng([seed, 0xF01D])
    if how == "points":
        walks = len(set(survey.group)) > 1
        unit = np.unique(np.array(survey.group), return_inverse=True)[1].reshape(-1) if walks else survey.point
        fold = _deal(int(unit.max()) + 1, rng)[unit]
    else:
        fold = _sample_folds(survey, rng)
    for k in range(FOLDS):
        held = fold == k
        if held.any() and len(np.unique(survey.point[~held])) > 1:
            yield survey.rows(~held), survey.rows(held)


def _deal(units: int, rng: np.random.Generator) -> ndarray:
    fold = np.empty(units, int)
    fold[rng.permutation(units)] = np.arange(units) % FOLDS
    return fold


def _sample_folds(survey: Fingerprints, rng: np.random.Generator) -> ndarray:
    count = np.bincount(survey.point)
    fold = np.full(survey.samples, -1)
    for p in np.flatnonzero(count > 1):
        rows = rng.permutation(np.flatnonzero(survey.point == p))
        fold[rows] = (np.arange(len(rows)) + rng.integers(FOLDS)) % FOLDS
    if (fold < 0).all():
        raise InputError("no point has two samples, so that none can be held out", "Hold out points: --test points")
    return fold


def refuse_outside(survey: Fingerprints, test: Fingerprints) -> None:
    """Raise an InputError if a test point lies outside the survey."""
    from scipy.spatial import KDTree

    tree = KDTree(survey.position_m)
    gap = float(tree.query(survey.position_m, k=2)[0][:, 1].max())
    limit = max(GAPS * gap, EXTENTS * float(np.linalg.norm(np.ptp(survey.position_m, axis=0))))
    away = tree.query(test.position_m)[0]
    k = int(away.argmax())
    if away[k] > limit:
        at = ", ".join(f"{x:.4g}" for x in test.position_m[k])
        raise InputError(
            f"the test point at ({at}) m is {away[k]:.3g} m from the nearest survey point; {int(np.sum(away > limit))} "
            f"of {len(away)} test points lie more than {limit:.3g} m outside",
            "Survey that area, or leave these points out; check that both are in the same coordinates",
        )
