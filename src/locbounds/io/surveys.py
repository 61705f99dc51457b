"""Reading surveys: fingerprints in wide or long CSV files, positions in them or beside them."""

from __future__ import annotations

import difflib
import fnmatch
import re
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from locbounds.axes import ndarray
from locbounds.errors import InputError
from locbounds.io.csv_table import CsvTable
from locbounds.survey.fingerprints import RANGE, RSS, Fingerprints

VALUES = ("rss", "range", "both")
STRONGEST_DBM, WEAKEST_DBM = 0.0, -150.0  # what a receiver can report
GAP_DB, SHARE = 5.0, 0.1  # a weakest value so far below the next, and so frequent, is a code and no RSS


@dataclass(frozen=True)
class SurveyColumns:
    """Column names; those that a file lacks are not needed, but for the positions (or points with positions).

    Examples
    --------
    >>> SurveyColumns.parse(["x=east", "y=north"]).x
    'east'
    """

    x: str = "x_m"
    y: str = "y_m"
    z: str = "z_m"
    point: str = "point_id"
    sample: str = "sample"
    group: str = "trajectory_id"
    ap: str = "anchor_id"
    rss: str = "rssi_dbm"
    range: str = "range_m"

    @classmethod
    def parse(cls, options: list[str] | tuple[str, ...]) -> SurveyColumns:
        """From options such as ``x=east`` (key, column in the file)."""
        columns = cls()
        known = [f.name for f in fields(cls)]
        for option in options:
            key, equals, name = option.partition("=")
            if not (equals and name) or key not in known:
                near = difflib.get_close_matches(key, known, n=1, cutoff=0.3)
                raise InputError(
                    f'column mapping "{option}" is not KEY=COLUMN with a known key',
                    f"Did you mean {near[0]}=...?" if near else f"Keys: {', '.join(known)}",
                )
            columns = replace(columns, **{key: name})
        return columns


@dataclass(frozen=True)
class SurveyFile:
    """Fingerprints as read, and what else the file says about every sample.

    Attributes
    ----------
    survey : Fingerprints
    labels : dict
        Per further column, one text per sample: what samples may be chosen by.
    """

    survey: Fingerprints
    labels: dict[str, tuple[str, ...]]


def read_survey(
    path: str | Path,
    *,
    points: str | Path | None = None,
    columns: SurveyColumns | None = None,
    select: str | None = None,
    access_points: str | None = None,
    values: str = "rss",
    not_heard: float | int | None = None,
    milliwatts: bool = False,
    flat: bool = False,
) -> SurveyFile:
    r"""Read a survey.

    Parameters
    ----------
    path : path
        CSV (also .gz). Wide: a line per sample and a column per access point, empty where it was not heard. Long: a
        line per sample and access point, with the column ``anchor_id``.
    points : path, optional
        CSV with the position of every ``point_id``, where the samples have none.
    columns : SurveyColumns
        Column names.
    select : str, optional
        ``"scene=office"``: only these rows, of every file that has the column; several separated by commas.
    access_points : str, optional
        Columns of a wide file, for example ``"WAP*"``; by default the largest family of columns that differ in a
        number.
    values : str
        ``"rss"``, ``"range"`` or ``"both"``; a wide file has RSS only.
    not_heard : float, optional
        A code in the file that means not heard, for example 100 or -110.
    milliwatts : bool
        RSS is in mW and is converted to dBm.
    flat : bool
        Leave heights out.

    Returns
    -------
    SurveyFile

    Raises
    ------
    InputError
        Missing columns or positions, text in numbers, values that are no RSS in dBm, a point at two positions, two
        values of one access point in one sample.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     path = Path(name) / "survey.csv"
    ...     _ = path.write_text("x_m,y_m,ap1,ap2\n0,0,-40,-70\n0,0,-41,\n3,0,-52,-61\n")
    ...     survey = read_survey(path).survey
    >>> survey.points, survey.names, survey.value[1].tolist()
    (2, ('ap1', 'ap2'), [-41.0, nan])
    """
    if values not in VALUES:
        raise InputError(f'values are "{values}"', f"Choose one of {', '.join(VALUES)}")
    c = columns or SurveyColumns()
    table = CsvTable(path, "fingerprints")
    where = CsvTable(points, "points") if points is not None else None
    _select([t for t in (table, where) if t is not None], select)
    notes: list[str] = []
    long = c.ap in table
    if long:
        names, units, value, first = _long(table, c, values)
    else:
        if values != "rss":
            raise InputError(f"{table.path.name} is a wide file, which has RSS only", f"Give a long one, with {c.ap}")
        names = _family(table, access_points, c)
        value = np.column_stack([table.numbers(name, empty=True) for name in names])
        units, first = (RSS,) * len(names), np.arange(len(table))
    if not_heard is not None:
        value = np.where(value == not_heard, np.nan, value)
    rss = np.array([unit == RSS for unit in units])
    value[:, rss] = _dbm(value[:, rss], milliwatts, table.path.name, notes)
    labels = {
        name: tuple(table.text(name, empty=True)[first])
        for name in table.names
        if name not in names and name not in (c.ap, c.rss, c.range)
    }
    place, extra = _positions(table, first, where, c, flat, notes)
    labels |= {key: values for key, values in extra.items() if key not in labels}
    group = labels.get(c.group, ("",) * len(value))
    _same_place(labels.get(c.point), place, c, table, first)
    survey = Fingerprints.at(place, value, names=tuple(names), units=tuple(units), group=group, notes=tuple(notes))
    if c.point in labels and where is None:
        ids = len(set(labels[c.point]))
        if ids > survey.points:
            note = f"{ids - survey.points} points have the position of another one and are taken as one point."
            survey = replace(survey, notes=(*survey.notes, note))
    return SurveyFile(survey, labels)


