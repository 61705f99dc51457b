"""Tables of maps: a row per point, per cell, per method."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from locbounds.registry import method
from locbounds.result import Result
from locbounds.static.cells import Cell
from locbounds.static.maps import AccuracyMap
from locbounds.static.over_prior import Numbers, Refusal, rmse_of
from locbounds.static.tightest import choose

STATUS = ("ok", "singular", "no derivative")
METHOD_COLUMNS = ("method", "what", "rmse_m", "stderr_m", "verdict", "why")


def point_columns(found: AccuracyMap) -> tuple[str, ...]:
    """Columns of :func:`point_rows`: the place, its status, and every figure of merit."""
    return (*("x_m", "y_m", "z_m")[: found.plan.dim], "status", *found.figures)


def point_rows(found: AccuracyMap) -> Iterator[tuple[Any, ...]]:
    """A row per point inside the area; cells are empty where there is no bound, and the status says why."""
    columns = list(found.figures.values())
    status = np.asarray(found.bounds.status)
    for i, place in enumerate(found.points):
        code = int(status[i])
        values = [float(c[i]) if np.isfinite(c[i]) else "" for c in columns]
        yield (*map(float, place), STATUS[code], *values)


def cell_columns(ids: Sequence[str]) -> tuple[str, ...]:
    """Columns of :func:`cell_rows`.

    >>> cell_columns(["ezzb"])[4:]
    ('ezzb_m', 'tightest', 'tightest_m', 'runner_up', 'refused')
    """
    corners = ("x_low_m", "y_low_m", "x_high_m", "y_high_m")
    return (*corners, *_value_columns(ids), "tightest", "tightest_m", "runner_up", "refused")


def _value_columns(ids: Sequence[str]) -> list[str]:
    return [name for id in ids for name in ((f"{id}_m",) if _bound(id) else (f"{id}_m", f"{id}_stderr_m"))]


def _bound(id: str) -> bool:
    return method(id).kind == "bound"


def cell_rows(cells: Sequence[Cell], ids: Sequence[str]) -> list[tuple[Any, ...]]:
    """A row per cell: corners, numbers, the tightest valid bound and the runner-up, what is refused and why."""
    rows = []
    for cell in cells:
        values: list[Any] = []
        for id in ids:
            got = rmse_of(cell.found.get(id))
            values += got[:1] if _bound(id) else got
        best = choose(cell.found)
        chosen = (best.best.id, best.rmse_m, best.runner_up.id if best.runner_up else "") if best else ("", "", "")
        refused = "; ".join(f"{r.id}: {r.why}" for r in cell.found.values() if isinstance(r, Refusal))
        numbers = ["" if v != v else v for v in values]
        rows.append((*map(float, cell.corners.ravel()), *numbers, *chosen, refused))
    return rows


def method_rows(found: Numbers) -> list[tuple[Any, ...]]:
    """A row per method over the prior, in the order of :data:`METHOD_COLUMNS`."""
    rows = []
    for id, r in found.items():
        entry = method(id)
        what = "bound over the prior" if entry.kind == "bound" else "estimator over the prior"
        if isinstance(r, Result):
            rows.append((id, what, *rmse_of(r), str(r.verdict.status), "; ".join(r.verdict.reasons)))
        else:
            rows.append((id, what, "", "", "refused", r.why))
    return rows
