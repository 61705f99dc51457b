"""Figure of errors along measured tracks."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from locbounds.fit.held_out import AlongTracks
from locbounds.report.plot import colour

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def along_tracks(results: Sequence[AlongTracks], *, width_s: float, title: str = "") -> "Figure":
    """Left: pooled position RMSE over the time since the start; right: distribution of the errors."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2, gridspec_kw={"width_ratios": (3, 2)})
    for k, result in enumerate(results):
        rows = np.array(result.over_time(width_s))
        style = {"ls": "-", "lw": 1.8} if result.kind == "bound" else {"ls": "--", "lw": 1.2}
        label = f"{result.name} along the tracks" if result.kind == "bound" else result.name
        shade = colour(result.id, k)
        left.plot(rows[:, 1], rows[:, 2], color=shade, label=label, **style)
        if result.kind == "filter":
            low, high = rows[:, 2] - rows[:, 3], rows[:, 2] + rows[:, 3]
            left.fill_between(rows[:, 1], low, high, color=shade, alpha=0.2, linewidth=0)
            errors = np.sort(np.sqrt(np.concatenate([s[1:] for s in result.square_m2])))
            right.plot(errors, np.arange(1, len(errors) + 1) / len(errors), color=shade, label=label, **style)
        else:
            value = result.rmse()[0]
            right.axvline(value, color=shade, label=f"{label}: {value:.2f} m (RMSE)", **style)
    tracks = len(results[0].tracks)
    left.set(xlabel="time since the start of the track in s", ylabel="position RMSE in m", ylim=(0, None))
    left.set_title(title or f"{tracks} measured track{'s, pooled' if tracks > 1 else ''}", loc="left")
    right.set(xlabel="position error in m", ylabel="share of steps with a smaller error", ylim=(0, 1.01))
    right.set_xlim(0, max((r.quantile(0.99) for r in results if r.kind == "filter"), default=1.0) * 1.1)
    right.set_title("distribution", loc="left")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2)
    return figure
