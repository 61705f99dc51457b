"""Figs. 7 and 8 of McGuire and Plataniotis (2009): terminals in the streets of a dense city.

Buildings of 300 m, streets of 20 m. The chapter does not print where the stations are: at every other crossing, like
one colour of a checkerboard, its statements hold (the nearest station has sight, the other two are one corner away).
The terminal is anywhere on the streets with equal probability and measured by its three nearest stations. Which three
these are tells the stretch of street, from the nearest station to the next crossing: all stretches are alike, so that
one stands for all. That support is convex, and a Weiss-Weinstein bound needs a length of its own along and across it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from locbounds.axes import LOS, Float, ndarray
from locbounds.papers.mcguire2009.simple import ESTIMATE, VALID, Row
from locbounds.papers.mcguire2009.statements import FAILS, HOLDS, TIGHT, Statement, word
from locbounds.plan import Observations, Plan
from locbounds.precision import double_precision
from locbounds.propagation import City, StreetCell, StreetRanges, street_cells, street_links

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLOCK_M, STREET_M = 300.0, 20.0
PITCH_M = BLOCK_M + STREET_M
IN_USE = 3
SIGMAS_M = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
STREET_CASES = ("ToA", "TDoA")
NODES, FINER = 10, 16  # of the quadrature, along a side
RARELY, SLIGHTLY = 0.05, 10.0  # share of places; %: what the words are taken to mean
GRID = (14, 9)  # lengths along and across the street that are tried first
ZOOMS, AROUND = 4, (-1.0, 0.0, 1.0)


def city(blocks: int = 2) -> City:
    """Square blocks, ``2 * blocks`` along each side, around the crossing at the origin.

    Examples
    --------
    >>> len(city(1).buildings), city(1).streets().area
    (4, 24400.0)
    """
    corner = PITCH_M * np.arange(-blocks, blocks) + STREET_M / 2
    return City([shapely.box(x, y, x + BLOCK_M, y + BLOCK_M) for x in corner for y in corner])


def nearby() -> City:
    """The six blocks around one stretch: no shortest path of its links goes beyond them.

    Examples
    --------
    >>> len(nearby().buildings)
    6
    """
    inner = [b for b in city(2).buildings if b.polygon.bounds[0] < 400 and b.polygon.bounds[0] > -400]
    return City([b for b in inner if abs(b.polygon.centroid.y) < PITCH_M])


def stations(reach: int = 2) -> dict[str, tuple[float, float]]:
    """Every other crossing, up to ``reach`` crossings from the origin.

    Examples
    --------
    >>> list(stations(1)), stations(1)["1,1"]
    (['-1,-1', '-1,1', '0,0', '1,-1', '1,1'], (320.0, 320.0))
    """
    around = range(-reach, reach + 1)
    return {f"{i},{j}": (i * PITCH_M, j * PITCH_M) for i in around for j in around if (i + j) % 2 == 0}


def stretch() -> tuple[StreetCell, Float[ndarray, "stations 2"]]:
    """The street from the station at the origin to the crossing on its right, and its stations, the nearest one first.

    Examples
    --------
    >>> cell, places = stretch()
    >>> round(cell.region.area), places.tolist()
    (6200, [[0.0, 0.0], [320.0, -320.0], [320.0, 320.0]])
    """
    known = stations()
    around = shapely.box(-PITCH_M, -PITCH_M, PITCH_M, PITCH_M)
    for cell in street_cells(city().streets(around), list(known.values()), count=IN_USE):
        places = np.array([list(known.values())[k] for k in cell.nearest])
        if not places[0].any() and (places[1:, 0] > 0).all():
            return cell, places
    raise AssertionError("unreachable")


def plan(case: str = "ToA", sigma_m: float = 1.0) -> Plan:
    """Times of arrival, or their differences to the nearest station, on one stretch of street.

    Examples
    --------
    >>> plan("TDoA", 10.0).groups[0].covariance.tolist()
    [[200.0, 100.0], [100.0, 200.0]]
    """
    cell, places = stretch()
    to = None if case == "ToA" else 0
    ranges = StreetRanges(nearby(), places, difference_to=to)
    covariance = sigma_m**2 * (np.eye(IN_USE) if to is None else np.eye(IN_USE - 1) + 1.0)
    return Plan([Observations([ranges], covariance)], prior=cell.prior)


class Sights(NamedTuple):
    """What the chapter says of sight in this city, measured on the streets.

    Attributes
    ----------
    nearest_los, other_los : float
        Share of the streets where the nearest station, and another one in use, has sight.
    corners : float
        Share of the links without sight that bend around exactly one corner.
    """

    nearest_los: float
    other_los: float
    corners: float


def sight_shares(nodes: int = 60) -> Sights:
    """Sight and corners on one stretch, by quadrature.

    Examples
    --------
    >>> found = sight_shares(20)
    >>> found.nearest_los, found.corners, bool(found.other_los < 0.03)
    (1.0, 1.0, True)
    """
    cell, places = stretch()
    points, weights = cell.prior.nodes(nodes)
    links = street_links(city(), places, points)
    free = weights @ (links.sight == LOS)
    bends = [len(links.path(i, m)) - 2 for i, m in np.argwhere(links.sight != LOS)[:: nodes // 4].tolist()]
    return Sights(round(float(free[0]), 12), float(free[1:].mean()), float(np.mean(np.array(bends) == 1)))


@double_precision
def weiss_weinstein(
    case: str, sigmas_m: Sequence[float], *, equal: bool = False
) -> list[tuple[float, Float[ndarray, " 2"], float]]:
    """Largest Weiss-Weinstein bound over a length along and a length across the street, per noise level.

    Parameters
    ----------
    case
        ``"ToA"`` or ``"TDoA"``.
    sigmas_m
        Deviations of a time of arrival, in metres.
    equal
        One length for both directions, as the chapter's (17).

    Returns
    -------
    list
        RMSE in metres, the two lengths in metres, and the relative quadrature error, per noise level.
    """
    from locbounds.static import weiss_weinstein_kernel as kernel
    from locbounds.static.plan_laws import pair_law, support_of

    one = plan(case)
    assert one.prior is not None
    support, law = support_of(one.prior), pair_law(one)
    reach = np.array([support.reach(axis) for axis in np.eye(2)])
    if equal:
        reach = np.full(2, reach.min())

    def values(logs: ndarray, nodes: int) -> ndarray:
        tests = [np.diag(np.exp(x) * reach) for x in logs]
        found = kernel.grams(support, law, tests, nodes, sigmas_m)
        traces = [np.trace(kernel.bound_matrices(H, g), axis1=1, axis2=2) for H, g in zip(tests, found, strict=True)]
        return np.stack(traces)

    axes = [np.log(np.geomspace(low, 0.9, n)) for low, n in zip((5e-4, 0.1), GRID, strict=True)]
    if equal:
        logs = np.repeat(np.log(np.geomspace(5e-4, 0.9, 3 * GRID[0]))[:, None], 2, axis=1)
    else:
        logs = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
    step = np.array([a[1] - a[0] for a in axes])
    mse = values(logs, NODES)
    for _ in range(ZOOMS):
        step = step / 2
        offsets = [(a, a) for a in AROUND] if equal else [(a, b) for a in AROUND for b in AROUND]
        tops = np.unique(logs[mse.argmax(0)], axis=0)
        near = np.minimum((tops[:, None] + np.array(offsets) * step).reshape(-1, 2), np.log(0.98))
        logs, mse = np.concatenate([logs, near]), np.concatenate([mse, values(near, NODES)])
    best = logs[mse.argmax(0)]
    fine = values(best, FINER)[np.arange(len(best)), np.arange(len(best))]
    change = np.abs(np.sqrt(fine / mse.max(0)) - 1)
    return [(float(np.sqrt(m)), np.exp(x) * reach, float(c)) for m, x, c in zip(fine, best, change, strict=True)]


@double_precision
def ziv_zakai(case: str, sigmas_m: Sequence[float]) -> list[float]:
    """Extended Ziv-Zakai bound along and across the street: RMSE in metres per noise level."""
    from locbounds.static.plan_laws import pair_law, support_of
    from locbounds.static.ziv_zakai import over_axes

    one = plan(case)
    assert one.prior is not None
    found = over_axes(support_of(one.prior), pair_law(one), np.eye(2), sigmas_m)
    return [float(np.sqrt(axes.sum())) for axes in found.axes_m2]


def fig8(
    sigmas_m: Sequence[float] = SIGMAS_M,
    *,
    cases: Sequence[str] = STREET_CASES,
    rtol: float = 2e-3,
    seed: int = 0,
    announce: Callable[[str], None] = lambda text: None,
) -> list[Row]:
    """Fig. 8: Weiss-Weinstein and Ziv-Zakai bounds and the least RMSE on the streets.

    Parameters
    ----------
    sigmas_m
        Deviations of a time of arrival, in metres; the chapter's are not printed.
    cases
        ``"ToA"`` and ``"TDoA"``.
    rtol
        Relative standard error of the least RMSE.
    seed
        Of its draws.
    announce
        Told what is being done.
    """
    from locbounds.static.mmse import mmse

    rows = []
    for case in cases:
        announce(f"Fig. 8, {case}: Weiss-Weinstein")
        for method, equal in (("WWB", False), ("WWB, one length", True)):
            found = weiss_weinstein(case, sigmas_m, equal=equal)
            rows += [Row(case, s, method, value, 0.0, VALID) for s, (value, _, _) in zip(sigmas_m, found, strict=True)]
        announce(f"Fig. 8, {case}: Ziv-Zakai")
        rows += [
            Row(case, s, "EZZB", value, 0.0, VALID)
            for s, value in zip(sigmas_m, ziv_zakai(case, sigmas_m), strict=True)
        ]
        for sigma in sigmas_m:
            announce(f"Fig. 8, {case}, {sigma:g} m: least error")
            least = mmse(plan(case, sigma), rtol=rtol, seed=seed)
            value = float(np.sqrt(np.asarray(least.position_mse)).item())
            rows.append(Row(case, sigma, "MMSE", value, float(value * least.relative_stderr()), ESTIMATE))
    return rows


def street_statements(rows: Iterable[Row]) -> list[Statement]:
    """The chapter's claims on Figs. 7 and 8, from the rows of Fig. 8.

    Examples
    --------
    >>> rows = [Row("ToA", 1.0, m, v, 0.01, VALID) for m, v in (("WWB", 4.0), ("MMSE", 5.0))]
    >>> found = street_statements([*rows, *(row._replace(case="TDoA", rmse_m=row.rmse_m + 1) for row in rows)])
    >>> found[1].verdict, found[1].why
    ('does not hold', 'by 20.0 to 20.0 % in the least RMSE')
    """
    found = sight_shares()
    known = {(row.case, row.sigma, row.method): row.rmse_m for row in rows}
    sigmas = list(dict.fromkeys(sigma for _, sigma, _ in known))
    cases = list(dict.fromkeys(case for case, _, _ in known))
    tight = [known[c, s, "WWB"] / known[c, s, "MMSE"] for c in cases for s in sigmas]
    worse = [100 * (known["TDoA", s, "MMSE"] / known["ToA", s, "MMSE"] - 1) for s in sigmas]
    return [
        Statement(
            "Fig. 7: only the nearest station has line of sight",
            HOLDS if found.nearest_los == 1 and found.other_los < RARELY else FAILS,
            f"the nearest has it on {found.nearest_los:.0%} of the streets, each of the other two on "
            f"{found.other_los:.1%} (inside a crossing), with stations at every other crossing: the layout is not "
            "printed",
        ),
        Statement(
            "Fig. 8: TDoA is slightly worse than ToA",
            word(0 < w < SLIGHTLY for w in worse),
            f"by {_span(worse, '.1f')} % in the least RMSE",
        ),
        Statement(
            "Fig. 8: the Weiss-Weinstein bound is fairly tight",
            word(t >= TIGHT for t in tight),
            f"{_span(tight, '.2f')} of the least RMSE, with a length of its own along and across the street; the noise "
            "of the figure is not printed",
        ),
    ]


def _span(values: Sequence[float], form: str) -> str:
    return f"{min(values):{form}} to {max(values):{form}}"


LOOKS = {
    "MMSE": ("least possible (MMSE)", "o", "none", "black"),
    "EZZB": ("Ziv-Zakai", "", "-", "C2"),
    "WWB": ("Weiss-Weinstein, lengths along and across", "", "-", "C0"),
    "WWB, one length": ("Weiss-Weinstein, one length", "", ":", "C0"),
}


def fig8_figure(rows: Sequence[Row]) -> Figure:
    """Fig. 8: RMSE over the noise, one panel per case."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullFormatter

    cases = list(dict.fromkeys(row.case for row in rows))
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    panels = figure.subplots(1, len(cases), sharey=True, squeeze=False)[0]
    for panel, case in zip(panels, cases, strict=True):
        for method, (label, marker, line, colour) in LOOKS.items():
            mine = [row for row in rows if (row.case, row.method) == (case, method)]
            panel.errorbar(
                [row.sigma for row in mine], [row.rmse_m for row in mine],
                [2 * row.stderr_m for row in mine] if marker else None,
                label=label, marker=marker, ls=line, color=colour, ms=5, capsize=2,
            )  # fmt: skip
        panel.set(xscale="log", yscale="log", xlabel="standard deviation of a time of arrival in m")
        for axis, ticks in ((panel.xaxis, (1, 2, 5, 10, 20, 50, 100)), (panel.yaxis, (3, 5, 10, 20, 50))):
            axis.set_major_locator(FixedLocator(ticks))
            axis.set_major_formatter(FormatStrFormatter("%g"))
            axis.set_minor_formatter(NullFormatter())
        panel.set_title({"ToA": "Times of arrival", "TDoA": "Time differences of arrival"}[case], loc="left")
        panel.grid(alpha=0.3, which="both")
    panels[0].set_ylabel("position RMSE in m")
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def fig7_figure() -> Figure:
    """Fig. 7: the city, its stations, one stretch of street and the links of a terminal on it."""
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch

    from locbounds.report.city_plot import draw_buildings, draw_paths
    from locbounds.report.plan_view import draw_anchors, outline

    cell, places = stretch()
    whole = city(3)
    links = street_links(whole, places, [[200.0, -4.0]])
    figure = Figure(figsize=(7.0, 6.1), layout="constrained")
    panel = figure.subplots()
    draw_buildings(panel, whole, bounds=(-480, -480, 800, 480))
    panel.add_patch(PathPatch(outline(cell.region), facecolor="#F4D58D", edgecolor="none", zorder=1))
    draw_paths(panel, links, [(0, m) for m in range(IN_USE)])
    panel.plot(*links.points.T, "s", color="white", mec="black", ms=6, zorder=7, ls="", label="terminal")
    others = [p for p in stations(3).values() if not any(np.array_equal(p, q) for q in places)]
    panel.plot(*np.array(others).T, "^", color="0.55", mec="white", ms=8, ls="", zorder=7, label="other stations")
    draw_anchors(panel, places, ["nearest", "second", "third"])
    panel.plot([], [], "s", color="#F4D58D", label="where these three are nearest")
    panel.set_title("Stations at every other crossing", loc="left", fontsize=10)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure
