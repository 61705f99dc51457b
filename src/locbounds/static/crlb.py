r"""The Cramér-Rao bound of a plan at points.

With the derivatives ``H`` of the noise-free values and the intrinsic accuracies ``W`` of the channels (the inverse
covariance of Gaussian noise; for independent noise of any other density the diagonal of ``E[score^2]``), the Fisher
information about the position is ``J = H^T W H``. A clock offset b that adds to the channels marked by c is a further
unknown: information [c H]^T W [c H], plus 1 / s^2 for the clock if it is known to a deviation s. The bound on the
position is then the inverse of the Schur complement.

Computed by Gram-Schmidt on the whitened columns (clock first), never by an inverse of J: what remains of a column
beside the others is found to rounding, so that singular geometry is told apart from merely poor geometry.
"""

from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.errors import InputError, RefusedError
from locbounds.plan import Plan
from locbounds.precision import double_precision, traced
from locbounds.registry import method
from locbounds.result import Provenance
from locbounds.static import merit
from locbounds.verdict import Status, Verdict

CHUNK = 1 << 16  # points at once: memory stays bounded, one compilation for all chunks
SINGULAR = 1e-9  # what remains of a derivative beside the others, relative to it, below which geometry is singular
LARGE, BLOCK = 1 << 19, 1 << 16  # numbers in an array [channels, points]: from when it is cut, and into what
AT_ANCHOR_M = 1e-9
MANY = 16  # channels from which a common part of their noise is worth a look
REASONS = {
    0: "",
    1: "the measurements do not determine the position here",
    2: "no derivative here: at an anchor, where an angle is not defined, or where a function has no finite one",
}


