r"""The least mean square error: the posterior mean, by quadrature.

Positions and measurements are drawn from the plan by randomised quasi-Monte Carlo. For each draw the posterior over the
nodes of a quadrature of the prior gives its mean and variance; the mean of the posterior variances is the least mean
square error, with less noise than that of the squared errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from locbounds.axes import Bool, Float, ndarray
from locbounds.blocks import check_seed
from locbounds.errors import InputError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.result import Result
from locbounds.static.common import check_clock, check_rtol, not_refined, static_result, verdict_of
from locbounds.static.draws import places, sobol
from locbounds.static.likelihood import SMALL, Likelihood, likelihood
from locbounds.static.plan_laws import needs_prior

REPLICATES = 16
RUNS = 128  # per replicate at first
MOST_RUNS = 2048
TRIAL = 256  # draws on which the nodes are chosen
NODES, MOST_NODES = 16, 420  # along a line
MOST_WITH_LIMITS = 1500  # where noise has limits, so that few nodes are possible for a draw, but those must be fine
MOST_PLACES = 2**21  # nodes altogether: in three dimensions the memory ends first
TABLE = 2**22  # numbers in one table of likelihoods
FACE = 24  # draws that share the nodes which matter to any of them


class Drawn(NamedTuple):
    """Draws of positions and measurements.

    Attributes
    ----------
    places : array [draws, space]
    measured : tuple
        In the form of :meth:`Likelihood.features`.
    """

    places: Float[ndarray, "draws space"]
    measured: tuple[ndarray, ndarray]


class Posterior(NamedTuple):
    """Moments of the posterior of each draw, and its most likely node.

    Attributes
    ----------
    mean : array [draws, space]
    covariance : array [draws, space, space]
    likeliest : array [draws, space]
    missed : array [draws]
        Draws for which no node is possible (noise with limits): their moments are those of the few nodes that miss the
        limits least, so that the covariance is too small.
    """

    mean: Float[ndarray, "draws space"]
    covariance: Float[ndarray, "draws space space"]
    likeliest: Float[ndarray, "draws space"]
    missed: Bool[ndarray, " draws"]


def draw(plan: Plan, law: Likelihood, runs: int, replicates: int, seed: int) -> Drawn:
    """``replicates`` independent sets of ``runs`` draws."""
    prior = needs_prior(plan, "an average over positions")
    u = sobol(runs, replicates, plan.dim + law.dims, seed).reshape(-1, plan.dim + law.dims)
    at = places(prior, u[:, : plan.dim])
    return Drawn(at, law.draw(at, u[:, plan.dim :]))


class Nodes(NamedTuple):
    """Quadrature of the prior with the measurements there."""

    points: Float[ndarray, "n space"]
    log_weights: Float[ndarray, " n"]
    features: tuple[ndarray, ndarray]

    def only(self, which: ndarray) -> Nodes:
        """Some of the nodes."""
        white, other = self.features
        return Nodes(self.points[which], self.log_weights[which], (white[which], other[which]))


def nodes_of(plan: Plan, law: Likelihood, n: int) -> Nodes:
    """Of n nodes along a line."""
    points, weights = map(np.asarray, needs_prior(plan, "an average over positions").nodes(n))
    keep = weights > 0
    points, weights = points[keep], weights[keep]
    return Nodes(points, np.log(weights), law.features(points))


def posterior(law: Likelihood, nodes: Nodes, drawn: Drawn) -> Posterior:
    """Posterior of every draw; draws that are close together share the nodes that matter to them.

    Where no node is possible (noise with limits), the posterior is even over the nodes that miss the limits least.
    """
    order = _neighbours_together(drawn.places)
    count, space = drawn.places.shape
    mean, likeliest = np.empty((2, count, space))
    covariance = np.empty((count, space, space))
    missed = np.zeros(count, bool)
    limits = noise_limits(law)
    for part, at in _blocks(law, limits, nodes, drawn, order):
        z = (drawn.measured[0][part], drawn.measured[1][part])
        log = law.log(z, at.features)
        likeliest[part] = at.points[log.argmax(1)]
        log += at.log_weights
        top = log.max(1, keepdims=True)
        missed[part] = ~np.isfinite(top[:, 0])
        weight = np.exp(np.where(np.isfinite(top), log - np.where(np.isfinite(top), top, 0.0), 0.0))
        weight /= weight.sum(1, keepdims=True)
        middle = at.points.mean(0)
        x = at.points - middle
        mean[part] = weight @ x
        square = weight @ (x[:, :, None] * x[:, None, :]).reshape(len(x), -1)
        covariance[part] = square.reshape(-1, space, space) - mean[part][:, :, None] * mean[part][:, None, :]
        mean[part] += middle
        for one in part[missed[part]]:
            points = nodes.points[_least_missed(limits, nodes, drawn.measured[1][one], 2**space)]
            mean[one], likeliest[one] = points.mean(0), points[0]
            covariance[one] = np.cov(points.T, bias=True).reshape(space, space)
    return Posterior(mean, covariance, likeliest, missed)


def _neighbours_together(points: ndarray) -> ndarray:
    """Order along a Morton curve: consecutive draws are close together."""
    low, size = points.min(0), np.ptp(points, axis=0).max() + 1e-12
    cell = np.floor((points - low) / size * 2**10 * (1 - 1e-9)).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(10):
        for axis in range(points.shape[1]):
            code |= ((cell[:, axis] >> bit) & 1) << (bit * points.shape[1] + axis)
    return np.argsort(code, kind="stable")


def _blocks(
    law: Likelihood, limits: ndarray, nodes: Nodes, drawn: Drawn, order: ndarray
) -> Iterator[tuple[ndarray, Nodes]]:
    """Draws that share nodes, few enough for one table of likelihoods, with the nodes that matter to them."""
    shared = np.any(np.isfinite(limits)) or law.angles is not None
    step = FACE if shared else int(np.clip(TABLE // len(nodes.points), 1, FACE))
    for start in range(0, len(order), step):
        part = order[start : start + step]
        z = (drawn.measured[0][part], drawn.measured[1][part])
        near = _possible(limits, nodes, z[1])
        if near is None:
            near = _relevant(law, nodes, z)
        at = nodes if near is None else nodes.only(near)
        few = max(1, TABLE // len(at.points))
        for first in range(0, len(part), few):
            yield part[first : first + few], at


def noise_limits(law: Likelihood) -> Float[ndarray, "channels 2"]:
    """Least and largest noise of the channels outside the Gaussian part, infinite where there is none.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.static.likelihood import likelihood
    >>> stations = [[0, 15], [-13, -7.5], [13, -7.5]]
    >>> noises = [lb.Gaussian(0, 1), lb.Uniform(-1, 2), lb.Exponential(3.0)]
    >>> noise_limits(likelihood(lb.toa(stations, noises))).tolist()
    [[-1.0, 2.0], [0.0, inf]]
    """
    out = np.tile([-np.inf, np.inf], (len(law.noises), 1))
    for k, (_, noise, periodic) in enumerate(law.noises):
        if periodic:
            continue
        places = np.asarray(double_precision(lambda noise=noise: noise.landmarks())())
        ends, beyond = places[[0, -1]], np.ptp(places) * np.array([-1e-3, -1.0])
        for side, sign in enumerate((1, -1)):
            if np.all(np.isneginf(np.asarray(double_precision(noise.log_prob)(ends[side] + sign * beyond)))):
                out[k, side] = ends[side]
    return out


def _possible(limits: ndarray, nodes: Nodes, z: ndarray) -> ndarray | None:
    """Nodes that are possible for any of the draws; None if nothing is gained, or none is."""
    keep = None
    for k, (low, high) in enumerate(limits):
        if np.isinf(low) and np.isinf(high):
            continue
        slack = 1e-3 * (high - low) if np.isfinite(high - low) else 1e-3 * np.ptp(z[:, k]) + 1e-6
        here = nodes.features[1][:, k] if keep is None else nodes.features[1][keep, k]
        good = (here >= z[:, k].min() - high - slack) & (here <= z[:, k].max() - low + slack)
        keep = np.flatnonzero(good) if keep is None else keep[good]
    return None if keep is None or not len(keep) else keep


def _least_missed(limits: ndarray, nodes: Nodes, z: ndarray, count: int) -> ndarray:
    """The nodes from which the measurements of a draw are least outside the limits of the noise, the best one first."""
    gap = z - nodes.features[1]
    outside = np.maximum(limits[:, 0] - gap, gap - limits[:, 1]).max(1, initial=0.0)
    few = np.argpartition(outside, min(count, len(outside)) - 1)[:count]
    return few[np.argsort(outside[few])]


def _relevant(law: Likelihood, nodes: Nodes, z: tuple[ndarray, ...]) -> ndarray | None:
    """Nodes whose likelihood counts for any of the draws: those near them in the space of the measurements.

    With c one of the draws and r the largest distance of another from it, a node at a distance of more than
    ``r + sqrt(b^2 + 2 * SMALL)`` from c is less likely than one at a distance b from a draw by e^SMALL. Distances are
    in deviations; those of narrow angles on the circle.
    """
    width = law.angles
    if width is None:
        return None
    first = tuple(m[len(m) // 2] for m in z)
    spread = np.sqrt(_squares(z, first, width).max())
    square = _squares(nodes.features, first, width)
    best = np.sqrt(square.min()) + spread
    near = square <= (spread + np.sqrt(best**2 + 2 * SMALL)) ** 2
    return None if near.mean() > 0.7 else np.flatnonzero(near)


def _squares(one: tuple[ndarray, ...], other: tuple[ndarray, ...], width: ndarray) -> ndarray:
    """Squared distances of measurements from one of them."""
    total = np.square(one[0] - other[0]).sum(1)
    if len(width):
        gap = one[1] - other[1]
        total = total + np.square((gap - 2 * np.pi * np.round(gap / (2 * np.pi))) / width).sum(1)
    return total


def choose_nodes(plan: Plan, law: Likelihood, drawn: Drawn, rtol: float) -> tuple[Nodes, float]:
    """Nodes so fine that the least RMSE over some draws no longer changes, and how much it changed at last."""
    some = _some(drawn, TRIAL)
    n, before = NODES, None
    most = MOST_WITH_LIMITS if np.any(np.isfinite(noise_limits(law))) else MOST_NODES
    while True:
        nodes = nodes_of(plan, law, n)
        value = float(np.sqrt(np.trace(posterior(law, nodes, some).covariance, axis1=1, axis2=2).mean()))
        if before is not None:
            change = abs(value / before - 1) if before > 0 else np.inf
            if change <= rtol:
                return nodes, change
            if n >= most or len(nodes.points) * 1.5**plan.dim > MOST_PLACES:
                return nodes, change
        n, before = n + n // 2 - (n // 2) % 2, value


def _some(drawn: Drawn, count: int) -> Drawn:
    pick = np.linspace(0, len(drawn.places) - 1, min(count, len(drawn.places))).astype(int)
    return Drawn(drawn.places[pick], (drawn.measured[0][pick], drawn.measured[1][pick]))


class Reached(NamedTuple):
    """Mean square errors over draws.

    Attributes
    ----------
    matrix : array [space, space]
        m^2.
    replicates : array [replicates]
        Deviations of the replicates' traces from the mean.
    """

    matrix: Float[ndarray, "space space"]
    replicates: Float[ndarray, " replicates"]

    @property
    def relative_error(self) -> float:
        """Relative standard error of the root mean square error."""
        g = len(self.replicates)
        return float(np.sqrt(np.sum(self.replicates**2) / (g * (g - 1))) / (2 * np.trace(self.matrix)))


def over_replicates(matrices: Float[ndarray, "draws space space"], replicates: int) -> Reached:
    """Average of the mean square error matrices of draws."""
    each = matrices.reshape(replicates, -1, *matrices.shape[1:]).mean(1)
    mean = each.mean(0)
    return Reached(mean, np.trace(each, axis1=1, axis2=2) - np.trace(mean))


@double_precision
def mmse(plan: Plan, *, rtol: float = 2e-3, draws: int | None = None, seed: int = 0) -> Result:
    """The least mean square error of the position that any estimator can have, averaged over the prior.

    Parameters
    ----------
    plan
        With a prior.
    rtol
        Largest relative standard error of the RMSE; draws are added until it is reached. The nodes of the posterior are
        refined until the RMSE changes by less than half of it.
    draws
        A fixed number of draws instead (rounded up to 16 replicates of a power of two).
    seed
        Of all draws.

    Returns
    -------
    Result
        ``covariance[0]`` is the mean posterior covariance; ``diagnostics`` hold ``nodes``, ``draws``,
        ``quadrature_error`` (the last relative change when the nodes were refined) and ``missed`` (draws that no node
        explains: the verdict then warns that the error is too small).

    Notes
    -----
    The posterior mean is the best estimator (the chapter's reference in Figs. 3 to 6); every valid bound is below its
    error. The standard error comes from 16 independently scrambled Sobol sets.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> least = lb.mmse(plan, rtol=0.01)
    >>> bool(lb.ezzb(plan).position_mse < least.position_mse), least.relative_stderr() < 0.01
    (True, True)
    """
    needs_prior(plan, "an average over positions")
    check_clock(plan)
    verdict, rtol = verdict_of("mmse", plan), check_rtol(rtol)
    law, seed = likelihood(plan), check_seed(seed)
    nodes = None
    change, runs = 0.0, RUNS if draws is None else power(draws)
    while True:
        drawn = draw(plan, law, runs, REPLICATES, seed)
        if nodes is None:
            nodes, change = choose_nodes(plan, law, drawn, rtol / 2)
        each = posterior(law, nodes, drawn)
        found = over_replicates(each.covariance, REPLICATES)
        if draws is not None or found.relative_error <= rtol or runs >= MOST_RUNS:
            break
        runs = int(min(MOST_RUNS, 2 ** np.ceil(np.log2(runs * max(2.0, (found.relative_error / rtol) ** 2)))))
    if found.relative_error > rtol and draws is None:
        verdict = verdict._replace(warnings=(*verdict.warnings, f"relative standard error {found.relative_error:.1%}"))
    verdict, missed = not_refined(verdict, change, rtol), int(each.missed.sum())
    if missed:
        text = (
            f"no node is possible for {missed:,} of {runs * REPLICATES:,} draws: their part of the error is too small"
        )
        verdict = verdict._replace(warnings=(*verdict.warnings, text))
    how = f"posterior variance over {len(nodes.points):,} places, {REPLICATES} scrambled Sobol sets"
    diagnostics = {"nodes": len(nodes.points), "draws": runs * REPLICATES, "quadrature_error": change, "missed": missed}
    return static_result(
        "mmse", found.matrix, verdict, how, replicates=found.replicates, seed=seed, samples=runs * REPLICATES,
        diagnostics=diagnostics,
    )  # fmt: skip


def power(draws: int) -> int:
    """Draws of each replicate: the next power of two.

    >>> power(1000)
    64
    """
    if draws < 2 * REPLICATES:
        raise InputError(f"{draws} draws", f"Give at least {2 * REPLICATES}")
    return int(2 ** np.ceil(np.log2(draws / REPLICATES)))
