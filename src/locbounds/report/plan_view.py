"""What every picture of a plan has: outline, anchors with names, a scale bar."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from locbounds.axes import Float, ndarray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
