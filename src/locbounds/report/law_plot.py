"""Figure of laws over the errors that they were compared on."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from locbounds.axes import ndarray
from locbounds.fit import LawComparison
from locbounds.fit.noise_law import log_densities

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 3  # the best laws; a Gaussian, too, if it was compared
TAILS = 0.0005, 0.9995  # quantiles between which the errors are drawn
BINS = 80


def law_figure(comparisons: Mapping[str, Sequence[LawComparison]], held_out: Mapping[str, ndarray]) -> "Figure":
    """Histograms of held-out errors with the best laws, linear above and logarithmic below.

    Parameters
    ----------
    comparisons
        Of every sight, best first, as `compare_noise_laws` returns them.
    held_out
        The errors of every sight, m.

    Examples
    --------
    >>> from locbounds.fit import compare_noise_laws
    >>> e = np.random.default_rng(0).laplace(0, 1, 400)
    >>> figure = law_figure({"all": compare_noise_laws(e[:200], e[200:], families=("laplace",))}, {"all": e[200:]})
    >>> [axes.get_title() for axes in figure.axes][0]
    'all: 200 held-out errors'
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(5.5, 4.8 * len(comparisons)), 6.2), layout="constrained")
    panels = figure.subplots(2, len(comparisons), squeeze=False, sharex="col")
    for column, (name, rows) in enumerate(comparisons.items()):
        e = held_out[name]
        low, high = np.quantile(e, TAILS)
        x = np.linspace(low, high, 600)
        edges = np.linspace(low, high, BINS + 1)
        counts = np.histogram(e, edges)[0] / (len(e) * (edges[1] - edges[0]))
        fitted = [row for row in rows if row.fit is not None]
        shown = fitted[:SHOWN] + [row for row in fitted[SHOWN:] if row.family == "gaussian"]
        for axes in panels[:, column]:
            axes.stairs(counts, edges, fill=True, color="0.87", label="measured, held out")
            for k, row in enumerate(shown):
                assert row.fit is not None
                style = {"color": "k", "ls": ":"} if row.family == "gaussian" else {"color": f"C{k}"}
                axes.plot(x, np.exp(log_densities(row.fit.noise, x)), lw=1.3, label=_label(row), **style)
        top, bottom = panels[:, column]
        top.set_title(f"{name}: {len(e):,} held-out errors", fontsize=10)
        top.legend(fontsize=8, frameon=False)
        top.set_ylim(0, 1.1 * max([counts.max(), *(np.max(line.get_ydata()) for line in top.lines)]))
        bottom.set_yscale("log")
        bottom.set_ylim(0.5 * counts[counts > 0].min(), 2 * counts.max())
        bottom.set_xlabel("range error in m")
    for axes in panels[:, 0]:
        axes.set_ylabel("density in 1/m")
    return figure


def _label(row: LawComparison) -> str:
    return row.family if row.behind == 0 else f"{row.family}, {row.behind:.3f} behind"
