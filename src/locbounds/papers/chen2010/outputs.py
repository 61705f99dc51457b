"""Tables and figures of the study."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from locbounds.evaluation import quantile
from locbounds.papers.chen2010.setting import PUBLISHED_BOUND_M, STEP_S
from locbounds.papers.chen2010.study import Study, overall
from locbounds.report import plot
from locbounds.report.tables import csv_text
from locbounds.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHARES = (0.67, 0.95)
FIG1_COLUMNS = ("method", "step", "position_rmse_m", "stderr_m")
FIG2_COLUMNS = ("method", "error_m", "share", "stderr")
QUANTILE_COLUMNS = ("method", "quantile", "value_m", "stderr_m")
SEGMENT_COLUMNS = ("method", "segment", "rmse_m", "stderr_m")
SETTING_COLUMNS = ("method", "stay", "rmse_m", "stderr_m", "q67_m", "q67_stderr_m", "q95_m", "q95_stderr_m")
BOUND_COLUMNS = ("evaluator", "reading", "q67_m", "q95_m", "min_m", "max_m")
GRID_M = np.arange(0.0, 301.0, 1.0)


def fig1_csv(found: Study) -> str:
    """``fig1.csv``: position RMSE per step."""
    rows = []
    for name, result in found.results.items():
        values = zip(result.position_rmse.values, result.position_rmse_stderr.values, strict=True)
        rows += [(name, step, float(value), float(error)) for step, (value, error) in enumerate(values)]
    return csv_text(FIG1_COLUMNS, rows)


def quantiles(found: Study) -> list[tuple[str, float, float, float]]:
    """Quantiles of the errors over runs and steps; for the bound, of its values over steps."""
    rows = []
    for name, result in found.results.items():
        of = of_bound if result.kind == "bound" else quantile
        rows += [(name, share, *of(result, share)) for share in SHARES]
    return rows


def of_bound(result: Result, share: float) -> tuple[float, float]:
    """Quantile of a bound's values over steps 1..K, with the standard error from its groups of draws."""
    mse, changes = np.asarray(result.position_mse)[1:], np.asarray(result.replicates)[:, 1:]
    value = float(np.quantile(np.sqrt(mse), share))
    groups = len(changes)
    if groups < 2:
        return value, 0.0
    small = changes / (groups - 1)  # each group left out in turn
    without = np.quantile(np.sqrt(mse - small), share, axis=1)
    return value, float(np.sqrt((groups - 1) * np.var(without)))


def quantiles_csv(found: Study) -> str:
    """``quantiles.csv``: 0.67 and 0.95 quantiles."""
    return csv_text(QUANTILE_COLUMNS, quantiles(found))


def segments(found: Study) -> list[tuple[str, int, float, float]]:
    """RMSE in every period of Table 1."""
    length = found.segments
    return [
        (name, s, *overall(result, slice(1 + (s - 1) * length, 1 + s * length)))
        for name, result in found.results.items()
        for s in range(1, 9)
    ]


def segments_csv(found: Study) -> str:
    """``segments.csv``: RMSE in each of the eight periods of the schedule."""
    return csv_text(SEGMENT_COLUMNS, segments(found))


def settings(found: Study) -> list[tuple]:
    """Every filter under both assumed chains."""
    return [
        (s.method, s.stay, *overall(s.result), *quantile(s.result, 0.67), *quantile(s.result, 0.95))
        for s in found.settings
    ]


def settings_csv(found: Study) -> str:
    """``settings.csv``: what the filters' assumed probability of keeping the sight changes."""
    return csv_text(SETTING_COLUMNS, settings(found))


def bounds(found: Study) -> list[tuple]:
    """The bound's values over steps 1..K in both readings, for every way to take the expectation."""
    rows = []
    for evaluator in found.evaluators:
        total = np.asarray(evaluator.total_m)[1:]
        for reading, values in (("total", total), ("per axis", total / np.sqrt(2))):
            quantile_values = (float(np.quantile(values, share)) for share in SHARES)
            rows.append((evaluator.name, reading, *quantile_values, float(values.min()), float(values.max())))
    return rows


def bounds_csv(found: Study) -> str:
    """``bounds.csv``: total ``sqrt(C11 + C22)`` and per-axis ``sqrt((C11 + C22) / 2)`` RMS."""
    return csv_text(BOUND_COLUMNS, bounds(found))


def distribution(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Share of errors (of a bound: of its values over time) within each length of the grid, with standard errors."""
    if result.kind == "bound":
        values = np.sqrt(np.asarray(result.position_mse)[1:])
        return np.mean(values[:, None] <= GRID_M, axis=0), np.zeros(len(GRID_M))
    error = np.asarray(result.diagnostics["error_m"])[:, 1:]
    per_run = np.stack([np.searchsorted(np.sort(row), GRID_M, side="right") for row in error]) / error.shape[1]
    return per_run.mean(axis=0), per_run.std(axis=0, ddof=1) / np.sqrt(len(per_run))


def fig2_csv(found: Study) -> str:
    """``fig2.csv``: distributions; the row of the bound is one of its values over time, not of an error."""
    rows = []
    for name, result in found.results.items():
        share, error = distribution(result)
        rows += [(name, *map(float, row)) for row in zip(GRID_M, share, error, strict=True)]
    return csv_text(FIG2_COLUMNS, rows)


def _lines(found: Study) -> Iterator[tuple[str, Result, dict[str, Any]]]:
    for k, (name, result) in enumerate(found.results.items()):
        bound = result.kind == "bound"
        style: dict[str, Any] = (
            {"ls": "-", "lw": 2.0} if bound else {"ls": "--" if name == "oracle" else "-", "lw": 1.1}
        )
        yield name, result, style | {"color": plot.colour(result.id, k)}


def fig1(found: Study) -> "Figure":
    """Fig. 1: position RMSE over the time steps, over random tracks."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    axes = figure.subplots()
    for name, result, style in _lines(found):
        axes.plot(result.position_rmse.values, label=name, **style)
    top = 1.15 * max(float(r.position_rmse.values[found.segments // 2 :].max()) for r in found.results.values())
    for s in range(1, 9):
        axes.axvline(s * found.segments, color="0.85", lw=0.8, zorder=0)
        axes.text((s - 0.5) * found.segments, 0.01 * top, f"T({s})", ha="center", color="0.5")
    axes.set(
        xlabel=f"time step ({STEP_S} s each)",
        ylabel="position RMSE in m (total)",
        ylim=(0, top),
        xlim=(0, 8 * found.segments),
    )
    axes.set_title("Sight of Table 1, filters assume a stay probability of 0.85", loc="left")
    axes.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.06))
    return figure


def fig2(found: Study) -> "Figure":
    """Fig. 2: distribution of the errors, and of the bound's values over time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    axes = figure.subplots()
    for name, result, style in _lines(found):
        label = f"{name} (its values over time, no error)" if result.kind == "bound" else name
        axes.plot(GRID_M, distribution(result)[0], label=label, **style)
    for share, value in PUBLISHED_BOUND_M.items():
        axes.plot(value, share, "kx", ms=6, label="the bound as printed" if share == SHARES[0] else None)
    for limit, share in ((100, 0.67), (300, 0.95)):
        axes.plot([limit, limit], [0, share], color="0.4", lw=0.9, ls=":")
        axes.plot(limit, share, "v", color="0.4", ms=6, label="E911 limit" if share == SHARES[0] else None)
    axes.set(xlabel="position error in m", ylabel="share within", xlim=(0, 305), ylim=(0, 1.02))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, loc="center right")
    return figure
