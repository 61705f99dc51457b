"""Bayesian Cramér-Rao bounds of jump-Markov and known-sight models, with noise and geometry separated."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, check_seed
from locbounds.bounds.backward import bound_recursion
from locbounds.bounds.bcrb_of_plan import bcrb_of_plan
from locbounds.bounds.common import bound_result, further_information, prepare
from locbounds.bounds.corrected import corrected
from locbounds.bounds.expectation import Expectation
from locbounds.bounds.general import general
from locbounds.bounds.precision_control import Estimate, Progress, check_rtol, refine
from locbounds.bounds.score_covariance import NoiseProcess, noise_process, score_covariance_increments
from locbounds.bounds.separated import SeparatedIncrements, geometry
from locbounds.bounds.truncation import extrapolated, judged, shortened
from locbounds.errors import InputError, RefusedError
from locbounds.horizon import Horizon
from locbounds.model import JumpMarkov, jump_markov
from locbounds.plan import Plan
from locbounds.precision import double_precision, traced
from locbounds.registry import method
from locbounds.result import Result
from locbounds.scenario import Scenario, beyond_separation
from locbounds.sight import KnownSight
from locbounds.verdict import Status

PATHS = 64  # noise paths per group and block
FIRST_WINDOW = 12
FEWEST_GROUPS = 16  # kept even for large tables: fewer say too little about a standard error
MOST_BYTES = 1e9  # tables and draws above this size are not kept: the corrected engine needs none
TABLE_BYTES = 2.5e8  # above this size of one link's increments, fewer groups are kept


def _same(a: NoiseProcess, b: NoiseProcess) -> bool:
    leaves_a, tree_a = jax.tree.flatten(a)
    leaves_b, tree_b = jax.tree.flatten(b)
    return tree_a == tree_b and all(np.array_equal(x, y) for x, y in zip(leaves_a, leaves_b, strict=True))


def _distinct(processes: list[NoiseProcess]) -> list[int]:
    """For every process the index of the first equal one, so that equal links share their draws' work."""
    if traced(processes):
        return list(range(len(processes)))
    first: list[int] = []
    for i, process in enumerate(processes):
        first.append(next((j for j in first if _same(processes[j], process)), i))
    return first


class _Solution(NamedTuple):
    """The bound from tables of score covariances and geometry, and its first-order changes."""

    estimate: Estimate
    shorter: Float[Array, "2 times"]


@partial(jax.jit, static_argnames="horizon")
def _solve(scenario, C, G, extra, *, horizon) -> _Solution:
    """The bound from the means of all groups, and how its position mean square error changes to first order.

    That is, with each group's own tables in place of the means (delta method), and with windows that are shorter by a
    quarter and by a half.
    """
    index = np.array(scenario.motion.position_index)
    mean = C.mean(0), G.mean(0)
    cuts = [kept[:, None] & kept for kept in shortened(C.shape[-1])]
    every_C = jnp.concatenate([C, mean[0] * np.stack(cuts)[:, None, None]])
    every_G = G if len(G) == 1 else jnp.concatenate([G, mean[1][None], mean[1][None]])
    P, changes = bound_recursion(scenario, SeparatedIncrements(*mean, (every_C, every_G)), horizon, extra)
    return _Solution(Estimate(P, P[:, index, index].sum(-1), changes[:-2]), changes[-2:])


