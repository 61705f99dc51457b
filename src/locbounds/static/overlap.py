r"""Quadrature over the places whose shifted copies all lie in the support of a prior.

Weiss-Weinstein and Ziv-Zakai bounds integrate over ``{theta : theta + u in S for every shift u}``. Smooth integrands
on that set, not an indicator on all of S: the edge of the set is followed exactly, so that some hundred nodes do what
a hundred thousand do on a grid. All rules have the weights of ``d theta``.
"""

from __future__ import annotations

import functools
import itertools
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray

if TYPE_CHECKING:
    import shapely

NO_MARKS = np.zeros((0, 2))
FEWEST = 4  # nodes on the smallest piece
FAR = 9.0  # half-width of a Gaussian rule along its first axis, in deviations: 1e-18 lies beyond


class Rule(NamedTuple):
    """Nodes [n, space] and weights [n] of an integral over places."""

    points: Float[ndarray, "n space"]
    weights: Float[ndarray, " n"]


@functools.lru_cache(maxsize=256)
def legendre(n: int) -> tuple[ndarray, ndarray]:
    """Gauss-Legendre nodes and weights on [0, 1].

    >>> x, w = legendre(3)
    >>> round(float(w @ x**5), 12) == round(1 / 6, 12)
    True
    """
    x, w = np.polynomial.legendre.leggauss(n)
    return 0.5 * (x + 1), 0.5 * w


@functools.lru_cache(maxsize=256)
def _cosine(n: int) -> tuple[ndarray, ndarray]:
    """Nodes on [0, 1] for functions with a square root at each end."""
    x, w = legendre(n)
    return 0.5 * (1 - np.cos(np.pi * x)), 0.5 * np.pi * np.sin(np.pi * x) * w


def empty(space: int) -> Rule:
    """The rule of an empty set."""
    return Rule(np.zeros((0, space)), np.zeros(0))


def disc_overlap(
    centre: ndarray, radius: float, shifts: ndarray, n: int, marks: ndarray = NO_MARKS, rough: ndarray | None = None
) -> Rule:
    """Of discs of one radius around ``centre - shift``: rows between the corners of the common part.

    Parameters
    ----------
    centre
        [2] m.
    radius
        m.
    shifts
        [k, 2] m.
    n
        Nodes along each side, and some more at every edge.
    marks
        [m, 2] m: places where the integrand is rough if a shifted copy of theta is there (anchors). Rows and columns end
        at them, and nodes crowd around them.
    rough
        [j, 2] m: the copies for which that is so; by default all.

    Examples
    --------
    >>> lens = disc_overlap(np.zeros(2), 1.0, np.array([[0.0, 0.0], [0.6, 0.8]]), 24)
    >>> bool(abs(lens.weights.sum() - (2 * np.pi / 3 - np.sqrt(0.75))) < 1e-9)
    True
    """
    shifts = distinct(shifts)
    c = centre - shifts
    corners = [c[:, 1] - radius, c[:, 1] + radius]
    for a, b in itertools.combinations(c, 2):
        gap = b - a
        apart = np.hypot(*gap)
        if apart >= 2 * radius:
            return empty(2)
        rise = np.sqrt(radius**2 - apart**2 / 4) * gap[0] / apart
        middle = 0.5 * (a[1] + b[1])
        corners.append(np.array([middle - rise, middle + rise]))
    low, high = corners[0].max(), corners[1].min()
    if high <= low:
        return empty(2)
    at = _moved(marks, shifts if rough is None else distinct(rough))
    y, wy = _panels(np.concatenate([*corners, at[:, 1]]), low, high, n, lambda y: np.subtract(*_chord(c, radius, y)[::-1]))
    if not len(y):
        return empty(2)
    left, right = _chord(c, radius, y)
    right = np.maximum(left, right)
    edges = np.sort(np.clip(at[:, 0], left[:, None], right[:, None]), axis=1)
    edges = np.column_stack([left, edges, right])
    length = np.diff(edges, axis=1)
    shares = (wy @ length) / max(wy @ (right - left), 1e-300)
    xs, ys, ws = [], [], []
    for k in np.flatnonzero(shares > 0):
        t, w = _cosine(nodes_for(n, shares[k])) if len(at) else legendre(n)
        xs.append((edges[:, k, None] + length[:, k, None] * t).ravel())
        ys.append(np.repeat(y, len(t)))
        ws.append(((wy * length[:, k])[:, None] * w).ravel())
    x, y, w = np.concatenate(xs), np.concatenate(ys), np.concatenate(ws)
    there = w > 0
    return Rule(np.stack([x[there], y[there]], -1), w[there])


