"""What accuracy is possible over an area: the bound at the points of a grid, and Bayesian numbers over the prior.

Three kinds of numbers, which answer different questions:

- *at a point* (``crlb``): what is possible for a device that is there, for estimators without prior knowledge;
- *over the prior* (``bcrb``, ``wwb``, ``ezzb``, ``mmse``): the least mean square error on average over the prior;
- *per cell*: the same for a device that is known to be in one cell of the area, uniformly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, LocboundsError, RefusedError
from locbounds.plan import Plan
from locbounds.priors import PositionPrior, PriorMixture, Prism, UniformBox, UniformPolygon
from locbounds.registry import load, method
from locbounds.result import Result
from locbounds.static import merit
from locbounds.static.crlb import REASONS, PointBounds, crlb
from locbounds.verdict import Status

if TYPE_CHECKING:
    import xarray

AT_POINTS = ("crlb",)
OVER_PRIOR = ("bcrb", "wwb", "ezzb", "mmse")  # ids whose function takes a plan with a prior and rtol
OUTSIDE = -1
MOST_POINTS = 4_000_000
RTOL = 5e-3


class AccuracyMap:
    """The Cramér-Rao bound over the points of a grid that are in an area.

    Attributes
    ----------
    plan : Plan
    x_m, y_m : array
        Coordinates of columns and rows.
    height_m : float or None
        In 3-D.
    inside : array
        [y, x] which points are in the area.
    bounds : PointBounds
        At the points inside, row by row.
    share : float
        Of the error quantile, besides the median (CEP).
    """

    def __init__(
        self,
        plan: Plan,
        area: PositionPrior,
        *,
        grid: int = 101,
        height_m: float | None = None,
        share: float = 0.67,
    ):
        self.plan, self.height_m, self.share = plan, height_m, merit.check_share(share)
        self.x_m, self.y_m, self.inside = grid_of(area, grid)
        self.bounds: PointBounds = crlb(plan, self.points)

    @property
    def points(self) -> Float[ndarray, "points space"]:
        """The points inside."""
        x, y = np.meshgrid(self.x_m, self.y_m)
        flat = np.column_stack([x[self.inside], y[self.inside]])
        return flat if self.height_m is None else np.column_stack([flat, np.full(len(flat), self.height_m)])

    @cached_property
    def figures(self) -> dict[str, ndarray]:
        """Figures of merit at the points inside, by column name; infinite where there is no bound."""
        b = self.bounds
        C = np.asarray(b.covariance)
        ellipse = b.ellipse(0.95)
        out = {
            "crlb_rmse_m": b.rmse,
            "crlb_mde_m": b.mde(),
            "crlb_cep_m": b.cep(),
            f"crlb_q{quantile_name(self.share)}_m": b.quantile(self.share),
        }
        for i, axis in enumerate("xyz"[: self.plan.dim]):
            out[f"crlb_std_{axis}_m"] = np.sqrt(C[:, i, i])
        for i, name in enumerate(("major", "middle", "minor") if self.plan.dim == 3 else ("major", "minor")):
            out[f"ellipse95_{name}_m"] = ellipse.semi_axes_m[:, i]
        if self.plan.dim == 2:
            out["ellipse95_angle_rad"] = ellipse.angle_rad
        if b.clock_variance is not None:
            out["crlb_clock_m"] = np.sqrt(b.clock_variance)
        if b.station_std is not None:
            out |= {name: value for name, value in b.dop()._asdict().items() if value is not None}
        return {name: np.asarray(value) for name, value in out.items()}

    def on_grid(self, values: ndarray) -> ndarray:
        """Values of the points inside as [y, x]; NaN outside of the area."""
        out = np.full(self.inside.shape, np.nan)
        out[self.inside] = values
        return out

    def statistics(self) -> list[tuple[str, float, float, float, float]]:
        """Per figure: median and 95 % of the area, the worst finite value, the share without a bound.

        The share without a bound counts as worst: a median over an area of which more than half is singular is
        infinite.
        """
        rows = []
        for name, values in self.figures.items():
            if name.endswith("_rad"):
                continue
            ordered = np.sort(values)
            finite = values[np.isfinite(values)]
            pick = [float(ordered[min(len(ordered) - 1, int(np.ceil(q * len(ordered))) - 1)]) for q in (0.5, 0.95)]
            worst = float(finite.max()) if len(finite) else np.inf
            rows.append((name, *pick, worst, float(np.mean(~np.isfinite(values)))))
        return rows

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the map should know."""
        out = []
        status = np.asarray(self.bounds.status)
        for code in (1, 2):
            n = int(np.sum(status == code))
            if n:
                out.append(f"{n} of {len(status)} points without a bound: {REASONS[code]}")
        if self.bounds.station_std is None:
            why = "different units" if len(set(self.plan.units)) > 1 else "different deviations"
            out.append(f"no dilution of precision: the stations have {why} (lb.dop takes weights)")
        return tuple(out)

    def to_dataset(self) -> xarray.Dataset:
        """All figures over y and x with units and the status of every point (-1: outside of the area)."""
        import xarray

        status = np.full(self.inside.shape, OUTSIDE, dtype=np.int8)
        status[self.inside] = np.asarray(self.bounds.status)
        data: dict[str, Any] = {
            name: (("y_m", "x_m"), self.on_grid(values), {"units": _unit(name)})
            for name, values in self.figures.items()
        }
        flags = {"flag_values": [OUTSIDE, *REASONS], "flag_meanings": "outside bounded singular no_derivative"}
        data["status"] = (("y_m", "x_m"), status, flags)
        p = self.bounds.provenance
        attrs = {
            "title": self.plan.title,
            "method": "crlb",
            "verdict": str(self.bounds.verdict),
            "how": p.how if p else "",
            "references": ", ".join(p.references) if p else "",
            "versions": ", ".join(f"{n} {v}" for n, v in p.versions) if p else "",
            "date": p.date if p else "",
        }
        if self.height_m is not None:
            attrs["height_m"] = self.height_m
        return xarray.Dataset(data, {"x_m": self.x_m, "y_m": self.y_m}, attrs)


