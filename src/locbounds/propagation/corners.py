"""The visibility graph of corners, and shortest paths through it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from locbounds.axes import Bool, Float, Int, ndarray
from locbounds.propagation.walls import Horizon, Walls, cross, horizon, sees

TOUCH = 1e-9  # m; a line this close to a wall's direction is tangent
NONE = -1  # no corner: the path comes straight from the anchor


class Trees(NamedTuple):
    """Shortest paths from anchors to all corners."""

    length: Float[ndarray, "anchors corners"]  # inf where there is no path
    previous: Int[ndarray, "anchors corners"]  # the corner before, NONE for the anchor itself


class View(NamedTuple):
    """A horizon with the walls that it refers to, all relative to the graph's origin."""

    horizon: Horizon
    a: Float[ndarray, "walls 2"]
    b: Float[ndarray, "walls 2"]


class CornerGraph:
    """Convex corners and the tangent lines between them.

    A shortest path between obstacles is straight but for bends around convex corners, and every straight piece touches
    the buildings at both its bends (Lozano-Pérez and Wesley, Communications of the ACM 22, 1979): other vertices and
    other lines of sight are left out.

    Parameters
    ----------
    obstacles
        A Shapely polygon or several.

    Examples
    --------
    >>> import shapely
    >>> graph = CornerGraph(shapely.box(0, 0, 10, 10))
    >>> len(graph.corner), graph.weights.nnz
    (4, 8)
    """

    def __init__(self, obstacles: Any):
        xmin, ymin, xmax, ymax = obstacles.bounds
        self.origin = np.array([(xmin + xmax) / 2, (ymin + ymax) / 2])  # far from zero, differences lose digits
        import shapely

        self.walls = Walls.of(obstacles)
        self._local = Walls.of(shapely.transform(obstacles, lambda xy: xy - self.origin))
        keep = self._local.convex
        self.corner = self._local.vertex[keep] + self.origin
        self._at, self._before, self._after = (
            getattr(self._local, name)[keep] for name in ("vertex", "before", "after")
        )

    @cached_property
    def _views(self) -> list[Horizon]:
        return [horizon(at, self._local.a, self._local.b) for at in self._at]

    def _tangent(self, k: Any, points: Float[ndarray, "#points 2"]) -> Bool[ndarray, " points"]:
        """Whether the line from a point to corner k, or from each to its own, leaves both its walls on one side."""
        to = self._at[k] - points
        scale = np.sqrt(np.sum(to**2, axis=1)) * TOUCH
        one, other = cross(to, self._before[k] - self._at[k]), cross(to, self._after[k] - self._at[k])
        return ((one >= -scale) & (other >= -scale)) | ((one <= scale) & (other <= scale))

    def seen(
        self, points: Float[ndarray, "points 2"]
    ) -> Iterator[tuple[int, Int[ndarray, " n"], Float[ndarray, " n"]]]:
        """For every corner: which points see it along a tangent, and at what distance in metres."""
        local = points - self.origin
        for k, view in enumerate(self._views):
            index = np.flatnonzero(self._tangent(k, local))
            index = index[sees(view, local[index], self._local.a, self._local.b)]
            yield k, index, np.sqrt(np.sum((local[index] - self._at[k]) ** 2, axis=1))

    @cached_property
    def weights(self) -> csr_array:
        """Lengths of the tangent lines between corners, [corners, corners]."""
        rows, columns, values = [], [], []
        for k, index, distance in self.seen(self.corner):
            both = self._tangent(index, self._at[k : k + 1]) & (index != k)
            rows.append(np.full(both.sum(), k))
            columns.append(index[both])
            values.append(np.maximum(distance[both], TOUCH))
        n = len(self.corner)
        if not n:
            return csr_array((0, 0))
        matrix = csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))
        return csr_array(matrix.maximum(matrix.T))

    def all_views(self) -> list[View]:
        """What every corner sees."""
        return [View(view, self._local.a, self._local.b) for view in self._views]

    def view(self, place: Float[ndarray, " 2"], walls: Walls | None = None) -> View:
        """What a place sees, of all walls or of these."""
        a, b = (self._local.a, self._local.b) if walls is None else (walls.a - self.origin, walls.b - self.origin)
        return View(horizon(np.asarray(place) - self.origin, a, b), a, b)

    def sees(self, views: Sequence[View], points: Float[ndarray, "points 2"]) -> Bool[ndarray, "places points"]:
        """Which points places see."""
        local = points - self.origin
        return np.array([sees(v.horizon, local, v.a, v.b) for v in views], dtype=bool).reshape(-1, len(points))

    def trees(self, anchors: Float[ndarray, "anchors 2"], seen: Bool[ndarray, "anchors corners"]) -> Trees:
        """Shortest paths from anchors that see these corners.

        Parameters
        ----------
        anchors
            Their places.
        seen
            Which corners each of them sees.
        """
        n, m = len(self.corner), len(anchors)
        if not n:
            return Trees(np.zeros((m, 0)), np.zeros((m, 0), int))
        links, legs = [], []
        for anchor, row in zip(anchors, seen, strict=True):
            index = np.flatnonzero(row & self._tangent(np.arange(n), (anchor - self.origin)[None]))
            links.append(index)
            legs.append(np.maximum(np.linalg.norm(self.corner[index] - anchor, axis=1), TOUCH))
        rows = np.concatenate([np.full(len(i), n + k) for k, i in enumerate(links)])
        inner = self.weights.tocoo()
        graph = csr_array(
            (
                np.concatenate([inner.data, *legs]),
                (np.concatenate([inner.coords[0], rows]), np.concatenate([inner.coords[1], *links])),
            ),
            shape=(n + m, n + m),
        )
        length, previous = dijkstra(graph, directed=True, indices=np.arange(n, n + m), return_predecessors=True)
        before = np.where(previous[:, :n] >= n, NONE, previous[:, :n])
        return Trees(length[:, :n], before)
