"""CSV tables read so that every bad cell is named by line and column."""

from __future__ import annotations

import difflib
import gzip
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from locbounds.axes import Float, Int, ndarray
from locbounds.errors import InputError

_ANGLE = re.compile(r"^(lat|latitude|lon|long|lng|longitude)([_ .(\[]|$)|(^|[_ ])deg(rees?)?$", re.IGNORECASE)

_WHOLE = re.compile(r"^(-?\d+)\.0+$")


def is_angle(column: str) -> bool:
    """Whether a column name says degrees.

    >>> [name for name in ("lat", "Longitude_deg", "x_m", "latency_s", "lon (deg)") if is_angle(name)]
    ['lat', 'Longitude_deg', 'lon (deg)']
    """
    return bool(_ANGLE.search(column.strip()))


class CsvTable:
    """A CSV file (also .gz), as text until a column is asked for.

    Parameters
    ----------
    path
        With a header line; separated by commas, semicolons or tabs.
    what
        What the file is to the user, for messages: "ranges".

    Raises
    ------
    InputError
        If the file is missing, unreadable or has no rows.
    """

    def __init__(self, path: str | Path, what: str):
        self.path, self.what = Path(path), what
        try:
            with (gzip.open if self.path.suffix == ".gz" else open)(self.path, "rt", encoding="utf-8-sig") as file:
                header = file.readline()
                separator = max(",;\t", key=header.count)
                names = [name.strip().strip('"') for name in header.rstrip("\r\n").split(separator)]
                twice = [name for name in names if names.count(name) > 1]
                if twice:
                    raise InputError(f"{self.path.name} has two columns {twice[0]}", "Give every column its own name")
                # Blank lines are kept while reading, so that the row index tells the line in the file.
                frame: Any = pd.read_csv(
                    file, sep=separator, names=names, dtype=str, skip_blank_lines=False, keep_default_na=False,
                    na_values=[""], skipinitialspace=True, index_col=False,
                )  # fmt: skip
        except FileNotFoundError:
            raise InputError(f"the {what} file {self.path} does not exist", "Check the path") from None
        except pd.errors.EmptyDataError:
            frame = pd.DataFrame()
        except (OSError, EOFError, UnicodeDecodeError, pd.errors.ParserError) as error:
            raise InputError(
                f"the {what} file {self.path} cannot be read: {' '.join(str(error).split())}",
                "Give a text file of comma-separated values in UTF-8 (or such a file compressed as .gz)",
            ) from None
        frame = frame.dropna(how="all")
        self._cells: dict[str, ndarray] = {str(name): frame[name].to_numpy(dtype=object) for name in frame.columns}
        self._lines = np.asarray(frame.index, int) + 2
        if not len(self):
            raise InputError(
                f"the {what} file {self.path.name} has no rows", "Give a header line and a line for every value"
            )

    @property
    def names(self) -> list[str]:
        """Column names."""
        return list(self._cells)

    def __contains__(self, column: str) -> bool:
        return column in self._cells

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def lines(self) -> Int[ndarray, " rows"]:
        """Line in the file of every row that is selected; the header is line 1."""
        return self._lines

    def need(self, column: str, option: str) -> None:
        """Raise an InputError with the nearest name unless there is a column that is not in degrees."""
        angles = [name for name in self.names if is_angle(name)]
        if column in self and not is_angle(column):
            return
        if column in self or (option.startswith(("x", "y")) and angles):
            raise InputError(
                f"{self.path.name} gives positions in degrees (column {column if column in self else angles[0]}), "
                "where metres are expected",
                "Project them to local metres first (east, north), for example with pyproj",
            )
        near = difflib.get_close_matches(column, self.names, n=1, cutoff=0.4)
        nearest = f"the nearest name is {near[0]}" if near else f"it has {', '.join(self.names)}"
        raise InputError(
            f"{self.path.name} has no column {column}; {nearest}",
            f"Rename the column or map it: --column {self.what}.{option}={near[0] if near else 'NAME'}",
        )

    def select(self, column: str, value: str) -> None:
        """Keep the rows where a column has a value."""
        values = self.text(column)
        keep = values == value
        if not keep.any():
            known = list(dict.fromkeys(values.tolist()))
            raise InputError(
                f"{self.path.name} has no row with {column} = {value}",
                f"It has {', '.join(known[:8])}{', ...' if len(known) > 8 else ''}",
            )
        self._cells = {name: cells[keep] for name, cells in self._cells.items()}
        self._lines = self._lines[keep]

    def text(self, column: str, *, empty: bool = False) -> ndarray:
        """A column as text; names such as 3.0 lose their zeros, so that they match 3 in another file.

        With ``empty``, cells may be empty; otherwise an InputError names the first line where one is.
        """
        cells = self._cells[column]
        missing = np.flatnonzero(pd.isna(cells))
        if missing.size and not empty:
            raise InputError(
                f"line {self.lines[missing[0]]} of {self.path.name} has no {column}", "Fill it in or delete the line"
            )
        unique: dict[Any, str] = {c: "" if pd.isna(c) else _WHOLE.sub(r"\1", c.strip()) for c in set(cells.tolist())}
        return np.array([unique[c] for c in cells], dtype=object)

    def numbers(self, column: str, *, empty: bool = False) -> Float[ndarray, " rows"]:
        """A column as finite numbers; with ``empty``, cells may be empty (NaN).

        Raises
        ------
        InputError
            Naming line, column and text of the first cell that is none.
        """
        cells: Any = self._cells[column]
        values = np.asarray(pd.to_numeric(cells, errors="coerce"), dtype=float)
        bad = np.flatnonzero(~np.isfinite(values) & ~(pd.isna(cells) if empty else False))
        if bad.size:
            cell = cells[bad[0]]
            shown = "empty" if pd.isna(cell) else f'"{cell}"'
            more = f" (and {bad.size - 1:,} more)" if bad.size > 1 else ""
            raise InputError(
                f"line {self.lines[bad[0]]} of {self.path.name}, column {column}, is {shown}{more}: not a number",
                "Correct it, or leave the cell empty"
                if empty
                else "Correct it, or delete the line: a missing range is a line that is not there",
            )
        return values

    def positions(self, columns: Iterable[str]) -> Float[ndarray, "rows space"]:
        """Coordinate columns as numbers."""
        return np.column_stack([self.numbers(column) for column in columns])

    def decimals(self, column: str) -> Int[ndarray, " rows"]:
        """How many decimals the numbers of a column are written with."""
        return np.array([len(str(cell).strip().partition(".")[2]) for cell in self._cells[column]])