class PointBounds(eqx.Module):
    """The Cramér-Rao bound at points.

    Attributes
    ----------
    points
        [points, space] in metres.
    covariance
        [points, space, space] m^2: no unbiased estimator has a smaller error covariance. Where there is no bound the
        diagonal is infinite, and the rest zero.
    status
        [points] code of :data:`~locbounds.static.crlb.REASONS`; 0: there is a bound.
    clock_variance
        [points] m^2: bound on the variance of the clock offset, or None if the clock is known.
    station_std
        Standard deviation that dilutions of precision are relative to, or None if stations differ.
    verdict, provenance
        Whether the numbers may be quoted; where they come from.

    Examples
    --------
    >>> import locbounds as lb
    >>> square = [[0, 0], [100, 0], [100, 100], [0, 100]]
    >>> bound = lb.crlb(lb.toa(square, std_m=2.0), np.array([[50.0, 50.0], [0.0, 0.0]]))
    >>> bound.rmse, bound.cep().round(3), bound.reasons[1][:18]
    (array([ 2., inf]), array([1.665,   inf]), 'no derivative here')
    """

    points: Float[Array, "points space"]
    covariance: Float[Array, "points space space"]
    status: Any
    clock_variance: Float[Array, " points"] | None
    station_std: Any = None
    verdict: Verdict | None = eqx.field(static=True, default=None)
    provenance: Provenance | None = eqx.field(static=True, default=None)
    id: str = eqx.field(static=True, default="crlb")

    @property
    def singular(self) -> Bool[Array, " points"]:
        """Where there is no bound."""
        return self.status != 0

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why there is no bound, per point."""
        return tuple(REASONS[int(code)] for code in self.status)

    @property
    def rmse(self) -> Float[Array, " points"]:
        """Bound on the root mean square position error, in metres."""
        return merit.rmse(self.covariance)

    def cep(self) -> Float[Array, " points"]:
        """Circular error probable of a Gaussian error with this covariance, in metres."""
        return merit.cep(self.covariance)

    def quantile(self, share: float) -> Float[Array, " points"]:
        """Radius that a Gaussian error with this covariance stays within, in metres."""
        return merit.error_quantile(self.covariance, share)

    def mde(self) -> Float[Array, " points"]:
        """Mean length of a Gaussian error with this covariance, in metres."""
        return merit.mde(self.covariance)

    def ellipse(self, share: float = 0.95) -> merit.Ellipse:
        """Ellipses that hold a Gaussian error with this covariance."""
        return merit.error_ellipse(self.covariance, share)

    def dop(self, *, std: float | None = None) -> "Dop":
        """Dilutions of precision: errors relative to the deviation of one station.

        Parameters
        ----------
        std
            The deviation, if stations differ.

        Raises
        ------
        InputError
            If the stations have different units or deviations and none is given.
        """
        unit = self.station_std if std is None else std
        if unit is None:
            raise InputError(
                "the stations have no common deviation, or different units",
                "Give the deviation that errors are relative to (dop(std=...)), or weights (lb.dop)",
            )
        return _dop(self.covariance, self.clock_variance, unit)

    def __str__(self) -> str:
        if traced(self):
            return "CRLB: traced"
        good = ~np.asarray(self.singular)
        if not good.any():
            return f"CRLB: no bound at any of {len(good)} points; {self.verdict}"
        r = np.asarray(self.rmse)[good]
        lost = f", singular at {len(good) - good.sum()}" if not good.all() else ""
        return f"CRLB: position RMSE {r.min():.3g} to {r.max():.3g} m at {good.sum()} points{lost}; {self.verdict}"


class Dop(NamedTuple):
    """Dilutions of precision: bounds on errors over the deviation of one station; infinite where there is no bound.

    Attributes
    ----------
    gdop, pdop, hdop
        Position and clock (if unknown) together; position; horizontal position. [points]
    vdop, tdop
        Height; clock offset. None in 2-D, and for a known clock.
    """

    gdop: Any
    pdop: Any
    hdop: Any
    vdop: Any
    tdop: Any


def _dop(covariance: Any, clock: Any, unit: Any) -> Dop:
    xp = jnp if traced(covariance) else np
    v = xp.diagonal(covariance, axis1=-2, axis2=-1) / unit**2
    time = None if clock is None else clock / unit**2
    total = v.sum(-1)
    return Dop(
        xp.sqrt(total if time is None else total + time),
        xp.sqrt(total),
        xp.sqrt(v[..., :2].sum(-1)),
        xp.sqrt(v[..., 2]) if v.shape[-1] == 3 else None,
        None if time is None else xp.sqrt(time),
    )


@double_precision
def crlb(plan: Plan, points: Float[Array, "points space"]) -> PointBounds:
    """Cramér-Rao lower bound on the position error at points.

    Parameters
    ----------
    plan
        What is measured. Its prior is not used: the position is a fixed unknown.
    points
        [points, space] in metres.

    Returns
    -------
    PointBounds
        Covariances, RMSE, CEP, quantiles, ellipses and dilutions of precision per point; points without a bound are
        marked with the reason.

    Raises
    ------
    RefusedError
        If a noise has no finite Fisher information, or there are fewer measurements than unknowns.
    InputError
        If the points are no list of positions.

    Notes
    -----
    Assumes estimators that are unbiased around each point. (5) to (8) of McGuire and Plataniotis; soft NLOS
    information through the noise of a mixture; NLOS links that carry none are left out (Qi and Kobayashi). The
    covariance can be differentiated by JAX, for example with respect to anchors.

    Examples
    --------
    Differences of arrival times, whichever the reference, and times of arrival with an unknown clock tell the same:

    >>> import locbounds as lb
    >>> square, there = [[0, 0], [100, 0], [100, 100], [0, 100]], np.array([[20.0, 70.0]])
    >>> [float(lb.crlb(lb.tdoa(square, 2.0, reference=r), there).rmse[0]) for r in (0, 2)]
    [2.1001126, 2.1001126]
    >>> float(lb.crlb(lb.toa(square, 2.0, clock_std_m=np.inf), there).rmse[0])
    2.1001126
    """
    if traced(plan, points):
        return _bounds(plan, jnp.asarray(points), None, None)
    points = _check(plan, points)
    verdict = method("crlb").verdict(plan)
    if verdict.status is Status.REFUSED:
        raise RefusedError(
            f"there is no Cramér-Rao bound: {'; '.join(verdict.reasons)}",
            "Weiss-Weinstein and Ziv-Zakai bounds (wwb, ezzb) apply, given a prior",
        )
    how = "whitened derivatives, Gram-Schmidt; deterministic"
    provenance = Provenance.now(0, 0, how, method("crlb").references)
    if len(points) <= CHUNK:
        return _bounds(plan, points, verdict, provenance)
    parts: list[PointBounds] = []
    for start in range(0, len(points), CHUNK):
        part = points[start : start + CHUNK]
        padded = np.concatenate([part, np.broadcast_to(part[-1:], (CHUNK - len(part), plan.dim))])
        found = _bounds(plan, padded, None, None)
        parts.append(jax.tree.map(lambda a: np.asarray(a) if np.ndim(a) else a, found))
    n = len(points)
    join = [np.concatenate([np.asarray(p) for p in column])[:n] for column in zip(*map(_arrays, parts), strict=True)]
    clock = join[2] if len(join) > 2 else None
    return PointBounds(points, join[0], join[1], clock, station_std(plan), verdict, provenance)


def _arrays(part: PointBounds) -> list[Any]:
    return [a for a in (part.covariance, part.status, part.clock_variance) if a is not None]


def _check(plan: Plan, points: Any) -> np.ndarray:
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != plan.dim:
        raise InputError(f"the points have shape {points.shape}", f"Give [points, {plan.dim}] coordinates in metres")
    if not np.all(np.isfinite(points)):
        bad = int(np.flatnonzero(~np.all(np.isfinite(points), axis=1))[0])
        raise InputError(f"point {bad} is {points[bad].tolist()}", "Give finite coordinates in metres")
    return points


def station_std(plan: Plan) -> float | None:
    """The deviation that all stations have in common, or None."""
    if len(set(plan.units)) > 1:
        return None
    stds = np.concatenate([np.asarray(group.station_stds) for group in plan.groups])
    return float(stds[0]) if np.ptp(stds) <= 1e-12 * stds[0] else None


def _bounds(plan: Plan, points: Array, verdict: Verdict | None, provenance: Provenance | None) -> PointBounds:
    root, floor, clock = _whitener(plan)
    covariance, status, clock_variance = _kernel(*plan._assembled, root, floor, clock, points)
    if plan.clock_std_m is None:
        clock_variance = None
    if traced(covariance):
        return PointBounds(points, covariance, status, clock_variance)
    return PointBounds(points, covariance, status, clock_variance, station_std(plan), verdict, provenance)


def _whitener(plan: Plan) -> tuple[Any, Any, Any]:
    """L^T of ``W = L L^T`` (its diagonal if there is nothing else), the rounding of its columns, the clock's column.

    Many channels whose noise shares one common part (differences to one reference) are taken as independent ones with
    an offset of that deviation in common, which is the same and costs as many operations as there are channels.
    """
    W = plan.accuracy_with_clock
    shared = None if traced(W) or plan.size < MANY else _shared_part(plan)
    if shared is not None:
        own, column, std = shared
        root = 1 / own
        floor = np.sqrt(np.sum(np.where(_cancelling(plan), root**2, 0.0)))
        return root, floor, (column * root, 1.0 / std)
    xp = jnp if traced(W) else np
    diagonal = not traced(W) and np.count_nonzero(W - np.diag(np.diagonal(W))) == 0
    root = xp.sqrt(xp.diagonal(W)) if diagonal else xp.linalg.cholesky(W).T
    floor = xp.sqrt(xp.sum(xp.where(_cancelling(plan), xp.diagonal(W), 0.0)))
    if plan.clock_std_m is None:
        return root, floor, None
    column = plan.clocked * root if diagonal else root @ plan.clocked.astype(float)
    return root, floor, (column, 1.0 / xp.asarray(plan.clock_std_m))


def _cancelling(plan: Plan) -> np.ndarray:
    return np.array([m.cancels for group in plan.groups for m in group.per_channel])


def _shared_part(plan: Plan) -> tuple[Any, Any, float] | None:
    """Own deviations [channels], who has the common part [channels], its deviation; None if there is no such form."""
    known = [(g, np.asarray(g.covariance)) for g in plan.groups if g.covariance is not None]
    correlated = [(g, C) for g, C in known if np.count_nonzero(C - np.diag(np.diagonal(C)))]
    if plan.clock_std_m is not None or len(correlated) != 1:
        return None
    group, C = correlated[0]
    common = float(C[0, 1])
    own = np.diagonal(C) - common
    if not common > 0 or np.any(own <= 1e-3 * common) or not np.allclose(C, np.diag(own) + common, rtol=1e-12, atol=0):
        return None
    variances = 1 / np.diagonal(plan.accuracy_with_clock)
    here = np.concatenate([np.full(g.size, g is group) for g in plan.groups])
    variances[here] = own
    return np.sqrt(variances), here.astype(float), np.sqrt(common)


@partial(jax.jit, static_argnums=1)
def _kernel(parts: list, counts: tuple[int, ...], order: Any, root: Any, floor: Any, clock: Any, points: Any) -> tuple:
    """Covariance [n, d, d], status [n], variance of the clock [n]; in blocks whose arrays stay in the cache."""
    one = partial(_block, parts, counts, order, root, floor, clock)
    n, block = len(points), max(BLOCK // len(order), 256)
    if n * len(order) <= LARGE:
        return one(points)
    padded = jnp.pad(jnp.asarray(points), ((0, -n % block), (0, 0)), mode="edge")
    found = jax.lax.map(one, padded.reshape(-1, block, padded.shape[1]))
    return jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[:n], found)


def _block(parts: list, counts: tuple[int, ...], order: Any, root: Any, floor: Any, clock: Any, points: Any) -> tuple:
    x = jnp.asarray(points).T  # columns [channels, n]: long axes last
    d = len(x)
    H = _slopes(parts, counts, order, x)
    G = [root[:, None] * h if root.ndim == 1 else root @ h for h in H]
    size = jnp.maximum(jnp.sqrt(_fold(jnp.maximum, jnp.stack([_fold(jnp.add, g**2) for g in G]))), floor)
    rows = jnp.zeros_like(x[:1])
    if clock is not None:  # what a prior on the clock adds is one more row
        column, known = clock
        G = [jnp.concatenate([column[:, None] + rows, known + rows])] + [jnp.concatenate([g, rows]) for g in G]
    R, ok = _gram_schmidt(G, size, first_free=clock is not None)
    C = _inverse_gram(R)
    k = len(G) - d
    near = [
        jax.vmap(lambda m: jax.vmap(lambda p: m.singular(p[None])[0], in_axes=1)(x), axis_size=n)(part)
        for part, n in zip(parts, counts, strict=True)
    ]
    at_anchor = _fold(jnp.minimum, jnp.concatenate(near)) <= AT_ANCHOR_M
    status = jnp.where(at_anchor | ~jnp.isfinite(size), 2, jnp.where(ok, 0, 1)).astype(jnp.int8)
    good = status == 0
    columns = [
        jnp.where(good, C[min(i, j)][max(i, j)], jnp.inf if i == j else 0.0)
        for i in range(k, k + d)
        for j in range(k, k + d)
    ]
    return jnp.stack(columns, -1).reshape(-1, d, d), status, jnp.where(good, C[0][0], jnp.inf)


def _slopes(parts: list, counts: tuple[int, ...], order: Any, x: Array) -> list[Array]:
    """Derivatives by coordinate, each [channels, n]."""

    def one(part: Any, k: int, p: Array) -> Array:
        return jax.vmap(lambda m: jnp.reshape(jax.jacfwd(m)(p), (-1, len(p))), axis_size=k)(part).reshape(-1, len(p))

    rows = [jax.vmap(partial(one, part, k), in_axes=1, out_axes=2)(x) for part, k in zip(parts, counts, strict=True)]
    H = jnp.concatenate(rows)[order]
    return [H[:, i] for i in range(len(x))]


def _gram_schmidt(G: list[Any], size: Array, first_free: bool) -> tuple[list[list[Array]], Array]:
    """Upper triangle R with ``R^T R = G^T G``, and whether every column has something of its own."""
    R: list[list[Array]] = [[jnp.zeros_like(size)] * len(G) for _ in G]
    ok = jnp.ones(size.shape, dtype=bool)
    for i in range(len(G)):
        square = _fold(jnp.add, G[i] ** 2)
        least = (SINGULAR * size) ** 2 if not (first_free and i == 0) else jnp.zeros_like(size)
        good = square > least
        ok = ok & good
        R[i][i] = jnp.where(good, jnp.sqrt(jnp.where(good, square, 1.0)), 1.0)
        q = G[i] / R[i][i]
        for j in range(i + 1, len(G)):
            R[i][j] = _fold(jnp.add, q * G[j])
            G = [*G[:j], G[j] - q * R[i][j], *G[j + 1 :]]
    return R, ok


def _fold(op: Any, rows: Array) -> Array:
    """Rows [k, n] combined into one, by halves: unlike a reduction over the first axis, loops over n are vectorised."""
    while len(rows) > 1:
        half = len(rows) // 2
        folded = op(rows[:half], rows[half : 2 * half])
        rows = folded if len(rows) == 2 * half else jnp.concatenate([folded, rows[-1:]])
    return rows[0]


def _inverse_gram(R: list[list[Any]]) -> dict[int, dict[int, Any]]:
    """Upper triangle of ``(R^T R)^-1 = S S^T`` with ``S = R^-1``, by back substitution."""
    n = len(R)
    S: list[list[Any]] = [[jnp.zeros_like(R[0][0])] * n for _ in range(n)]
    for j in range(n):
        S[j][j] = 1.0 / R[j][j]
        for i in range(j - 1, -1, -1):
            S[i][j] = -sum(R[i][k] * S[k][j] for k in range(i + 1, j + 1)) / R[i][i]
    return {i: {j: sum(S[i][k] * S[j][k] for k in range(j, n)) for j in range(i, n)} for i in range(n)}
