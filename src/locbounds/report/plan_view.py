"""What every picture of a plan has: colours with a bar, outline, anchors with names, a scale bar."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOP = 0.98  # quantile of the values at the top of a colour bar, so that a few bad places do not hide the rest
LOGARITHMIC = 10.0  # a wider range of values has logarithmic colours
ALIKE = 0.02  # a narrower range, relative to the largest value, is no pattern: colours then begin at zero
MOST_TICKS = 12  # of whole numbers at a colour bar
BARS_M = tuple(float(f"{k}e{e}") for e in range(-2, 5) for k in (1, 2, 5))
FAR = 0.6  # anchors farther off than this, relative to the area's longer side, do not widen the picture


def scale_bar(panel: "Axes") -> None:
    """A bar of a round length, about a fifth of the picture's width, above the upper right corner of the axes."""
    from matplotlib.transforms import ScaledTranslation

    (left, right), top = panel.get_xlim(), panel.get_ylim()[1]
    length = max((b for b in BARS_M if b <= 0.25 * (right - left)), default=BARS_M[0])
    lifted = panel.transData + ScaledTranslation(0, 8 / 72, panel.figure.dpi_scale_trans)
    ends = [right - length, right]
    panel.plot(ends, [top, top], color="black", lw=3, solid_capstyle="butt", clip_on=False, transform=lifted)
    panel.annotate(
        f"{length:g} m", (ends[0], top), (-5, 8), textcoords="offset points", ha="right", va="center", fontsize=8
    )


def draw_anchors(panel: "Axes", anchors: Float[ndarray, "anchors 2"], names: Sequence[str]) -> None:
    """Triangles with their names, if any, beside them; what is outside of the picture is left out."""
    import matplotlib.patheffects as effects

    panel.plot(*anchors.T, "^", color="black", mec="white", mew=0.8, ms=9, zorder=7, ls="", label="anchors")
    middle = np.mean([panel.get_xlim(), panel.get_ylim()], axis=1)
    for name, place in zip(names, anchors, strict=bool(names)):
        left, below = place > middle  # names point inwards
        text = panel.annotate(
            name,
            place,
            (-6 if left else 6, -6 if below else 6),
            textcoords="offset points",
            ha="right" if left else "left",
            va="top" if below else "bottom",
            fontsize=9,
            zorder=8,
            annotation_clip=True,
        )
        text.set_path_effects([effects.withStroke(linewidth=2.5, foreground="white")])


class Colours(NamedTuple):
    """How values become colours.

    Attributes
    ----------
    norm, cmap
        Of matplotlib.
    extend : str
        ``"max"`` where there are values above the top of the bar.
    ticks
        Of the bar; None for matplotlib's own.
    """

    norm: Any
    cmap: Any
    extend: str
    ticks: Any

    def bar(self, figure: "Figure", panels: Any, label: str, *, shrink: float = 0.85) -> None:
        """A colour bar beside axes."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import LogNorm

        image = ScalarMappable(self.norm, self.cmap)
        bar = figure.colorbar(image, ax=panels, label=label, extend=self.extend, shrink=shrink, ticks=self.ticks)
        if isinstance(self.norm, LogNorm):
            bar.ax.yaxis.set_major_formatter("{x:g}")
            bar.ax.yaxis.set_minor_formatter("")


def colours(values: Float[ndarray, "..."], high: float | None = None) -> Colours:
    """Colours of values: logarithmic where they spread over more than a factor of 10, steps for few whole numbers.

    Parameters
    ----------
    values
        Of any shape; those that are not finite do not count.
    high
        Value at the top; by default the 98 % quantile.

    Examples
    --------
    >>> scale = colours(np.append(np.arange(1.0, 200.0), np.inf))
    >>> type(scale.norm).__name__, scale.norm.vmin, scale.extend, colours(np.array([0.0, 3.0, 1.0])).ticks.tolist()
    ('LogNorm', 1.0, 'max', [0, 1, 2, 3])
    """
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import LogLocator

    some = values[np.isfinite(values)]
    low, most = (float(some.min()), float(some.max())) if some.size else (0.0, 1.0)
    if some.size and not np.any(some % 1) and (most if high is None else high) <= MOST_TICKS:
        top = int(most if high is None else high)
        steps = colormaps["viridis"].resampled(top + 1)
        return Colours(Normalize(-0.5, top + 0.5), steps, "max" if most > top else "neither", np.arange(top + 1))
    top = high if high is not None else float(np.quantile(some, TOP)) if some.size else 1.0
    extend = "max" if most > top * (1 + 1e-6) else "neither"
    if low > 0 and top > LOGARITHMIC * low:
        return Colours(LogNorm(low, top), colormaps["viridis"], extend, LogLocator(subs=(1.0, 2.0, 5.0)))
    return Colours(Normalize(low if top - low > ALIKE * top else 0.0, top or 1.0), colormaps["viridis"], extend, None)


def outline(polygon: Any) -> Any:
    """A Shapely polygon with its holes as one matplotlib path."""
    import shapely
    from matplotlib.path import Path

    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    return Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))


def draw_outline(panel: "Axes", shape: Any) -> None:
    """Rings of a Shapely polygon."""
    for ring in (shape.exterior, *shape.interiors):
        panel.plot(*np.asarray(ring.coords)[:, :2].T, color="0.25", lw=1.0, zorder=5)


def frame(panel: "Axes", low: ndarray, high: ndarray, anchors: Float[ndarray, "anchors 2"]) -> int:
    """Limits around an area and the anchors that are near it; returns how many anchors stay outside."""
    from matplotlib.ticker import MaxNLocator

    size = float((high - low).max())
    near = np.all((anchors > low - FAR * size) & (anchors < high + FAR * size), axis=1)
    shown = np.vstack([low, high, anchors[near]])
    room = 0.04 * np.ptp(shown, axis=0).max()
    (left, bottom), (right, top) = shown.min(0) - room, shown.max(0) + room
    panel.set_xlim(left, right)
    panel.set_ylim(bottom, top)
    panel.set_aspect("equal")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
    panel.set_xlabel("x in m")
    panel.set_ylabel("y in m")
    panel.tick_params(labelsize=8)
    return int((~near).sum())
