"""Algorithm 1 of Fritsche 2013 as printed, with normalised quantities: the slow reference."""

from functools import partial, reduce

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, Stream, block_key, check_seed
from locbounds.bounds.common import bound_result, prepare
from locbounds.bounds.expectation import Prior
from locbounds.bounds.precision_control import Estimate, check_rtol
from locbounds.bounds.score_covariance import noise_process
from locbounds.errors import InputError, RefusedError
from locbounds.precision import double_precision, traced
from locbounds.result import Result
from locbounds.scenario import Scenario, beyond_separation
from locbounds.simulation import draw_noise, draw_sight, draw_states

DRAWS = 16  # samples per group and block: scores of all horizons are kept for one block at a time
MAX_MODES = 1024


def _prior_information(scenario: Scenario, horizon: Array) -> Float[Array, "n n"]:
    """Eq. 7: information of the prior and of the motion up to the horizon about x_0..x_K, block tridiagonal."""
    n, K = scenario.motion.state_size, scenario.steps
    F, inverse_Q = scenario.transition, jnp.linalg.inv(scenario.process_noise)
    inverse_Q = jnp.where(jnp.arange(1, K + 1)[:, None, None] <= horizon, inverse_Q, 0.0)
    J = jnp.zeros((K + 1, n, K + 1, n)).at[0, :, 0, :].set(jnp.linalg.inv(jnp.asarray(scenario.prior.covariance)))
    now, later = np.arange(K), np.arange(1, K + 1)
    J = J.at[now, :, now, :].add(jnp.einsum("kji,kjl,klm->kim", F, inverse_Q, F))
    J = J.at[now, :, later, :].add(-jnp.einsum("kji,kjl->kil", F, inverse_Q))
    J = J.at[later, :, now, :].add(-jnp.einsum("kij,kjl->kil", inverse_Q, F))
    return J.at[later, :, later, :].add(inverse_Q).reshape((K + 1) * n, (K + 1) * n)


@partial(jax.jit, static_argnames="samples")
def _scores(scenario, seed, block, *, samples) -> Float[Array, "samples horizons steps state"]:
    """``grad log p(z_{1:k} | x_{0:k})`` for every horizon k = 1..K (rows n = 1..k, zero later), by the recursion."""
    tracks = block_key(seed, Stream.TRACKS, block)
    x = draw_states(tracks, scenario, samples)[:, 1:]
    links = [noise_process(scenario, link) for link in scenario.links]
    z = []
    for m, (link, process) in enumerate(zip(scenario.links, links, strict=True)):
        chain, noise = jax.random.split(jax.random.fold_in(block_key(seed, Stream.MEASUREMENTS, block), m))
        sight = draw_sight(chain, process.start, process.transitions, samples).T
        position = scenario.motion.position(x)
        z.append(jax.vmap(jax.vmap(link.measurement))(position) + draw_noise(noise, process.noises, sight))
    z = jnp.stack(z, -1)
    start = reduce(jnp.kron, [jnp.asarray(p.start) for p in links])
    transitions = reduce(jax.vmap(jnp.kron), [p.transitions for p in links])
    reports = jnp.stack([p.reports for p in links], -1)

    def log_density(x, z, reported):  # log p(z_k | x_k, r_k) for every joint mode r_k
        position = scenario.motion.position(x)
        total = jnp.zeros(1)
        for m, (link, process) in enumerate(zip(scenario.links, links, strict=True)):
            w = z[m] - link.measurement(position)
            each = jnp.where(reported[m], jnp.stack([law.log_prob(w) for law in process.noises]), 0.0)
            total = (total[:, None] + each[None, :]).ravel()
        return total

    def one(x, z):
        def step(carry, inputs):
            f, D = carry  # p(z_{1:k-1}, r_{k-1} | x) normalised; its gradient, same scale, [modes, steps, state]
            k, x, z, T, reported = inputs
            log_l = log_density(x, z, reported)
            gradient = jax.jacfwd(log_density)(x, z, reported)
            predicted = f @ T
            l = jnp.exp(log_l - jnp.max(jnp.where(predicted > 0, log_l, -jnp.inf)))
            l = jnp.where(predicted > 0, l, 0.0)  # a mode that cannot be has no say in the scale
            f = l * predicted
            D = l[:, None, None] * jnp.einsum("ij,inx->jnx", T, D)
            D = jnp.asarray(D).at[:, k].add(f[:, None] * gradient)
            total = f.sum()
            f, D = f / total, D / total
            return (f, D), D.sum(0)

        first = (jnp.asarray(start), jnp.zeros((len(start), *x.shape)))
        return jax.lax.scan(step, first, (jnp.arange(len(x)), x, z, transitions, reports))[1]

    return jax.vmap(one)(x, z)


@jax.jit
def _products(scores):
    return jnp.einsum("skix,skjy->kixjy", scores, scores) / len(scores)