def quantile_name(share: float) -> str:
    """A share as part of a column name.

    >>> quantile_name(0.67), quantile_name(0.995)
    ('67', '99_5')
    """
    return f"{100 * share:g}".replace(".", "_")


def _unit(name: str) -> str:
    return "m" if name.endswith("_m") else "rad" if name.endswith("_rad") else "1"


def grid_of(area: PositionPrior, n: int) -> tuple[ndarray, ndarray, ndarray]:
    """Columns, rows, and which points are inside; n points along the longer side, cells as square as they can be.

    Raises
    ------
    InputError
        If the grid is too fine, or no point of it is in the area.

    Examples
    --------
    >>> from locbounds.priors import UniformBox
    >>> x, y, inside = grid_of(UniformBox([0.0, 0.0], [10.0, 4.0]), 6)
    >>> len(x), len(y), bool(inside.all())
    (6, 3, True)
    """
    if n < 2 or int(n) != n:
        raise InputError(f"the grid is {n}", "Give a whole number of points along the longer side, at least 2")
    low, high = (np.asarray(corner)[:2] for corner in area.bounds())
    sides = high - low
    counts = np.maximum(2, 1 + np.round((n - 1) * sides / sides.max()).astype(int))
    if counts.prod() > MOST_POINTS:
        raise InputError(
            f"a grid of {counts[0]} x {counts[1]} points", f"At most {MOST_POINTS:,} points: a smaller grid"
        )
    x, y = (np.linspace(a, b, k) for a, b, k in zip(low, high, counts, strict=True))
    gx, gy = np.meshgrid(x, y)
    inside = np.asarray(area.inside(np.column_stack([gx.ravel(), gy.ravel()]))).reshape(gx.shape)
    if not inside.any():
        raise InputError("no point of the grid is in the area", "Take a finer grid (--grid), or a larger area")
    return x, y, inside


class Refusal:
    """Why a method has no number."""

    def __init__(self, id: str, why: str):
        self.id, self.why = id, why


