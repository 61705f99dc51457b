"""Bounds for known sight, averaged over sight schedules (Enumer-BCRB), with or without the NLOS ranges.

Given the sight of every link the noises are independent over time, the information of the ranges is block diagonal,
and the bound obeys the covariance recursion ``P <- F P F' + Q``, ``P <- P (I + J_k P)^-1``.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, Stream, block_key, check_seed
from locbounds.bounds.common import bound_result, prepare
from locbounds.bounds.expectation import Expectation, directions
from locbounds.bounds.precision_control import MAX_BLOCKS, Estimate, Progress, check_rtol, refine, relative_error
from locbounds.bounds.score_covariance import mode_information, noise_process
from locbounds.linalg import small_inverse, symmetrize
from locbounds.precision import double_precision, traced
from locbounds.quadrature import deviations
from locbounds.result import Result
from locbounds.scenario import Scenario
from locbounds.simulation import draw_sight, likelihood_ratios

SCHEDULES = 64  # sight schedules per group and block
TRACKS = 64  # tracks per group and block


def conditional_recursion(
    scenario: Scenario, information: Float[Array, "steps space space"]
) -> Float[Array, "times state state"]:
    """Bound at every step when the measurement of step k adds this information about the position at step k.

    Tichavský 1998 for linear Gaussian motion, in covariance form: Q and the prior may be singular.
    """
    index = np.array(scenario.motion.position_index)
    eye = jnp.eye(len(index))

    def step(P, inputs):
        F, Q, J = inputs
        P = F @ P @ F.T + Q
        cross = P[:, index]
        P = symmetrize(P - cross @ (small_inverse(eye + J @ cross[index]) @ J) @ cross.T)
        return P, P

    P0 = jnp.asarray(scenario.prior.covariance)
    _, later = jax.lax.scan(step, P0, (scenario.transition, scenario.process_noise, information))
    return jnp.concatenate([P0[None], later])


@partial(jax.jit, static_argnames="groups")
def _geometry(scenario, expectation, seed, block, *, groups) -> Float[Array, "groups links steps space space"]:
    paths = groups * TRACKS if expectation.random else 1
    u = directions(scenario, expectation, block_key(seed, Stream.TRACKS, block), paths)
    u = u.reshape(u.shape[0], groups if expectation.random else 1, -1, *u.shape[2:])
    return jnp.einsum("lgnka,lgnkb->glkab", u, u) / u.shape[2]


@partial(jax.jit, static_argnames=("groups", "los_ranges_only"))
def _schedules(
    scenario, seed, block, *, groups, los_ranges_only
) -> tuple[Float[Array, "groups schedules links steps"], Float[Array, "groups schedules steps"]]:
    """Information of every range about its own distance, for random sight schedules, and their weights in the mean.

    The weights are equal; their derivatives make those of the mean right, as drawing a schedule has none.
    """
    rows, ratios = [], 1.0
    for m, link in enumerate(scenario.links):
        process = noise_process(scenario, link)
        key = jax.random.fold_in(block_key(seed, Stream.SCHEDULES, block), m)
        sight = draw_sight(key, process.start, process.transitions, groups * SCHEDULES)
        ratios = ratios * likelihood_ratios(sight, process.start, process.transitions)
        sight = sight.T
        info = mode_information(process)
        info = info * (jnp.arange(len(info)) == 0) if los_ranges_only else info
        rows.append((info[sight] * process.reports).reshape(groups, SCHEDULES, -1))
    ratios = ratios.T.reshape(groups, SCHEDULES, -1)
    return jnp.stack(rows, 2), ratios / ratios.sum(1, keepdims=True)


@jax.jit
def _block(scenario, info, weights, G, G_mean):
    """Group means over schedules of the covariance, the position mse, and the mse's change with the geometry."""
    index = np.array(scenario.motion.position_index)

    def one(info, change):  # one schedule; the change of its mse with the geometry, by a directional derivative
        def mse(G):
            P = conditional_recursion(scenario, jnp.einsum("lk,lkab->kab", info, G))
            return P[:, index, index].sum(-1), P

        (value, tangent, P) = jax.jvp(mse, (G_mean,), (change,), has_aux=True)
        return P, value, tangent

    G = jnp.broadcast_to(G, (info.shape[0], *G.shape[1:]))
    P, mse, change = jax.vmap(jax.vmap(one, (0, None)), (0, 0))(info, G - G_mean)
    with_prior = jnp.concatenate([weights[..., :1], weights], -1)  # step 0 is the same for every schedule
    P = jnp.einsum("gsk,gskij->kij", with_prior, P) / len(P)
    return P, jnp.sum(with_prior * mse, 1), jnp.sum(with_prior * change, 1)


def _average_over_schedules(id, scenario, rtol, samples, seed, expectation, progress, conditions=()) -> Result:
    """The common part of enumer and los-only, which differ in the information of NLOS ranges and in the verdict."""
    expectation, verdict = prepare(id, scenario, expectation, conditions)
    target = check_rtol(rtol, samples, traced(scenario, expectation))
    seed_key = np.uint32(check_seed(seed))
    blocks = None if samples is None else -(-samples // (GROUPS * SCHEDULES))

    def geometry(count: int) -> Array:
        tables = [_geometry(scenario, expectation, seed_key, np.uint32(b), groups=GROUPS) for b in range(count)]
        return sum(tables[1:], start=tables[0]) / count

    def draw(block: int, G: Array):
        b, los_ranges_only = np.uint32(block), id == "los-only"
        info, weights = _schedules(scenario, seed_key, b, groups=GROUPS, los_ranges_only=los_ranges_only)
        return _block(scenario, info, weights, G, G.mean(0))

    def estimate_from(tables) -> Estimate:
        P, mse, change = tables
        mean, spread = deviations(mse)
        return Estimate(P, mean, spread + change)

    tracks = blocks or 1  # blocks of tracks: doubled until the geometry leaves half of the error to the schedules
    G = geometry(tracks)
    while blocks is None and expectation.random and tracks < MAX_BLOCKS and not traced(scenario):
        P, mse, change = draw(0, G)
        if relative_error(Estimate(P, mse.mean(0), change)) <= target / 2:
            break
        tracks *= 2
        G = geometry(tracks)
    estimate, done = refine(
        lambda block: draw(block, G),
        estimate_from,
        rtol=target,
        blocks=blocks or (1 if traced(scenario, expectation) else None),
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
        A fixed number of sight sequences instead of a precision (rounded up to whole blocks of 2048).

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
    condition = "estimators that discard NLOS ranges, or an NLOS excess about which nothing is known"
    return _average_over_schedules("los-only", scenario, rtol, samples, seed, expectation, progress, (condition,))
