"""Figs. 1 and 2: the densities of signal strength and time of arrival."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np

from locbounds.axes import ndarray
from locbounds.noise import Noise, Uniform
from locbounds.papers.prieto2011.setting import RSS_BIAS_DB, RSS_DB, TOA_BIAS_CYCLES, TOA_CYCLES, cut
from locbounds.precision import double_precision
from locbounds.report.tables import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Densities = Mapping[str, tuple[Noise, Noise]]
"""Noise and bias of every case of a figure, by name."""
POINTS = 401
COLUMNS = ("case", "error", "density")
FIG1 = {
    f"noise {RSS_DB:g} dB, bias {RSS_BIAS_DB:g} dB": (cut(RSS_DB), cut(RSS_BIAS_DB)),
    f"noise {RSS_BIAS_DB:g} dB, bias {RSS_DB:g} dB": (cut(RSS_BIAS_DB), cut(RSS_DB)),
}
FIG2 = {
    f"noise {TOA_CYCLES:g} cycles, bias up to {TOA_BIAS_CYCLES:g}": (cut(TOA_CYCLES), Uniform(0.0, TOA_BIAS_CYCLES)),
    f"noise 0.5 cycles, bias up to {TOA_BIAS_CYCLES:g}": (cut(0.5), Uniform(0.0, TOA_BIAS_CYCLES)),
}


@double_precision
def density(noise: Noise, e: ndarray) -> ndarray:
    """Density at some errors.

    >>> float(density(Uniform(0.0, 2.0), np.array([1.0]))[0])
    0.5
    """
    return np.exp(np.asarray(noise.log_prob(jnp.asarray(e))))


def curves(figure: Densities) -> dict[str, tuple[ndarray, ndarray]]:
    """Errors and densities of every case of a figure."""
    found = {}
    for name, (noise, bias) in figure.items():
        law = noise + bias
        low, high = law.support()[0]
        e = np.linspace(low, high, POINTS)
        found[name] = (e, density(law, e))
    return found


def csv_of(figure: Densities) -> str:
    """``fig1.csv`` or ``fig2.csv``; errors in dB or clock cycles."""
    rows = [(name, float(e), float(p)) for name, (x, y) in curves(figure).items() for e, p in zip(x, y, strict=True)]
    return csv_text(COLUMNS, rows)


def draw(figure: Densities, unit: str, title: str) -> "Figure":
    """Densities of the cases side by side, with those of noise and bias."""
    from matplotlib.figure import Figure

    picture = Figure(figsize=(9.0, 3.9), layout="constrained")
    panels = np.atleast_1d(picture.subplots(1, len(figure)))
    for ax, (name, (e, p)) in zip(panels, curves(figure).items(), strict=True):
        for part, label, style in zip(figure[name], ("noise", "bias"), ("--", ":"), strict=True):
            ax.plot(e, density(part, e), style, color="0.5", lw=1.1, label=label)
        ax.plot(e, p, color="C0", lw=1.8, label="sum: what is measured")
        ax.plot(e[[0, -1]], [0, 0], "o", color="C3", ms=5, label="edges like t: infinite information")
        ax.set(xlabel=f"error in {unit}", title=name, ylim=(0, None))
        ax.title.set_fontsize(10)
    panels[0].set_ylabel(f"density in 1/{unit.rstrip('s')}")
    handles, labels = panels[0].get_legend_handles_labels()
    picture.legend(handles, labels, frameon=False, fontsize=9, loc="outside lower center", ncols=4)
    picture.suptitle(title, x=0.01, ha="left", fontsize=11)
    return picture