def over_prior(plan: Plan, ids: Sequence[str], *, rtol: float = RTOL) -> dict[str, Result | Refusal]:
    """Bayesian numbers of a plan, by id: a result, or why there is none.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7], [13, -7]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> found = over_prior(plan, ["bcrb", "ezzb"])
    >>> found["bcrb"].why[:34], round(float(found["ezzb"].position_rmse[0]), 2)
    ('the density of a uniform law jumps', 2.22)
    """
    out: dict[str, Result | Refusal] = {}
    for id in ids:
        entry = method(id)
        verdict = entry.verdict(plan)
        if verdict.status is Status.REFUSED:
            out[id] = Refusal(id, "; ".join(verdict.reasons))
            continue
        try:
            out[id] = load(entry)(plan, rtol=rtol)
        except (RefusedError, InputError) as error:
            out[id] = Refusal(id, error.cause)
    return out


def cells_of(area: PositionPrior, n: int, height: tuple[float, float] | None = None) -> list[tuple[Any, PositionPrior]]:
    """The area cut into squares, n along the longer side: corners [2, 2] of each and the uniform law on its part.

    Examples
    --------
    >>> from locbounds.priors import UniformDisc
    >>> len(cells_of(UniformDisc([0.0, 0.0], 10.0), 4))
    16
    """
    import shapely

    low, high = (np.asarray(corner)[:2] for corner in area.bounds())
    side = float((high - low).max()) / n
    counts = np.maximum(1, np.ceil((high - low) / side - 1e-9).astype(int))
    whole = _outline(area)
    out = []
    for j in range(counts[1]):
        for i in range(counts[0]):
            a = low + side * np.array([i, j])
            b = np.minimum(a + side, high)
            part = whole.intersection(shapely.box(*a, *b))
            law = _law(part, least=1e-3 * side**2)
            if law is not None:
                out.append((np.stack([a, b]), law if height is None else Prism(law, *height)))
    return out


def _outline(area: PositionPrior) -> Any:
    import shapely

    if isinstance(area, UniformBox):
        return shapely.box(*area.low[:2], *area.high[:2])
    if isinstance(area, UniformPolygon):
        return area.shape
    return shapely.Point(*area.center).buffer(float(area.radius), quad_segs=32)  # pyright: ignore[reportAttributeAccessIssue]


def _law(part: Any, least: float) -> PositionPrior | None:
    """The uniform law on a Shapely region; None if it is too small to speak of."""
    pieces = [g for g in getattr(part, "geoms", [part]) if g.geom_type == "Polygon" and g.area > least]
    laws: list[PositionPrior] = []
    for g in pieces:
        corners = np.asarray(g.exterior.coords)[:-1]
        low, high = corners.min(0), corners.max(0)
        box = not g.interiors and abs(g.area - np.prod(high - low)) < 1e-9 * g.area
        laws.append(
            UniformBox(low, high) if box else UniformPolygon(corners, [np.asarray(r.coords) for r in g.interiors])
        )
    if len(laws) < 2:
        return laws[0] if laws else None
    sizes = np.array([g.area for g in pieces])
    return PriorMixture(sizes / sizes.sum(), laws)


class Cell:
    """A cell of the area: its corners [2, 2] in metres, and the numbers of each method there."""

    def __init__(self, corners: ndarray, found: dict[str, Result | Refusal]):
        self.corners, self.found = corners, found

    def rmse(self, id: str) -> tuple[float, float]:
        """RMSE and standard error in metres; NaN where a method has no number, which its refusal explains."""
        r = self.found.get(id)
        if not isinstance(r, Result):
            return float("nan"), float("nan")
        return float(r.position_rmse[0]), float(r.position_rmse_stderr[0])


def per_cell(
    plan: Plan,
    area: PositionPrior,
    ids: Sequence[str],
    *,
    cells: int,
    height: tuple[float, float] | None = None,
    rtol: float = 2 * RTOL,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Cell]:
    """Bayesian numbers for a device that is known to be in one cell of the area, for every cell.

    Parameters
    ----------
    plan
        Its prior is replaced.
    area
        Of the map.
    ids
        Methods, of :data:`OVER_PRIOR`.
    cells
        Cells along the longer side.
    height
        In 3-D: lowest and highest position.
    progress
        Called with (cells done, cells).
    """
    parts = cells_of(area, cells, height)
    out = []
    for k, (corners, law) in enumerate(parts):
        try:
            found = over_prior(plan.replace(prior=law), ids, rtol=rtol)
        except LocboundsError as error:
            found = {id: Refusal(id, error.cause) for id in ids}
        out.append(Cell(corners, found))
        progress(k + 1, len(parts))
    return out