@double_precision
def bcrb(
    scenario: Scenario | JumpMarkov | Plan,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    expectation: Expectation | None = None,
    window: int | None = None,
    engine: str | None = None,
    horizon: str | Horizon = "filter",
    extra: Float[Array, "times state state"] | None = None,
    progress: Progress | None = None,
) -> Result:
    r"""Bayesian Cramér-Rao bound of a jump-Markov model, at every step; or of a plan, one number.

    The engine is chosen by what the model needs; ``provenance.how`` names it and the reason. The general engine
    (:mod:`locbounds.bounds.general`) takes every :class:`~locbounds.JumpMarkov` and every scenario whose motion
    switches, whose measurements depend on the sight or whose links share a chain. All others separate: the information
    of the ranges is separated into the covariance of the noise score, a property of each link's noise
    process (see :mod:`locbounds.bounds.score_covariance`), and the expected products of range gradients. Modes are
    never enumerated; links with equal noise processes share their noise draws.

    Parameters
    ----------
    scenario
        The model. Noises of different links are independent, and so are chains that are not named as one. For a
        :class:`~locbounds.Plan` the inverse of the expected information of measurements and prior, by quadrature; it is
        refused where the prior jumps at an edge or the expected information is infinite.
    rtol
        Largest relative standard error of the position RMSE over the steps; draws are added until it is reached.
        Default 1e-3.
    samples
        A fixed number of noise paths instead (rounded up to whole blocks of 2048).
    seed
        Seed of the random numbers.
    expectation
        Where range gradients are taken: ``Prior()`` (default, the Bayesian bound) or ``AlongTrack(positions)``.
    window
        How many steps back a measurement's information correlates with that of others; by default it grows until
        the truncation, as estimated below, is at most ``rtol / 10`` (``rtol`` 1e-3 where none is given).
    engine
        ``"windowed"`` or ``"corrected"``, for models that separate. The windowed engine keeps tables of all steps, its
        number is that of the truncated information. The corrected engine (:mod:`locbounds.bounds.corrected`) keeps
        none and takes all lags, whatever the window. By default the windowed one, and the corrected one where tables
        or draws of all steps would take more than a gigabyte.
    horizon
        Which measurements an estimator of x_k sees: ``"filter"`` z_1..z_k, ``"predict:N"`` z_1..z_{k-N} (the prior
        alone for k < N), ``"smooth"`` z_1..z_K. See docs/theory/recursions.md.
    extra
        Information about the state at steps 0..K from further measurements, independent of all others given the
        state: ``H' R^-1 H`` for ``H x + noise`` of covariance R, zero at steps without. A bound with it holds for
        estimators that see these too.
    progress
        Called with (samples, precision reached, target) after every look.

    Returns
    -------
    Result
        ``covariance`` [steps+1, state, state] is the bound on the mean square error matrix of any estimator of x_k
        that sees what the horizon says. ``diagnostics["truncation"]`` is the relative error of the position RMSE, at
        the worst step, made by truncating at the window, as extrapolated from how the bound changes when the window is
        shortened by a quarter and by a half. It exceeds the error where the entries left out decay quickly; it is no
        guarantee, and the error may have either sign. NaN where the window was given and is shorter than the record:
        the verdict is then conditional on it. From the corrected engine it is
        the distance between the truncated and the corrected value, and ``diagnostics["remainder"]``, its square, the
        order of what the corrected value, which lies below the bound up to its standard error, still lacks.

    Raises
    ------
    RefusedError
        If an assumption is violated (see ``locbounds explain bcrb``; functions of one's own are searched for jumps and
        for slopes without a finite mean square), or the engine has no such horizon.
    InputError
        If an option makes no sense, or the horizon lies beyond the record.

    Notes
    -----
    Fritsche 2013, eqs. 2 to 9, with Louis' identity in place of products of scores.

    JAX transforms it (``jit``, ``vmap``, ``grad``) with respect to any number of the scenario, with a fixed number of
    draws: ``samples``, by default one block, and ``window``, by default 12 steps. Derivatives with respect to the
    chains carry the likelihood ratio of the drawn sights and are much noisier than all others.

    Examples
    --------
    >>> import locbounds as lb
    >>> bound = lb.bcrb(lb.papers.fritsche2013.scenario(stay=0.9), seed=0)
    >>> bool(abs(bound.mean_position_rmse() - 51.2) < 0.2)
    True
    """
    if isinstance(scenario, Plan):
        return bcrb_of_plan(scenario, rtol=1e-3 if rtol is None else rtol)
    horizon = Horizon.parse(horizon, scenario.steps)
    extra = further_information(scenario, extra)
    if isinstance(scenario, JumpMarkov) or beyond_separation(scenario):
        if engine is not None:
            raise InputError(f"engine {engine!r} does not take this model", "Leave the engine out")
        return _by_general_engine(scenario, rtol, samples, seed, expectation, window, progress, horizon, extra)
    if engine not in (None, "windowed", "corrected"):
        raise InputError(f"the engine is {engine!r}", "Give 'windowed' or 'corrected', or leave it out")
    why = "it was asked for" if engine else too_large(scenario, window)
    if engine == "corrected" or (engine is None and why is not None and not traced(scenario, expectation)):
        if horizon.kind != "filter" or extra is not None:
            raise RefusedError(
                f"the corrected engine, taken because {why}, gives filtering bounds from the scenario's ranges alone",
                "Use engine='windowed', which needs memory for the tables of all steps",
            )
        return corrected(scenario, rtol, samples, seed, expectation, window, progress, str(why))
    return separated("bcrb", scenario, rtol, samples, seed, expectation, window, progress, horizon, extra)


def too_large(scenario: Scenario, window: int | None) -> str | None:
    """Why the tables of the windowed engine would not fit, or None.

    >>> import locbounds as lb
    >>> too_large(lb.papers.fritsche2013.scenario(), None) is None
    True
    """
    size = min(FIRST_WINDOW if window is None else window, scenario.steps)
    if traced(scenario):
        return None
    links = len(set(_distinct([noise_process(scenario, link) for link in scenario.links])))
    tables = 8.0 * FEWEST_GROUPS * scenario.steps * size**2 * links
    draws = 8.0 * FEWEST_GROUPS * PATHS * scenario.steps * (6 + size)
    if tables + draws <= MOST_BYTES:
        return None
    return f"tables of {scenario.steps:,} steps and {links} different noises would take {(tables + draws) / 1e9:.1f} GB"


