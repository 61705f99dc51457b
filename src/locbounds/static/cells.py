"""Bayesian numbers for a device that is known to be in one cell of an area, for every cell.

They are the numbers of :mod:`locbounds.static.over_prior` for a law that is uniform over the cell. Both differ from the
Cramér-Rao bound at a point, which is about estimators without prior knowledge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import ndarray
from locbounds.errors import InputError
from locbounds.plan import Plan
from locbounds.priors import PositionPrior, PriorMixture, Prism, UniformBox, UniformPolygon, UniformPrior
from locbounds.static.over_prior import RTOL, Numbers, over_prior

PER_CELL = ("wwb", "ezzb", "mmse")  # what is worth a map: bcrb never exists for a cell
CELL_RTOL = 2 * RTOL
MOST_CELLS = 64


def cells_of(
    area: UniformPrior, n: int, height: tuple[float, float] | None = None
) -> list[tuple[ndarray, Any, PositionPrior]]:
    """The area cut into squares, n along the longer side.

    Returns
    -------
    list
        Corners [2, 2] of each, its part of the area as a Shapely region, and the uniform law on that.

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
    out = []
    for j in range(counts[1]):
        for i in range(counts[0]):
            a = low + side * np.array([i, j])
            b = np.minimum(a + side, high)
            part = area.shape.intersection(shapely.box(*a, *b))
            law = _law(part, least=1e-3 * side**2)
            if law is not None:
                out.append((np.stack([a, b]), part, law if height is None else Prism(law, *height)))
    return out


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
    """A cell: its corners [2, 2] in metres, its part of the area as a Shapely region, the numbers of each method."""

    corners: ndarray
    part: Any
    found: Numbers


def per_cell(
    plan: Plan,
    area: UniformPrior,
    ids: Sequence[str],
    *,
    cells: int,
    height: tuple[float, float] | None = None,
    rtol: float = CELL_RTOL,
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
        Methods, of :data:`PER_CELL`.
    cells
        Cells along the longer side.
    height
        In 3-D: lowest and highest position.
    rtol, seed
        As for :func:`~locbounds.static.over_prior.over_prior`.
    progress
        Called with (numbers done, numbers), one number per cell and method.
    """
    if not 1 <= cells <= MOST_CELLS:
        raise InputError(f"{cells} cells along the longer side", f"Give a number from 1 to {MOST_CELLS}")
    parts = cells_of(area, cells, height)
    out = []
    progress(0, len(parts) * len(ids))
    for k, (corners, part, law) in enumerate(parts):
        found: Numbers = {}
        for j, id in enumerate(ids):
            found |= over_prior(plan.replace(prior=law), [id], rtol=rtol, seed=seed)
            progress(k * len(ids) + j + 1, len(parts) * len(ids))
        out.append(Cell(corners, part, found))
    return out
