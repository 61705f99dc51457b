"""Columns that say which ranges are LOS."""

import numpy as np

from locbounds.axes import Int, ndarray
from locbounds.errors import InputError
from locbounds.io.csv_table import CsvTable

LABELS = {"los": 0, "nlos": 1, "": -1, "unknown": -1}
"""What a label cell may say, in upper or lower case."""
YES, NO = ("1", "true", "yes"), ("0", "false", "no")


def read_labels(table: CsvTable, column: str) -> Int[ndarray, " rows"]:
    """0 for LOS, 1 for NLOS, -1 for unknown.

    Cells say ``los`` or ``nlos``; in a column that is called ``los`` or ``nlos`` also 1 or 0, true or false, yes or no.

    Raises
    ------
    InputError
        No such column, or a cell that says something else.
    """
    table.need(column, "label")
    text = table.text(column, empty=True)
    known = dict(LABELS)
    if (name := column.strip().lower()) in ("los", "nlos"):
        known |= dict.fromkeys(YES, LABELS[name]) | dict.fromkeys(NO, 1 - LABELS[name])
    values = np.array([known.get(cell.strip().lower(), -2) for cell in text])
    bad = np.flatnonzero(values == -2)
    if bad.size:
        raise InputError(
            f'line {table.lines[bad[0]]} of {table.path.name}, column {column}, says "{text[bad[0]]}"',
            "Labels are los, nlos or empty; 1 and 0 only in a column that is called los or nlos",
        )
    return values
