"""Pictures of maps of accuracy; every function returns a matplotlib figure and saves nothing."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.plan import Plan
from locbounds.registry import method
from locbounds.report.plan_view import Colours, colours, draw_anchors, draw_outline, frame, outline, scale_bar
from locbounds.static.cells import Cell
from locbounds.static.crlb import REASONS
from locbounds.static.maps import AccuracyMap, quantile_name
from locbounds.static.over_prior import rmse_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ELLIPSES = 9  # along the longer side
SIDE_IN = 4.6  # inches of a panel's longer side
NO_BOUND = "#D62728"


def draw_map(found: AccuracyMap, area: Any, *, names: Sequence[str] = (), anchors: Any = None) -> "Figure":
    """The Cramér-Rao bound over an area: RMSE with error ellipses, CEP, and GDOP if the plan has one.

    Parameters
    ----------
    found
        The map.
    area
        What it was made of.
    names, anchors
        Of the anchors; by default those of the plan, numbered.

    Returns
    -------
    matplotlib.figure.Figure
        Points without a bound are red, points outside of the area white; the colours end at the 98 % quantile.

    Examples
    --------
    >>> import locbounds as lb
    >>> hall = lb.UniformBox([0, 0], [100, 60])
    >>> plan = lb.toa([[0, 0], [100, 0], [50, 60]], 2.0)
    >>> figure = draw_map(lb.AccuracyMap(plan, hall, grid=21), hall)
    >>> [axes.get_ylabel() for axes in figure.axes[3:]]
    ['RMSE in m', 'CEP in m', 'GDOP']
    """
    f = found.figures
    quantile = f"crlb_q{quantile_name(found.share)}_m"
    spherical = "SEP" if found.plan.dim == 3 else "CEP"
    panels = [
        ("Least RMSE without prior knowledge (CRLB)", "RMSE in m", f["crlb_rmse_m"]),
        ("Median error of that accuracy", f"{spherical} in m", f["crlb_cep_m"]),
        ("Dilution of precision", "GDOP", f["gdop"])
        if "gdop" in f
        else (
            f"{100 * found.share:g} % of the errors are below",
            f"{100 * found.share:g} % quantile in m",
            f[quantile],
        ),
    ]
    anchors = np.asarray(found.plan.anchors if anchors is None else anchors)[:, :2]
    names = names or [str(k + 1) for k in range(len(anchors))]
    figure, axes, outside = _panels(area, anchors, names, len(panels))
    lost = np.asarray(found.bounds.status) != 0
    extent = _extent(found)
    for panel, (title, label, values) in zip(axes, panels, strict=True):
        _image(figure, panel, found.on_grid(values), extent, label)
        _mark(panel, found, lost, extent)
        panel.set_title(title, loc="left", fontsize=10, pad=16)
    drawn = _ellipses(axes[0], found)
    notes = [found.plan.title] if found.plan.title else []
    if found.height_m is not None:
        notes.append(f"at a height of {found.height_m:g} m, seen from above")
    figure.suptitle(", ".join(notes), fontsize=11) if notes else None
    below = ["ellipses: hold 95 % of the errors" + (f", drawn {drawn:g} times as large" if drawn != 1 else "")]
    if lost.any():
        codes = sorted({int(c) for c in np.asarray(found.bounds.status)} - {0})
        below.append("red: no bound, " + "; ".join(REASONS[c] for c in codes))
    if outside:
        below.append(f"{outside} anchor{'s' * (outside > 1)} outside of the picture")
    figure.supxlabel("\n".join(below), fontsize=9, color="0.25")
    return figure


def draw_cells(plan: Plan, area: Any, cells: Sequence[Cell], ids: Sequence[str], *, anchors: Any = None) -> "Figure":
    """Bayesian numbers per cell, one panel per method on one scale.

    Parameters
    ----------
    plan, area, anchors
        As for :func:`draw_map`.
    cells
        Of :func:`locbounds.static.cells.per_cell`.
    ids
        Methods to draw; one that has no number anywhere says so.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.static.cells import per_cell
    >>> hall = lb.UniformBox([0, 0], [100, 60])
    >>> plan = lb.toa([[0, 0], [100, 0], [50, 60]], 2.0)
    >>> cells = per_cell(plan, hall, ["ezzb"], cells=1)
    >>> draw_cells(plan, hall, cells, ["ezzb"]).axes[1].get_ylabel()
    'RMSE in m'
    """
    anchors = np.asarray(plan.anchors if anchors is None else anchors)[:, :2]
    values = {id: np.array([rmse_of(cell.found.get(id))[0] for cell in cells]) for id in ids}
    every = np.concatenate(list(values.values()))
    scale = colours(every, float(every[np.isfinite(every)].max(initial=0.0)) or 1.0)
    figure, axes, _ = _panels(area, anchors, (), len(ids))
    for panel, id in zip(axes, ids, strict=True):
        entry = method(id)
        _tiles(panel, cells, values[id], scale)
        some = np.isfinite(values[id]).any()
        title = f"{entry.name} ({'bound' if entry.kind == 'bound' else 'least possible'})"
        panel.set_title(title + ("" if some else ": no number"), loc="left", fontsize=10, pad=16)
    scale.bar(figure, list(axes), "RMSE in m")
    title = "Least RMSE of a device that is known to be in the cell"
    figure.suptitle(f"{plan.title}: {title[0].lower()}{title[1:]}" if plan.title else title, fontsize=11)
    return figure


def _panels(area: Any, anchors: ndarray, names: Sequence[str], n: int) -> tuple["Figure", Any, int]:
    from matplotlib.figure import Figure

    low, high = (np.asarray(corner)[:2] for corner in area.bounds())
    width, height = SIDE_IN * np.maximum(high - low, 0.35 * (high - low).max()) / (high - low).max()
    wide = width > 1.6 * height
    across, down = (1, n) if wide and n > 1 else (n, 1)
    figure = Figure(figsize=(across * (width + 1.5) + 0.4, down * (height + 0.85) + 0.7), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False).ravel()
    outside = 0
    for panel in axes:
        outside = frame(panel, low, high, anchors)
        draw_outline(panel, area.shape)
        draw_anchors(panel, anchors, names)
        scale_bar(panel)
    return figure, axes, outside


def _extent(found: AccuracyMap) -> tuple[float, float, float, float]:
    """Edges of the picture elements, whose centres are the points."""
    dx, dy = (0.5 * (v[1] - v[0]) for v in (found.x_m, found.y_m))
    return found.x_m[0] - dx, found.x_m[-1] + dx, found.y_m[0] - dy, found.y_m[-1] + dy


def _image(figure: "Figure", panel: "Axes", values: Float[ndarray, "rows columns"], extent: Any, label: str) -> None:
    scale = colours(values)
    shown = np.where(np.isfinite(values), values, np.nan)
    panel.imshow(shown, origin="lower", extent=extent, cmap=scale.cmap, norm=scale.norm, zorder=1)
    scale.bar(figure, panel, label)


def _mark(panel: "Axes", found: AccuracyMap, lost: ndarray, extent: Any) -> None:
    """Points without a bound in red: as picture elements, and with a cross where they are few."""
    from matplotlib.colors import ListedColormap

    if not lost.any():
        return
    mask = found.on_grid(np.where(lost, 1.0, np.nan))
    panel.imshow(mask, origin="lower", extent=extent, cmap=ListedColormap([NO_BOUND]), zorder=2)
    if lost.sum() <= 25:
        panel.plot(*found.points[lost][:, :2].T, "x", color=NO_BOUND, ms=11, mew=1.8, zorder=6)


def _ellipses(panel: "Axes", found: AccuracyMap) -> float:
    """Horizontal 95 % ellipses at a few points; returns how many times as large as they are."""
    from matplotlib.patches import Ellipse

    from locbounds.static.merit import error_ellipse

    step = max(found.inside.shape) / ELLIPSES
    rows, columns = (np.unique((np.arange(0.5, n / step) * step).astype(int)) for n in found.inside.shape)
    index = found.on_grid(np.arange(len(found.bounds.status), dtype=float))[np.ix_(rows, columns)].ravel()
    index = index[np.isfinite(index)].astype(int)
    index = index[np.asarray(found.bounds.status)[index] == 0]
    if not len(index):
        return 1.0
    shapes = error_ellipse(np.asarray(found.bounds.covariance)[index][:, :2, :2], 0.95)
    spacing = step * (found.x_m[1] - found.x_m[0])
    largest = np.quantile(shapes.semi_axes_m[:, 0], 0.8)
    steps = np.array([0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500])
    factor = float(steps[np.searchsorted(steps, 0.45 * spacing / largest, side="right") - 1])
    for place, semi, angle in zip(found.points[index], shapes.semi_axes_m, shapes.angle_rad, strict=True):
        size = 2 * factor * semi
        middle, turn = (float(place[0]), float(place[1])), float(np.degrees(angle))
        style = {"fill": False, "edgecolor": "white", "lw": 0.9, "zorder": 4}
        panel.add_patch(Ellipse(middle, size[0], size[1], angle=turn, **style))
    return factor


def _tiles(panel: "Axes", cells: Sequence[Cell], values: ndarray, scale: Colours) -> None:
    """Coloured parts of cells with their number; hatched where there is none."""
    import shapely
    from matplotlib.patches import PathPatch

    for cell, value in zip(cells, values, strict=True):
        known = np.isfinite(value)
        style = {"facecolor": scale.cmap(scale.norm(value))} if known else {"facecolor": "0.92", "hatch": "///"}
        for piece in shapely.get_parts(cell.part):
            if piece.geom_type == "Polygon":
                panel.add_patch(PathPatch(outline(piece), edgecolor="white", lw=0.6, zorder=1, **style))
        if known and len(cells) <= 60:
            at = cell.part.representative_point()
            shade = "black" if scale.norm(value) > 0.6 else "white"
            panel.text(at.x, at.y, f"{value:.3g}", ha="center", va="center", fontsize=7, color=shade, zorder=6)
