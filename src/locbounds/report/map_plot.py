"""Pictures of maps of accuracy; every function returns a matplotlib figure and saves nothing."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.plan import Plan
from locbounds.registry import method
from locbounds.report.plan_view import draw_anchors, draw_outline, frame, scale_bar
from locbounds.static.cells import Cell, outline_of
from locbounds.static.crlb import REASONS
from locbounds.static.maps import AccuracyMap, quantile_name
from locbounds.static.over_prior import rmse_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOP = 0.98  # quantile of the values at the top of a colour bar, so that a few bad places do not hide the rest
LOGARITHMIC = 8.0  # a wider range of values has logarithmic colours
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
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    anchors = np.asarray(plan.anchors if anchors is None else anchors)[:, :2]
    values = {id: np.array([rmse_of(cell.found.get(id))[0] for cell in cells]) for id in ids}
    every = np.concatenate(list(values.values()))
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if every.size else (0.0, 1.0)
    scale = ScalarMappable(Normalize(low if high - low > 0.02 * high else 0.0, high or 1.0), "viridis")
    figure, axes, _ = _panels(area, anchors, (), len(ids))
    for panel, id in zip(axes, ids, strict=True):
        entry = method(id)
        _tiles(panel, cells, values[id], scale, area)
        some = np.isfinite(values[id]).any()
        title = f"{entry.name} ({'bound' if entry.kind == 'bound' else 'least possible'})"
        panel.set_title(title + ("" if some else ": no number"), loc="left", fontsize=10, pad=16)
    figure.colorbar(scale, ax=list(axes), label="RMSE in m", shrink=0.85)
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
        draw_outline(panel, outline_of(area))
        draw_anchors(panel, anchors, names)
        scale_bar(panel)
    return figure, axes, outside


def _extent(found: AccuracyMap) -> tuple[float, float, float, float]:
    """Edges of the picture elements, whose centres are the points."""
    dx, dy = (0.5 * (v[1] - v[0]) for v in (found.x_m, found.y_m))
    return found.x_m[0] - dx, found.x_m[-1] + dx, found.y_m[0] - dy, found.y_m[-1] + dy


def _image(figure: "Figure", panel: "Axes", values: Float[ndarray, "rows columns"], extent: Any, label: str) -> None:
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import LogLocator

    some = values[np.isfinite(values)]
    low, high = (float(some.min()), float(np.quantile(some, TOP))) if some.size else (0.0, 1.0)
    if high - low < 1e-6 * max(high, 1e-300):  # one value everywhere
        low, high = 0.0, high or 1.0
    shown = np.where(np.isfinite(values), values, np.nan)
    wide = low > 0 and high > LOGARITHMIC * low
    scale = (LogNorm if wide else Normalize)(low, high)
    image = panel.imshow(shown, origin="lower", extent=extent, cmap="viridis", norm=scale, zorder=1)
    over = bool(some.size and some.max() > high * (1 + 1e-6))
    bar = figure.colorbar(image, ax=panel, label=label, extend="max" if over else "neither", shrink=0.85)
    if wide:
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.yaxis.set_minor_formatter("")


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


def _tiles(panel: "Axes", cells: Sequence[Cell], values: ndarray, scale: Any, area: Any) -> None:
    """Coloured parts of cells with their number; hatched where there is none."""
    import shapely
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    whole = outline_of(area)
    for cell, value in zip(cells, values, strict=True):
        part = whole.intersection(shapely.box(*cell.corners.ravel()))
        known = np.isfinite(value)
        pieces = [g for g in getattr(part, "geoms", [part]) if g.geom_type == "Polygon"]
        for g in pieces:
            rings = [Path(np.asarray(ring.coords)[:, :2], closed=True) for ring in (g.exterior, *g.interiors)]
            style = {"facecolor": scale.to_rgba(value)} if known else {"facecolor": "0.92", "hatch": "///"}
            panel.add_patch(PathPatch(Path.make_compound_path(*rings), edgecolor="white", lw=0.6, zorder=1, **style))
        if known and len(cells) <= 60:
            at = part.representative_point()
            shade = "black" if scale.norm(value) > 0.6 else "white"
            panel.text(at.x, at.y, f"{value:.3g}", ha="center", va="center", fontsize=7, color=shade, zorder=6)
