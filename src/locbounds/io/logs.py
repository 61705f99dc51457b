"""Reading range logs: ranges, anchors and true positions from CSV files."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.fit.clock import Stamped, bursts, estimate_offset
from locbounds.fit.range_log import RangeLog, Track
from locbounds.io.csv_table import CsvTable
from locbounds.io.log_columns import AnchorColumns, LogColumns, TruthColumns
from locbounds.io.sight_labels import read_labels

MERGE_HINT = 1.5  # ranges per step below which anchors seem to report one after the other
MERGE_HINT_RANGES = 100
OTHER_UNIT = 100.0  # ranges this many times larger than all positions' extent cannot be in the same unit
OTHER_UNITS = {"millimetres": 1e3, "centimetres": 1e2, "kilometres": 1e-3} | {
    "microseconds": 1 / 299.792458,
    "feet or nanoseconds": 3.3,  # 3.281 and 3.336
    "negative metres": -1.0,
}
FEWEST = 5  # ranges of one anchor from which a unit can be told
AGREES = 0.2  # another unit is meant if the median error shrinks to less than this share with it
DEGREES_SPREAD = 0.1
"""Positions that differ by less than this over a whole log look like degrees."""


def read_log(
    ranges: str | Path,
    *,
    anchors: str | Path,
    truth: str | Path | None = None,
    columns: LogColumns | None = None,
    select: str | Mapping[str, str] | None = None,
    time_offset_s: float | str = 0.0,
    merge_s: float = 0.0,
    every: int = 1,
    labels: str | None = None,
    dim: int | None = None,
) -> RangeLog:
    r"""Read a log of ranges.

    Parameters
    ----------
    ranges, anchors, truth : path
        CSV files (also .gz).  Without a column ``track`` everything is one track.  Anchors with such a column stand
        where it says along that track.
    columns : LogColumns
        Column names.
    select : str or mapping
        ``"scene=canteen"``: only these rows, of every file that has the column; several separated by commas.
    time_offset_s : float or "auto"
        Added to the times of the ranges before they are compared with the truth's, s; ``"auto"`` takes the one at which
        the range errors spread least (see `locbounds.fit.clock.estimate_offset`) and says so in the notes.
    merge_s : float
        Ranges of different anchors within this many seconds of the first one make one step, at their mean time; for
        anchors that report one after the other.  By default every time is a step.
    every : int
        Keep the ranges of every so many steps of a track only: 5 for one in five, where successive errors repeat.
    labels : str, optional
        Column of the ranges, or of the truth, that says ``los`` or ``nlos`` (empty: unknown); that of the truth holds
        for the ranges nearest in time, or of the same step.
    dim : int, optional
        2 leaves heights out.  Default: 3 if anchors and truth have heights, 2 if neither has.

    Returns
    -------
    RangeLog
        If the ranges have times, these are the steps, and the true positions are interpolated to them; ranges before
        or after the truth are left out (with a note).  Otherwise ranges and truth are joined on (track, step), and the
        truth's rows are the steps.  Step 0 is the first of a track; its ranges are not used.

    Raises
    ------
    InputError
        Cells that are no numbers, times out of order or twice, unknown anchors, degrees, missing columns, empty files.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     folder = Path(name)
    ...     _ = (folder / "anchors.csv").write_text("anchor_id,x_m,y_m\na,0,0\nb,9,0\n")
    ...     _ = (folder / "truth.csv").write_text("step,time_s,x_true_m,y_true_m\n0,0,3,4\n1,0.5,3,5\n")
    ...     _ = (folder / "ranges.csv").write_text("step,anchor_id,range_m\n1,a,6.1\n1,b,8.0\n")
    ...     log = read_log(folder / "ranges.csv", anchors=folder / "anchors.csv", truth=folder / "truth.csv")
    >>> log.anchor_names, log.tracks[0].ranges_m.tolist()
    (('a', 'b'), [[6.1, 8.0]])
    """
    columns = columns or LogColumns()
    tables = {"ranges": CsvTable(ranges, "ranges"), "anchors": CsvTable(anchors, "anchors")}
    if truth is not None:
        tables["truth"] = CsvTable(truth, "truth")
    selected = select_rows(tables, select)
    notes: list[str] = []

    names, places, own = anchor_places(
        tables["anchors"], columns.anchors, tables.get("truth"), columns.truth, dim, notes
    )
    r, c = tables["ranges"], columns.ranges
    r.need(c.anchor, "anchor")
    r.need(c.range, "range")
    timed = c.time in r
    _check_clock(r, c, timed, truth, time_offset_s, merge_s)
    true = _truth(tables.get("truth"), columns.truth, places.shape[1], steps=not timed, notes=notes)
    frame: Any = pd.DataFrame(
        {
            "track": r.text(c.track) if c.track in r else "",
            "time": r.numbers(c.time if timed else c.step),
            "anchor": r.text(c.anchor),
            "range": r.numbers(c.range),
            "line": r.lines,
        }
    )
    in_ranges = labels is not None and (labels in r or true is None)
    frame["sight"] = read_labels(r, labels) if labels is not None and in_ranges else -1
    if selected and true is not None:
        frame = frame[frame["track"].isin(list(true))]
        if frame.empty:
            raise InputError(f"no range belongs to a track of {select}", "Compare the track names of both files")
    _check_rows(frame, names, r, anchors, timed)
    heard = set(frame["anchor"])
    silent = [name for name in names if name not in heard]
    if silent:
        notes.append(f"Anchors without any range are left out: {', '.join(silent)}.")
        kept = [name in heard for name in names]
        places, own = places[kept], {track: place[kept] for track, place in own.items()}
        names = [name for name in names if name in heard]
    if len(frame) == 1:
        raise InputError("the log has one range", "Give a log of a moving device, with many ranges per anchor")
    if timed:
        offset = time_offset_s
        if isinstance(offset, str):
            offset = _estimated_offset(frame, names, places, own, true or {}, notes)
        frame = _as_steps(frame.assign(time=frame["time"] + offset), names, merge_s, notes)
    if every != 1:
        frame = _thinned(frame, every, notes)
    frame = frame.assign(key=frame["time"])
    if labels is not None and not in_ranges:
        frame["sight"] = _labels_of_truth(frame, tables["truth"], columns.truth, labels, timed)
    tracks = []
    for name, rows in frame.groupby("track", sort=False):
        found = _track(str(name), rows, names, None if true is None else true.get(str(name)), timed, notes)
        if found is not None:
            tracks.append(replace(found, anchors_m=own.get(str(name)) if own else None))
    if not tracks:
        raise InputError("no range has a true position", "Compare track names, steps and times of both files")
    if labels is None:
        tracks = [replace(track, sight=None) for track in tracks]
    _refuse_other_units(names, places, tracks, notes)
    return RangeLog(tuple(names), places, tuple(tracks), tuple(notes))


def _check_clock(r: CsvTable, c, timed: bool, truth, time_offset_s: float | str, merge_s: float) -> None:
    """Refuse clock options that the files cannot serve."""
    if isinstance(time_offset_s, str) and time_offset_s != "auto":
        raise InputError(f'the time offset is "{time_offset_s}"', "Give seconds, or auto")
    if not (np.isfinite(merge_s) and merge_s >= 0):
        raise InputError(f"ranges within {merge_s} s are to be merged", "Give seconds, zero or more")
    if timed:
        if time_offset_s == "auto" and truth is None:
            raise InputError("a time offset can only be estimated against a truth", "Give the truth file")
        return
    r.need(c.step, "step")
    if truth is None:
        raise InputError(
            f"{r.path.name} has steps but no times, and there is no truth file to look them up",
            f"Give the truth file, or a column {c.time} in the ranges",
        )
    for what, value in (("a time offset", time_offset_s), ("a time to merge within", merge_s)):
        if value:
            raise InputError(
                f"{what} of {value} s was given, but {r.path.name} has no times",
                f"Leave it out, or give a column {c.time} in the ranges",
            )


def _estimated_offset(frame: Any, names: list[str], places, own, true, notes: list[str]) -> float:
    stamped = []
    for name, rows in frame.groupby("track", sort=False):
        if str(name) in true:
            t, x, _ = true[str(name)]
            link = pd.Categorical(rows["anchor"], categories=names).codes.astype(int)
            at = own.get(str(name), places)[link]
            stamped.append(Stamped(rows["time"].to_numpy(), rows["range"].to_numpy(), at, link, t, x))
    offset = estimate_offset(stamped)
    error = f", s.e. {offset.stderr_s:.2g} s" if np.isfinite(offset.stderr_s) else ""
    each = ", ".join(f"{x:.3f}" for x in offset.by_track_s)
    notes.append(f"The time offset was estimated as {offset.value_s:.3f} s{error} (by track: {each}).")
    return offset.value_s


def _as_steps(frame: Any, names: list[str], merge_s: float, notes: list[str]) -> Any:
    """The ranges with the time of their step; bursts within ``merge_s`` make one step."""
    if not merge_s:
        times = len(frame.groupby(["track", "time"]))
        if len(names) > 1 and MERGE_HINT_RANGES <= len(frame) < MERGE_HINT * times:
            notes.append(
                f"A step has {len(frame) / times:.1f} ranges of {len(names)} anchors on average: if they report one "
                "after the other, merge their bursts (--merge S)."
            )
        return frame
    step = np.empty(len(frame), int)
    first = 0
    for rows in frame.reset_index(drop=True).groupby("track", sort=False).groups.values():
        part = frame.iloc[rows]
        link = pd.Categorical(part["anchor"], categories=names).codes
        step[rows] = first + bursts(part["time"].to_numpy(), link, merge_s)
        first = step[rows].max() + 1
    middle = frame.groupby(step)["time"].transform("mean").to_numpy()
    short = middle.round(6)  # microseconds, unless that makes two steps one
    merged = frame.assign(time=short if len(np.unique(short)) == len(np.unique(middle)) else middle)
    notes.append(f"{len(frame):,} ranges within {merge_s:g} s of each other were merged into {first:,} steps.")
    return merged


def _thinned(frame: Any, every: int, notes: list[str]) -> Any:
    """One in so many steps of every track."""
    if every < 1 or int(every) != every:
        raise InputError(f"every {every} steps are to be kept", "Give a whole number of at least 1")
    number = frame.groupby("track", sort=False)["time"].rank(method="dense").to_numpy() - 1
    kept = frame[number % every == 0]
    notes.append(f"{len(kept):,} of {len(frame):,} ranges were kept: those of one step in {every}.")
    return kept


def _labels_of_truth(frame: Any, table: CsvTable, c: TruthColumns, labels: str, timed: bool) -> ndarray:
    """Label of the true position that is nearest in time, or of the same step, for every range; -1 where none is."""
    sight = read_labels(table, labels)
    track = table.text(c.track) if c.track in table else np.full(len(table), "", dtype=object)
    key = table.numbers(c.time if timed else c.step)
    found = np.full(len(frame), -1)
    owner, at = frame["track"].to_numpy(), frame["key"].to_numpy()
    for name in set(owner.tolist()) & set(track.tolist()):
        mine, rows = np.flatnonzero(owner == name), np.flatnonzero(track == name)
        rows = rows[np.argsort(key[rows])]
        right = np.clip(np.searchsorted(key[rows], at[mine]), 1, max(len(rows) - 1, 1))
        left = right - 1
        right = np.minimum(right, len(rows) - 1)
        near = np.where(at[mine] - key[rows[left]] <= key[rows[right]] - at[mine], left, right)
        exact = timed | (key[rows[near]] == at[mine])
        found[mine] = np.where(exact, sight[rows[near]], -1)
    return found


def _refuse_other_units(names: list[str], places: Float[ndarray, "n space"], tracks: list[Track], notes) -> None:
    """Refuse positions and ranges that cannot both be metres, of any anchor; remark on single odd ranges."""
    everything = np.concatenate([places, *(t.position_m for t in tracks if t.position_m is not None)])
    extent = float(np.ptp(everything, axis=0).max())
    ranges = np.concatenate([t.ranges_m for t in tracks])
    typical = float(np.nanmedian(np.abs(ranges)))
    remedy = "Convert positions to metres in a local plane and ranges to metres"
    if all(t.position_m is not None for t in tracks):
        distance = np.concatenate([_distances(places, t) for t in tracks])
        for m, name in enumerate(names):
            there = np.isfinite(ranges[:, m])
            unit = other_unit(ranges[there, m], distance[there, m]) if there.sum() >= FEWEST else ""
            if unit:
                raise InputError(
                    f"the ranges to anchor {name} look like {unit}: about {np.median(ranges[there, m]):.4g}, where the "
                    f"true distances are about {np.median(distance[there, m]):.3g} m",
                    remedy,
                )
    elif np.nanmean(ranges < 0) > 0.5:
        raise InputError("most ranges are negative", "Give distances in metres; check the sign")
    if typical > OTHER_UNIT * extent > 0:
        raise InputError(
            f"ranges are about {typical:.4g} m, but all positions lie within {extent:.3g} m: one of them is not in "
            "metres (positions in degrees? ranges in millimetres?)",
            remedy,
        )
    below, beyond = np.sum(ranges < 0), np.sum(np.abs(ranges) > OTHER_UNIT * extent) if extent > 0 else 0
    if below:
        notes.append(
            f"{below:,} of {np.isfinite(ranges).sum():,} ranges are negative, down to {np.nanmin(ranges):.3g} m; they "
            "are kept: a device that subtracts a delay gives such ranges close to an anchor."
        )
    if beyond:
        notes.append(
            f"{beyond:,} ranges are longer than {OTHER_UNIT * extent:.3g} m, {OTHER_UNIT:g} times the extent of all "
            "positions: are some rows in another unit?"
        )


def _distances(places: Float[ndarray, "n space"], track: Track) -> Float[ndarray, "steps n"]:
    anchors = places if track.anchors_m is None else track.anchors_m
    return np.linalg.norm(np.asarray(track.position_m)[1:, None] - anchors, axis=-1)


def other_unit(values: Float[ndarray, " n"], distance: Float[ndarray, " n"]) -> str:
    """The unit in which ranges agree far better with true distances than in metres; empty if in none.

    >>> other_unit(np.array([5000.0, 7100.0]), np.array([5.1, 7.0])), other_unit(np.array([5.3]), np.array([5.0]))
    ('millimetres', '')
    """
    if not len(values):
        return ""
    left = {unit: np.median(np.abs(values / factor - distance)) for unit, factor in OTHER_UNITS.items()}
    best = min(left, key=lambda unit: left[unit])
    return best if left[best] < AGREES * np.median(np.abs(values - distance)) else ""


def select_rows(tables: Mapping[str, CsvTable], select: str | Mapping[str, str] | None) -> bool:
    """Keep the rows that are selected, of every table that has the column; whether anything was asked for."""
    if not select:
        return False
    if isinstance(select, str):
        pairs = [part.partition("=") for part in select.split(",")]
        if not all(equals and column.strip() for column, equals, _ in pairs):
            raise InputError(f'selection "{select}" is not COLUMN=VALUE', "For example --select scene=canteen")
        select = {column.strip(): value.strip() for column, _, value in pairs}
    for column, value in select.items():
        having = [table for table in tables.values() if column in table]
        if not having:
            known = sorted({name for table in tables.values() for name in table.names})
            near = difflib.get_close_matches(column, known, n=1)
            raise InputError(
                f"no file has a column {column} to select by",
                f"Did you mean {near[0]}?" if near else f"The columns are {', '.join(known)}",
            )
        for table in having:
            table.select(column, value)
    return True


def anchor_places(table: CsvTable, c: AnchorColumns, truth: CsvTable | None, tc: TruthColumns, dim: int | None, notes):
    """Names and positions of the anchors, and their positions per track where these differ."""
    table.need(c.anchor, "anchor")
    table.need(c.x, "x")
    table.need(c.y, "y")
    heights = c.z in table, tc.z in truth if truth is not None else c.z in table
    if dim not in (None, 2, 3):
        raise InputError(f"dim is {dim}", "Choose 2 or 3")
    if dim is None and heights[0] != heights[1]:
        have, lack = ("anchors", "truth") if heights[0] else ("truth", "anchors")
        raise InputError(
            f"the {have} file has heights, the {lack} file has none",
            f"Give heights in both, or dim=2 (--dim 2) if all ranges are horizontal distances; "
            f"the {lack} column would be {tc.z if have == 'anchors' else c.z}",
        )
    use = (3 if all(heights) else 2) if dim is None else dim
    if use == 3:
        table.need(c.z, "z")
    column = table.text(c.anchor)
    places = table.positions((c.x, c.y, c.z)[:use])
    _note_degrees(table, (c.x, c.y), places, notes)
    names = list(dict.fromkeys(column.tolist()))
    track = table.text(c.track) if c.track in table else np.full(len(table), "", dtype=object)
    twice = pd.DataFrame({"track": track, "anchor": column}).duplicated().to_numpy()
    if twice.any():
        others = [n for n in table.names if n not in (c.anchor, c.x, c.y, c.z)]
        remedy = f"Choose one with --select {others[0]}=VALUE" if others else "Give every anchor its own name"
        raise InputError(f"anchor {column[twice][0]} is in {table.path.name} more than once", remedy)
    first = np.stack([places[column == name][0] for name in names])
    own = {}
    for t in dict.fromkeys(track.tolist()) if c.track in table else ():
        mine = {name: place for name, place, of in zip(column, places, track, strict=True) if of == t}
        own[str(t)] = np.stack([mine.get(name, place) for name, place in zip(names, first, strict=True)])
    if all(np.array_equal(place, first) for place in own.values()):
        own = {}
    return names, first, own


def _note_degrees(table: CsvTable, columns: tuple[str, str], places: Float[ndarray, "n space"], notes) -> None:
    x, y = places[:, 0], places[:, 1]
    small = len(x) > 1 and np.ptp(x) < DEGREES_SPREAD and np.ptp(y) < DEGREES_SPREAD and np.ptp(places[:, :2]) > 0
    long = all(np.mean(table.decimals(c) >= 5) > 0.5 for c in columns)
    if small and long and np.abs(x).max() <= 180 and np.abs(y).max() <= 180:
        notes.append(
            f"Positions in {table.path.name} differ by less than {DEGREES_SPREAD} and have many decimals: "
            "are they degrees? Metres are expected."
        )


def _truth(table: CsvTable | None, c: TruthColumns, dim: int, *, steps: bool, notes):
    """Rows of the truth per track: time, positions and steps, checked."""
    if table is None:
        return None
    for column, key in ((c.x, "x"), (c.y, "y"), (c.time, "time"), *([(c.z, "z")] if dim == 3 else [])):
        table.need(column, key)
    if steps:
        table.need(c.step, "step")
    track = table.text(c.track) if c.track in table else np.full(len(table), "", dtype=object)
    places = table.positions((c.x, c.y, c.z)[:dim])
    _note_degrees(table, (c.x, c.y), places, notes)
    time = table.numbers(c.time)
    step = table.numbers(c.step) if steps else np.arange(len(table), dtype=float)
    found = {}
    for name in dict.fromkeys(track.tolist()):
        rows = np.flatnonzero(track == name)
        t = time[rows]
        bad = np.flatnonzero(~(np.diff(t) > 0))
        if bad.size:
            k = rows[bad[0] + 1]
            what = "repeats the time before" if t[bad[0] + 1] == t[bad[0]] else "goes back in time"
            raise InputError(
                f"line {table.lines[k]} of {table.path.name} (track {name or 1}, {c.time} = {time[k]:g}) {what}",
                "Sort each track by time and delete repeated times",
            )
        if len(np.unique(step[rows])) < len(rows):
            raise InputError(f"track {name or 1} of {table.path.name} repeats a step", "Give every step once per track")
        found[str(name)] = (t, places[rows], step[rows])
    return found


def _check_rows(frame: Any, names: list[str], table: CsvTable, anchors: str | Path, timed: bool) -> None:
    unknown = frame[~frame["anchor"].isin(names)]
    if len(unknown):
        row = unknown.iloc[0]
        raise InputError(
            f"line {row['line']} of {table.path.name} is a range to anchor {row['anchor']}, which is not in "
            f"{Path(anchors).name}",
            f"Add its position; the anchors there are {', '.join(names[:12])}{', ...' if len(names) > 12 else ''}",
        )
    twice = frame[frame.duplicated(["track", "time", "anchor"])]
    if len(twice):
        row = twice.iloc[0]
        raise InputError(
            f"line {row['line']} of {table.path.name} is a second range to anchor {row['anchor']} at the same "
            f"{'time' if timed else 'step'} of a track",
            "Delete one of them",
        )
    if timed:
        back = frame[frame.groupby("track", sort=False)["time"].diff() < 0]
        if len(back):
            raise InputError(
                f"line {back.iloc[0]['line']} of {table.path.name} goes back in time", "Sort each track by time"
            )


def _track(name: str, rows: Any, names: list[str], true, timed: bool, notes) -> Track | None:
    shown = name or "1"
    if true is None and timed:
        key = np.unique(rows["key"].to_numpy())
        time, places = key, None
    elif true is None:
        notes.append(f"Track {shown} has no true positions and is left out.")
        return None
    else:
        t, x, step = true
        if timed:
            key = np.unique(rows["key"].to_numpy())
            key = key[(key >= t[0]) & (key <= t[-1])]
            time, places = key, np.stack([np.interp(key, t, column) for column in x.T], axis=1)
        else:
            order = np.argsort(step)
            if (np.diff(order) < 0).any():
                raise InputError(f"the steps of track {shown} do not increase with time", "Number them in time order")
            key, time, places = step, t, x
    if len(key) < 2:
        notes.append(f"Track {shown} has fewer than two times with a true position and is left out.")
        return None
    at = np.searchsorted(key, rows["key"].to_numpy())
    there = (at < len(key)) & (key[np.minimum(at, len(key) - 1)] == rows["key"].to_numpy())
    if not there.all():
        outside = "before or after its true positions" if timed else "at steps that the truth does not have"
        notes.append(f"Track {shown}: {(~there).sum():,} of {len(there):,} ranges are left out, {outside}.")
    link = pd.Categorical(rows["anchor"], categories=names).codes
    z, sight = np.full((len(key), len(names)), np.nan), np.full((len(key), len(names)), -1)
    z[at[there], link[there]] = rows["range"].to_numpy()[there]
    sight[at[there], link[there]] = rows["sight"].to_numpy()[there]
    raw = (true[0], true[1]) if timed and true is not None else (None, None)
    return Track(shown, time, z[1:], places, sight[1:], None, *raw)
