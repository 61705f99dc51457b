"""Figures of surveys: where the position fails, and the bound over noise levels."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from locbounds.survey.neighbours import Errors
from locbounds.survey.study import NAMES, Row, SurveyStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CURVES = {
    "survey": {"color": "C0", "ls": "-", "lw": 1.8, "marker": "o"},
    "mmse": {"color": "C2", "ls": "-", "lw": 1.3, "marker": "s"},
    "survey-printed": {"color": "0.5", "ls": ":", "lw": 1.5, "marker": "x"},
    "knn-model": {"color": "C1", "ls": "--", "lw": 1.2},
    "wknn-model": {"color": "C3", "ls": "--", "lw": 1.2},
}
POINTS = {"knn": ("C1", "D"), "wknn": ("C3", "v"), "gp": ("C4", "^")}
ACROSS = 3  # panels side by side
LINKS = 60  # confused pairs drawn at most
SMALLEST_M = 1e-3  # errors below are drawn at the lower edge


def curve(sets: Mapping[str, tuple[Sequence[Row], Sequence[Row]]]) -> "Figure":
    """Position RMSE over noise levels, one panel per set.

    Parameters
    ----------
    sets
        Title -> (curve, rows at the set's own noise level); of the rows, estimators on held-out samples are drawn.
    """
    from matplotlib.figure import Figure

    across = min(len(sets), ACROSS)
    down = -(-len(sets) // across)
    figure = Figure(figsize=(max(6.8, 4.0 * across), (1.0 if across > 2 else 1.6) + 3.8 * down), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False, sharey=True).ravel()
    for axes in panels[len(sets) :]:
        axes.set_visible(False)
    panels = panels[: len(sets)]
    for axes, (title, (rows, own)) in zip(panels, sets.items(), strict=True):
        in_db = all(np.isfinite(r.noise_db) for r in rows)
        for method, style in CURVES.items():
            line = sorted((r.noise_db if in_db else r.factor, r.rmse_m) for r in rows if r.method == method)
            if line:
                x, y = np.array(line).T
                axes.plot(x, np.where(y >= SMALLEST_M, y, np.nan), ms=4, label=NAMES[method], **style)
        for row in own:
            if row.method in POINTS:
                colour, marker = POINTS[row.method]
                x = row.noise_db if in_db else 1.0
                axes.errorbar(
                    x, row.rmse_m, row.stderr_m, color=colour, marker=marker, ms=6, ls="", label=NAMES[row.method]
                )
        level = next((r.noise_db if in_db else 1.0 for r in own), None)
        if level is not None:
            axes.axvline(level, color="0.8", lw=1, zorder=0)
            axes.text(
                level, 0.01, " this survey", transform=axes.get_xaxis_transform(), fontsize="x-small", color="0.4"
            )
        axes.set(yscale="log", xlabel="noise in dB" if in_db else "noise relative to this survey's")
        axes.set_title(title, loc="left", fontsize="medium")
        axes.grid(alpha=0.3, which="both")
    drawn = [r.rmse_m for rows, own in sets.values() for r in (*rows, *own) if r.rmse_m >= SMALLEST_M]
    panels[0].set_ylim(max(SMALLEST_M, min(drawn) / 2), 1.5 * max(drawn)) if drawn else None
    for axes in panels[::across]:
        axes.set_ylabel("position RMSE in m")
    handles: dict = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside lower center",
        ncols=4 if across > 2 else 2,
        frameon=False,
        fontsize="small",
    )
    return figure


def where_it_fails(found: SurveyStudy, *, title: str = "") -> "Figure":
    """Two maps: the least error at each survey point with the pairs that are confused, and errors on held-out samples.

    Parameters
    ----------
    found
        Of :func:`locbounds.survey.study.study`.
    title
        Of the figure.

    Notes
    -----
    Heights are drawn on top of each other.
    """
    from matplotlib.figure import Figure

    place = found.model.position_m
    flat = place if place.shape[1] > 1 else np.column_stack([place, np.zeros(len(place))])
    wide = np.ptp(flat[:, 0]) > np.ptp(flat[:, 1])
    figure = Figure(figsize=(9.0, 8.0) if wide else (10.0, 6.5), layout="constrained")
    panels = figure.subplots(2 if wide else 1, 1 if wide else 2)
    size = float(np.clip(3000 / len(place), 4, 60))
    left, right = panels
    _least(left, found, flat, size)
    id = min(found.held_out, key=lambda k: found.held_out[k].rmse_m)
    _held_out(right, found.held_out[id], NAMES[id], flat, size)
    for axes in panels:
        axes.set(xlabel="x in m", ylabel="y in m", aspect="equal")
        axes.grid(alpha=0.2)
    if title:
        figure.suptitle(title)
    return figure


def _least(axes, found: SurveyStudy, flat, size: float) -> None:
    from matplotlib.collections import LineCollection

    at = np.sqrt(found.visible.at_m2)
    drawn = np.isfinite(at)
    parts = [m for part in found.bound.axes.values() for m in part.matchings]
    pairs = np.unique(np.sort(np.concatenate([np.stack([m.left, m.right], 1) for m in parts]), axis=1), axis=0)
    x = found.model.whitened / found.visible_factor
    d = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    apart = np.linalg.norm(found.model.position_m[pairs[:, 0]] - found.model.position_m[pairs[:, 1]], axis=1)
    cost = 2 * np.log(apart) - d**2 / 8  # of a confusion, times how often it happens
    worst = pairs[np.argsort(-cost)[:LINKS]]
    axes.add_collection(LineCollection(list(flat[worst][:, :, :2]), colors="0.6", linewidths=0.8, zorder=1))
    points = axes.scatter(*flat[drawn][:, :2].T, c=at[drawn], s=size, cmap="viridis", vmin=0, zorder=2)
    axes.scatter(*flat[~drawn][:, :2].T, c="0.8", s=size / 4, zorder=1)
    axes.figure.colorbar(points, ax=axes, label="RMS error in m", shrink=0.8)
    level = "" if found.visible_factor == 1 else f", at {found.visible_factor:.2g} times this noise"
    axes.set_title(
        f"least error at the survey's points{level}\n(RMSE {found.visible.rmse_m:.2g} m; lines: pairs that cost most)",
        fontsize="medium",
    )


def _held_out(axes, errors: Errors, name: str, flat, size: float) -> None:
    where, index = np.unique(errors.position_m, axis=0, return_inverse=True)
    count = np.bincount(index.reshape(-1))
    rms = np.sqrt(np.bincount(index.reshape(-1), errors.square_m2) / count)
    places = where if where.shape[1] > 1 else np.column_stack([where, np.zeros(len(where))])
    axes.scatter(*flat[:, :2].T, c="0.85", s=size / 3, zorder=1)
    points = axes.scatter(
        *places[:, :2].T, c=rms, s=size, cmap="viridis", vmin=0, vmax=np.quantile(rms, 0.98), zorder=2
    )
    axes.figure.colorbar(points, ax=axes, label="RMS error in m", shrink=0.8, extend="max")
    axes.set_title(f"{name} (RMSE {errors.rmse_m:.2f} m)\ngrey: the survey's points", fontsize="medium")
