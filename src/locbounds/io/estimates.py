"""Reading what a filter in another language made of simulated runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from locbounds.axes import Array, Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.io.csv_table import CsvTable
from locbounds.io.log_columns import TruthColumns
from locbounds.io.runs import truth_columns
from locbounds.scenario import Scenario

ARRAY_KEYS = ("estimates", "states", "position_m", "mean")
SAME_TIME = 1e-3  # of the shortest interval


@dataclass(frozen=True)
class EstimateColumns:
    """Column names of estimates: one line per run and step."""

    track: str = "track_id"
    step: str = "step"
    time: str = "time_s"
    x: str = "x_m"
    y: str = "y_m"
    z: str = "z_m"


@dataclass(frozen=True)
class ScoreColumns:
    """Column names of estimates and truth."""

    estimates: EstimateColumns = EstimateColumns()
    truth: TruthColumns = field(default_factory=TruthColumns)


class Runs(NamedTuple):
    """States or positions of many runs.

    Attributes
    ----------
    values
        [runs, steps+1 or steps, space or state].
    names
        Names of the runs in their order; empty where the file has none (arrays).
    covariance
        [runs, steps+1, state, state] or None.
    """

    values: Float[Array, "runs n components"]
    names: tuple[str, ...] = ()
    covariance: Float[Array, "runs n components components"] | None = None


def read_estimates(path: str | Path, scenario: Scenario, columns: EstimateColumns | None = None) -> Runs:
    r"""Estimates from a file.

    Parameters
    ----------
    path
        ``.csv`` (also ``.gz``): ``track_id`` (left out: one run), ``step`` or ``time_s``, ``x_m``, ``y_m`` (``z_m``)
        and optionally every other state component by its name (``vx_m_s``); all steps 1..K of every run, step 0
        optional. ``.npy``: the array. ``.npz``: the array ``estimates`` (or the only one), and ``covariance`` if
        there is one.
    scenario
        What the ranges were drawn from.

    Raises
    ------
    InputError
        Naming line and column, or run and step, of what is missing, repeated or no number.

    Examples
    --------
    >>> import tempfile, locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=2)
    >>> path = Path(tempfile.mkdtemp()) / "mine.csv"
    >>> _ = path.write_text("track_id,step,x_m,y_m\n0,1,500,501\n0,2,502,503\n1,1,510,511\n1,2,512,513\n")
    >>> read_estimates(path, scenario).values.shape
    (2, 2, 2)
    """
    c = columns or EstimateColumns()
    whole = [f"{'xyz'[scenario.motion.position_index.index(i)]}_m" if i in scenario.motion.position_index else name
             for i, name in enumerate(scenario.motion.state_names)]  # fmt: skip
    return _read(path, "estimates", scenario, c, whole, ARRAY_KEYS)


def read_truth(path: str | Path, scenario: Scenario, columns: TruthColumns | None = None) -> Runs:
    """True tracks from a file as ``locbounds simulate`` writes it, or from the folder that holds it."""
    path = Path(path)
    if path.is_dir():
        found = [path / name for name in ("truth.npz", "truth.csv") if (path / name).exists()]
        if not found:
            raise InputError(f"{path} has neither truth.npz nor truth.csv", "Name the folder of locbounds simulate")
        path = found[0]
    keys = ("state_true", "position_true_m", "truth")
    return _read(path, "truth", scenario, columns or TruthColumns(), truth_columns(scenario), keys)


def _read(path: str | Path, what: str, scenario: Scenario, c, whole: list[str], keys: tuple[str, ...]) -> Runs:
    path = Path(path)
    if path.suffix not in (".npy", ".npz"):
        return _from_csv(CsvTable(path, what), scenario, c, whole)
    try:
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            arrays = {"": loaded}
        else:
            with loaded:
                arrays = {name: loaded[name] for name in loaded.files}
    except FileNotFoundError:
        raise InputError(f"the {what} file {path} does not exist", "Check the path") from None
    except (OSError, ValueError, EOFError) as error:
        raise InputError(f"the {what} file {path} cannot be read: {error}", "Write it with numpy.savez") from None
    covariance = arrays.pop("covariance", None)
    name = next(iter(arrays)) if len(arrays) == 1 else next((key for key in keys if key in arrays), None)
    if name is None:
        raise InputError(
            f"{path.name} holds the arrays {', '.join(arrays) or 'none'}", f"Name the one with the {what} {keys[0]}"
        )
    if arrays[name].dtype.kind not in "fiu":
        raise InputError(f"{path.name} holds {arrays[name].dtype}, not numbers", "Save an array of float64")
    return Runs(arrays[name].astype(float), (), covariance)


def _from_csv(table: CsvTable, scenario: Scenario, c, whole: list[str]) -> Runs:
    for key in "xyz"[: scenario.dim]:
        table.need(getattr(c, key), key)
    # positions may be called otherwise; the rest of the state only counts if all of it is there
    place = dict(zip(scenario.motion.position_index, "xyz", strict=False))
    names = [getattr(c, place[i]) if i in place else name for i, name in enumerate(whole)]
    if not all(name in table for name in names):
        names = [getattr(c, key) for key in "xyz"[: scenario.dim]]
    values = table.positions(names)
    step = _steps(table, c, scenario)
    track = table.text(c.track) if c.track in table else np.full(len(table), "0", dtype=object)
    order = {name: i for i, name in enumerate(sorted(dict.fromkeys(track.tolist()), key=_natural))}
    run = np.array([order[name] for name in track])
    place_in = run * (scenario.steps + 1) + step
    counts = np.bincount(place_in, minlength=len(order) * (scenario.steps + 1))
    if counts.max() > 1:
        line = table.lines[np.flatnonzero(counts[place_in] > 1)[1]]
        raise InputError(
            f"line {line} of {table.path.name} gives a step of a run for the second time",
            "Give every step once per run",
        )
    present = counts.reshape(len(order), -1) > 0
    first = 0 if present[:, 0].all() else 1
    if first and present[:, 0].any():
        raise InputError(f"step 0 is in some runs of {table.path.name} only", "Give it for all runs or for none")
    missing = np.argwhere(~present[:, first:])
    if len(missing):
        name, more = list(order)[missing[0, 0]], f" (and {len(missing) - 1:,} more)" if len(missing) > 1 else ""
        raise InputError(
            f"{table.path.name} has no line for run {name}, step {missing[0, 1] + first}{more}; the scenario has "
            f"the steps 0..{scenario.steps}",
            "A filter has an estimate at every step, also where no link reported: give its prediction",
        )
    filled = np.full((len(order) * (scenario.steps + 1), len(names)), np.nan)
    filled[place_in] = values
    return Runs(filled.reshape(len(order), scenario.steps + 1, -1)[:, first:], tuple(order))


def _natural(name: str) -> tuple[float, str]:
    return (float(name) if name.isdigit() else np.inf, name)


def _steps(table: CsvTable, c, scenario: Scenario) -> Int[ndarray, " rows"]:
    """Step of every line; times, where given, must be those of the scenario."""
    time_s = np.asarray(scenario.times.time_s)
    time = table.numbers(c.time) if c.time in table else None
    if c.step in table:
        raw = table.numbers(c.step)
        bad = np.flatnonzero((raw != np.round(raw)) | (raw < 0) | (raw > scenario.steps))
        if bad.size:
            raise InputError(
                f"line {table.lines[bad[0]]} of {table.path.name} is step {raw[bad[0]]:g}; the scenario has the steps "
                f"0..{scenario.steps}",
                "Number the steps as in the ranges: the first ranges come at step 1",
            )
        step = raw.astype(int)
    elif time is None:
        raise InputError(f"{table.path.name} has neither a column {c.step} nor {c.time}", "Give one of them")
    else:
        step = _nearest(time, time_s)
    if time is not None:
        late = np.flatnonzero(np.abs(time - time_s[step]) > SAME_TIME * np.diff(time_s).min())
        if late.size:
            k = late[0]
            raise InputError(
                f"line {table.lines[k]} of {table.path.name} is at {time[k]:g} s, step {step[k]} of the scenario at "
                f"{time_s[step[k]]:g} s",
                "Give the times of the ranges, in seconds",
            )
    return step


def _nearest(time: Float[ndarray, " n"], grid: Float[ndarray, " m"]) -> Int[ndarray, " n"]:
    right = np.clip(np.searchsorted(grid, time), 1, len(grid) - 1)
    return right - (time - grid[right - 1] < grid[right] - time)


def same_runs(estimates: Runs, truth: Runs) -> None:
    """Raise an InputError unless both hold the same runs; runs without names are called 0, 1, ..."""
    mine, true = (r.names or tuple(map(str, range(len(r.values)))) for r in (estimates, truth))
    lacking, foreign = ([name for name in a if name not in set(b)] for a, b in ((true, mine), (mine, true)))
    if not (estimates.names or truth.names) or not (lacking or foreign):
        return
    if lacking and foreign:
        raise InputError(
            f"the estimates have the runs {mine[0]}..{mine[-1]}, the truth {true[0]}..{true[-1]}",
            "Keep the track_id of the ranges; it starts at 0",
        )
    if lacking:
        more = f" (and {len(lacking) - 1:,} more)" if len(lacking) > 1 else ""
        raise InputError(f"there is no estimate of run {lacking[0]}{more}", "Give estimates of all runs of the truth")
    raise InputError(f"run {foreign[0]} of the estimates is not in the truth", "Give the truth of the same simulation")