def _select(tables: list[CsvTable], select: str | None) -> None:
    for part in select.split(",") if select else ():
        column, equals, value = (text.strip() for text in part.partition("="))
        if not (equals and column):
            raise InputError(f'selection "{part}" is not COLUMN=VALUE', "For example --select scene=office")
        having = [table for table in tables if column in table]
        if not having:
            known = sorted({name for table in tables for name in table.names})
            raise InputError(f"no file has a column {column} to select by", f"The columns are {', '.join(known[:12])}")
        for table in having:
            table.select(column, value)


def _family(table: CsvTable, pattern: str | None, c: SurveyColumns) -> list[str]:
    """Columns of the access points in a wide file."""
    if pattern is not None:
        found = fnmatch.filter(table.names, pattern)
        if not found:
            raise InputError(
                f'no column of {table.path.name} is called "{pattern}"', f"It has {', '.join(table.names[:12])}"
            )
        return found
    families: dict[str, list[str]] = {}
    for name in table.names:
        if name not in (c.x, c.y, c.z) and (match := re.fullmatch(r"(.*?)[-_ ]?\d+", name)):
            families.setdefault(match[1], []).append(name)
    if not families:
        raise InputError(
            f"{table.path.name} has no columns that look like access points (ap1, ap2, ...)",
            f"Name them with --access-points PATTERN, or give a long file with a column {c.ap}; it has "
            f"{', '.join(table.names[:12])}",
        )
    return max(families.values(), key=len)


def _long(table: CsvTable, c: SurveyColumns, values: str) -> tuple[list[str], tuple[str, ...], ndarray, ndarray]:
    """Columns, units, samples as rows, and the first line of each, from one line per sample and access point."""
    wanted = {"rss": [(c.rss, "rss", RSS)], "range": [(c.range, "range", RANGE)]}
    kinds = wanted["rss"] + wanted["range"] if values == "both" else wanted[values]
    for column, key, _ in kinds:
        table.need(column, key)
    keys = [k for k in (c.group, c.point, c.sample, c.x, c.y) if k in table]
    text = [table.text(k) for k in keys]
    rows = np.array(
        ["\0".join(parts) for parts in zip(*text, strict=True)] if text else [""] * len(table), dtype=object
    )
    _, first, sample = np.unique(rows, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    sample, first = rank[sample.reshape(-1)], first[order]
    ids, ap = np.unique(table.text(c.ap), return_inverse=True)
    cell = sample * len(ids) + ap.reshape(-1)
    _, once = np.unique(cell, return_index=True)
    if len(once) < len(cell):
        twice = np.setdiff1d(np.arange(len(cell)), once)[0]
        raise InputError(
            f"line {table.lines[twice]} of {table.path.name} is a second value of access point {ids[ap[twice]]} in one "
            "sample",
            f"Number the samples of a point in a column {c.sample}, or delete the line",
        )
    names, units, parts = [], [], []
    for column, _, unit in kinds:
        part = np.full((len(first), len(ids)), np.nan)
        part[sample, ap] = table.numbers(column, empty=True)
        parts.append(part)
        names += [f"range {id}" if values == "both" and unit == RANGE else str(id) for id in ids]
        units += [unit] * len(ids)
    return names, tuple(units), np.hstack(parts), first


def _dbm(value: ndarray, milliwatts: bool, file: str, notes: list[str]) -> ndarray:
    heard = value[np.isfinite(value)]
    if not heard.size:
        return value
    if milliwatts:
        if heard.min() <= 0:
            raise InputError(f"{file} has an RSS of {heard.min():g} mW", "Power is positive: are these dBm already?")
        notes.append("RSS was converted from mW to dBm.")
        return 10 * np.log10(value)
    if heard.max() > STRONGEST_DBM:
        if heard.min() > 0 and heard.max() < 10:
            raise InputError(f"the RSS values of {file} look like mW ({heard.max():g})", "Convert them with --mw")
        raise InputError(
            f"{file} has an RSS of {heard.max():g}, which is not in dBm",
            f"If it means not heard: --not-heard {heard.max():g}",
        )
    if heard.min() < WEAKEST_DBM:
        raise InputError(
            f"{file} has an RSS of {heard.min():g} dBm, which no receiver reports",
            f"If it means not heard: --not-heard {heard.min():g}",
        )
    levels, count = np.unique(heard, return_counts=True)
    if len(levels) > 1 and levels[1] - levels[0] >= GAP_DB and count[0] > SHARE * len(heard):
        notes.append(
            f"{count[0] / len(heard):.0%} of the values are {levels[0]:g} dBm and the next is {levels[1]:g}: if it is "
            f"a code for not heard, give --not-heard {levels[0]:g}."
        )
    return value


def _positions(table: CsvTable, first: ndarray, where: CsvTable | None, c: SurveyColumns, flat: bool, notes: list[str]):
    source = table if where is None else where
    for name, key in ((c.x, "x"), (c.y, "y")):
        source.need(name, key)
    names = (c.x, c.y) if flat or c.z not in source else (c.x, c.y, c.z)
    place = source.positions(names)
    if where is None:
        return place[first], {}
    for t in (table, where):
        t.need(c.point, "point")
    ids = where.text(c.point).tolist()
    twice = next((id for k, id in enumerate(ids) if id in set(ids[:k])), None) if len(set(ids)) < len(ids) else None
    if twice is not None:
        others = [n for n in where.names if n not in (c.point, c.x, c.y, c.z)]
        remedy = f"Choose one with --select {others[0]}=VALUE" if others else "Give every point its own id"
        raise InputError(f"point {twice} is in {where.path.name} more than once", remedy)
    at = {id: k for k, id in enumerate(ids)}
    asked = table.text(c.point)[first]
    missing = [k for k, id in enumerate(asked) if id not in at]
    if missing:
        raise InputError(
            f"line {table.lines[first[missing[0]]]} of {table.path.name} is at point {asked[missing[0]]}, which has no "
            f"position in {where.path.name}",
            "Add its position",
        )
    rows = np.array([at[id] for id in asked])
    unused = len(ids) - len(set(asked.tolist()))
    if unused:
        notes.append(f"{unused} points of {where.path.name} have no samples.")
    labels = {name: tuple(where.text(name, empty=True)[rows]) for name in where.names if name not in names}
    return place[rows], labels


def _same_place(ids, place: ndarray, c: SurveyColumns, table: CsvTable, first: ndarray) -> None:
    """Refuse a point at two positions."""
    if ids is None:
        return
    seen: dict[str, int] = {}
    for k, id in enumerate(ids):
        other = seen.setdefault(id, k)
        if id and not np.array_equal(place[other], place[k]):
            raise InputError(
                f"point {id} is at two positions (lines {table.lines[first[other]]} and {table.lines[first[k]]} of "
                f"{table.path.name})",
                f"Give every position its own {c.point}; to merge points that are close together: --merge M",
            )
