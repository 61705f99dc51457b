"""A plan as bounds of its prior see it: how well pairs of places are told apart, and the prior's support."""

from __future__ import annotations

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.priors import GaussianPrior, PositionPrior, UniformBox, UniformDisc, UniformPolygon
from locbounds.static import support as supports
from locbounds.static.overlap import polygon_overlap, shared_nodes
from locbounds.static.pair_laws import GaussianPairs, PairLaw, Tabulated
from locbounds.static.support import REACH, Support

BLOCK = 4096  # places evaluated at once: one compilation per plan


def means(plan: Plan, points: Float[ndarray, "n space"]) -> Float[ndarray, "n channels"]:
    """Noise-free values, in blocks of one size."""
    return _in_blocks(plan.means, points)


def _in_blocks(function, *points: ndarray) -> ndarray:
    n = len(points[0])
    if n == 0:
        return np.asarray(function(*(np.zeros((1, p.shape[1])) for p in points)))[:0]
    out = []
    for start in range(0, n, BLOCK):
        part = [p[start : start + BLOCK] for p in points]
        short = BLOCK - len(part[0])
        if short:
            part = [np.concatenate([p, np.broadcast_to(p[-1:], (short, p.shape[1]))]) for p in part]
        out.append(np.asarray(function(*part))[: BLOCK - short])
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


def support_of(prior: PositionPrior, marks: ndarray | None = None) -> Support:
    """Density and overlaps of a prior; ``marks`` are the anchors, at which integrands are rough."""
    marks = supports.NO_MARKS if marks is None or not len(marks) else np.asarray(marks, float)
    if isinstance(prior, UniformDisc):
        return supports.disc(prior.center, float(prior.radius), marks)
    if isinstance(prior, UniformBox):
        return supports.box(prior.low, prior.high, marks if prior.dim == marks.shape[1] else supports.NO_MARKS)
    if isinstance(prior, GaussianPrior):
        return supports.gaussian(prior.mean, prior.covariance)
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
    low, high = prior.bounds()
    whole = bool(np.all(prior.inside(np.stack([low - 100 * (high - low), high + 100 * (high - low)]))))

    def reach(a: ndarray) -> float:
        if not whole:
            return float(np.abs(a) @ (high - low))
        return float(np.abs(a) @ (high - low)) + REACH * float(np.sqrt(a @ covariance @ a))

    return Support(
        prior.dim,
        prior.log_density,
        lambda shifts, n, rough=None: shared_nodes(*prior.nodes(3 * n), prior.log_density, shifts),
        reach,
        False,
        whole,
        covariance,
    )
