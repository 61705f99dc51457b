"""Sum of two independent noises without a closed form: accurate convolution, tabulated."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, ndarray
from locbounds.errors import InputError
from locbounds.noise.base import Noise
from locbounds.noise.sum_of_two import Sum
from locbounds.precision import double_precision, traced

DEGREE = 11  # of the polynomials
ROWS = 256  # densities at once: one compiled shape
ACCURATE = 1e-11  # last coefficients of the log-density, at which a panel is no longer halved
NEGLIGIBLE = 650.0  # panels whose log-density lies this far below the largest are left to extrapolation
HALVINGS = 40
SHORTEST = 1e-9  # panel, in widths of the law
SPACING = 1e-13  # relative: shorter panels hold too few doubles
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_FINER = np.polynomial.legendre.leggauss(24)
_CHEBYSHEV = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
_FIT = np.linalg.inv(np.polynomial.chebyshev.chebvander(_CHEBYSHEV, DEGREE))


@partial(jax.jit, static_argnames="finer")
def _convolve(a: Noise, b: Noise, e: Float[Array, " n"], *, finer: bool = False) -> Float[Array, " n"]:
    """Log-density of the sum, by Gauss-Legendre quadrature between the landmarks of both."""
    nodes, weights = _FINER if finer else (_NODES, _WEIGHTS)
    one, two = a.landmarks(), b.landmarks()
    low = jnp.maximum(one[0], e - two[-1])[:, None]
    high = jnp.minimum(one[-1], e - two[0])[:, None]
    here = jnp.broadcast_to(one, (len(e), len(one)))
    places = jnp.sort(jnp.clip(jnp.concatenate([here, e[:, None] - two], 1), low, jnp.maximum(low, high)), axis=1)
    half = 0.5 * jnp.diff(places)
    x = (0.5 * (places[:, 1:] + places[:, :-1]))[..., None] + half[..., None] * nodes
    logs = a.log_prob(x) + b.log_prob(e[:, None, None] - x)
    top = jnp.max(logs, (1, 2), keepdims=True)
    top = jnp.where(jnp.isfinite(top), top, 0.0)
    total = jnp.sum(half[..., None] * weights * jnp.exp(logs - top), (1, 2))
    return jnp.where(total > 0, jnp.log(jnp.where(total > 0, total, 1.0)) + top[:, 0, 0], -jnp.inf)


def _log_density(a: Noise, b: Noise, e: ndarray, *, finer: bool = False) -> ndarray:
    padded = np.concatenate([e, np.full(-len(e) % ROWS, e[-1])]).reshape(-1, ROWS)
    return np.concatenate([np.asarray(_convolve(a, b, rows, finer=finer)) for rows in padded])[: len(e)]


def _table(a: Noise, b: Noise, edges: ndarray, scale: float) -> tuple[ndarray, ndarray]:
    """Panels and Chebyshev coefficients of the log-density; panels are halved until the last coefficients are small."""
    todo = np.stack([edges[:-1], edges[1:]], 1)
    done, coefficients, top = [], [], -np.inf
    for _ in range(HALVINGS):
        middle, half = todo.mean(1, keepdims=True), 0.5 * np.diff(todo, axis=1)
        values = _log_density(a, b, (middle + half * _CHEBYSHEV).ravel()).reshape(len(todo), -1)
        top = max(top, float(values.max()))
        there = np.isfinite(values).all(1) & (values.max(1) > top - NEGLIGIBLE)
        c = np.where(there[:, None], values, 0.0) @ _FIT.T
        rough = np.abs(c[:, -2:]).max(1) > ACCURATE * np.maximum(1.0, np.abs(c).max(1))
        splits = there & rough & (half[:, 0] > SHORTEST * scale + SPACING * np.abs(middle[:, 0]))
        ends = (todo[:, 0] == edges[0]) | (todo[:, 1] == edges[-1])
        keep = there & ~splits & ~(rough & ends)  # next to an end the density goes on as a power
        done.append(todo[keep])
        coefficients.append(c[keep])
        todo = todo[splits]
        if not len(todo):
            break
        m = todo.mean(1)
        todo = np.concatenate([np.stack([todo[:, 0], m], 1), np.stack([m, todo[:, 1]], 1)])
    panels, table = np.concatenate(done), np.concatenate(coefficients)
    order = np.argsort(panels[:, 0])
    return panels[order], table[order]


class Convolution(Sum):
    """Sum of two independent noises, tabulated.

    The density is integrated at construction and kept as polynomials of its logarithm between places where it is not
    smooth; ``error`` states how exact that is. Beyond the table, where the density is below 1e-280 of its
    maximum or next to an end of the support, it goes on as a power of the distance from that end (or from the mean).

    Parameters
    ----------
    first, second
        The parts. Their numbers must be known: a convolution is not rebuilt inside JAX transformations.

    Attributes
    ----------
    error
        Largest relative difference of the density at places between those of the table from quadrature with more
        nodes, wherever the density is above 1e-12 of its maximum.

    Raises
    ------
    InputError
        If a part is being traced by JAX.

    Examples
    --------
    >>> import locbounds as lb
    >>> noise = lb.Gaussian(0.0, 1.0) + lb.Gamma(2.0, 3.0)
    >>> noise.regularity().status, bool(noise.error < 1e-8)
    ('regular', True)
    """

    first: Noise
    second: Noise
    edges: Float[Array, " p+1"]
    table: Float[Array, "p d"]
    anchors: Float[Array, " 2"]
    error: Float[Array, ""]

    def __init__(self, first: Noise, second: Noise):
        if traced(first, second):
            raise InputError(
                "a sum of noises without a closed form cannot be built inside a JAX transformation",
                "Build it outside, from numbers",
            )
        self.first, self.second = first, second
        self.edges, self.table, self.anchors, self.error = _build(first, second)

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        w, edges, table = jnp.asarray(w), jnp.asarray(self.edges), jnp.asarray(self.table)
        x = jnp.clip(w, edges[0], edges[-1])
        i = jnp.clip(jnp.searchsorted(edges, x, side="right") - 1, 0, len(table) - 1)
        low, high = edges[i], edges[i + 1]
        inside = _chebyshev(table[i], (2 * x - low - high) / (high - low))
        left, right = self._tail(0), self._tail(-1)
        log_p = jnp.where(w < edges[0], left(w), jnp.where(w > edges[-1], right(w), inside))
        one, two = self.first.landmarks(), self.second.landmarks()
        there = (w > one[0] + two[0]) & (w < one[-1] + two[-1])
        return jnp.where(there, log_p, -jnp.inf)

    def _tail(self, end: int):
        """Power law through value and slope of the table's first or last place."""
        edge, reference = jnp.asarray(self.edges)[end], jnp.asarray(self.anchors)[end]
        side = 1.0 if end == 0 else -1.0
        c = jnp.asarray(self.table)[end]
        width = jnp.abs(jnp.diff(jnp.asarray(self.edges))[end])
        k = np.arange(len(c))
        value = jnp.sum(c * (-side) ** k)
        slope = jnp.sum(c * k**2 * (-side) ** (k + 1)) * 2 / width
        power = slope * (edge - reference)

        def log_p(w: Array) -> Array:
            ratio = (w - reference) / (edge - reference)
            return value + power * jnp.log(jnp.where(ratio > 0, ratio, 1.0))

        return log_p

    def landmarks(self) -> Float[Array, " k"]:
        one, two = self.first.landmarks(), self.second.landmarks()
        ends = jnp.stack([one[0] + two[0], one[-1] + two[-1]])
        return jnp.concatenate([ends[:1], jnp.asarray(self.edges), ends[1:]])


