"""Bounds for known sight, averaged over sight schedules (Enumer-BCRB), with or without the NLOS ranges.

Given the sight of every link the noises are independent over time, the information of the ranges is block diagonal,
and the bound obeys the covariance recursion ``P <- F P F' + Q``, ``P <- P (I + J_k P)^-1``.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, Stream, block_key, check_seed
from locbounds.bounds.common import bound_result, prepare
from locbounds.bounds.expectation import Expectation, directions
from locbounds.bounds.precision_control import MAX_BLOCKS, Estimate, Progress, check_rtol, refine, relative_error
from locbounds.bounds.score_covariance import mode_information, noise_process
from locbounds.linalg import small_inverse
from locbounds.precision import double_precision, traced
from locbounds.quadrature import deviations
from locbounds.result import Result
from locbounds.scenario import Scenario
from locbounds.simulation import equal_weights, likelihood_ratios, sight_from_uniforms

SCHEDULES = 32  # sight schedules per group and block
SCHEDULES_FOR_GEOMETRY = 4  # per group: enough for how the bound changes with the geometry
TRACKS = 16  # tracks per group and block


def conditional_recursion(
    scenario: Scenario,
    information: Float[Array, "steps space space *batch"],
    summary: Callable[[Array], Array] = lambda P: P,
) -> Float[Array, "times ..."]:
    """Bound at every step when the measurement of step k adds this information about the position at step k.

    Tichavský 1998 for linear Gaussian motion, in covariance form: Q and the prior may be singular. Schedules are the
    last axes, so that the small products run over thousands of them at once; ``summary`` is what is kept of
    ``P [state, state, *batch]`` at every step.
    """
    index = np.array(scenario.motion.position_index)
    state, batch = scenario.motion.state_size, information.shape[3:]

    def alone(a):  # shared by all schedules
        return jnp.asarray(a).reshape(*a.shape, *(1 for _ in batch))

    def product(a, b):
        return jnp.sum(a[:, :, None] * b[None], 1)

    def step(P, inputs):
        F, Q, J = inputs
        P = (F @ P.reshape(state, -1)).reshape(P.shape)
        P = product(P, alone(F.T)) + alone(Q)
        cross = P[:, index]
        A = alone(np.eye(len(index))) + product(J, cross[index])
        inverse = jnp.moveaxis(small_inverse(jnp.moveaxis(A, (0, 1), (-2, -1))), (-2, -1), (0, 1))
        P = P - product(product(cross, product(inverse, J)), jnp.swapaxes(cross, 0, 1))
        P = 0.5 * (P + jnp.swapaxes(P, 0, 1))
        return P, summary(P)

    P0 = jnp.broadcast_to(alone(scenario.prior.covariance), (state, state, *batch))
    _, later = jax.lax.scan(step, P0, (scenario.transition, scenario.process_noise, information))
    return jnp.concatenate([summary(P0)[None], later])


@partial(jax.jit, static_argnames="groups")
def _geometry(scenario, expectation, seed, block, *, groups) -> Float[Array, "groups links steps space space"]:
    paths = groups * TRACKS if expectation.random else 1
    u = directions(scenario, expectation, block_key(seed, Stream.TRACKS, block), paths)
    u = u.reshape(u.shape[0], groups if expectation.random else 1, -1, *u.shape[2:])
    return jnp.einsum("lgnka,lgnkb->glkab", u, u) / u.shape[2]


class _Schedules(NamedTuple):
    """Information of every range about its own distance, for random sight schedules, and their weights in the mean.

    The weights are equal (None: without their derivatives, which make those of the mean right: a draw has none).
    """

    information: Float[Array, "groups schedules links steps"]
    weights: Float[Array, "steps groups schedules"] | None


@partial(jax.jit, static_argnames=("groups", "los_ranges_only", "differentiable"))
def _schedules(scenario, seed, block, *, groups, los_ranges_only, differentiable) -> _Schedules:
    """Random sight schedules in antithetic pairs."""
    rows, ratios = [], 1.0
    for m, link in enumerate(scenario.links):
        process = noise_process(scenario, link)
        key = jax.random.fold_in(block_key(seed, Stream.SCHEDULES, block), m)
        u = jax.random.uniform(key, (len(process.transitions) + 1, groups * SCHEDULES // 2))
        sight = sight_from_uniforms(process.start, process.transitions, jnp.stack([u, 1 - u], -1).reshape(len(u), -1))
        if differentiable:
            ratios = ratios * likelihood_ratios(sight, process.start, process.transitions)
        info = mode_information(process)
        info = info * (jnp.arange(len(info)) == 0) if los_ranges_only else info
        rows.append((info[sight.T] * process.reports).reshape(groups, SCHEDULES, -1))
    return _Schedules(jnp.stack(rows, 2), equal_weights(jnp.asarray(ratios), groups) if differentiable else None)


@jax.jit
def _group_means(scenario, schedules, G) -> Float[Array, "groups times state state"]:
    """Group means over schedules of the bound for a known schedule."""
    J = jnp.einsum("gslk,lkab->kabgs", schedules.information, G)
    if schedules.weights is None:
        P = conditional_recursion(scenario, J, lambda P: P.mean(-1))
    else:
        weights = jnp.concatenate([schedules.weights[:1], schedules.weights])  # step 0: the same for every schedule
        P = jnp.einsum("kgs,kijgs->kijg", weights, conditional_recursion(scenario, J))
    return jnp.moveaxis(P, -1, 0)


@jax.jit
def _geometry_deviations(scenario, info, G) -> Float[Array, "groups times"]:
    """Each group's deviation of the position mse that is due to its tracks, to first order, over these schedules."""
    index = np.array(scenario.motion.position_index)
    mean = G.mean(0)
    changes = jnp.broadcast_to(G, (info.shape[0], *G.shape[1:])) - mean

    def position_mse(J):
        return conditional_recursion(scenario, J, lambda P: P[index, index].sum(0).mean(-1))

    J = jnp.einsum("gslk,lkab->kabgs", info, mean), jnp.einsum("gslk,glkab->kabgs", info, changes)
    change = jax.jvp(position_mse, J[:1], J[1:])[1]
    return deviations(change.T)[1]  # every group has its own schedules: their changes cancel up to sampling only


