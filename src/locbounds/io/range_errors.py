"""Reading range errors that are no log of tracks: surveys at fixed points, and tables that hold the errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locbounds.axes import Bool, Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.fit.range_errors import EVERY, RangeErrors
from locbounds.io.csv_table import CsvTable
from locbounds.io.log_columns import LogColumns
from locbounds.io.logs import anchor_places, select_rows
from locbounds.io.sight_labels import read_labels


def read_errors(
    ranges: str | Path,
    *,
    errors: str | None = None,
    distance: str | None = None,
    points: str | None = None,
    anchors: str | Path | None = None,
    truth: str | Path | None = None,
    columns: LogColumns | None = None,
    select: str | None = None,
    labels: str | None = None,
    hold_out: str | None = None,
    dim: int | None = None,
) -> RangeErrors:
    r"""Read range errors in one of three forms.

    Parameters
    ----------
    ranges : path
        CSV file (also .gz), a line per range; empty ranges are left out.
    errors : str, optional
        Column of the errors themselves, measured minus true, m.
    distance : str, optional
        Column of the true distances, m.
    points : str, optional
        Column, of the ranges and of the truth, that names the point where a range was measured. With ``errors`` or
        ``distance`` no truth is needed, and it only says which errors belong together.
    anchors, truth : path, optional
        Positions of anchors and points, one line each, for the third form.
    columns, select, labels, dim
        As in `locbounds.io.logs.read_log`.
    hold_out : str, optional
        Errors to compare laws on: ``COLUMN=VALUE`` of the ranges or the truth, a number (the last points), or names
        of points separated by commas. By default every fourth point, or error where there are no points.

    Returns
    -------
    RangeErrors

    Raises
    ------
    InputError
        Columns or files that are missing or too many, unknown points or anchors, cells that are no numbers.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     path = Path(name) / "ranges.csv"
    ...     _ = path.write_text("range_m,true_m,los\n5.5,5,1\n9,6,0\n7,7,1\n8,7.5,1\n")
    ...     read_errors(path, distance="true_m", labels="los").error_m.tolist()
    [0.5, 3.0, 0.0, 0.5]
    """
    columns = columns or LogColumns()
    if errors is not None and distance is not None:
        raise InputError("both a column of errors and one of distances were given", "Give one of them")
    direct = errors is not None or distance is not None
    files = {name: path for name, path in (("anchors", anchors), ("truth", truth)) if path is not None}
    if direct and files:
        raise InputError(
            f"the errors are in {Path(ranges).name}, yet there is a file of {' and '.join(files)}",
            "Leave it out, or leave out the column of errors or distances",
        )
    if not direct and len(files) < 2:
        missing = " and ".join(name for name in ("anchors", "truth") if name not in files)
        raise InputError(
            f"ranges at points need their true distances: {missing} missing",
            "Give --anchors and --truth, or the column of the distances (--distance) or of the errors (--errors)",
        )
    tables = {"ranges": CsvTable(ranges, "ranges")} | {name: CsvTable(path, name) for name, path in files.items()}
    select_rows(tables, select)
    r = tables["ranges"]
    if errors is not None:
        r.need(errors, "range")
        error = r.numbers(errors, empty=True)
    else:
        r.need(columns.ranges.range, "range")
        error = r.numbers(columns.ranges.range, empty=True)
    if distance is not None:
        r.need(distance, "range")
        error = error - r.numbers(distance)
    elif errors is None:
        assert points is not None
        error = error - _distances(tables, columns, points, dim)
    sight = np.full(len(error), -1) if labels is None else read_labels(r, labels)
    own = points if points is not None else columns.ranges.track
    notes = ()
    if points is not None:
        r.need(points, "track")
    if own in r:
        group = np.unique(r.text(own), return_inverse=True)[1]
    else:
        group = np.arange(len(error))
        notes = ("No column says which errors belong together (--points): standard errors take all as independent.",)
    return RangeErrors(error, sight, group, _held(tables, hold_out, own, group), notes)


def _rows_of(points: ndarray, table: CsvTable, column: str, wanted: ndarray, ranges: CsvTable) -> Int[ndarray, " n"]:
    """Row of the truth for every range."""
    row = {name: k for k, name in enumerate(points.tolist())}
    if len(row) < len(points):
        twice = next(name for k, name in enumerate(points.tolist()) if row[name] != k)
        raise InputError(
            f"{column} {twice} is in {table.path.name} more than once", "Choose with --select COLUMN=VALUE, or rename"
        )
    unknown = [k for k, name in enumerate(wanted.tolist()) if name not in row]
    if unknown:
        raise InputError(
            f"line {ranges.lines[unknown[0]]} of {ranges.path.name} is at {column} {wanted[unknown[0]]}, "
            f"which is not in {table.path.name}",
            "Add it, or select rows with --select",
        )
    return np.array([row[name] for name in wanted.tolist()])


def _distances(tables: dict[str, CsvTable], columns: LogColumns, points: str, dim) -> Float[ndarray, " n"]:
    r, truth, c = tables["ranges"], tables["truth"], columns.truth
    for table in (r, truth):
        table.need(points, "track")
    r.need(columns.ranges.anchor, "anchor")
    truth.need(c.x, "x")
    truth.need(c.y, "y")
    names, places, _ = anchor_places(tables["anchors"], columns.anchors, truth, c, dim, [])
    at = truth.positions((c.x, c.y, c.z)[: places.shape[1]])
    of_point = _rows_of(truth.text(points), truth, points, r.text(points), r)
    anchors = np.array(names, dtype=object)
    of_anchor = _rows_of(anchors, tables["anchors"], columns.anchors.anchor, r.text(columns.ranges.anchor), r)
    return np.linalg.norm(at[of_point] - places[of_anchor], axis=-1)


def _held(tables: dict[str, CsvTable], hold_out: str | None, own: str, group: ndarray) -> Bool[ndarray, " n"]:
    r = tables["ranges"]
    if hold_out is None:
        held = group % EVERY == EVERY - 1
    elif "=" in hold_out:
        column, value = (part.strip() for part in hold_out.split("=", 1))
        truth = tables.get("truth")
        if column not in r and truth is not None and column in truth:
            chosen = set(truth.text(own)[truth.text(column, empty=True) == value].tolist())
            held = np.array([name in chosen for name in r.text(own).tolist()])
        else:
            r.need(column, "track")
            held = r.text(column, empty=True) == value
    elif own not in r:
        raise InputError(
            f"cannot hold out {hold_out}: no column says which errors belong together",
            "Name it with --points COLUMN, or hold out by a column: --hold-out COLUMN=VALUE",
        )
    else:
        names = list(dict.fromkeys(r.text(own).tolist()))
        asked = [name.strip() for name in hold_out.split(",") if name.strip()]
        if hold_out.strip().isdigit():
            asked = names[-int(hold_out) :] if int(hold_out) else []
        unknown = [name for name in asked if name not in names]
        if unknown:
            raise InputError(f"no {own} is called {unknown[0]}", f"They are {', '.join(names[:12])}, ...")
        held = np.isin(r.text(own).astype(str), asked)
    if held.all() or not held.any():
        raise InputError(
            f"{'all' if held.all() else 'no'} errors are held out" + (f" by {hold_out}" if hold_out else ""),
            "Hold some out: COLUMN=VALUE, a number of points, or their names",
        )
    return held
