"""Accuracy over the streets of a city: local Cramér-Rao bounds where they exist, Bayesian bounds per set of anchors."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import LOS, Bool, Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.propagation import City, Links, LinkTable, StreetCell, street_links
from locbounds.propagation.links import UNREACHED
from locbounds.static.street_raster import FEWEST, raster_ezzb, raster_mmse, raster_wwb, street_raster

MEASURES = ("toa", "tdoa")
BOUNDARY_M = 0.5


def street_crlb(
    links: Links, used: Int[ndarray, "points used"], std_m: float, measure: str
) -> Float[ndarray, " points"]:
    """Cramér-Rao bound on the position RMSE in metres from the anchors in use; inf where the position is not told.

    Parameters
    ----------
    links
        Of the points.
    used
        Which anchors measure each point.
    std_m
        Standard deviation of a time of arrival, in metres; of each one, also for differences.
    measure
        ``"toa"`` or ``"tdoa"``.

    Notes
    -----
    With the unit vectors u from the last corners, ``J = sum u u^T / s^2`` for times, and minus ``k ubar ubar^T / s^2``
    for differences of k of them. Between sight boundaries only: there u, and with it J, jumps.

    Examples
    --------
    >>> import shapely
    >>> links = street_links(City([shapely.box(90, 90, 99, 99)]), [[9.0, 0.0], [0.0, 9.0]], [[0.0, 0.0]])
    >>> street_crlb(links, np.array([[0, 1]]), 1.0, "toa").round(3).tolist()
    [1.414]
    """
    u = np.take_along_axis(links.direction, used[..., None], axis=1)
    J = np.einsum("nka,nkb->nab", u, u)
    if measure == "tdoa":
        J = J - np.einsum("na,nb->nab", u.sum(axis=1), u.sum(axis=1)) / used.shape[1]
    determinant = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] ** 2
    trace = J[:, 0, 0] + J[:, 1, 1]
    told = (trace > 1e-12) & (determinant > 1e-12 * trace**2)
    square = np.divide(trace, determinant, out=np.full(len(J), np.inf), where=told)
    return std_m * np.sqrt(np.where(np.isfinite(trace), square, np.nan))


def near_boundary(
    city: City,
    links: Links,
    anchors: Any,
    used: Int[ndarray, "points used"],
    *,
    roof: Any = (),
    within_m: float = BOUNDARY_M,
) -> Bool[ndarray, " points"]:
    """Which points have, so near, another sight, another last corner, or other nearest anchors.

    Examples
    --------
    >>> import shapely
    >>> city, points = City([shapely.box(0, 0, 10, 10)]), np.array([[20.0, 0.1], [20.0, 5.0]])
    >>> links = street_links(city, {"bs": (-10.0, 0.0)}, points)
    >>> near_boundary(city, links, {"bs": (-10.0, 0.0)}, links.nearest(1)).tolist()
    [True, False]
    """
    here = np.take_along_axis(links.last, used, axis=1)
    changed = np.zeros(len(links.points), dtype=bool)
    for step in within_m * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]):
        other = street_links(city, anchors, links.points + step, roof=roof)
        again = other.nearest(used.shape[1])
        differs = (np.take_along_axis(other.last, used, axis=1) != here).any(axis=1)
        differs |= (again[:, 0] != used[:, 0]) | (np.sort(again, axis=1) != np.sort(used, axis=1)).any(axis=1)
        changed |= differs & ~other.inside
    return changed


class StreetMap(NamedTuple):
    """What the points of a map tell.

    Attributes
    ----------
    links
        Of all points.
    used
        The anchors in use, nearest first, [points, used].
    status
        ``""`` (a value), ``"boundary"``, ``"building"``, ``"unreached"`` or ``"singular"`` (for every measure) per
        point.
    rmse_m
        Measure -> Cramér-Rao bound, NaN where there is none, infinite where the position is not told.
    """

    links: Links
    used: Int[ndarray, "points used"]
    status: list[str]
    rmse_m: dict[str, Float[ndarray, " points"]]

    @property
    def in_sight(self) -> Int[ndarray, " points"]:
        """How many of the anchors in use have sight."""
        return (np.take_along_axis(self.links.sight, self.used, axis=1) == LOS).sum(axis=1)

    @property
    def verdict(self) -> str:
        """For which points the Cramér-Rao bound holds."""
        free = [s for s in self.status if s not in ("building", "unreached")]
        left_out = free.count("boundary")
        text = (
            "crlb: valid for unbiased estimators and points away from sight boundaries; refused at "
            f"{left_out:,} of {len(free):,} street points ({left_out / max(len(free), 1):.0%}) where sight, last "
            "corner or the set of nearest anchors changes nearby, so that the law of the ranges has no derivative"
        )
        for measure in self.rmse_m:
            singular = self.status_of(measure).count("singular")
            if singular:
                text += (
                    f"; infinite for {measure} at {singular:,} ({singular / len(free):.0%}), where it does not tell "
                    "the position"
                )
        unreached = self.status.count("unreached")
        if unreached:
            text += f"; left out: {unreached:,} more points that an anchor in use does not reach"
        return f"{text}. wwb and ezzb need no derivative"

    def status_of(self, measure: str) -> list[str]:
        """Status per point for one measure, which may be singular where another one is not.

        >>> import shapely
        >>> city, places = City([shapely.box(30, 30, 40, 40)]), [[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]]
        >>> found = street_map(city, places, [[25.0, 0.0], [25.0, 9.0]], std_m=1.0, within_m=0.01)
        >>> found.status_of("tdoa")
        ['singular', '']
        """
        singular = np.isinf(self.rmse_m[measure])
        return ["singular" if s == "" and n else s for s, n in zip(self.status, singular.tolist(), strict=True)]


def street_map(
    city: City,
    anchors: Any,
    points: Any,
    *,
    std_m: float,
    count: int = 3,
    roof: Any = (),
    measures: tuple[str, ...] = MEASURES,
    within_m: float = BOUNDARY_M,
    streets: Any = None,
) -> StreetMap:
    """Cramér-Rao bounds over points of a city, from the nearest anchors.

    Parameters
    ----------
    city, anchors, points, roof
        As for :func:`~locbounds.street_links`.
    std_m
        Standard deviation of a time of arrival, in metres.
    count
        How many nearest anchors measure.
    measures
        ``"toa"``, ``"tdoa"``.
    within_m
        Distance from a sight boundary up to which no bound is given.
    streets
        The region that is meant, a Shapely polygon or several; by default all that is free of buildings.

    Raises
    ------
    InputError
        If there are too few anchors, a number is out of range, no point lies on a street, or an anchor reaches none of
        those that do.

    Examples
    --------
    >>> import shapely
    >>> city = City([shapely.box(0, 0, 10, 10)])
    >>> found = street_map(city, [[-5, 20], [20, 20], [5, -20]], [[-5.0, 2.0], [5.0, 5.0]], std_m=1.0)
    >>> found.status, found.rmse_m["toa"].round(2).tolist()
    (['', 'building'], [1.62, nan])
    """
    if not (np.isfinite(std_m) and std_m > 0 and np.isfinite(within_m) and within_m >= 0):
        raise InputError(f"a deviation of {std_m} m, a distance of {within_m} m", "Give positive numbers of metres")
    wrong = [m for m in measures if m not in MEASURES]
    if wrong or not measures:
        raise InputError(f"the measures are {', '.join(measures) or 'none'}", f"Choose from {', '.join(MEASURES)}")
    links = street_links(city, anchors, points, roof=roof)
    free = ~links.inside
    if streets is not None:
        import shapely

        free &= shapely.contains_xy(streets, *links.points.T)
    if not free.any():
        raise InputError("no point of the map lies on a street", "Choose another area or a smaller step")
    deaf = (links.sight[free] == UNREACHED).all(axis=0)
    if deaf.any():
        raise InputError(
            f"anchor {links.names[int(np.argmax(deaf))]} reaches no street point of the map",
            "It stands in a courtyard without a way out: move it, or put it on the roof",
        )
    if "tdoa" in measures and count < 2:
        raise InputError("time differences of a single anchor", "Use two nearest anchors at least")
    used = links.nearest(count)
    unreached = (np.take_along_axis(links.sight, used, axis=1) == UNREACHED).any(axis=1)
    boundary = near_boundary(city, links, anchors, used, roof=roof, within_m=within_m)
    rmse = {m: street_crlb(links, used, std_m, m) for m in measures}
    blank = links.inside | unreached | boundary
    singular = np.logical_and.reduce([np.isinf(v) for v in rmse.values()])
    status = np.select(
        [links.inside, unreached, boundary, singular], ["building", "unreached", "boundary", "singular"], ""
    )
    return StreetMap(links, used, status.tolist(), {m: np.where(blank, np.nan, v) for m, v in rmse.items()})


class CellBounds(NamedTuple):
    """Bounds for a mobile that is anywhere on the streets of one set of anchors with equal probability."""

    nearest: tuple[int, ...]
    share: float
    measure: str
    wwb_m: float
    ezzb_m: float
    mmse_m: float
    mmse_stderr_m: float

    @property
    def tightest_m(self) -> float:
        """The larger one of both bounds: both hold for any path lengths."""
        return max(self.wwb_m, self.ezzb_m)


def cell_bounds(
    city: City,
    anchors: Float[ndarray, "anchors 2"],
    cell: StreetCell,
    *,
    std_m: float,
    measure: str,
    step_m: float,
    roof: Any = (),
    draws: int = 2000,
    seed: int = 0,
) -> CellBounds | None:
    """Weiss-Weinstein, Ziv-Zakai and the least error on one cell of the streets; None where no anchor pair reaches it.

    Cells are cut to a raster of ``step_m``, and parts that an anchor in use does not reach are left out.

    Examples
    --------
    >>> import shapely, locbounds as lb
    >>> city, anchors = City([shapely.box(0, 10, 90, 90)]), np.array([[0.0, 5.0], [45.0, 5.0], [100.0, 5.0]])
    >>> cell = lb.street_cells(shapely.box(0, 0, 90, 10), anchors, count=3)[0]
    >>> found = cell_bounds(city, anchors, cell, std_m=5.0, measure="toa", step_m=1.0)
    >>> bool(found.tightest_m < found.mmse_m)
    True
    """
    import shapely

    xmin, ymin, xmax, ymax = cell.region.bounds
    x = (np.floor(xmin / step_m) + 0.5 + np.arange(int((xmax - xmin) / step_m) + 2)) * step_m
    y = (np.floor(ymin / step_m) + 0.5 + np.arange(int((ymax - ymin) / step_m) + 2)) * step_m
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    points = points[shapely.contains_xy(cell.region, *points.T)]
    if not len(points):
        return None
    mine = anchors[list(cell.nearest)]
    length = street_links(city, mine, points, roof=roof).length_m
    reached = np.isfinite(length).all(axis=1)
    points, length = points[reached], length[reached]
    if len(points) < FEWEST:
        return None
    covariance = std_m**2 * np.eye(len(mine))
    return _bounds(points, length, covariance, cell.nearest, cell.share, measure, step_m, draws, seed)


def _bounds(
    points: Float[ndarray, "points 2"],
    length: Float[ndarray, "points used"],
    covariance: Any,
    nearest: tuple[int, ...],
    share: float,
    measure: str,
    step_m: float,
    draws: int,
    seed: int,
) -> CellBounds:
    """Bounds from times of arrival, or their differences to the first anchor, on the cells of a raster."""
    if measure == "tdoa":
        F = np.eye(len(nearest))[1:] - np.eye(len(nearest))[0]
        length, covariance = length @ F.T, F @ covariance @ F.T
    raster = street_raster(points, length, covariance, step_m=step_m)
    least = raster_mmse(raster, draws=draws, seed=seed)
    return CellBounds(nearest, share, measure, raster_wwb(raster)[0], raster_ezzb(raster)[0], *least)


def table_bounds(
    table: LinkTable, *, count: int = 3, measure: str = "toa", draws: int = 2000, seed: int = 0
) -> list[CellBounds]:
    """Bounds from a ray tracer's table of links, for every set of the ``count`` nearest anchors.

    Parameters
    ----------
    table
        Its points are the centres of the streets' cells; biases and deviations are taken as constant on each.
    count
        How many anchors measure the mobile: of those that are received at its place, the nearest by straight distance.
    measure
        ``"toa"`` or ``"tdoa"``.
    draws, seed
        Of the least error.

    Returns
    -------
    list of CellBounds
        Sets that serve fewer than nine cells are left out.

    Raises
    ------
    InputError
        If a point receives fewer anchors than that, or the points are on no raster.

    Examples
    --------
    >>> x = np.arange(0.5, 40.0)
    >>> none, place = np.zeros((40, 1)), {"a": (-5, 0)}
    >>> table = LinkTable.of(np.stack([x, 0 * x], axis=1), place, none, bias_m=none, deviation_m=none + 1)
    >>> [bounds] = table_bounds(table, count=1)
    >>> bounds.share, bool(bounds.tightest_m < bounds.mmse_m)
    (1.0, True)
    """
    if measure not in MEASURES:
        raise InputError(f"the measure is {measure}", f"Choose from {', '.join(MEASURES)}")
    heard = (table.sight != UNREACHED).sum(axis=1)
    if not 1 + (measure == "tdoa") <= count <= len(table.anchors):
        raise InputError(f"the {count} nearest of {len(table.anchors)} anchors are wanted", "Give another number")
    if (heard < count).any():
        x, y = table.points[int(np.argmin(heard))]
        raise InputError(
            f"the point ({x:g}, {y:g}) m receives {heard.min()} of the {count} anchors that are to measure it "
            f"(and {int((heard < count).sum()) - 1:,} more points)",
            "Use fewer anchors, or leave such points out",
        )
    links = table.links
    distance = np.where(table.sight == UNREACHED, np.inf, links.distance_m)
    order = np.argsort(distance, axis=1, kind="stable")[:, :count]
    sets = np.concatenate([order[:, :1], np.sort(order[:, 1:], axis=1)], axis=1)
    found, step = [], table.step_m
    for row in np.unique(sets, axis=0):
        mine = np.flatnonzero((sets == row).all(axis=1))
        if len(mine) < FEWEST:
            continue
        covariance = table.deviation_m[mine][:, row][:, :, None] ** 2 * np.eye(count)
        if (covariance == covariance[0]).all():
            covariance = covariance[0]
        nearest, share = tuple(int(k) for k in row), len(mine) / len(sets)
        length = links.length_m[mine][:, row]
        found.append(_bounds(table.points[mine], length, covariance, nearest, share, measure, step, draws, seed))
    return found


def over_cells(cells: list[CellBounds], value: Callable[[CellBounds], float]) -> float:
    """RMSE over all cells from that of each: mean squares weigh by the cells' shares.

    >>> cells = [CellBounds((0,), 0.25, "toa", 1, 2, 3, 0.1), CellBounds((1,), 0.75, "toa", 1, 2, 3, 0.1)]
    >>> over_cells(cells, lambda cell: cell.ezzb_m)
    2.0
    """
    shares = np.array([cell.share for cell in cells])
    return float(np.sqrt(shares @ np.array([value(cell) for cell in cells]) ** 2 / shares.sum()))
