"""Tables of anchors."""

import csv
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from locbounds.errors import InputError
from locbounds.io.complain import DEGREES_REMEDY, close_key, is_degrees

COLUMNS = ("anchor_id", "x_m", "y_m", "z_m")


def read_anchors(path: str | os.PathLike, *, columns: tuple[str, ...] = COLUMNS) -> dict[str, tuple[float, ...]]:
    r"""Positions of anchors from a CSV file.

    Parameters
    ----------
    path
        With a header line; other columns are ignored.
    columns
        Names of the columns with the anchor's name and its coordinates in metres; the last one may be absent (2-D).

    Returns
    -------
    dict
        Name -> 2 or 3 coordinates in metres, in the file's order.

    Raises
    ------
    InputError
        If the file cannot be read, a column is missing, a cell is not a finite number, or a name repeats.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "anchors.csv"
    >>> _ = path.write_text("anchor_id,x_m,y_m\nbs1,-3000,-2000\n")
    >>> read_anchors(path)
    {'bs1': (-3000.0, -2000.0)}
    """
    path = Path(path)
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read the anchors from {path}: {reason.lower()}", "Give a CSV file") from error
    header = [name.strip() for name in rows[0]] if rows else []
    used = [name for name in columns if name in header]
    for name in columns[:3]:
        if name not in header:
            raise InputError(
                f"{path} has no column {name}, but {', '.join(header) or 'nothing'}", _remedy(name, header)
            )
    anchors: dict[str, tuple[float, ...]] = {}
    for line, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        cells = dict(zip(header, (cell.strip() for cell in row), strict=False))
        name = cells.get(columns[0], "")
        if not name or name in anchors:
            raise InputError(
                f"{path}, line {line}: the name {name!r} is {'given twice' if name else 'empty'}",
                "Give every anchor its own name",
            )
        anchors[name] = tuple(_metres(cells.get(column, ""), f"{path}, line {line}, {column}") for column in used[1:])
    if not anchors:
        raise InputError(f"{path} has no anchors", "Add a line per anchor below the header")
    return anchors


def _metres(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where} is {cell!r}", "Give a finite number of metres")
    return value


def _remedy(name: str, header: list[str]) -> str:
    if any(is_degrees(column) for column in header):
        return DEGREES_REMEDY
    close = close_key(name, header)
    return (
        f"Rename the column {close} to {name}" if close else f"The columns are {', '.join(COLUMNS[:3])} and z_m in 3-D"
    )


def hoisted(keys: dict[str, Any]) -> dict[str, Any]:
    """A file's keys, ``anchors_csv`` at the top: below a section TOML counts it to that section, a person to the file.

    >>> hoisted({"format": 1, "links": {"anchors_csv": "anchors.csv"}})
    {'format': 1, 'links': {}, 'anchors_csv': 'anchors.csv'}
    """
    for section, table in keys.items():
        if isinstance(table, dict) and isinstance(table.get("anchors_csv"), str) and "anchors_csv" not in keys:
            rest = {k: v for k, v in table.items() if k != "anchors_csv"}
            return {**keys, section: rest, "anchors_csv": table["anchors_csv"]}
    return keys


def anchor_positions(anchors: Mapping[str, Any], anchors_csv: str | None, folder: Path) -> dict[str, Any]:
    """Positions of a file's anchors: from its own keys, otherwise from the table that it names.

    Parameters
    ----------
    anchors
        Name -> section with a key ``position_m``, which may be absent where the table has the anchor.
    anchors_csv
        The table, relative to ``folder``.

    Raises
    ------
    InputError
        If an anchor has no position, or there is none.
    """
    positions: dict[str, Any] = {} if anchors_csv is None else dict(read_anchors(folder / anchors_csv))
    for name, own in anchors.items():
        if own.position_m is not None:
            positions[name] = own.position_m
        elif name not in positions:
            raise InputError(
                f"anchor {name} has no position" + (f" and is not in {anchors_csv}" if anchors_csv else ""),
                f"anchors.{name}.position_m: {type(own).model_fields['position_m'].description}",
            )
    if not positions:
        raise InputError("there are no anchors", "Add [anchors] with a line NAME = { position_m = [x, y] } each")
    return positions
