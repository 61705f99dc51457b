r"""Whether the mean square of a function's gradient is finite, found numerically.

Where a gradient grows like ``r^-a`` with the distance r from a set of codimension c, and the density is positive there,
``E|grad h|^2`` is a multiple of ``int r^(-2a) r^(c-1) dr`` near it: finite exactly for ``2 a < c``. Both numbers can be
measured: a from the growth over shrinking shells around the steepest place, c from the share of a small ball around
it in which the square exceeds a level, which falls with the level to the power ``-c / (2a)``.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from locbounds.axes import Array, Float, Int, ndarray

STARTS, AROUND = 16, 256  # steepest draws, and points around each that are looked at
HALVINGS = 30  # of the ball in which the steepest place is sought; the last is 1e-9 deviations wide
SHELLS = np.arange(4, 27)  # radii 2^-j in deviations
DIRECTIONS = 64
OCTAVES = 8  # that an exponent is measured over
BALL, IN_BALL, TAIL = 2.0**-8, 8192, 400  # radius in deviations, points in it, and how many of them are the tail
STEEP = 0.1  # exponents below this are none
FINITE, INFINITE = 0.8, 0.97  # 2 a / c up to which the mean square is finite, and from which it is infinite
AGREE = 0.03  # by how much two exponents, or a codimension and a whole number of it, may differ
WHOLE = 0.35
RANK = 1e-12  # relative variance below which draws do not spread in a direction
BATCH = 4096  # points that are evaluated at once: one shape, compiled once


class Steep(NamedTuple):
    """A place at which the gradient grows without bound.

    Attributes
    ----------
    place
        [space].
    exponent, codimension
        a and c of the module's first lines.
    infinite
        Whether the mean square is infinite where the density is positive; None: too close to tell.
    """

    place: ndarray
    exponent: float
    codimension: int
    infinite: bool | None


def steepest(
    gradients: Callable[[Float[ndarray, "n space"], Int[ndarray, " n"]], Float[Array, "n space"]],
    draws: Float[Array, "laws n space"],
    *,
    candidates: Float[Array, "candidates space"] | None = None,
    inside: Callable[[Float[ndarray, "n space"]], Array] | None = None,
) -> Steep | None:
    """The place where the mean square of a gradient is, or may be, infinite; None if none is found.

    Parameters
    ----------
    gradients
        Gradient at points, each under the law whose number is given.
    draws
        Of every law under which the mean matters. Directions in which a law does not spread do not count.
    candidates
        Places to look at in any case, for example anchors.
    inside
        Which places count; None: all.

    Examples
    --------
    The logarithm of the distance, in two dimensions and in three:

    >>> def slopes(x, law):
    ...     return x / np.sum(x**2, axis=1, keepdims=True)
    >>> found = steepest(slopes, np.random.default_rng(0).normal(size=(1, 4096, 2)))
    >>> round(found.exponent, 2), found.codimension, found.infinite
    (1.0, 2, True)
    >>> steepest(slopes, np.random.default_rng(0).normal(size=(1, 4096, 3))) is None
    True
    """
    draws = np.asarray(draws, dtype=float)
    roots, means = _roots(draws), draws.mean(1)

    def size(points: ndarray, law: ndarray) -> ndarray:
        """Length of the gradient in units of the laws' deviations, zero where it is not a number."""
        shape = points.shape[:-1]
        law = np.broadcast_to(law, shape).ravel()
        g = _in_batches(gradients, points.reshape(-1, points.shape[-1]), law)
        found = np.linalg.norm(np.einsum("nsi,ns->ni", roots[law], g), axis=-1)
        return np.where(np.isfinite(found), found, 0.0).reshape(shape)

    first = size(draws, np.arange(len(draws))[:, None])
    if not first.max() > 0:
        return None
    top = np.argsort(first, axis=None)[-STARTS:]
    law, index = np.unravel_index(top, first.shape)
    rng = np.random.default_rng(0)
    places = _sought(size, draws[law, index], law, roots, rng)
    extra, extra_law = _reached(candidates, means, roots)
    places, law = np.concatenate([places, extra]), np.concatenate([law, extra_law])
    if inside is not None:
        kept = np.asarray(inside(places))
        places, law = places[kept], law[kept]
    if not len(places):
        return None
    near, far = _exponents(size, places, law, roots, rng)
    doubtful = None
    for i in np.argsort(-near):
        if near[i] < STEEP:
            break
        found = _judged(size, places[i], int(law[i]), roots, float(near[i]), float(far[i]), rng)
        if found is not None and found.infinite:
            return found
        doubtful = doubtful or found
    return doubtful


