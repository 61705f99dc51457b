"""The general engine: any jump-Markov model, the same precision control as the separated one."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, check_seed
from locbounds.bounds.backward import bound_recursion
from locbounds.bounds.common import bound_result
from locbounds.bounds.expectation import Expectation, Prior
from locbounds.bounds.general.frame import Frame, Tables, beyond_reference, frame, linear_model, placed
from locbounds.bounds.general.increments import information_increments
from locbounds.bounds.general.parts import Part
from locbounds.bounds.precision_control import Estimate, Progress, check_rtol, refine
from locbounds.bounds.recursion import GivenIncrements, LinearModel
from locbounds.bounds.truncation import extrapolated, judged, shortened
from locbounds.errors import InputError, RefusedError
from locbounds.horizon import FILTER, PREDICT, Horizon
from locbounds.model import AdditiveChannel, DensityMotion, JumpMarkov
from locbounds.paths import draw_paths
from locbounds.priors import DensityPrior
from locbounds.result import Result
from locbounds.verdict import Status, Verdict

PATHS = 64  # per group and block
FIRST_WINDOW = 12
FEWEST_GROUPS = 16
TABLE_BYTES = 2.5e8
SCORE_SIGMAS = 6.0  # mean scores further from zero than this: density and sampler do not belong together


@eqx.filter_jit
def _prior_information(prior: DensityPrior, x0: Array, groups: int) -> Float[Array, "groups state state"]:
    g = jax.vmap(jax.grad(lambda x: jnp.reshape(prior.log_density(x), ())))(x0)
    g = g.reshape(groups, -1, g.shape[-1])
    return jnp.einsum("gna,gnb->gab", g, g) / g.shape[1]


def _tables(model: JumpMarkov, what: Frame, seed: np.uint32, block: int, groups: int, window: int) -> Tables:
    """One block of draws."""
    paths = draw_paths(model, seed, np.uint32(block), groups * PATHS)
    total, scores, z = jnp.zeros(()), [], _by_part(model, what.parts, paths.z)
    for part, z_part, exact in zip(what.parts, z, what.exact, strict=True):
        out = information_increments(part, paths.x, z_part, jnp.asarray(exact), groups=groups, window=window)
        total = total + placed(out.information, part, what, window)
        scores.append(out.score.sum(1))
    prior = jnp.zeros((groups, model.state_size, model.state_size))
    if isinstance(model.prior, DensityPrior):
        prior = _prior_information(model.prior, paths.x[0], groups)
    return Tables(total, prior, tuple(scores))


def _by_part(model: JumpMarkov, parts: list[Part], z: tuple[Array, ...]) -> list[tuple[Array, ...]]:
    """Every part's measurements: parts come in the order of their chains, channels in the model's order."""
    by_chain = {}
    for channel, z_c in zip(model.channels, z, strict=True):
        by_chain.setdefault(channel.chain, []).append(z_c)
    chains = sorted(by_chain)
    return [tuple(by_chain[chains.pop(0)]) if part.channels else () for part in parts]


@eqx.filter_jit
def _recursion(
    linear: LinearModel, mean: Array, changes: Array, extra: Array | None, horizon: Horizon
) -> tuple[Array, Array]:
    return bound_recursion(linear, GivenIncrements(mean, changes), horizon, extra)


class _Solution(NamedTuple):
    """The bound, and its first-order changes with windows that are shorter by a quarter and by a half."""

    estimate: Estimate
    shorter: Float[Array, "2 times"]


def _solve(
    model: JumpMarkov,
    what: Frame,
    linear: LinearModel,
    tables: Tables,
    window: int,
    horizon: Horizon,
    extra: Array | None,
) -> _Solution:
    """The bound from the means of all groups, and each group's change of it (delta method)."""
    beyond = beyond_reference(model, what, linear, tables)
    mean = beyond.mean(0)
    cuts = []
    for kept in shortened(window):
        kept = np.pad(kept, (mean.shape[1] - window, 0), constant_values=True)  # with lag 1 the newest two ages are one
        cuts.append(mean * (kept[:, None, None, None] & kept[:, None]))
    P, changes = _recursion(linear, mean, jnp.concatenate([beyond, jnp.stack(cuts)]) - mean, extra, horizon)
    deviations, shorter = changes[:-2], changes[-2:]
    index = np.array(model.position_index)
    if isinstance(model.prior, DensityPrior) and horizon.kind == FILTER:
        P0 = jnp.linalg.inv(tables.prior.mean(0) + (0.0 if extra is None else extra[0]))
        change = -jnp.einsum("ab,gbc,cd->gad", P0, tables.prior - tables.prior.mean(0), P0)
        P = jnp.asarray(P).at[0].set(P0)
        deviations = jnp.asarray(deviations).at[:, 0].set(change[:, index, index].sum(-1))
    return _Solution(Estimate(P, P[:, index, index].sum(-1), deviations), shorter)