def _chord(c: ndarray, radius: float, y: ndarray) -> tuple[ndarray, ndarray]:
    half = np.sqrt(np.maximum(radius**2 - (y - c[:, 1:]) ** 2, 0.0))
    return (c[:, :1] - half).max(0), (c[:, :1] + half).min(0)


def distinct(shifts: ndarray) -> ndarray:
    """Rows without repetitions, in their order."""
    keep = [k for k, u in enumerate(shifts) if not any(np.array_equal(u, v) for v in shifts[:k])]
    return shifts[keep]


def nodes_for(n: int, share: float) -> int:
    """Nodes on a piece that takes this share of the whole."""
    return FEWEST + int(np.ceil(n * share))


def _moved(marks: ndarray, shifts: ndarray) -> ndarray:
    """Where theta is when a shifted copy of it is at a mark."""
    return (marks[:, None] - shifts).reshape(-1, shifts.shape[1])


def _panels(edges: ndarray, low: float, high: float, n: int, length: Any = None) -> tuple[ndarray, ndarray]:
    """Nodes and weights between sorted edges, crowded at each; pieces without length are left out."""
    edges = np.unique(np.clip(edges, low, high))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-9 * (high - low)])]
    if len(edges) < 2:
        return np.zeros(0), np.zeros(0)
    width = np.diff(edges)
    keep = np.arange(len(width))
    if length is not None:
        keep = np.flatnonzero(length(0.5 * (edges[1:] + edges[:-1])) > 0)
    total = width[keep].sum()
    nodes, weights = [np.zeros(0)], [np.zeros(0)]
    for k in keep:
        t, w = _cosine(nodes_for(n, width[k] / total))
        nodes.append(edges[k] + width[k] * t)
        weights.append(width[k] * w)
    return np.concatenate(nodes), np.concatenate(weights)


def box_overlap(
    low: ndarray, high: ndarray, shifts: ndarray, n: int, marks: ndarray = NO_MARKS, rough: ndarray | None = None
) -> Rule:
    """Of boxes ``[low - shift, high - shift]``, in any dimension.

    >>> rule = box_overlap(np.zeros(2), np.array([3.0, 1.0]), np.array([[0.0, 0.0], [1.0, 0.5]]), 4)
    >>> float(rule.weights.sum())
    1.0
    """
    shifts = distinct(shifts)
    low, high = (low - shifts).max(0), (high - shifts).min(0)
    size = high - low
    if np.any(size <= 0):
        return empty(len(low))
    if len(marks):
        at = _moved(marks, shifts if rough is None else distinct(rough))
        axes = [_panels(np.concatenate([[a, b], at[:, k]]), a, b, n) for k, (a, b) in enumerate(zip(low, high, strict=True))]
    else:
        t, w = legendre(n)
        axes = [(a + s * t, s * w) for a, s in zip(low, size, strict=True)]
    grid = np.meshgrid(*(x for x, _ in axes), indexing="ij")
    weight = functools.reduce(np.multiply.outer, [w for _, w in axes])
    return Rule(np.stack(grid, -1).reshape(-1, len(low)), weight.ravel())


