"""Bayesian numbers of a plan: over its prior, and for a device that is known to be in one cell of an area.

- *over the prior* (``bcrb``, ``wwb``, ``ezzb``, ``mmse``): the least mean square error on average over the prior;
- *per cell*: the same for a device that is known to be in one cell of the area, uniformly.

Both differ from the Cramér-Rao bound at a point, which is about estimators without prior knowledge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import ndarray
from locbounds.errors import InputError, LocboundsError, RefusedError
from locbounds.plan import Plan
from locbounds.priors import PositionPrior, PriorMixture, Prism, UniformBox, UniformPolygon
from locbounds.registry import load, method
from locbounds.result import Result
from locbounds.verdict import Status

OVER_PRIOR = ("bcrb", "wwb", "ezzb", "mmse", "ml", "ls")
PER_CELL = ("wwb", "ezzb", "mmse")  # of those, what is worth a map: bcrb never exists for a cell
RTOL = 5e-3
MOST_CELLS = 64


class Refusal(NamedTuple):
    """Why a method has no number."""

    id: str
    why: str


class Chosen(NamedTuple):
    """The tightest of the valid bounds and the runner-up, by id, RMSE in metres; why, in a sentence."""

    id: str
    rmse_m: float
    runner_up: str
    why: str


Numbers = dict[str, Result | Refusal]  # by method id


def over_prior(
    plan: Plan,
    ids: Sequence[str],
    *,
    rtol: float = RTOL,
    seed: int = 0,
    announce: Callable[[str], None] = lambda text: None,
) -> Numbers:
    """Bayesian numbers of a plan, by id: a result, or why there is none.

    Parameters
    ----------
    plan
        With a prior; without one, every method is refused.
    ids
        Methods, of :data:`OVER_PRIOR`.
    rtol
        Precision of bounds; relative standard error of the least error.
    seed
        Of the estimators' draws.
    announce
        Told what is being computed.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7], [13, -7]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> found = over_prior(plan, ["bcrb", "ezzb"])
    >>> found["bcrb"].why[:34], round(float(found["ezzb"].position_rmse[0]), 1)
    ('the density of a uniform law jumps', 2.2)
    """
    out: Numbers = {}
    for id in ids:
        entry = method(id)
        verdict = entry.verdict(plan)
        if verdict.status is Status.REFUSED:
            out[id] = Refusal(id, "; ".join(verdict.reasons))
            continue
        announce(f"{entry.name} over the prior")
        options = {} if id in ("ml", "ls") else {"rtol": rtol}
        if entry.kind != "bound":
            options["seed"] = seed
        try:
            out[id] = load(entry)(plan, **options)
        except (RefusedError, InputError) as error:
            out[id] = Refusal(id, error.cause)
    return out


def rmse_of(found: Result | Refusal | None) -> tuple[float, float]:
    """RMSE and standard error in metres; NaN where a method has no number.

    >>> rmse_of(Refusal("wwb", "no prior"))
    (nan, nan)
    """
    if not isinstance(found, Result):
        return float("nan"), float("nan")
    return float(found.position_rmse[0]), float(found.position_rmse_stderr[0])


def choose(found: Numbers) -> Chosen | None:
    """The largest of the valid bounds; None if there is none.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7], [13, -7]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> choose(over_prior(plan, ["bcrb", "wwb", "ezzb"], rtol=1e-3)).why
    'EZZB is the tightest valid bound over the prior: 2.214 m, 4.4 % above WWB'
    """
    valid = [r for r in found.values() if isinstance(r, Result) and r.kind == "bound" and r.verdict.status == "valid"]
    if not valid:
        return None
    best, *others = sorted(valid, key=lambda r: -rmse_of(r)[0])
    top = rmse_of(best)[0]
    why = f"{best.name} is the tightest valid bound over the prior: {top:.3f} m"
    if others:
        why += f", {100 * (top / rmse_of(others[0])[0] - 1):.2g} % above {others[0].name}"
    return Chosen(best.id, top, others[0].id if others else "", why)


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
    whole = outline_of(area)
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


def outline_of(area: PositionPrior) -> Any:
    """The Shapely polygon of an area; a disc as a polygon of 128 corners."""
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


class Cell(NamedTuple):
    """A cell of the area: its corners [2, 2] in metres, and the numbers of each method there."""

    corners: ndarray
    found: Numbers


def per_cell(
    plan: Plan,
    area: PositionPrior,
    ids: Sequence[str],
    *,
    cells: int,
    height: tuple[float, float] | None = None,
    rtol: float = 2 * RTOL,
    seed: int = 0,
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
    rtol, seed
        As for :func:`over_prior`.
    progress
        Called with (numbers done, numbers), one number per cell and method.
    """
    if not 1 <= cells <= MOST_CELLS:
        raise InputError(f"{cells} cells along the longer side", f"Give a number from 1 to {MOST_CELLS}")
    parts = cells_of(area, cells, height)
    out = []
    progress(0, len(parts) * len(ids))
    for k, (corners, law) in enumerate(parts):
        found: Numbers = {}
        for j, id in enumerate(ids):
            try:
                found |= over_prior(plan.replace(prior=law), [id], rtol=rtol, seed=seed)
            except LocboundsError as error:
                found[id] = Refusal(id, error.cause)
            progress(k * len(ids) + j + 1, len(parts) * len(ids))
        out.append(Cell(corners, found))
    return out
