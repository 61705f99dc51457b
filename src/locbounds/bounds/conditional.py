"""Bounds for known sight, averaged over sight schedules (Enumer-BCRB), with or without the NLOS ranges.

Given the sight of every link the noises are independent over time, the information of the ranges is block diagonal,
and the bound obeys the covariance recursion ``P <- F P F' + Q``, ``P <- P (I + J_k P)^-1``.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, Stream, block_key, check_seed
from locbounds.bounds.ahead import predicted
from locbounds.bounds.common import bound_result, further_information, prepare
from locbounds.bounds.expectation import Expectation, directions
from locbounds.bounds.precision_control import MAX_BLOCKS, Estimate, Progress, check_rtol, refine, relative_error
from locbounds.bounds.recursion import linear_model
from locbounds.bounds.score_covariance import mode_information, noise_process
from locbounds.horizon import PREDICT, SMOOTH, Horizon
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
    *,
    smoothing: bool = False,
    extra: Float[Array, "times state state"] | None = None,
) -> Float[Array, "times ..."]:
    """Bound at every step when the measurement of step k adds this information about the position at step k.

    Tichavský 1998 for linear Gaussian motion, in covariance form: Q and the prior may be singular. Schedules are the
    last axes, so that the small products run over thousands of them at once; ``summary`` is what is kept of
    ``P [state, state, *batch]`` at every step. ``smoothing``: with the information of later steps too, by the adjoint
    recursion of :mod:`locbounds.bounds.backward`; ``extra``: information about the state at steps 0..K that all
    schedules share.
    """
    index = np.array(scenario.motion.position_index)
    state, batch = scenario.motion.state_size, information.shape[3:]

    def alone(a):  # shared by all schedules
        return jnp.asarray(a).reshape(*a.shape, *(1 for _ in batch))

    P0 = jnp.broadcast_to(alone(scenario.prior.covariance), (state, state, *batch))
    if extra is not None:  # about the whole state, as the ranges' information then is
        everywhere = np.arange(state)
        P0 = _updated(P0, _gain(P0, alone(extra[0]), everywhere), everywhere)
        at_state = jnp.zeros((len(information), state, state, *batch))
        information = at_state.at[:, index[:, None], index].set(information) + jnp.expand_dims(
            extra[1:], tuple(range(3, 3 + len(batch)))
        )
        index = everywhere

    def step(P, inputs) -> Any:
        F, Q, J = inputs
        P = (F @ P.reshape(state, -1)).reshape(P.shape)
        P = _product(P, alone(F.T)) + alone(Q)
        A = _gain(P, J, index)
        after = _updated(P, A, index)
        return after, (P, A, after) if smoothing else summary(after)

    steps = scenario.transition, scenario.process_noise, information
    _, later = jax.lax.scan(step, P0, steps)
    if not smoothing:
        return jnp.concatenate([summary(P0)[None], later])

    def back(L, inputs):
        F, P, A, after = inputs
        smoothed = after - _product(_product(after, L), after)
        M = alone(np.eye(state)) - _placed(_product(P[:, index], A), index, state)
        L = _product(_product(_transposed(M), L), M)
        L = jnp.asarray(L).at[index[:, None], index].add(A)
        return _product(_product(alone(F.T), L), alone(F)), summary(smoothed)

    L, of_steps = jax.lax.scan(back, jnp.zeros_like(P0), (steps[0], *later), reverse=True)
    return jnp.concatenate([summary(P0 - _product(_product(P0, L), P0))[None], of_steps])


def _product(a: Array, b: Array) -> Array:
    """Matrix products with the batch as last axes."""
    return jnp.sum(a[:, :, None] * b[None], 1)


def _transposed(a: Array) -> Array:
    return jnp.swapaxes(a, 0, 1)


def _placed(columns: Array, index: np.ndarray, state: int) -> Array:
    return jnp.zeros((len(columns), state, *columns.shape[2:])).at[:, index].set(columns)


def _gain(P: Array, J: Array, index: np.ndarray) -> Array:
    """``(I + J P_pp)^-1 J``."""
    A = _product(J, P[index][:, index])
    A = A + jnp.eye(len(index)).reshape(len(index), len(index), *(1 for _ in A.shape[2:]))
    return _product(jnp.moveaxis(small_inverse(jnp.moveaxis(A, (0, 1), (-2, -1))), (-2, -1), (0, 1)), J)


def _updated(P: Array, gain: Array, index: np.ndarray) -> Array:
    cross = P[:, index]
    P = P - _product(_product(cross, gain), _transposed(cross))
    return 0.5 * (P + _transposed(P))


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


@partial(jax.jit, static_argnames="horizon")
def _group_means(scenario, schedules, G, extra, *, horizon) -> Float[Array, "groups times state state"]:
    """Group means over schedules of the bound for a known schedule."""
    J = jnp.einsum("gslk,lkab->kabgs", schedules.information, G)
    options = {"smoothing": horizon.kind == SMOOTH, "extra": extra}
    if schedules.weights is None:
        P = conditional_recursion(scenario, J, lambda P: P.mean(-1), **options)
    else:
        weights = jnp.concatenate([schedules.weights[:1], schedules.weights])  # step 0: the same for every schedule
        weights = weights[-1:].repeat(len(weights), 0) if horizon.kind == SMOOTH else weights
        P = jnp.einsum("kgs,kijgs->kijg", weights, conditional_recursion(scenario, J, **options))
    return jax.vmap(partial(_moved, scenario, horizon))(jnp.moveaxis(P, -1, 0))


def _moved(scenario, horizon, P) -> Float[Array, "times state state"]:
    """Filtering bounds as they are, or moved on to the step that is predicted."""
    return predicted(linear_model(scenario), P, horizon.ahead) if horizon.kind == PREDICT else P


@partial(jax.jit, static_argnames="horizon")
def _geometry_deviations(scenario, info, G, extra, *, horizon) -> Float[Array, "groups times"]:
    """Each group's deviation of the position mse that is due to its tracks, to first order, over these schedules."""
    index = np.array(scenario.motion.position_index)
    mean = G.mean(0)
    changes = jnp.broadcast_to(G, (info.shape[0], *G.shape[1:])) - mean
    options = {"smoothing": horizon.kind == SMOOTH, "extra": extra}

    def position_mse(J):
        P = conditional_recursion(scenario, J, lambda P: P.mean(-1), **options)
        P = jax.vmap(partial(_moved, scenario, horizon), -1, -1)(P)
        return P[:, index, index].sum(1)

    J = jnp.einsum("gslk,lkab->kabgs", info, mean), jnp.einsum("gslk,glkab->kabgs", info, changes)
    change = jax.jvp(position_mse, J[:1], J[1:])[1]
    return deviations(change.T)[1]  # every group has its own schedules: their changes cancel up to sampling only