def polygon_overlap(outline: shapely.Geometry, shifts: ndarray, n: int) -> Rule:
    """Of a polygon, or several, with holes or not, convex or not: triangles of the common part.

    >>> import shapely
    >>> rule = polygon_overlap(shapely.box(0, 0, 3, 1), np.array([[0.0, 0.0], [1.0, 0.5]]), 6)
    >>> round(float(rule.weights.sum()), 12)
    1.0
    """
    import shapely
    from shapely.affinity import translate

    shifts = distinct(shifts)
    part = functools.reduce(shapely.intersection, (translate(outline, *-u) for u in shifts))
    if part.is_empty or part.area == 0:
        return empty(2)
    return triangle_rule(part, n)


def triangle_rule(part: shapely.Geometry, n: int) -> Rule:
    """Nodes on the triangles of an area; about ``n`` along a side as long as the area is wide."""
    import shapely

    found = [np.asarray(t.exterior.coords)[:3, :2] for t in shapely.constrained_delaunay_triangles(part).geoms]
    corners = np.array(found)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    corners, twice = corners[twice > 0], twice[twice > 0]
    width = np.sqrt(twice.sum())
    points, weights = [], []
    for (p, q, r), area in zip(corners, twice, strict=True):
        longest = max(np.hypot(*(p - q)), np.hypot(*(q - r)), np.hypot(*(r - p)))
        k = int(np.clip(np.ceil(n * longest / width), 3, 2 * n))
        t, w = legendre(k)
        u, v = np.meshgrid(t, t, indexing="ij")
        points.append((p + u[..., None] * ((q - p) + v[..., None] * (r - q))).reshape(-1, 2))
        weights.append((area * u * np.multiply.outer(w, w)).ravel())
    return Rule(np.concatenate(points), np.concatenate(weights))


def gaussian_overlap(mean: ndarray, root: ndarray, shifts: ndarray, n: int) -> Rule:
    """Of the whole space, for integrands that fall like a Gaussian density moved by minus the mean shift.

    Parameters
    ----------
    mean, root
        Of the Gaussian: m and a root L of the covariance L L^T, m.
    shifts
        [k, space] m. The rule is split in two across the line from the first to the last, where the smaller of two
        shifted densities has an edge.
    n
        Nodes along each axis.
    """
    space = len(mean)
    along = np.linalg.solve(root, shifts[-1] - shifts[0])
    if np.linalg.norm(along) > 0:
        basis = np.linalg.qr(np.column_stack([along, np.eye(space)]))[0][:, :space]
    else:
        basis = np.eye(space)
    t, w = legendre(n)
    x = np.concatenate([-FAR * t[::-1] ** 2, FAR * t**2])
    wx = np.concatenate([(2 * FAR * t * w)[::-1], 2 * FAR * t * w])
    g, wg = np.polynomial.hermite_e.hermegauss(n)
    wg = wg * np.exp(0.5 * g**2)
    axes = [x] + [g] * (space - 1)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, space)
    weight = functools.reduce(np.multiply.outer, [wx] + [wg] * (space - 1)).ravel()
    points = mean - shifts.mean(0) + grid @ basis.T @ root.T
    return Rule(points, weight * abs(np.linalg.det(root)))


def shared_nodes(points: ndarray, weights: ndarray, log_density: Any, shifts: ndarray) -> Rule:
    """Any prior's own nodes, moved to every shifted copy and weighted so that no copy counts twice.

    Parameters
    ----------
    points, weights
        Quadrature for expectations under the prior.
    log_density
        Of the prior; minus infinity outside its support, so that nodes outside the overlap are dropped.

    Notes
    -----
    A node theta of the copy moved by -u has the weight ``w / sum_k f(theta + u_k)``: an integrand
    ``sqrt(f(theta + u) f(theta + v)) g`` becomes at most ``g / 2``, wherever the copies meet.
    """
    shifts = distinct(shifts)
    moved = np.concatenate([points - u for u in shifts])
    with np.errstate(divide="ignore"):
        densities = np.exp([log_density(moved + u) for u in shifts])
    keep = np.all(densities > 0, axis=0)
    return Rule(moved[keep], np.tile(weights, len(shifts))[keep] / densities[:, keep].sum(0))
