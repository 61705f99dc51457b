"""A ray tracer's links from CSV."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from locbounds.axes import LOS, NLOS
from locbounds.errors import InputError
from locbounds.io.anchors_csv import read_anchors
from locbounds.io.csv_table import CsvTable
from locbounds.propagation.link_table import LinkTable
from locbounds.propagation.links import UNREACHED

COLUMNS = ("x_m", "y_m", "anchor_id", "sight", "bias_m", "deviation_m")
SIGHTS = {"los": LOS, "nlos": NLOS, "none": UNREACHED, "0": LOS, "1": NLOS}


def read_links(path: str | os.PathLike, anchors: Any) -> LinkTable:
    r"""Links between points and anchors, computed elsewhere.

    Parameters
    ----------
    path
        A CSV file with one line per point and anchor: ``x_m, y_m`` (the point), ``anchor_id``, ``sight`` (``los``,
        ``nlos``, or ``none`` where the anchor is not received), ``bias_m`` (length of the path minus the straight
        distance) and ``deviation_m`` (standard deviation of the range). Other columns are ignored.
    anchors
        Name -> position in metres, or a CSV file with ``anchor_id, x_m, y_m``.

    Raises
    ------
    InputError
        If the file cannot be read, a cell is no number, a link is given twice, or one is missing: every point needs a
        line for every anchor.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "links.csv"
    >>> _ = path.write_text("x_m,y_m,anchor_id,sight,bias_m,deviation_m\n3,4,bs,nlos,2,0.5\n3,6,bs,none,,\n")
    >>> read_links(path, {"bs": (0.0, 0.0)}).sight.tolist()
    [[1], [-1]]
    """
    table = CsvTable(Path(path), "links")
    for column in COLUMNS:
        table.need(column, column)
    known = anchors if isinstance(anchors, dict) else read_anchors(anchors)
    name = Path(path).name
    who, words = table.text("anchor_id"), table.text("sight")
    strange = [w for w in dict.fromkeys(words.tolist()) if w.lower() not in SIGHTS]
    if strange:
        line = table.lines[np.flatnonzero(words == strange[0])[0]]
        raise InputError(f'line {line} of {name} has the sight "{strange[0]}"', "Write los, nlos or none")
    unknown = [a for a in dict.fromkeys(who.tolist()) if a not in known]
    if unknown:
        raise InputError(
            f"{name} has links to anchor {unknown[0]}, whose position is not given", "Add it to the anchors"
        )
    unused = [a for a in known if a not in set(who.tolist())]
    if unused:
        raise InputError(f"{name} has no link to anchor {unused[0]}", "Add its lines, or leave the anchor out")
    points, row = np.unique(table.positions(COLUMNS[:2]), axis=0, return_inverse=True)
    column = np.array([list(known).index(a) for a in who])
    sight = np.array([SIGHTS[w.lower()] for w in words])
    bias, deviation = (table.numbers(c, empty=True) for c in COLUMNS[4:])
    _refuse_empty(table, name, sight, bias, deviation)
    _refuse_holes(table, name, points, row, column, list(known))
    shape = (len(points), len(known))
    filled = []
    for values, empty in ((sight, UNREACHED), (bias, np.nan), (deviation, np.nan)):
        array = np.full(shape, empty)
        array[row, column] = values
        filled.append(array)
    return LinkTable.of(points, known, *filled)


def _refuse_empty(table: CsvTable, name: str, sight: Any, bias: Any, deviation: Any) -> None:
    for column, bad in (("bias_m", np.isnan(bias)), ("deviation_m", ~(deviation > 0))):
        wrong = np.flatnonzero(bad & (sight != UNREACHED))
        if wrong.size:
            which = "no positive deviation_m" if column == "deviation_m" else "no bias_m"
            raise InputError(
                f"line {table.lines[wrong[0]]} of {name} has {which}"
                + (f" (and {wrong.size - 1:,} more)" if wrong.size > 1 else ""),
                "Fill it in, in metres, or write sight = none where the anchor is not received",
            )


def _refuse_holes(table: CsvTable, name: str, points: Any, row: Any, column: Any, names: list[str]) -> None:
    count = np.zeros((len(points), len(names)), int)
    np.add.at(count, (row, column), 1)
    twice = np.argwhere(count > 1)
    if len(twice):
        i, m = twice[0]
        line = table.lines[np.flatnonzero((row == i) & (column == m))[1]]
        raise InputError(
            f"line {line} of {name} gives the link of {_text(points[i])} to {names[m]} a second time",
            "Keep one of the lines",
        )
    holes = np.argwhere(count == 0)
    if len(holes):
        i, m = holes[0]
        more = f" (and {len(holes) - 1:,} more links)" if len(holes) > 1 else ""
        raise InputError(
            f"{name} has no link of {_text(points[i])} to {names[m]}{more}",
            "Give a line for every point and anchor; where the anchor is not received, with sight = none",
        )


def _text(point: Any) -> str:
    return f"({point[0]:g}, {point[1]:g}) m"
