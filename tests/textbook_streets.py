"""Shortest paths by the book: every vertex, every pair, Shapely's exact predicates, Dijkstra by SciPy."""

import numpy as np
import shapely
import shapely.affinity
from scipy.sparse.csgraph import dijkstra

DEPTH_M = 1e-8  # a place on a wall is rounded to one side of it


def visibility_graph(obstacles, anchors, points):
    """Lengths [points, anchors] and sight [points, anchors] (True: free) among anchors, points and all vertices."""
    nodes = np.concatenate([anchors, points, np.unique(shapely.get_coordinates(obstacles), axis=0)])
    i, j = np.triu_indices(len(nodes), 1)
    lines = shapely.linestrings(np.stack([nodes[i], nodes[j]], axis=1))
    solid = shapely.buffer(obstacles, -DEPTH_M, join_style="mitre")
    shapely.prepare(solid)
    free = ~shapely.intersects(solid, lines)
    weight = np.full((len(nodes), len(nodes)), np.inf)
    weight[i[free], j[free]] = np.linalg.norm(nodes[i] - nodes[j], axis=1)[free]
    weight = np.minimum(weight, weight.T)
    m, n = len(anchors), len(points)
    length = dijkstra(np.where(np.isfinite(weight), weight, 0.0), indices=np.arange(m), directed=False)[:, m : m + n]
    length = np.where((anchors[:, None] == points).all(-1), 0.0, length)  # a dense graph has no edges of length zero
    return length.T, np.isfinite(weight)[m : m + n, :m]


def random_city(rng, kind):
    """Some polygons in a square of 100 m; kind says what is special about them."""
    if kind == "blocks":  # shared walls, aligned rows, shared corners
        cells = rng.random((5, 5)) < 0.5
        return [shapely.box(20 * i, 20 * j, 20 * i + 20, 20 * j + 20) for i, j in np.argwhere(cells)]
    if kind == "courtyards":
        boxes = []
        for x, y in ((5, 5), (55, 10), (20, 60), (65, 65)):
            w, h = rng.uniform(15, 30, 2)
            ring = shapely.box(x, y, x + w, y + h).difference(shapely.box(x + 4, y + 4, x + w - 4, y + h - 4))
            if rng.random() < 0.5:  # a gate
                ring = ring.difference(shapely.box(x + 6, y - 1, x + 8, y + 5))
            boxes.append(shapely.affinity.rotate(ring, rng.uniform(0, 20)))
        return boxes
    polygons = []
    while len(polygons) < 7:
        angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 9)))
        radius = rng.uniform(3, 16, len(angle))[:, None]
        star = shapely.Polygon(rng.uniform(10, 90, 2) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        apart = kind == "overlapping" or not any(star.intersects(p) for p in polygons)
        if star.is_valid and star.area > 5 and apart:
            polygons.append(star)
    return polygons
