"""Figs. 3 to 6: a node anywhere in a disc, three stations on a circle around its centre.

The chapter draws one case per figure (ToA with stations at 15 m, ToA at 5 m, RSS at 5 m, AoA at 5 m); here every figure
has a second one (TDoA, or the other radius), and TDoA's covariance is F C F^T. Angles of the stations are not printed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.plan import Plan, aoa, rss, tdoa, toa
from locbounds.priors import UniformDisc
from locbounds.static.crlb import crlb

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AREA_M = 15.0
ANGLES_DEG = (90.0, 210.0, 330.0)
EXPONENT = 3.0
METHODS = ("CRLB", "BCRB", "WWB", "WWB as printed", "EZZB", "MMSE")
COLUMNS = ("case", "sigma", "method", "rmse_m", "stderr_m", "valid")
VALID, REFUSED, ESTIMATE = "valid", "refused", "estimate"
RTOL, MMSE_RTOL = 1e-3, 2e-3
METRES = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
DECIBELS = (0.5, 1.0, 2.0, 4.0, 8.0)
RADIANS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
CRLB_NODES = (60, 90)  # along a line
SMALL_SIGMA = 1e-3  # where angles are not wide: information scales with the noise from there on


class Case(NamedTuple):
    """What is measured, and from where.

    Attributes
    ----------
    kind : str
        ``"ToA"``, ``"TDoA"``, ``"RSS"`` or ``"AoA"``.
    radius_m : float
        Of the circle of stations.
    figure : str
        Where it is drawn.
    """

    kind: str
    radius_m: float
    figure: str

    @property
    def name(self) -> str:
        """As in the files."""
        return f"{self.kind} R_BS={self.radius_m:g} m"

    @property
    def unit(self) -> str:
        """Of sigma."""
        return {"RSS": "dB", "AoA": "rad"}.get(self.kind, "m")

    @property
    def sigmas(self) -> tuple[float, ...]:
        """Noise levels that are computed."""
        return {"RSS": DECIBELS, "AoA": RADIANS}.get(self.kind, METRES)

    def plan(self, sigma: float = 1.0, *, turned_deg: float = 0.0) -> Plan:
        """The plan at a noise level, the stations turned."""
        stations = anchors(self.radius_m, turned_deg)
        prior = disc()
        if self.kind == "RSS":
            return rss(stations, sigma, exponent=EXPONENT, prior=prior, title=self.name)
        make = {"ToA": toa, "TDoA": tdoa, "AoA": aoa}[self.kind]
        return make(stations, sigma, prior=prior, title=self.name)


CASES = (
    Case("ToA", 15.0, "fig3"),
    Case("TDoA", 15.0, "fig3"),
    Case("ToA", 5.0, "fig4"),
    Case("TDoA", 5.0, "fig4"),
    Case("RSS", 5.0, "fig5"),
    Case("RSS", 15.0, "fig5"),
    Case("AoA", 5.0, "fig6"),
    Case("AoA", 15.0, "fig6"),
)
FIGURE_OF = {case.name: case.figure for case in CASES}


class Row(NamedTuple):
    """One number: a method at a noise level of a case.

    Attributes
    ----------
    stderr_m : float
        Standard error of the MMSE, quadrature error of the others.
    valid : str
        ``valid``: a bound here; ``refused``: not a bound here; ``estimate``: the least error itself.
    """

    case: str
    sigma: float
    method: str
    rmse_m: float
    stderr_m: float
    valid: str


def disc() -> UniformDisc:
    """Where the node is."""
    return UniformDisc([0.0, 0.0], AREA_M)  # pyright: ignore[reportCallIssue]


def anchors(radius_m: float, turned_deg: float = 0.0) -> Float[ndarray, "3 2"]:
    """Stations at 90, 210 and 330 degrees.

    >>> anchors(15.0).round(3)[0].tolist()
    [0.0, 15.0]
    """
    angle = np.deg2rad(np.array(ANGLES_DEG) + turned_deg)
    return radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def expected_crlb(case: Case) -> tuple[float, float]:
    """Root of the mean over the disc of the local Cramér-Rao bound at sigma = 1, and its quadrature error.

    Infinite for time differences with stations inside the disc: on the extension of a baseline two directions agree,
    and the bound grows with the inverse square of the distance from it.
    """
    if case.kind == "TDoA" and case.radius_m < AREA_M:
        return np.inf, 0.0
    found = []
    for n in CRLB_NODES:
        points, weights = disc().nodes(n)
        found.append(np.sqrt(weights @ np.square(crlb(case.plan(SMALL_SIGMA), points).rmse)) / SMALL_SIGMA)
    return float(found[1]), float(abs(found[1] - found[0]))


def inverse_expected_information(case: Case) -> float:
    """Root of the trace of the inverse expected Fisher information at sigma = 1: what a BCRB would be without the edge.

    Zero for strengths and angles, whose expected information is infinite.
    """
    if case.kind in ("RSS", "AoA"):
        return 0.0
    points, weights = disc().nodes(CRLB_NODES[1])
    J = np.einsum("n,nab->ab", weights, np.asarray(case.plan(SMALL_SIGMA).information(points)))
    return float(np.sqrt(np.trace(np.linalg.inv(J)))) / SMALL_SIGMA


def case_rows(
    case: Case, *, seed: int = 0,
    announce: Callable[[str], None] = lambda text: None,
) -> list[Row]:  # fmt: skip
    """All methods at all noise levels of a case."""
    from locbounds.static.mmse import mmse
    from locbounds.static.noise_levels import bounds_over_noise

    announce(f"{case.name}: bounds")
    crlb, crlb_error = expected_crlb(case)
    bcrb = inverse_expected_information(case)
    rows = []
    for level in bounds_over_noise(case.plan(), case.sigmas, rtol=RTOL):
        sigma = level.scale
        announce(f"{case.name}: least error at {sigma:g} {case.unit}")
        least = mmse(case.plan(sigma), rtol=MMSE_RTOL, seed=seed)
        least_m = float(least.mean_position_rmse())
        values = {
            "CRLB": (sigma * crlb, sigma * crlb_error, REFUSED),
            "BCRB": (sigma * bcrb, 0.0, REFUSED),
            "WWB": (level.wwb_m, level.wwb_m * level.wwb_error, VALID),
            "WWB as printed": (level.printed_m, level.printed_m * level.printed_error, VALID),
            "EZZB": (level.ezzb_m, level.ezzb_m * level.ezzb_error, VALID),
            "MMSE": (least_m, least.mean_position_rmse_stderr(), ESTIMATE),
        }
        rows += [Row(case.name, sigma, method, *values[method]) for method in METHODS]
    return rows


def simple_study(
    figures: Iterable[str] = ("fig3", "fig4", "fig5", "fig6"), *, seed: int = 0,
    announce: Callable[[str], None] = lambda text: None,
) -> dict[str, list[Row]]:  # fmt: skip
    """Figure -> rows of its cases."""
    wanted = list(figures)
    return {
        name: [row for case in CASES if case.figure == name for row in case_rows(case, seed=seed, announce=announce)]
        for name in wanted
    }


def figure_csv(rows: Iterable[Row]) -> str:
    """Rows of a figure as CSV."""
    from locbounds.report.tables import csv_text

    return csv_text(COLUMNS, rows)


STYLE = {
    "CRLB": {"color": "0.55", "ls": ":", "lw": 1.4},
    "BCRB": {"color": "0.35", "ls": "--", "lw": 1.4},
    "WWB": {"color": "C0", "ls": "-", "lw": 1.8, "marker": "o"},
    "WWB as printed": {"color": "C9", "ls": "-", "lw": 1.2, "marker": "v"},
    "EZZB": {"color": "C3", "ls": "-", "lw": 1.8, "marker": "s"},
    "MMSE": {"color": "k", "ls": "-", "lw": 1.5, "marker": "D"},
}
LABELS = {
    "CRLB": "mean CRLB (not a bound here)",
    "BCRB": "inverse mean information (not a bound here)",
    "MMSE": "MMSE: the least error",
}


def simple_figure(rows: Iterable[Row]) -> Figure:
    """RMSE over the noise level, one panel per case."""
    from matplotlib.figure import Figure

    rows = list(rows)
    names = list(dict.fromkeys(row.case for row in rows))
    figure = Figure(figsize=(5.0 * len(names), 4.9), layout="constrained")
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    top = 1.6 * max(row.rmse_m for row in rows if row.method == "MMSE")
    low = 0.8 * min(row.rmse_m for row in rows if row.valid == VALID)
    for axes, name in zip(panels, names, strict=True):
        case, absent = next(c for c in CASES if c.name == name), []
        for method in METHODS:
            line = [(r.sigma, r.rmse_m, r.stderr_m) for r in rows if (r.case, r.method) == (name, method)]
            x, y, error = np.array(line).T
            seen = np.isfinite(y) & (y > 0)
            label = LABELS.get(method, method)
            if not seen.any():
                axes.plot([], [], label=label, ms=4, **STYLE[method])
                absent.append(f"{label.partition(' (')[0]}: {'zero' if np.all(y == 0) else 'infinite'}")
            elif method == "MMSE":
                axes.errorbar(x, y, 2 * error, label=label, ms=4, **STYLE[method])
            else:
                axes.plot(x[seen], y[seen], label=label, ms=4, **STYLE[method])
        axes.set(xscale="log", yscale="log", xlabel=f"standard deviation of the noise in {case.unit}", ylim=(low, top))
        axes.set_title(name, loc="left", fontsize="medium")
        axes.text(0.97, 0.04, "\n".join(absent), transform=axes.transAxes, ha="right", fontsize="small", color="0.35")
        axes.set_xticks(case.sigmas, [f"{s:g}" for s in case.sigmas], minor=False)
        axes.set_xticks([], minor=True)
        ticks = [t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if low < t < top]
        axes.set_yticks(ticks, [f"{t:g}" for t in ticks])
        axes.set_yticks([], minor=True)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("position RMSE in m")
    handles = dict(zip(*reversed(panels[0].get_legend_handles_labels()), strict=True))
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False, fontsize="small"
    )
    return figure