@jax.jit
def _last_columns(scenario, J_z, horizon) -> Float[Array, "n state"]:
    """Columns of ``inv(J_{0:k})`` that belong to x_k; states after the horizon are decoupled by a unit diagonal."""
    n = scenario.motion.state_size
    size = n * (scenario.steps + 1)
    inside = jnp.arange(size) < (horizon + 1) * n
    J = jnp.asarray(_prior_information(scenario, horizon)).at[n:, n:].add(J_z.reshape(size - n, size - n))
    J = jnp.where(inside[:, None] & inside[None, :], J, jnp.eye(size))
    unit = jax.lax.dynamic_slice_in_dim(jnp.eye(size), horizon * n, n, axis=1)
    return jnp.linalg.solve(J, unit)


@double_precision
def bcrb_algorithm1(scenario: Scenario, *, samples: int = 2048, seed: int = 0) -> Result:
    """BCRB by Algorithm 1 of Fritsche 2013 as printed, made stable: the reference for :func:`locbounds.bcrb`.

    The joint chain of all links is enumerated (2^links modes), the whole state's score is propagated, its products
    are averaged, the full information matrix is inverted at every horizon. The printed products of densities
    underflow near step 35; here they are normalised, which leaves the same numbers. Cost: samples x modes x steps^2,
    and a (steps x state)-square inverse per step.

    Parameters
    ----------
    scenario
        With an invertible process noise and prior covariance.
    samples
        Number of draws, rounded up to whole blocks of 512.
    seed
        Seed of the random numbers; the draws differ from those of :func:`locbounds.bcrb`.

    Returns
    -------
    Result
        As :func:`locbounds.bcrb`. The inverse of an estimated matrix is biased upwards by about
        ``MSE * tr(J^-1 J_z) / samples``; the standard error does not include this.

    Raises
    ------
    RefusedError
        If the process noise or the prior is singular, or the joint chain has more than 1,024 modes.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> reference, bound = lb.bcrb_algorithm1(scenario), lb.bcrb(scenario)
    >>> error = np.hypot(reference.mean_position_rmse_stderr(), bound.mean_position_rmse_stderr())
    >>> bool(abs(reference.mean_position_rmse() - bound.mean_position_rmse()) < 4 * error)
    True
    """
    if traced(scenario):
        raise InputError("Algorithm 1 cannot be transformed by JAX", "Use locbounds.bcrb, which can")
    check_rtol(None, samples)
    why = beyond_separation(scenario)
    if why is not None:
        raise RefusedError(f"{why}, which Algorithm 1 as printed does not know", "Use locbounds.bcrb")
    expectation, verdict = prepare("bcrb", scenario, Prior())
    scenario = scenario.anonymous()
    seed_key = np.uint32(check_seed(seed))
    modes = int(np.prod([len(link.noises) for link in scenario.links]))
    if modes > MAX_MODES:
        raise RefusedError(
            f"Algorithm 1 would enumerate {modes} joint modes", "Use locbounds.bcrb, which adds links up"
        )
    matrices = [np.asarray(scenario.prior.covariance), *np.asarray(scenario.process_noise)]
    if any(np.linalg.matrix_rank(a, hermitian=True) < len(a) for a in matrices):
        raise RefusedError(
            "Algorithm 1 needs an invertible prior covariance and process noise",
            "Use locbounds.bcrb, whose covariance form needs neither",
        )
    blocks = -(-samples // (GROUPS * DRAWS))
    count = GROUPS * DRAWS

    def scores(block: int) -> Array:
        return _scores(scenario, seed_key, np.uint32(block), samples=count)

    J_z = jnp.stack([_products(scores(b)) for b in range(blocks)]).mean(0)
    columns = jnp.stack([_last_columns(scenario, J_z[k - 1], k) for k in range(1, scenario.steps + 1)])
    n = scenario.motion.state_size
    K = scenario.steps
    index = np.array(scenario.motion.position_index)
    V = columns.reshape(K, K + 1, n, n)[:, 1:][..., index]  # [horizons, steps, state, space]
    replicates = jnp.zeros((GROUPS, K))
    for b in range(blocks):  # d tr = -tr(V' dJ V): a second pass projects every sample's score on V
        projected = jnp.einsum("skix,kixa->ska", scores(b), V)
        replicates -= jnp.sum(projected**2, -1).reshape(GROUPS, DRAWS, K).mean(1) / blocks
    replicates = replicates - replicates.mean(0)
    k = np.arange(1, K + 1)
    covariance = columns.reshape(K, K + 1, n, n)[np.arange(K), k]
    covariance = jnp.concatenate([jnp.asarray(scenario.prior.covariance)[None], covariance])
    estimate = Estimate(
        covariance,
        covariance[:, index, index].sum(-1),
        jnp.concatenate([jnp.zeros((GROUPS, 1)), replicates], axis=1),
    )
    how = "Algorithm 1 as printed, normalised"
    return bound_result("bcrb", scenario, estimate, verdict, expectation, seed, blocks * count, how, {})
