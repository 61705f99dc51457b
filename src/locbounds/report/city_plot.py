"""Pictures of cities: footprints, anchors, links, paths around corners, maps over the streets.

Every function returns a matplotlib figure and saves nothing. Metres, equal axes, a scale bar.
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from locbounds.axes import LOS, Bool, Float, ndarray
from locbounds.propagation import City, Links
from locbounds.report.plan_view import colours, draw_anchors, outline, scale_bar

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BUILDING, WALL = "#C9C4BB", "#8A847A"
NO_VALUE = "#DFE3E8"
FREE, BLOCKED, STREET = "#0072B2", "#D55E00", "#E9F1E6"


def draw_buildings(panel: "Axes", city: City, *, bounds: Any = None, bar: bool = True) -> None:
    """Footprints, with courtyards left free, and a scale bar, on given axes.

    Parameters
    ----------
    panel
        The axes.
    city
        The buildings.
    bounds
        Smallest x, y and largest x, y of the picture; by default those of the city.
    bar
        Whether to draw the scale bar.
    """
    import shapely
    from matplotlib.collections import PathCollection

    shapes = [outline(p) for b in city.buildings for p in shapely.get_parts(b.polygon)]
    panel.add_collection(PathCollection(shapes, facecolor=BUILDING, edgecolor=WALL, linewidth=0.4, zorder=2))
    xmin, ymin, xmax, ymax = city.bounds if bounds is None else bounds
    panel.set_xlim(xmin, xmax)
    panel.set_ylim(ymin, ymax)
    panel.set_aspect("equal")
    panel.set_xlabel("x in m")
    panel.set_ylabel("y in m")
    panel.tick_params(labelsize=8)
    if bar:
        scale_bar(panel)


def draw_paths(panel: "Axes", links: Links, pairs: Iterable[tuple[int, int]]) -> None:
    """Paths of some links: blue where there is sight, orange dashed around corners with a dot at every bend."""
    known: set[bool] = set()
    for point, anchor in pairs:
        way, free = links.path(point, anchor), links.sight[point, anchor] == LOS
        if not len(way):
            continue
        label = None if free in known else "sight" if free else "around corners"
        known.add(free)
        shade, dashes = (FREE, "-") if free else (BLOCKED, "--")
        panel.plot(*way.T, color=shade, ls=dashes, lw=1.4, zorder=5, label=label)
        panel.plot(*way[1:-1].T, "o", color=BLOCKED, ms=4, zorder=6)


def draw_links(city: City, links: Links, *, title: str = "", bounds: Any = None) -> "Figure":
    """All links of some points with their anchors: sight, or the path around corners.

    Parameters
    ----------
    city
        The buildings.
    links
        Of a few points; many become unreadable.
    title
        Title of the figure.
    bounds
        Smallest x, y and largest x, y; by default around the anchors, the points and the paths.

    Examples
    --------
    >>> import shapely, locbounds as lb
    >>> city = lb.City([shapely.box(0, 0, 30, 40)])
    >>> figure = draw_links(city, lb.street_links(city, {"bs": (-5.0, 20.0)}, [[40.0, 20.0]]))
    >>> figure.axes[0].get_xlabel()
    'x in m'
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 6.2), layout="constrained")
    panel = figure.subplots()
    pairs = [(i, m) for i in range(len(links.points)) for m in range(len(links.anchors))]
    if bounds is None:
        ways = np.concatenate([links.points, links.anchors, *(links.path(i, m) for i, m in pairs)])
        room = 0.08 * np.ptp(ways, axis=0).max() + 5.0
        bounds = (*(ways.min(axis=0) - room), *(ways.max(axis=0) + room))
    draw_buildings(panel, city, bounds=bounds)
    draw_paths(panel, links, pairs)
    panel.plot(*links.points.T, "s", color="white", mec="black", ms=6, zorder=7, ls="", label="mobiles")
    draw_anchors(panel, links.anchors, links.names)
    if title:
        panel.set_title(title, loc="left", fontsize=10)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def raster(
    city: City, bounds: Any, step_m: float
) -> tuple[Float[ndarray, " columns"], Float[ndarray, " rows"], Float[ndarray, "points 2"]]:
    """Centres of square cells that cover a rectangle: x, y, and all of them as points, row by row.

    >>> import shapely
    >>> x, y, points = raster(City([shapely.box(0, 0, 10, 10)]), (0, 0, 20, 10), 10.0)
    >>> x.tolist(), y.tolist(), points.tolist()
    ([5.0, 15.0], [5.0], [[5.0, 5.0], [15.0, 5.0]])
    """
    xmin, ymin, xmax, ymax = city.bounds if bounds is None else bounds
    x = np.arange(xmin + step_m / 2, xmax, step_m)
    y = np.arange(ymin + step_m / 2, ymax, step_m)
    return x, y, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def draw_map(
    city: City,
    x: Float[ndarray, " columns"],
    y: Float[ndarray, " rows"],
    value: Float[ndarray, " points"],
    *,
    label: str,
    anchors: Any = None,
    names: Sequence[str] = (),
    title: str = "",
    high: float | None = None,
    streets: Bool[ndarray, " points"] | None = None,
    without: str = "no bound",
) -> "Figure":
    """A quantity over the streets, as colours with a bar; cells that are not finite stay empty.

    Colours are those of :func:`~locbounds.report.plan_view.colours`.

    Parameters
    ----------
    city
        The buildings, drawn on top.
    x, y
        Centres of the cells, from :func:`raster`.
    value
        One number per cell, row by row.
    label
        What the colour bar says, with the unit.
    anchors, names
        Drawn as triangles.
    title
        Title of the figure.
    high
        Value at the top of the colour bar; by default the 98 % quantile, so that a few far places do not hide the rest.
    streets
        Which cells are streets: those without a finite value are then light grey, and named in a legend.
    without
        What the legend calls them.

    Examples
    --------
    >>> import shapely, locbounds as lb
    >>> city = lb.City([shapely.box(0, 0, 30, 40)])
    >>> x, y, points = raster(city, (-20, -20, 60, 60), 5.0)
    >>> links = lb.street_links(city, {"bs": (-5.0, 20.0)}, points)
    >>> figure = draw_map(city, x, y, links.excess_m[:, 0], label="excess delay in m", anchors=links.anchors,
    ...                   names=links.names)
    >>> figure.axes[1].get_ylabel()
    'excess delay in m'
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    values = np.where(np.isfinite(value), value, np.nan).reshape(len(y), len(x))
    scale = colours(values, high)
    inside = city.inside(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(values.shape)
    empty = np.isnan(values) & ~inside & (False if streets is None else np.asarray(streets).reshape(values.shape))
    values = _under_walls(values, inside)
    figure = Figure(figsize=(7.6, 6.2), layout="constrained")
    panel = figure.subplots()
    steps = [np.ptp(v) / max(len(v) - 1, 1) or 1.0 for v in (x, y)]
    extent = (x[0] - steps[0] / 2, x[-1] + steps[0] / 2, y[0] - steps[1] / 2, y[-1] + steps[1] / 2)
    if empty.any():
        grey = _under_walls(np.where(empty, 1.0, np.nan), inside)
        panel.imshow(
            grey, origin="lower", extent=extent, cmap=ListedColormap([NO_VALUE]), interpolation="nearest", zorder=0.5
        )
        figure.legend(
            handles=[Patch(facecolor=NO_VALUE, edgecolor=WALL, lw=0.4, label=without)],
            loc="outside lower center", frameon=False, fontsize=9,
        )  # fmt: skip
    panel.imshow(
        values, origin="lower", extent=extent, interpolation="nearest", zorder=1, cmap=scale.cmap, norm=scale.norm
    )
    draw_buildings(panel, city, bounds=(extent[0], extent[2], extent[1], extent[3]))
    if anchors is not None:
        draw_anchors(panel, np.asarray(anchors), names or [str(k + 1) for k in range(len(anchors))])
    scale.bar(figure, panel, label, shrink=0.9)
    if title:
        panel.set_title(title, loc="left", fontsize=10)
    return figure


def _under_walls(
    values: Float[ndarray, "rows columns"], inside: Bool[ndarray, "rows columns"]
) -> Float[ndarray, "rows columns"]:
    """Carry the colours of the streets one cell into the buildings, which are drawn on top: no seam along the walls."""
    padded = np.pad(values, 1, constant_values=np.nan)
    rows, columns = values.shape
    around = [padded[1 + i : 1 + i + rows, 1 + j : 1 + j + columns] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    known = np.isfinite(around)
    count = known.sum(axis=0)
    mean = np.where(known, around, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(inside & np.isnan(values) & (count > 0), mean, values)
