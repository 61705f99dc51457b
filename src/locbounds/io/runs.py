"""Simulated runs for filters in any language: what they see, and what they do not."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
import pandas as pd

from locbounds.blocks import check_seed
from locbounds.errors import InputError
from locbounds.io.files import OutputFolder
from locbounds.io.scenario_file import dumps
from locbounds.report.tables import csv_text
from locbounds.scenario import Scenario
from locbounds.simulation import RUNS_PER_BLOCK, Draws, simulate_block

FORMATS = ("csv", "npz", "both")
_AXES = "xyz"


def write_runs(
    folder: OutputFolder,
    scenario: Scenario,
    *,
    runs: int,
    seed: int = 0,
    format: str = "both",
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Draw tracks from a scenario and write them, block by block.

    Parameters
    ----------
    folder
        Where to; see the page "Score your own filter" for the files.
    scenario, runs, seed
        As for :func:`locbounds.simulate`, which returns the same numbers.
    format
        ``csv`` (bounded memory), ``npz`` (all runs in memory) or ``both``.
    progress
        Called with (runs done, runs).

    Raises
    ------
    InputError
        If an option makes no sense.
    """
    if format not in FORMATS:
        raise InputError(f"the format is {format!r}", f"Choose {', '.join(FORMATS)}")
    if runs < 1 or int(runs) != runs:
        raise InputError(f"the number of runs is {runs}", "Give a whole number of at least 1")
    check_seed(seed)
    kept: list[Draws] = []
    with ExitStack() as stack:
        tables = _Tables(stack, folder, scenario) if format != "npz" else None
        for start in range(0, runs, RUNS_PER_BLOCK):
            block = simulate_block(scenario, seed=seed, block=start // RUNS_PER_BLOCK)
            draws = Draws(*(x[: runs - start] for x in block))
            if tables is not None:
                tables.write(draws, start)
            if format != "csv":
                kept.append(Draws(draws.states, draws.sight.astype(np.int8), draws.measurements))
            if progress is not None:
                progress(min(start + RUNS_PER_BLOCK, runs), runs)
    if kept:
        _save_arrays(folder, scenario, Draws(*(np.concatenate(parts) for parts in zip(*kept, strict=True))), seed)
    folder.write_text("scenario.toml", dumps(scenario, {"": f"{runs} runs were drawn from this with seed {seed}."}))


def truth_columns(scenario: Scenario) -> list[str]:
    """Columns of the true state: ``x_true_m``, ``y_true_m``, then what else the state holds."""
    names = dict(zip(scenario.motion.position_index, _AXES, strict=False))
    return [f"{names[i]}_true_m" if i in names else name for i, name in enumerate(scenario.motion.state_names)]


class _Tables:
    """CSV files that grow block by block."""

    def __init__(self, stack: ExitStack, folder: OutputFolder, scenario: Scenario):
        self.time_s = np.asarray(scenario.times.time_s)
        self.names = np.array([link.name for link in scenario.links], dtype=object)
        self.columns = truth_columns(scenario)
        modes = max(len(link.noises) for link in scenario.links)
        self.sights = np.array(["los", "nlos", *(f"mode{r}" for r in range(2, modes))], dtype=object)
        self.paths = {name: stack.enter_context(folder.writing(f"{name}.csv")) for name in ("ranges", "truth", "sight")}
        axes = [f"{a}_m" for a in _AXES[: scenario.dim]]
        rows = [(n, *map(float, a.measurement.anchor)) for n, a in zip(self.names, scenario.links, strict=True)]
        folder.write_text("anchors.csv", csv_text(("anchor_id", *axes), rows))

    def write(self, draws: Draws, first: int) -> None:
        runs, steps, links = draws.measurements.shape
        run, k, m = (i.ravel() for i in np.indices((runs, steps, links)))
        z = draws.measurements.ravel()
        there = np.isfinite(z)
        seen = {"track_id": run + first, "step": k + 1, "time_s": self.time_s[k + 1], "anchor_id": self.names[m]}
        self._append("ranges", {**{name: x[there] for name, x in seen.items()}, "range_m": z[there]}, first)
        self._append("sight", {**seen, "sight": self.sights[draws.sight.ravel()]}, first)
        run, k = (i.ravel() for i in np.indices((runs, steps + 1)))
        state = draws.states.reshape(-1, draws.states.shape[-1]).T
        true = {"track_id": run + first, "step": k, "time_s": self.time_s[k]}
        self._append("truth", {**true, **dict(zip(self.columns, state, strict=True))}, first)

    def _append(self, name: str, columns: dict[str, Any], first: int) -> None:
        pd.DataFrame(columns).to_csv(self.paths[name], mode="a", header=first == 0, index=False)


def _save_arrays(folder: OutputFolder, scenario: Scenario, draws: Draws, seed: int) -> None:
    time_s = np.asarray(scenario.times.time_s)
    seen = {
        "ranges_m": draws.measurements,
        "time_s": time_s,
        "anchors_m": np.asarray(scenario.anchors),
        "anchor_id": np.array([link.name for link in scenario.links]),
        "prior_mean": np.asarray(scenario.prior.mean),
        "prior_covariance": np.asarray(scenario.prior.covariance),
        "state_names": np.array(scenario.motion.state_names),
    }
    hidden = {
        "position_true_m": np.asarray(scenario.motion.position(draws.states)),
        "state_true": draws.states,
        "sight": draws.sight,
        "time_s": time_s,
        "seed": np.int64(seed),
    }
    for name, arrays in (("ranges.npz", seen), ("truth.npz", hidden)):
        folder.write(name, lambda path, arrays=arrays: np.savez(path, **arrays))
