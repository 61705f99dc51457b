r"""The Weiss-Weinstein matrix for any prior, from integrals over places.

With test vectors h_i (columns of H), ``r(u) = sqrt f(theta + u)`` and the Bhattacharyya coefficient B(a, b) of the
measurement laws at two places,

    T(u, v)  = int over {theta, theta + u, theta + v in S} of r(u) r(v) B(theta + u, theta + v)
    mu_i     = T(0, h_i),      q_ij = T(h_i, h_j) + T(-h_i, -h_j) - T(h_i, -h_j) - T(-h_i, h_j)
    E[e e^T] >= (H mu) q^-1 (H mu)^T,          H mu the columns h_i mu_i

(s = 1/2; docs/theory/static-bounds.md derives it, and other exponents). For small h the four terms nearly cancel; they
are summed as parts without data minus ``1 - B``, which vanish like h^2 one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.static.overlap import Rule
from locbounds.static.pair_laws import GaussianPairs, PairLaw
from locbounds.static.support import Support

RANK = 1e-11  # eigenvalues of q below this share of the largest are left out (a smaller set of test functions: valid)


class Gram(NamedTuple):
    """mu [scales, points] and q [scales, points, points] of one set of test vectors."""

    mu: Float[ndarray, "scales points"]
    q: Float[ndarray, "scales points points"]


class _Terms:
    """Integrals wanted, each once; all places are evaluated in one go."""

    def __init__(self, support: Support, n: int):
        self.support, self.n = support, n
        self.index: dict[tuple[bytes, ...], int] = {}
        self.a, self.b, self.third, self.amplitude = [], [], [], []

    def key(self, u: ndarray, v: ndarray) -> int:
        """Number of the term T(u, v); T is symmetric."""
        name = tuple(sorted((np.round(u, 12) + 0.0).tobytes() + b"|" for u in (u, v)))
        if name not in self.index:
            self.index[name] = len(self.index)
            rule = self._rule(u, v)
            a, b = rule.points + u, rule.points + v
            density = 0.5 * (self.support.log_density(a) + self.support.log_density(b))
            self.a.append(a)
            self.b.append(b)
            self.amplitude.append(rule.weights * np.exp(density))
        return self.index[name]

    def _rule(self, u: ndarray, v: ndarray) -> Rule:
        """Theta itself must lie in the support too."""
        shifts = [u, v] if self.support.whole else [u, v, np.zeros_like(u)]
        return self.support.overlap(np.array(shifts), self.n, np.array([u, v]))

    def values(self, law: PairLaw, scales: Sequence[float]) -> tuple[ndarray, ndarray]:
        """Parts without data [terms], and by how much data lower them [scales, terms]."""
        counts = np.array([len(a) for a in self.a])
        total = np.zeros((len(scales), len(counts)))
        plain = np.array([w.sum() for w in self.amplitude])
        filled = counts > 0
        if filled.any():
            amplitude = np.concatenate(self.amplitude)
            pairs = law.pairs(np.concatenate(self.a), np.concatenate(self.b))
            starts = (np.cumsum(counts) - counts)[filled]
            for k, scale in enumerate(scales):
                lost = -np.expm1(law.log_affinity(pairs, scale))
                total[k, filled] = np.add.reduceat(amplitude * lost, starts)
        return plain, total


def grams(
    support: Support, law: PairLaw, tests: Sequence[Float[ndarray, "space points"]], n: int, scales: Sequence[float]
) -> list[Gram]:
    """mu and q for several sets of test vectors."""
    terms = _Terms(support, n)
    wanted = []
    for H in tests:
        h = [np.ascontiguousarray(column) for column in H.T]
        zero = np.zeros(len(H))
        first = [terms.key(zero, u) for u in h]
        pairs = [
            [(terms.key(u, v), terms.key(-u, -v), terms.key(u, -v), terms.key(-u, v)) for v in h[: i + 1]]
            for i, u in enumerate(h)
        ]
        wanted.append((first, pairs))
    plain, lost = terms.values(law, scales)
    found = []
    for first, pairs in wanted:
        mu = plain[first] - lost[:, first]
        q = np.zeros((len(scales), len(first), len(first)))
        for i, row in enumerate(pairs):
            for j, (pp, mm, pm, mp) in enumerate(row):
                rest = plain[pp] + plain[mm] - plain[pm] - plain[mp]
                data = lost[:, pp] + lost[:, mm] - lost[:, pm] - lost[:, mp]
                q[:, i, j] = q[:, j, i] = rest - data
        found.append(Gram(mu, q))
    return found


def printed(
    support: Support, law: PairLaw, tests: Sequence[Float[ndarray, "space points"]], n: int, scales: Sequence[float]
) -> list[Gram]:
    """The chapter's (18): q_ij = 2 (mu(h_i - h_j) - mu(h_i + h_j)), which drops the restriction of theta to S."""
    terms = _Terms(support, n)
    wanted = []
    for H in tests:
        h = [np.ascontiguousarray(column) for column in H.T]
        zero = np.zeros(len(H))
        first = [terms.key(zero, u) for u in h]
        wanted.append((first, [[(terms.key(zero, u - v), terms.key(zero, u + v)) for v in h] for u in h]))
    plain, lost = terms.values(law, scales)
    value = plain - lost
    found = []
    for first, pairs in wanted:
        q = np.array([[2 * (value[:, minus] - value[:, plus]) for minus, plus in row] for row in pairs])
        found.append(Gram(value[:, first], np.moveaxis(q, -1, 0)))
    return found


