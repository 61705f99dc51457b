"""What accuracy is possible over an area: the Cramér-Rao bound at the points of a grid."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.plan import Plan
from locbounds.priors import PositionPrior
from locbounds.static import merit
from locbounds.static.crlb import REASONS, PointBounds, crlb
from locbounds.static.dop import dop

if TYPE_CHECKING:
    import xarray

OUTSIDE = -1
MOST_POINTS = 4_000_000
FARTHEST_M = 1e9


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
    weights : array or None
        For dilutions of precision of stations that differ, as in :func:`locbounds.dop`.

    Examples
    --------
    >>> import locbounds as lb
    >>> square = [[0, 0], [100, 0], [100, 100], [0, 100]]
    >>> found = lb.AccuracyMap(lb.toa(square, 2.0), lb.UniformBox([0, 0], [100, 100]), grid=5)
    >>> found.figures["crlb_rmse_m"].shape, found.notes
    ((25,), ('4 of 25 points without a bound: no derivative here: at an anchor, ...',))
    """

    def __init__(
        self,
        plan: Plan,
        area: PositionPrior,
        *,
        grid: int = 101,
        height_m: float | None = None,
        share: float = 0.67,
        weights: ndarray | None = None,
    ):
        if plan.dim == 3 and height_m is None:
            raise InputError("the plan has three coordinates, the map no height", "Give height_m in metres")
        self.plan, self.height_m, self.share = plan, height_m, merit.check_share(share)
        self.x_m, self.y_m, self.inside = grid_of(area, grid)
        self.weights = weights
        self.bounds: PointBounds = crlb(plan, self.points)
        self._dop = None if weights is None else dop(plan, self.points, weights=weights)

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
        dilutions = self._dop or (None if b.station_std is None else b.dop())
        if dilutions is not None:
            out |= {name: value for name, value in dilutions._asdict().items() if value is not None}
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
        if self.bounds.station_std is None and self.weights is None:
            why = "different units" if len(set(self.plan.units)) > 1 else "different deviations"
            out.append(f"no dilution of precision: the stations have {why}, and no weights are given")
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
        attrs: dict[str, Any] = {
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
        If the grid is too fine, no point of it is in the area, or the area is larger than the Earth.

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
    if not np.max(np.abs([low, high])) < FARTHEST_M:
        raise InputError(
            f"the area reaches from {low.tolist()} to {high.tolist()}", "Give metres in a local plane, not degrees"
        )
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