def _chebyshev(c: Float[Array, "*n d"], u: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Clenshaw's recurrence."""
    one = two = jnp.zeros(u.shape)
    for k in range(c.shape[-1] - 1, 0, -1):
        one, two = c[..., k] + 2 * u * one - two, one
    return c[..., 0] + u * one - two


def _width(a: Noise, b: Noise) -> float:
    """Interquartile range of the sum, roughly: the larger one of the parts."""
    ranges = [np.diff(np.asarray(part.quantile(jnp.array([0.25, 0.75]))))[0] for part in (a, b)]
    return float(max(ranges))


@double_precision
def _build(a: Noise, b: Noise) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    one, two = np.asarray(a.landmarks()), np.asarray(b.landmarks())
    corners = np.add.outer(np.asarray(a.corners()), np.asarray(b.corners())).ravel()
    low, high = one[0] + two[0], one[-1] + two[-1]
    places = np.concatenate([one + float(b.mean), two + float(a.mean), corners, [low, high]])
    places = np.unique(np.clip(places[np.isfinite(places)], low, high))
    keep = np.concatenate([[True], np.diff(places) > 1e4 * SPACING * np.abs(places[1:])])
    places = places[keep]
    panels, table = _table(a, b, places, _width(a, b))
    edges = np.append(panels[:, 0], panels[-1, 1])
    if not np.allclose(panels[1:, 0], panels[:-1, 1]):
        raise InputError("the sum of these noises has a gap in its support", "Give the parts of the mixture separately")
    finite_low = np.isfinite(a.support()[0][0] + b.support()[0][0])
    finite_high = np.isfinite(a.support()[-1][1] + b.support()[-1][1])
    middle = float(a.mean + b.mean)
    anchors = np.array([low if finite_low else middle, high if finite_high else middle])
    between = edges[:-1] + 0.3819660112501051 * np.diff(edges)
    u = np.full(len(between), 2 * 0.3819660112501051 - 1)
    said = np.polynomial.chebyshev.chebval(u, table.T, tensor=False)
    exact = _log_density(a, b, between, finer=True)
    seen = exact > exact.max() - np.log(1e12)
    return edges, table, anchors, np.asarray(np.max(np.abs(np.expm1(said - exact))[seen]))