def with_exponent(
    support: Support,
    law: GaussianPairs,
    tests: Sequence[Float[ndarray, "space points"]],
    exponent: float,
    n: int,
    scales: Sequence[float],
) -> list[Gram]:
    """mu and q for one exponent s in (0, 1) of all test vectors; Gaussian noise.

    ``psi_i = L^s(theta + h_i; theta) - L^(1-s)(theta - h_i; theta)``. Products of three Gaussian densities of one
    covariance with exponents a, b, c that sum to one integrate to exp(-(ab D_ab^2 + ac D_ac^2 + bc D_bc^2) / 2).
    """
    s = exponent

    def integral(u: ndarray, v: ndarray, a: float, b: float) -> ndarray:
        c = 1 - a - b
        shifts = np.array([u, v, np.zeros_like(u)])
        rule = support.overlap(shifts, n)
        here, left, right = rule.points, rule.points + u, rule.points + v
        density = a * support.log_density(left) + b * support.log_density(right)
        if c != 0:
            density = density + c * support.log_density(here)
        gap = a * b * law.pairs(left, right)[:, 0]
        if c != 0:
            gap = gap + a * c * law.pairs(left, here)[:, 0] + b * c * law.pairs(right, here)[:, 0]
        each = density - 0.5 * gap / np.square(scales)[:, None]
        with np.errstate(over="ignore"):
            return np.exp(each) @ rule.weights

    found = []
    for H in tests:
        h = list(H.T)
        mu = np.stack([integral(u, np.zeros_like(u), s, 1 - s) for u in h], -1)
        q = np.empty((len(scales), len(h), len(h)))
        for i, u in enumerate(h):
            for j, v in enumerate(h[: i + 1]):
                q[:, i, j] = q[:, j, i] = (
                    integral(u, v, s, s)
                    + integral(-u, -v, 1 - s, 1 - s)
                    - integral(u, -v, s, 1 - s)
                    - integral(-u, v, 1 - s, s)
                )
        found.append(Gram(mu, q))
    return found


def bound_matrices(H: Float[ndarray, "space points"], gram: Gram) -> Float[ndarray, "scales space space"]:
    """``(H mu) q^-1 (H mu)^T``, with directions of q that are zero to rounding left out."""
    moved = H * gram.mu[:, None, :]
    size = np.sqrt(np.maximum(np.diagonal(gram.q, axis1=1, axis2=2), 0.0))
    there = (size > 0) & np.isfinite(size)
    unit = np.where(there, size, 1.0)
    q = np.where(there[:, :, None] & there[:, None, :], gram.q / (unit[:, :, None] * unit[:, None, :]), 0.0)
    moved = np.where(there[:, None, :], moved / unit[:, None, :], 0.0)
    values, vectors = np.linalg.eigh(q)
    good = values > RANK * np.maximum(values[:, -1:], 1e-300)
    parts = (moved @ vectors) / np.sqrt(np.where(good, values, 1.0))[:, None, :]
    parts = np.where(good[:, None, :], parts, 0.0)
    return parts @ np.swapaxes(parts, 1, 2)
