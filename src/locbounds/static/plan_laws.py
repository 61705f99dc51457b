"""A plan as bounds of its prior see it: how well pairs of places are told apart, and the prior's support."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from locbounds.axes import Array, Float, ndarray
from locbounds.errors import InputError
from locbounds.plan import Plan
from locbounds.priors import GaussianPrior, PositionPrior, PriorMixture, Prism, UniformBox, UniformDisc, UniformPolygon
from locbounds.static import support as supports
from locbounds.static.overlap import polygon_overlap, shared_nodes
from locbounds.static.pair_laws import GaussianPairs, PairLaw, Tabulated
from locbounds.static.support import REACH, Support

BLOCKS = (4096, 32_768)  # places evaluated at once: two compilations per plan


def means(plan: Plan, points: Float[ndarray, "n space"]) -> Float[ndarray, "n channels"]:
    """Noise-free values, in blocks of two sizes."""
    return _in_blocks(plan.means, points)


def _in_blocks(function, *points: ndarray) -> ndarray:
    n = len(points[0])
    if n == 0:
        return np.asarray(function(*(np.zeros((1, p.shape[1])) for p in points)))[:0]
    out, block = [], BLOCKS[0] if n <= 4 * BLOCKS[0] else BLOCKS[1]
    for start in range(0, n, block):
        part = [p[start : start + block] for p in points]
        short = block - len(part[0])
        if short:
            part = [np.concatenate([p, np.broadcast_to(p[-1:], (short, p.shape[1]))]) for p in part]
        out.append(np.asarray(function(*part))[: block - short])
    return np.concatenate(out)


def pair_law(plan: Plan) -> PairLaw:
    """How well the plan's measurements tell two places apart."""
    gaussian, periodic = np.asarray(plan.gaussian), np.asarray(plan.periodic)
    plain = all(group.covariance is not None or _all_gaussian(group) for group in plan.groups)
    if plain and np.all(gaussian | periodic):
        whitener = np.zeros((plan.size, plan.size))
        mine = np.ix_(gaussian, gaussian)
        values, vectors = np.linalg.eigh(np.asarray(plan.precision))
        whitener[mine] = (vectors * np.sqrt(np.maximum(values, 0.0))).T
        wide = ~gaussian
        stds = np.asarray(plan.stds)
        whitener[wide, wide] = 1 / stds[wide]
        period = np.where(periodic, 2 * np.pi, np.inf)
        if _independent(plan, periodic):
            return GaussianPairs(lambda points: means(plan, points), whitener, period, stds)
    return Tabulated(
        lambda a, b: _in_blocks(plan.log_bhattacharyya, a, b), lambda a, b: _in_blocks(plan.minimum_error, a, b)
    )


def _all_gaussian(group) -> bool:
    from locbounds.noise import Gaussian

    return group.noises is not None and all(type(n) is Gaussian for n in group.noises)


def _independent(plan: Plan, channels: ndarray) -> bool:
    """Whether these channels' noise is independent of that of all others."""
    start = 0
    for group in plan.groups:
        here = np.arange(start, start + group.size)
        start += group.size
        if group.covariance is not None:
            C = np.asarray(group.covariance)
            mine = channels[here]
            if np.any((C - np.diag(np.diagonal(C)))[mine] != 0):
                return False
    return True


def needs_prior(plan: Plan, name: str) -> PositionPrior:
    """The plan's prior, or an InputError."""
    if plan.prior is None:
        raise InputError(
            f"{name} averages over positions, and the plan has no prior",
            "Give one, for example plan.replace(prior=lb.UniformDisc([0, 0], 15))",
        )
    return plan.prior


def _log_density(prior: PositionPrior) -> Callable[[ndarray], ndarray]:
    """A density that is asked for very often, as plain NumPy where it is Gaussian or a mixture."""
    if isinstance(prior, GaussianPrior):
        return supports.gaussian(np.asarray(prior.mean), np.asarray(prior.covariance)).log_density
    if isinstance(prior, PriorMixture):
        weights, parts = np.log(np.asarray(prior.weights)), [_log_density(part) for part in prior.parts]
        return lambda points: np.logaddexp.reduce([w + part(points) for w, part in zip(weights, parts, strict=True)])
    return lambda points: np.asarray(prior.log_density(points))


def support_of(prior: PositionPrior, marks: Array | None = None) -> Support:
    """Density and overlaps of a prior; ``marks`` are the anchors, at which integrands are rough."""
    marks = supports.NO_MARKS if marks is None or not len(marks) else np.asarray(marks, float)
    if isinstance(prior, UniformDisc):
        return supports.disc(np.asarray(prior.center), float(prior.radius), marks)
    if isinstance(prior, UniformBox):
        return supports.box(
            np.asarray(prior.low), np.asarray(prior.high), marks if prior.dim == marks.shape[1] else supports.NO_MARKS
        )
    if isinstance(prior, GaussianPrior):
        return supports.gaussian(np.asarray(prior.mean), np.asarray(prior.covariance))
    covariance = np.asarray(prior.covariance)
    if isinstance(prior, UniformPolygon):
        level = -np.log(prior.area)
        return Support(
            2,
            lambda points: np.full(len(points), level),
            lambda shifts, n, rough=None: polygon_overlap(prior.shape, shifts, n),
            lambda a: float(np.ptp(prior.corners @ a)),
            True,
            False,
            covariance,
        )

    if isinstance(prior, Prism):
        low, high = float(prior.low), float(prior.high)
        between = marks[(marks[:, 2] >= low) & (marks[:, 2] <= high)] if marks.shape[1] == 3 else supports.NO_MARKS
        return supports.prism(support_of(prior.base, between[:, :2]), low, high)

    log_density = _log_density(prior)

    @functools.cache
    def nodes(n: int) -> tuple[ndarray, ndarray]:
        points, weights = prior.nodes(n)
        return np.asarray(points), np.asarray(weights)

    low, high = (np.asarray(x) for x in prior.bounds())
    whole = bool(np.all(prior.inside(np.stack([low - 100 * (high - low), high + 100 * (high - low)]))))

    def reach(a: ndarray) -> float:
        if not whole:
            return float(np.abs(a) @ (high - low))
        return float(np.abs(a) @ (high - low)) + REACH * float(np.sqrt(a @ covariance @ a))

    return Support(
        prior.dim,
        log_density,
        lambda shifts, n, rough=None: shared_nodes(*nodes(3 * n), log_density, shifts),
        reach,
        False,
        whole,
        covariance,
    )
