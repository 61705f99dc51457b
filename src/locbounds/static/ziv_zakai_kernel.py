r"""The extended Ziv-Zakai bound along one direction.

For a unit vector a and any shift delta(h) with ``a . delta(h) = h``

    E[(a . e)^2] >= 1/2 int_0^inf h V[A(delta(h))] dh,
    A(delta) = int [f(theta) + f(theta + delta)] P_min(theta, theta + delta) dtheta,       V[g](h) = max over x >= h of g(x)

(Bell et al. 1997). P_min is the least error probability with the prior probabilities f(theta) and f(theta + delta);
where only that of equally likely places is known, ``2 min(f, f') P_el`` stands in for the integrand, which is smaller.
A falls from 1 at h = 0; the integral over h is adaptive, by Gauss-Kronrod panels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.static.pair_laws import GaussianPairs, PairLaw, gaussian_error
from locbounds.static.support import Support

HALVINGS = 6  # panels at the start: halves, quarters, ... of the longest shift
MOST_ROUNDS = 12
SIDEWAYS = 9  # free shifts tried at first, along each free coordinate
ZOOMS, AROUND = 3, 5  # then so many times, closer around the best
COARSE = 8  # nodes along a side while shifts are compared

# Gauss-Kronrod, 7 and 15 nodes on [-1, 1]
_X = np.array([0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
               0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
               0.586087235467691130294144691693013, 0.405845151377397166906606412076961,
               0.207784955007898467600689403773245, 0.0])  # fmt: skip
_WK = np.array([0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
                0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
                0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
                0.204432940075298892414161999234649, 0.209482141084727828012999174891714])  # fmt: skip
_WG = np.array([0.129484966168869693270611432679082, 0.279705391489276667901467771423780,
                0.381830050505118944950369775488975, 0.417959183673469387755102040816327])  # fmt: skip
KRONROD_X = np.concatenate([-_X, _X[-2::-1]])
KRONROD_W = np.concatenate([_WK, _WK[-2::-1]])
GAUSS_W = np.zeros(15)
GAUSS_W[1::2] = np.concatenate([_WG, _WG[-2::-1]])


class Along(NamedTuple):
    """The bound along one direction, one row per noise level.

    Attributes
    ----------
    mse_m2 : array [scales]
    error_m2 : array [scales]
        Estimated error of the integral over h.
    h_m : array [nodes]
    filled : array [scales, nodes]
        V[A] there.
    """

    mse_m2: Float[ndarray, " scales"]
    error_m2: Float[ndarray, " scales"]
    h_m: Float[ndarray, " nodes"]
    filled: Float[ndarray, "scales nodes"]


def confusion(
    support: Support, law: PairLaw, shifts: Float[ndarray, "shifts space"], n: int, scales: Sequence[float],
    *, equal: bool = False,
) -> Float[ndarray, "scales shifts"]:  # fmt: skip
    """A(delta) for shifts; with ``equal``, the smaller integrand of equally likely places."""
    rules = [support.overlap(np.stack([np.zeros_like(d), d]), n) for d in shifts]
    counts = np.array([len(rule.weights) for rule in rules])
    found = np.zeros((len(scales), len(shifts)))
    filled = counts > 0
    if not filled.any():
        return found
    here = np.concatenate([rule.points for rule in rules])
    there = here + np.repeat(shifts, counts, axis=0)
    weights = np.concatenate([rule.weights for rule in rules])
    pairs = law.pairs(here, there)
    starts = (np.cumsum(counts) - counts)[filled]
    one, two = support.log_density(here), support.log_density(there)
    exact = isinstance(law, GaussianPairs) and not support.uniform and not equal
    total, odds = np.logaddexp(one, two), one - two
    smaller = 2 * np.exp(np.minimum(one, two))
    for k, scale in enumerate(scales):
        if exact:
            each = np.exp(total) * gaussian_error(law.distance(pairs, scale), odds)
        else:
            each = smaller * law.error(pairs, scale)
        found[k, filled] = np.add.reduceat(weights * each, starts)
    return found


def along(
    support: Support, law: PairLaw, a: Float[ndarray, " space"], n: int, scales: Sequence[float], *,
    free: bool = False, valley: bool = True, equal: bool = False, rtol: float = 1e-4,
) -> Along:  # fmt: skip
    """The bound on the mean square error along a unit vector, for several noise levels."""
    if free and len(scales) > 1:
        each = [
            along(support, law, a, n, [s], free=True, valley=valley, equal=equal, rtol=rtol) for s in scales
        ]
        h = np.unique(np.concatenate([e.h_m for e in each]))
        filled = np.array([np.interp(h, e.h_m, e.filled[0]) for e in each])
        return Along(*(np.concatenate([getattr(e, f) for e in each]) for f in ("mse_m2", "error_m2")), h, filled)

    longest = _width(support, a) if free else support.reach(a)
    edges = longest * np.concatenate([[0.0], 0.5 ** np.arange(HALVINGS, -1, -1)])
    at = np.sort(np.concatenate([edges[1:] * k for k in (0.6, 0.8, 0.99)]))
    offsets = _free_offsets(support, law, a, at, scales, equal=equal) if free else None

    def value(h: ndarray) -> ndarray:
        found = confusion(support, law, h[:, None] * a, n, scales, equal=equal)
        if offsets is None or not len(basis):
            return found
        moved = np.stack([np.interp(h, at, c) for c in offsets.T], -1)
        other = confusion(support, law, h[:, None] * a + moved @ basis, n, scales, equal=equal)
        return np.maximum(found, other)

    basis = sideways(a)
    return _integral(value, edges, valley=valley, rtol=rtol)


def _integral(value: Callable[[ndarray], ndarray], edges: ndarray, *, valley: bool, rtol: float) -> Along:
    """``1/2 int h V[A(h)] dh`` on panels that are halved until every noise level has its precision."""
    low, high = edges[:-1], edges[1:]
    h = _nodes(low, high)
    values = value(h.ravel()).reshape(-1, *h.shape)
    for _ in range(MOST_ROUNDS):
        filled = _fill(h, values) if valley else values
        half = 0.5 * (high - low)
        parts = 0.5 * h * filled
        kronrod, gauss = half * (parts @ KRONROD_W), half * (parts @ GAUSS_W)
        errors = np.abs(kronrod - gauss)
        total = kronrod.sum(-1)
        bad = np.any(errors > rtol * total[:, None] / 4, axis=0)
        if not bad.any() or errors.sum(-1).max() <= 0:
            break
        middle = 0.5 * (low[bad] + high[bad])
        new_low, new_high = np.concatenate([low[bad], middle]), np.concatenate([middle, high[bad]])
        new_h = _nodes(new_low, new_high)
        new = value(new_h.ravel()).reshape(-1, *new_h.shape)
        low, high = np.concatenate([low[~bad], new_low]), np.concatenate([high[~bad], new_high])
        h, values = np.concatenate([h[~bad], new_h]), np.concatenate([values[:, ~bad], new], axis=1)
    filled = _fill(h, values) if valley else values
    half = 0.5 * (high - low)
    parts = 0.5 * h * filled
    kronrod = half * (parts @ KRONROD_W)
    errors = np.abs(kronrod - half * (parts @ GAUSS_W))
    order = np.argsort(h.ravel())
    return Along(kronrod.sum(-1), errors.sum(-1), h.ravel()[order], filled.reshape(len(filled), -1)[:, order])


def _nodes(low: ndarray, high: ndarray) -> ndarray:
    return 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * KRONROD_X


def _fill(h: ndarray, values: ndarray) -> ndarray:
    """The largest value at any node to the right: at most V."""
    order = np.argsort(h.ravel())
    flat = values.reshape(len(values), -1)[:, order]
    flat = np.maximum.accumulate(flat[:, ::-1], axis=1)[:, ::-1]
    filled = np.empty_like(flat)
    filled[:, order] = flat
    return filled.reshape(values.shape)


def sideways(a: ndarray) -> Float[ndarray, "free space"]:
    """Unit vectors that complete a to a basis.

    >>> sideways(np.array([1.0, 0.0])).round(12).tolist() in ([[0.0, 1.0]], [[0.0, -1.0]])
    True
    """
    full = np.linalg.qr(np.column_stack([a, np.eye(len(a))]))[0]
    return full[:, 1 : len(a)].T


def _width(support: Support, a: ndarray) -> float:
    """Longest projection on a of a shift with any overlap: over shifts in all directions."""
    longest = support.reach(a)
    basis = sideways(a)
    if len(basis) == 0:
        return longest
    if support.whole:
        return longest * np.sqrt(float(a @ support.covariance @ a) * float(a @ np.linalg.solve(support.covariance, a)))
    angles = np.linspace(-1, 1, 181)[1:-1] * np.pi / 2
    return max(
        longest, *(support.reach(np.cos(t) * a + np.sin(t) * b) * np.cos(t) for b in basis for t in angles)
    )


def _free_offsets(
    support: Support, law: PairLaw, a: ndarray, h: ndarray, scales: Sequence[float], *, equal: bool
) -> Float[ndarray, "h free"]:
    """For every h free components of a shift with a large A: a grid of them, then closer ones."""
    basis = sideways(a)
    free = len(basis)
    if free == 0:
        return np.zeros((len(h), 0))
    span = np.array([support.reach(b) for b in basis])
    best, width = np.zeros((len(h), free)), 0.5 * span
    for zoom in range(ZOOMS + 1):
        t = np.linspace(-1, 1, SIDEWAYS if zoom == 0 else AROUND)
        steps = np.stack(np.meshgrid(*[t] * free, indexing="ij"), -1).reshape(-1, free)
        tried = best[:, None] + steps * width
        shifts = h[:, None, None] * a + tried @ basis
        values = confusion(support, law, shifts.reshape(-1, len(a)), COARSE, scales[:1], equal=equal)
        values = values.reshape(len(h), -1)
        values[:, len(steps) // 2] *= 1 + 1e-9  # ties stay where they are
        best = tried[np.arange(len(h)), values.argmax(1)]
        width = width * (2 / (SIDEWAYS - 1) if zoom == 0 else 0.5)
    return best