def general(
    id: str,
    model: JumpMarkov,
    why: str,
    rtol: float | None,
    samples: int | None,
    seed: int,
    expectation: Expectation | None,
    window: int | None,
    progress: Progress | None,
    verdict: Verdict,
    horizon: Horizon,
    extra: Array | None,
) -> Result:
    """The bound of a jump-Markov model by the general engine; arguments as for :func:`locbounds.bcrb`."""
    expectation = Prior() if expectation is None else expectation
    _check_predictable(model, horizon)
    if not isinstance(expectation, Prior):
        raise InputError(
            f"the general engine ({why}) averages over the model's own tracks, not along {expectation.label}",
            "Leave expectation out",
        )
    rtol_target = check_rtol(rtol, samples)
    if window is not None and (int(window) != window or window < 1):
        raise InputError(f"the window is {window}", "Give a whole number of steps, at least 1")
    seed_key = np.uint32(check_seed(seed))
    what = frame(model)
    size = min(FIRST_WINDOW if window is None else int(window), model.steps)
    while True:
        width = what.ages(size) * len(what.components)
        groups = GROUPS if 8 * GROUPS * model.steps * width**2 <= TABLE_BYTES else FEWEST_GROUPS

        def draw(block: int, groups: int = groups, size: int = size) -> Tables:
            return _tables(model, what, seed_key, block, groups, size)

        first_block = draw(0)
        _check_finite(first_block)
        linear = linear_model(model, what, first_block)
        solution = _solve(model, what, linear, first_block, size, horizon, extra)
        truncation = 0.0 if size == model.steps else np.nan
        if window is None and size < model.steps:
            truncation = extrapolated(solution.shorter, solution.estimate.position_mse, size, model.steps)
            if truncation > rtol_target / 10:
                size = min(2 * size, model.steps)
                continue
        break
    last = [first_block]

    def evaluate(tables: Tables) -> Estimate:
        last[:] = [tables]
        return _solve(model, what, linear, tables, size, horizon, extra).estimate

    estimate, done = refine(
        draw,
        evaluate,
        rtol=rtol_target,
        blocks=None if samples is None else -(-samples // (groups * PATHS)),
        samples_per_block=groups * PATHS,
        progress=progress,
        first=(first_block, solution.estimate),
    )
    strange = _mean_scores(last[0])
    diagnostics = {
        "truncation": np.float64(truncation),
        "window": np.int64(size),
        "largest_mean_score": np.float64(strange),
    }
    how = f"general engine, because {why}; Fisher's and Louis' identities, window of {size} steps"
    verdict = judged(_judged(verdict, model, strange), truncation, size, model.steps)
    used = done * groups * PATHS
    return bound_result(id, model, estimate, verdict, expectation, seed, used, how, diagnostics, horizon)


def _check_predictable(model: JumpMarkov, horizon: Horizon) -> None:
    """A RefusedError where a filtering bound does not simply move on with the motion."""
    if horizon.kind != PREDICT:
        return
    nonlinear = isinstance(model.motion, DensityMotion)
    if model.switching or nonlinear or isinstance(model.prior, DensityPrior):
        what = "switches" if model.switching else "is a density" if nonlinear else "starts from a density"
        raise RefusedError(
            f"the motion {what}: a prediction bound does not follow from the filtering bound",
            "Give the model no reports after some step; the filtering bounds of later steps predict from there",
        )


def _check_finite(tables: Tables) -> None:
    if not all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(tables)):
        raise RefusedError(
            "a log-density or its gradient is not finite at draws of the model's own samplers",
            "Check that densities and samplers belong together and that the density is smooth where it is positive",
        )


def _mean_scores(tables: Tables) -> float:
    """Largest mean score over the parts, in standard errors: a t statistic where all densities fit their samplers."""
    worst = 0.0
    for score in tables.scores:
        mean, spread = score.mean(0), score.std(0, ddof=1) / np.sqrt(len(score))
        worst = max(worst, float(jnp.max(jnp.where(spread > 0, jnp.abs(mean) / jnp.where(spread > 0, spread, 1.0), 0))))
    return worst


def _judged(verdict: Verdict, model: JumpMarkov, strange: float) -> Verdict:
    """The verdict with what the draws say about densities that the user wrote."""
    if strange <= SCORE_SIGMAS or verdict.status is Status.REFUSED:
        return verdict
    exact = all(isinstance(channel, AdditiveChannel) for channel in model.channels)
    what = "noise" if exact else "density"
    return verdict._replace(
        warnings=(
            *verdict.warnings,
            f"scores average to {strange:.1f} standard errors away from zero: a sampler draws from another law than "
            f"its {what}, or a density jumps where it ends; then this is no bound",
        )
    )