def _roots(draws: ndarray) -> ndarray:
    """Per law a matrix [space, space] whose columns are the directions in which it spreads, zero if it does not."""
    out = []
    for x in draws:
        values, vectors = np.linalg.eigh(np.atleast_2d(np.cov(x, rowvar=False)))
        values = np.where(values > RANK * max(values[-1], np.finfo(float).tiny), values, 0.0)
        out.append(vectors * np.sqrt(values))
    return np.stack(out)


def _in_batches(gradients, points: ndarray, law: ndarray) -> ndarray:
    n = len(points)
    fill = -n % BATCH
    points, law = np.pad(points, ((0, fill), (0, 0)), mode="edge"), np.pad(law, (0, fill), mode="edge")
    parts = [np.asarray(gradients(points[i : i + BATCH], law[i : i + BATCH])) for i in range(0, n, BATCH)]
    return np.concatenate(parts)[:n]


def _ball(rng, n: int, dim: int) -> ndarray:
    u = rng.normal(size=(n, dim))
    return u / np.linalg.norm(u, axis=1, keepdims=True) * rng.random((n, 1)) ** (1 / dim)


def _sought(size, places: ndarray, law: ndarray, roots: ndarray, rng) -> ndarray:
    """From every start on to steeper places near it, in balls of half the radius each time."""
    u = _ball(rng, AROUND, places.shape[1])
    u[0] = 0.0
    moves = np.einsum("psi,ui->pus", roots[law], u)
    rows = np.arange(len(places))
    for j in range(1, HALVINGS + 1):
        around = places[:, None] + 0.5**j * moves
        places = around[rows, size(around, law[:, None]).argmax(1)]
    return places


def _reached(candidates, means: ndarray, roots: ndarray) -> tuple[ndarray, ndarray]:
    """The candidates that lie where some law spreads to, each with one such law."""
    places, laws = [], []
    for a in np.zeros((0, means.shape[1])) if candidates is None else np.asarray(candidates, dtype=float):
        for law in dict.fromkeys((0, len(means) - 1)):
            d = a - means[law]
            left = d - roots[law] @ (np.linalg.pinv(roots[law]) @ d)
            if np.linalg.norm(left) <= 1e-9 * (1 + np.linalg.norm(d)):
                places.append(a)
                laws.append(law)
    return np.array(places).reshape(-1, means.shape[1]), np.array(laws, dtype=int)


def _exponents(size, places: ndarray, law: ndarray, roots: ndarray, rng) -> tuple[ndarray, ndarray]:
    """Exponents of the growth over the smallest shells, and over those before them."""
    u = rng.normal(size=(DIRECTIONS, places.shape[1]))
    moves = np.einsum("psi,ui->pus", roots[law], u / np.linalg.norm(u, axis=1, keepdims=True))
    spread = np.linalg.norm(roots[law], axis=(1, 2))
    rounding = 1e5 * np.finfo(float).eps * np.abs(places).max(1) / np.where(spread > 0, spread, 1.0)
    last = np.clip(np.floor(-np.log2(np.maximum(rounding, 1e-30))), SHELLS[0] + 2 * OCTAVES, SHELLS[-1])
    radii = 0.5 ** (SHELLS + (last - SHELLS[-1])[:, None])  # [places, shells]
    points = places[:, None, None] + radii[..., None, None] * moves[:, None]
    found = np.median(size(points, law[:, None, None]), axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log2(found)
        near, far = log[:, -1] - log[:, -1 - OCTAVES], log[:, -1 - OCTAVES] - log[:, -1 - 2 * OCTAVES]
    return np.nan_to_num(near / OCTAVES, posinf=0.0, neginf=0.0), np.nan_to_num(far / OCTAVES, posinf=0.0, neginf=0.0)


def _judged(size, place: ndarray, law: int, roots: ndarray, near: float, far: float, rng) -> Steep | None:
    moves = np.einsum("si,ui->us", roots[law], _ball(rng, IN_BALL, len(place)))
    square = np.sort(size(place + BALL * moves, np.array(law)))[-TAIL - 1 :] ** 2
    rank = int(np.sum(np.linalg.norm(roots[law], axis=0) > 0))
    if not square[0] > 0:
        return Steep(place, near, 1, None)
    tail = 1.0 / np.mean(np.log(square[1:] / square[0]))
    codimension = int(np.clip(np.round(2 * near * tail), 1, max(rank, 1)))
    if 2 * max(near, far) < FINITE * codimension and abs(2 * near * tail - codimension) < WHOLE:
        return None
    sure = (
        2 * near >= INFINITE * codimension
        and abs(near - far) <= AGREE * near
        and abs(2 * near * tail - codimension) < WHOLE
    )
    return Steep(place, near, codimension, True if sure else None)