def _by_general_engine(scenario, rtol, samples, seed, expectation, window, progress, horizon, extra) -> Result:
    if traced(scenario, expectation):
        raise InputError(
            "the general engine cannot be transformed by JAX",
            "Transform a scenario with links of their own chains and a motion without modes",
        )
    if isinstance(scenario, JumpMarkov):
        verdict, model, why = method("bcrb").verdict(scenario), scenario, "the model is a JumpMarkov"
        if verdict.status is Status.REFUSED:
            raise RefusedError(f"bcrb does not apply: {'; '.join(verdict.reasons)}", "See: locbounds explain bcrb")
    else:
        _, verdict = prepare("bcrb", scenario, None)
        model, why = jump_markov(scenario.anonymous()), str(beyond_separation(scenario))
    return general("bcrb", model, why, rtol, samples, seed, expectation, window, progress, verdict, horizon, extra)


@double_precision
def known_sight(
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
    """Posterior Cramér-Rao bound for a known sight schedule.

    Parameters
    ----------
    scenario, rtol, samples, seed, expectation, horizon, extra, progress
        As for :func:`bcrb`; every link's sight is a :class:`~locbounds.KnownSight`. With
        ``AlongTrack(positions)`` nothing is random and the number is conditional on the track.

    Returns
    -------
    Result
        ``covariance`` [steps+1, state, state]: with the default expectation a bound on the mean square error matrix
        of every estimator that is told the sight.

    Raises
    ------
    RefusedError
        If the sight of some link is random.

    Notes
    -----
    Chen 2010, eq. 18, with the expectation over tracks taken by Monte Carlo. The same computation as :func:`bcrb`:
    with certain modes the score covariance is diagonal and exact.

    Examples
    --------
    >>> import numpy as np, locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario().with_known_sight(np.zeros(100, int))
    >>> bool(lb.known_sight(scenario).mean_position_rmse() < 45)
    True
    """
    horizon, extra = Horizon.parse(horizon, scenario.steps), further_information(scenario, extra)
    return separated("known-sight", scenario, rtol, samples, seed, expectation, 1, progress, horizon, extra)


def separated(id, scenario, rtol, samples, seed, expectation, window, progress, horizon, extra) -> Result:
    """The engine: blocks of score covariances and geometries until window and precision suffice."""
    expectation, verdict = prepare(id, scenario, expectation)
    scenario = scenario.anonymous()
    differentiable = traced(scenario, expectation)
    rtol_target = check_rtol(rtol, samples, differentiable)
    if window is not None and (int(window) != window or window < 1):
        raise InputError(f"the window is {window}", "Give a whole number of steps, at least 1")
    seed_key = np.uint32(check_seed(seed))
    processes = [noise_process(scenario, link) for link in scenario.links]
    first = _distinct(processes)
    distinct = sorted(set(first))
    sharing = tuple(tuple(m for m, i in enumerate(first) if i == process) for process in distinct)
    size = min(FIRST_WINDOW if window is None else int(window), scenario.steps)
    fixed = samples is not None or differentiable
    while True:
        groups = GROUPS if 8 * GROUPS * scenario.steps * size**2 <= TABLE_BYTES else FEWEST_GROUPS
        blocks = -(-(samples or 1) // (groups * PATHS)) if fixed else None

        def draw(block: int, groups: int = groups, size: int = size):
            b = np.uint32(block)
            C = [
                score_covariance_increments(
                    processes[i], seed_key, b, groups=groups, paths=PATHS, window=size, differentiable=differentiable
                )
                for i in distinct
            ]
            G = geometry(scenario, expectation, seed_key, b, groups=groups, window=size, sharing=sharing)
            return jnp.stack(C, axis=1), G

        tables = draw(0)
        solution = _solve(scenario, *tables, extra, horizon=horizon)
        known = all(isinstance(link.sight, KnownSight) for link in scenario.links)  # then there is nothing to cut
        truncation = 0.0 if size == scenario.steps or known else np.nan
        if window is None and size < scenario.steps and not differentiable and not known:
            truncation = extrapolated(solution.shorter, solution.estimate.position_mse, size, scenario.steps)
            if truncation > rtol_target / 10:
                size = min(2 * size, scenario.steps)
                continue
        estimate, done = refine(
            draw,
            lambda tables: _solve(scenario, *tables, extra, horizon=horizon).estimate,
            rtol=rtol_target,
            blocks=blocks,
            samples_per_block=groups * PATHS,
            progress=progress,
            first=(tables, solution.estimate),
        )
        break
    how = f"noise and geometry separated, Louis' identity, window of {size} steps"
    diagnostics = {"truncation": np.float64(truncation), "window": np.int64(size)}
    used = done * groups * PATHS
    verdict = judged(verdict, truncation, size, scenario.steps)
    return bound_result(id, scenario, estimate, verdict, expectation, seed, used, how, diagnostics, horizon)