@jax.jit
def _estimate(scenario, group_means, from_tracks) -> Estimate:
    """The mean over groups; the deviations of schedules and tracks, which are drawn independently, add."""
    index = np.array(scenario.motion.position_index)
    P, spread = deviations(group_means)
    return Estimate(P, P[:, index, index].sum(-1), spread[:, :, index, index].sum(-1) + from_tracks)


def _average_over_schedules(id, scenario, rtol, samples, seed, expectation, horizon, extra, progress) -> Result:
    """The common part of enumer and los-only, which differ in the information of NLOS ranges and in the verdict."""
    expectation, verdict = prepare(id, scenario, expectation)
    horizon, extra = Horizon.parse(horizon, scenario.steps), further_information(scenario, extra)
    scenario = scenario.anonymous()
    differentiable = traced(scenario, expectation)
    target = check_rtol(rtol, samples, differentiable)
    seed_key = np.uint32(check_seed(seed))
    blocks = None if samples is None else -(-samples // (GROUPS * SCHEDULES))
    group_means = partial(_group_means, extra=extra, horizon=horizon)

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
        from_tracks = _geometry_deviations(scenario, few.information, G, extra, horizon=horizon)
        if blocks is not None or not expectation.random or differentiable or tracks >= MAX_BLOCKS:
            break
        estimate = _estimate(scenario, group_means(scenario, few, G.mean(0)), from_tracks)
        if relative_error(estimate._replace(replicates=from_tracks)) <= target / 2:
            break
        tracks *= 2
    G_mean = G.mean(0)
    estimate, done = refine(
        lambda block: group_means(scenario, schedules(block) if block else first, G_mean),
        lambda means: _estimate(scenario, means, from_tracks),
        rtol=target,
        blocks=blocks or (1 if differentiable else None),
        samples_per_block=GROUPS * SCHEDULES,
        progress=progress,
    )
    how = "covariance recursion for every sight schedule, then the mean"
    used = done * GROUPS * SCHEDULES
    return bound_result(id, scenario, estimate, verdict, expectation, seed, used, how, {}, horizon)


@double_precision
def enumer(
    scenario: Scenario,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    expectation: Expectation | None = None,
    horizon: str | Horizon = "filter",
    extra: Float[Array, "times state state"] | None = None,
    progress: Progress | None = None,
) -> Result:
    """Enumer-BCRB: the bound for known sight, averaged over sight sequences drawn from the chains.

    Parameters
    ----------
    scenario, rtol, seed, expectation, horizon, extra, progress
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
    return _average_over_schedules("enumer", scenario, rtol, samples, seed, expectation, horizon, extra, progress)


@double_precision
def los_only(
    scenario: Scenario,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    expectation: Expectation | None = None,
    horizon: str | Horizon = "filter",
    extra: Float[Array, "times state state"] | None = None,
    progress: Progress | None = None,
) -> Result:
    """The Enumer-BCRB without the NLOS ranges: for estimators that know the sight and throw NLOS ranges away.

    Parameters
    ----------
    scenario, rtol, samples, seed, expectation, horizon, extra, progress
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
    return _average_over_schedules("los-only", scenario, rtol, samples, seed, expectation, horizon, extra, progress)
