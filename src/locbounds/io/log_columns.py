"""What the columns of a log are called."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from locbounds.errors import InputError

C = TypeVar("C", bound=Any)


@dataclass(frozen=True)
class RangeColumns:
    """Column names of the ranges: one line per range."""

    track: str = "track_id"
    step: str = "step"
    time: str = "time_s"
    anchor: str = "anchor_id"
    range: str = "range_m"


@dataclass(frozen=True)
class AnchorColumns:
    """Column names of the anchors; ``z`` is optional, ``track`` too: without it they stand still."""

    track: str = "track_id"
    anchor: str = "anchor_id"
    x: str = "x_m"
    y: str = "y_m"
    z: str = "z_m"


@dataclass(frozen=True)
class TruthColumns:
    """Column names of the true positions; ``z`` is optional, ``step`` too if the ranges have times."""

    track: str = "track_id"
    step: str = "step"
    time: str = "time_s"
    x: str = "x_true_m"
    y: str = "y_true_m"
    z: str = "z_true_m"


@dataclass(frozen=True)
class LogColumns:
    """Column names of all files of a log; the defaults are those of the example data.

    Examples
    --------
    >>> LogColumns.parse(["ranges.range=dist", "truth.time=t"]).ranges.range
    'dist'
    """

    ranges: RangeColumns = RangeColumns()
    anchors: AnchorColumns = AnchorColumns()
    truth: TruthColumns = TruthColumns()

    @classmethod
    def parse(cls, options: list[str] | tuple[str, ...]) -> LogColumns:
        """From options such as ``ranges.range=dist`` (file, key, column in the file)."""
        return renamed(cls(), options)


def renamed(columns: C, options: list[str] | tuple[str, ...]) -> C:
    """Column names after options such as ``ranges.range=dist`` (file, key, column in the file)."""
    for option in options:
        key, equals, name = option.partition("=")
        file, dot, part = key.partition(".")
        known = [f"{f.name}.{p.name}" for f in fields(columns) for p in fields(getattr(columns, f.name))]
        if not (equals and dot and name) or key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.3)
            raise InputError(
                f'column mapping "{option}" is not FILE.KEY=COLUMN with a known key',
                f"Did you mean {near[0]}=...?" if near else f"Keys: {', '.join(known)}",
            )
        columns = replace(columns, **{file: replace(getattr(columns, file), **{part: name})})
    return columns
