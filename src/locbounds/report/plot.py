"""Figures of results; every function returns a matplotlib figure and saves nothing."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from locbounds.errors import InputError
from locbounds.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"bcrb": "C0", "enumer": "C3", "known-sight": "C4", "los-only": "C5"} | {
    "imm-ekf": "C1",
    "imm-kf": "C2",
    "imm-ekf-factorised": "C6",
    "oracle-ekf": "C7",
    "ekf-banks": "darkgoldenrod",
    "rbpf": "navy",
    "imm-kf-smoother": "yellowgreen",
}  # the same in every figure
BAND = 1.959963984540054  # a 95 % band


def colour(id: str, k: int) -> str:
    """The colour of a method; own filters take what is left.

    >>> colour("bcrb", 3), colour("own", 0)
    ('C0', 'C8')
    """
    return COLOURS.get(id, f"C{8 + k % 2}")


def rmse(results: Sequence[Result] | Result, *, title: str = "", against: str = "time") -> "Figure":
    """Position RMSE over time with 95 % bands: bounds as lines, filters dashed.

    Parameters
    ----------
    results
        Bounds and filters on one scenario.
    title
        Title of the figure.
    against
        ``"time"`` in seconds or ``"step"``.

    Raises
    ------
    InputError
        If there is no result.

    Examples
    --------
    >>> import locbounds as lb
    >>> figure = rmse(lb.bcrb(lb.papers.fritsche2013.scenario(steps=10)), title="BCRB")
    >>> figure.axes[0].get_ylabel()
    'position RMSE in m'
    """
    from matplotlib.figure import Figure

    results = [results] if isinstance(results, Result) else list(results)
    if not results:
        raise InputError("there is nothing to draw", "Give at least one result of a bound or a filter")
    if against not in ("time", "step"):
        raise InputError(f"the error is to be drawn against {against!r}", 'Choose "time" or "step"')
    figure = Figure(figsize=(7.0, 4.8), layout="constrained")
    axes = figure.subplots()
    for k, result in enumerate(results):
        t = result.time_s if against == "time" else np.arange(len(result.time_s))
        middle, error = result.position_rmse.values, result.position_rmse_stderr.values
        style = {"ls": "-", "lw": 1.8} if result.kind == "bound" else {"ls": "--", "lw": 1.3}
        conditional = f" along {result.track}" if result.track else ""
        (line,) = axes.plot(t, middle, label=f"{result.name}{conditional}", color=colour(result.id, k), **style)
        axes.fill_between(
            t, middle - BAND * error, middle + BAND * error, color=line.get_color(), alpha=0.25, linewidth=0
        )
    axes.set_xlabel("time in s" if against == "time" else "time step")
    axes.set_ylabel("position RMSE in m")
    axes.margins(x=0.01)
    axes.grid(alpha=0.3)
    legend = {"title": "bands: 95 % of the Monte Carlo error", "title_fontsize": "small", "frameon": False}
    figure.legend(loc="outside lower center", ncols=3, **legend)
    if title:
        axes.set_title(title, loc="left")
    return figure