@jax.jit
def _estimate(scenario, group_means, from_tracks) -> Estimate:
    """The mean over groups; the deviations of schedules and tracks, which are drawn independently, add."""
    index = np.array(scenario.motion.position_index)
    P, spread = deviations(group_means)
    return Estimate(P, P[:, index, index].sum(-1), spread[:, :, index, index].sum(-1) + from_tracks)


def _average_over_schedules(id, scenario, rtol, samples, seed, expectation, progress) -> Result:
    """The common part of enumer and los-only, which differ in the information of NLOS ranges and in the verdict."""
    expectation, verdict = prepare(id, scenario, expectation)
    scenario = scenario.anonymous()
    differentiable = traced(scenario, expectation)
    target = check_rtol(rtol, samples, differentiable)
    seed_key = np.uint32(check_seed(seed))
    blocks = None if samples is None else -(-samples // (GROUPS * SCHEDULES))

    def geometry(count: int) -> Array:
        tables = [_geometry(scenario, expectation, seed_key, np.uint32(b), groups=GROUPS) for b in range(count)]
        return sum(tables[1:], start=tables[0]) / count

    def schedules(block: int) -> _Schedules:
        return _schedules(
            scenario,
            seed_key,
            np.uint32(block),
            groups=GROUPS,
            los_ranges_only=id == "los-only",
            differentiable=differentiable,
        )

    first = schedules(0)
    few = _Schedules(first.information[:, :SCHEDULES_FOR_GEOMETRY], None)
    tracks = blocks or 1  # blocks of tracks: doubled until they cause at most half of the permitted error
    while True:
        G = geometry(tracks)
        from_tracks = _geometry_deviations(scenario, few.information, G)
        if blocks is not None or not expectation.random or differentiable or tracks >= MAX_BLOCKS:
            break
        estimate = _estimate(scenario, _group_means(scenario, few, G.mean(0)), from_tracks)
        if relative_error(estimate._replace(replicates=from_tracks)) <= target / 2:
            break
        tracks *= 2
    G_mean = G.mean(0)
    estimate, done = refine(
        lambda block: _group_means(scenario, schedules(block) if block else first, G_mean),
        lambda group_means: _estimate(scenario, group_means, from_tracks),
        rtol=target,
        blocks=blocks or (1 if differentiable else None),
        samples_per_block=GROUPS * SCHEDULES,
        progress=progress,
    )
    how = "covariance recursion for every sight schedule, then the mean"
    return bound_result(
        id, scenario, estimate, verdict, expectation, seed, done * GROUPS * SCHEDULES, how, diagnostics={}
    )


@double_precision
def enumer(
    scenario: Scenario,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    expectation: Expectation | None = None,
    progress: Progress | None = None,
) -> Result:
    """Enumer-BCRB: the bound for known sight, averaged over sight sequences drawn from the chains.

    Parameters
    ----------
    scenario, rtol, seed, expectation, progress
        As for :func:`locbounds.bcrb`.
    samples
        A fixed number of sight sequences instead of a precision (rounded up to whole blocks of 1024).

    Returns
    -------
    Result
        ``covariance`` [steps+1, state, state]: a bound on the mean square error matrix of every estimator that sees
        the ranges, even if it is told the sight.

    Notes
    -----
    Hernandez 2005; Fritsche 2013, section V. The mean is taken over sequences of the inverse information.

    Examples
    --------
    >>> import locbounds as lb
    >>> bound = lb.enumer(lb.papers.fritsche2013.scenario(stay=0.9), seed=0)
    >>> bool(abs(bound.mean_position_rmse() - 49.5) < 0.3)
    True
    """
    return _average_over_schedules("enumer", scenario, rtol, samples, seed, expectation, progress)


@double_precision
def los_only(
    scenario: Scenario,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    expectation: Expectation | None = None,
    progress: Progress | None = None,
) -> Result:
    """The Enumer-BCRB without the NLOS ranges: for estimators that know the sight and throw NLOS ranges away.

    Parameters
    ----------
    scenario, rtol, samples, seed, expectation, progress
        As for :func:`locbounds.enumer`.

    Returns
    -------
    Result
        Valid only under the condition that NLOS ranges are discarded, or that their excess is unknown and arbitrary
        (Qi and Kobayashi's case), and labelled so.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(stay=0.9)
    >>> bool(lb.los_only(scenario).mean_position_rmse() > lb.enumer(scenario).mean_position_rmse())
    True
    """
    return _average_over_schedules("los-only", scenario, rtol, samples, seed, expectation, progress)
