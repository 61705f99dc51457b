"""Options of the commands that read a log of ranges."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from locbounds.errors import InputError

if TYPE_CHECKING:
    from locbounds.fit import RangeLog

RangesOption = Annotated[
    Path | None, typer.Option("--ranges", metavar="CSV", help="Measured ranges (.csv or .csv.gz).")
]
AnchorsOption = Annotated[Path | None, typer.Option("--anchors", metavar="CSV", help="Anchor positions.")]
TruthOption = Annotated[Path | None, typer.Option("--truth", metavar="CSV", help="True positions.")]
SelectOption = Annotated[
    str | None, typer.Option("--select", metavar="COLUMN=VALUE", help="Only these rows, e.g. scene=canteen.")
]
HoldOutOption = Annotated[
    str | None,
    typer.Option(
        "--hold-out",
        metavar="TRACKS",
        help="Tracks kept from the fit: names, or a number (the last ones); points also by COLUMN=VALUE.",
    ),
]
TimeOffsetOption = Annotated[
    str, typer.Option("--time-offset", metavar="S|auto", help="Seconds added to the times of the ranges, or auto.")
]
MergeOption = Annotated[
    float,
    typer.Option("--merge", metavar="S", min=0, help="Ranges of different anchors within S seconds make one step."),
]
EveryOption = Annotated[
    int, typer.Option("--every", metavar="N", min=1, help="Keep the ranges of every N-th step only.")
]
LabelsOption = Annotated[
    str | None, typer.Option("--labels", metavar="COLUMN", help="Column (ranges or truth) that says los or nlos.")
]
ErrorsOption = Annotated[
    str | None,
    typer.Option("--errors", metavar="COLUMN", help="Column of the ranges that holds their errors; no other files."),
]
DistanceOption = Annotated[
    str | None,
    typer.Option("--distance", metavar="COLUMN", help="Column of the ranges with true distances; no other files."),
]
PointsOption = Annotated[
    str | None,
    typer.Option("--points", metavar="COLUMN", help="Ranges at fixed points: column (ranges, truth) that names them."),
]
ColumnsOption = Annotated[
    list[str] | None,
    typer.Option("--column", metavar="FILE.KEY=NAME", help="Own column names, e.g. ranges.range=dist; repeatable."),
]


def read(
    ranges: Path | None,
    anchors: Path | None,
    truth: Path | None,
    select: str | None,
    time_offset: str,
    merge: float,
    every: int,
    columns: list[str] | None,
    labels: str | None,
) -> "RangeLog":
    """The log that these options describe; an InputError names the file that is missing."""
    from locbounds.io.log_columns import LogColumns
    from locbounds.io.logs import read_log

    missing = [
        name for name, path in (("--ranges", ranges), ("--anchors", anchors), ("--truth", truth)) if path is None
    ]
    if ranges is None or anchors is None or truth is None:
        raise InputError(f"a log needs three files: {', '.join(missing)} missing", "Give ranges, anchors and truth")
    return read_log(
        ranges,
        anchors=anchors,
        truth=truth,
        columns=LogColumns.parse(columns or []),
        select=select,
        time_offset_s=_offset(time_offset),
        merge_s=merge,
        every=every,
        labels=labels,
    )


def _offset(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
