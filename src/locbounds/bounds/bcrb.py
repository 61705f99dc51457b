"""Bayesian Cramér-Rao bounds of jump-Markov and known-sight models, with noise and geometry separated."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, Stream, block_key, check_seed
from locbounds.bounds.common import bound_result, prepare
from locbounds.bounds.expectation import Expectation, directions, windows
from locbounds.bounds.general import general, model_verdict
from locbounds.bounds.precision_control import Estimate, Progress, check_rtol, refine
from locbounds.bounds.recursion import covariance_deviations, covariance_recursion
from locbounds.bounds.score_covariance import NoiseProcess, noise_process, score_covariance_increments
from locbounds.errors import InputError, RefusedError
from locbounds.model import JumpMarkov, jump_markov
from locbounds.precision import double_precision, traced
from locbounds.result import Result
from locbounds.scenario import Scenario, beyond_separation
from locbounds.verdict import Status

PATHS = 64  # noise paths per group and block
TRACKS = 16  # tracks per group and block: the geometry varies far less than the noise
FIRST_WINDOW = 12
GROUPS_AT_ONCE = 8
FEWEST_GROUPS = 16  # kept even for large tables: fewer say too little about a standard error
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


@partial(jax.jit, static_argnames=("groups", "window", "sharing"))
def _geometry(
    scenario, expectation, seed, block, *, groups, window, sharing
) -> Float[Array, "groups processes steps window space space"]:
    """Group means of ``grad h(x_n) grad h(x_{n-lag})^T`` by step n and lag, summed over links that share noise."""
    paths = groups * TRACKS if expectation.random else 1
    u = directions(scenario, expectation, block_key(seed, Stream.TRACKS, block), paths)
    u = u.reshape(u.shape[0], groups if expectation.random else 1, -1, *u.shape[2:])
    by_link = jnp.einsum("lgnka,lgnkib->lgkiab", u, windows(u, window)) / u.shape[2]
    return jnp.stack([by_link[np.array(links)].sum(0) for links in sharing], axis=1)


def _information(C, G) -> Float[Array, "steps window space window space"]:
    """Increments of the information about positions at ages i, j: noise part times geometry part, summed."""
    window, steps = C.shape[-1], G.shape[1]
    padded = jnp.concatenate([jnp.zeros((len(G), window - 1, *G.shape[2:])), G], axis=1)  # nothing before step 1
    rows = []
    for i in range(window):  # newer member at age i, the other one j - i steps before it
        pairs = jax.lax.slice_in_dim(padded, window - 1 - i, window - 1 - i + steps, axis=1)[:, :, : window - i]
        row = jnp.sum(C[:, :, i, i:, None, None] * pairs, 0)
        rows.append(jnp.pad(row, ((0, 0), (i, 0), (0, 0), (0, 0))))
    upper = jnp.swapaxes(jnp.stack(rows, axis=1), 2, 3)
    i, j = np.meshgrid(np.arange(window), np.arange(window), indexing="ij")
    return jnp.where((i <= j)[:, None, :, None], upper, jnp.transpose(upper, (0, 3, 4, 1, 2)))


@jax.jit
def _covariances(scenario, C, G) -> Float[Array, "times state state"]:
    """Bound at every step from the means over all groups."""
    return covariance_recursion(scenario, _information(C, G))


@jax.jit
def _deviations(scenario, C, G) -> Float[Array, "groups times"]:
    """Each group's deviation of the position mean square error, to first order (delta method)."""
    C_mean, G_mean = C.mean(0), G.mean(0)
    index = np.array(scenario.motion.position_index)
    mean = _information(C_mean, G_mean)

    def some_groups(start):
        def change(C_group, G_group):  # independent draws of noise and geometry: their deviations add
            noise, geometry = (C_group - C_mean, G_mean), (C_mean, G_group - G_mean)
            return _information(*noise) + _information(*geometry)

        C_some, G_some = (jax.lax.dynamic_slice_in_dim(x, start, GROUPS_AT_ONCE) for x in (C, G))
        return covariance_deviations(scenario, mean, jax.vmap(change)(C_some, G_some))[..., index, index].sum(-1)

    G = jnp.broadcast_to(G, (len(C), *G.shape[1:]))
    return jax.lax.map(some_groups, jnp.arange(0, len(C), GROUPS_AT_ONCE)).reshape(len(C), -1)


def _truncation(scenario, C, G) -> float:
    """Relative error of the position RMSE at the worst step that is due to the window, extrapolated.

    The changes on shortening the window by a quarter and by a half say how fast they decay with its length:
    geometrically with a ratio q per quarter, ``half / quarter = (1 + q) / q``, and what was left out makes
    ``quarter * q / (1 - q)``. Where that is less than the last quarter itself, that quarter is reported; where nothing
    decays, the last quarter as often as quarters were left out.
    """
    index = np.array(scenario.motion.position_index)
    C, G = C.mean(0), G.mean(0)
    window = C.shape[-1]

    def rmse(length):
        kept = np.arange(window) < length
        return jnp.sqrt(_covariances(scenario, C * (kept[:, None] & kept), G)[:, index, index].sum(-1))

    full = rmse(window)
    quarter, half = (float(jnp.max(jnp.abs(rmse(-(-n * window // 4)) / full - 1))) for n in (3, 2))
    left_out = 4 * (scenario.steps - window) / window
    beyond = quarter / (half - 2 * quarter) if half > 2 * quarter else np.inf  # q / (1 - q)
    return quarter * max(1.0, min(beyond, left_out))


@double_precision
def bcrb(
    scenario: Scenario | JumpMarkov,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    expectation: Expectation | None = None,
    window: int | None = None,
    progress: Progress | None = None,
) -> Result:
    r"""Bayesian Cramér-Rao bound of a jump-Markov model, at every step.

    The engine is chosen by what the model needs; ``provenance.how`` names it and the reason. The general engine
    (:mod:`locbounds.bounds.general`) takes every :class:`~locbounds.JumpMarkov` and every scenario whose motion
    switches, whose measurements depend on the sight or whose links share a chain. All others separate: the information
    of the ranges is separated into the covariance of the noise score, a property of each link's noise
    process (see :mod:`locbounds.bounds.score_covariance`), and the expected products of range gradients. Modes are
    never enumerated; links with equal noise processes share their noise draws.

    Parameters
    ----------
    scenario
        The model. Noises of different links are independent, and so are chains that are not named as one.
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
    progress
        Called with (samples, precision reached, target) after every look.

    Returns
    -------
    Result
        ``covariance`` [steps+1, state, state] is the bound on the mean square error matrix of any estimator of x_k
        from z_1..z_k. ``diagnostics["truncation"]`` is the relative error of the position RMSE, at the worst step,
        made by truncating at the window, as extrapolated from how the bound changes when the window is shortened by a
        quarter and by a half. It exceeds the error where the entries left out decay quickly; it is no guarantee, and
        the error may have either sign. NaN where the window was given.

    Raises
    ------
    RefusedError
        If an assumption is violated (see ``locbounds explain bcrb``).
    InputError
        If an option makes no sense.

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
    if isinstance(scenario, JumpMarkov) or beyond_separation(scenario):
        return _by_general_engine(scenario, rtol, samples, seed, expectation, window, progress)
    return separated("bcrb", scenario, rtol, samples, seed, expectation, window, progress)


def _by_general_engine(scenario, rtol, samples, seed, expectation, window, progress) -> Result:
    if traced(scenario, expectation):
        raise InputError(
            "the general engine cannot be transformed by JAX",
            "Transform a scenario with links of their own chains and a motion without modes",
        )
    if isinstance(scenario, JumpMarkov):
        verdict, model, why = model_verdict(scenario), scenario, "the model is a JumpMarkov"
        if verdict.status is Status.REFUSED:
            raise RefusedError(f"bcrb does not apply: {'; '.join(verdict.reasons)}", "See: locbounds explain bcrb")
    else:
        _, verdict = prepare("bcrb", scenario, None)
        model, why = jump_markov(scenario.anonymous()), str(beyond_separation(scenario))
    return general("bcrb", model, why, rtol, samples, seed, expectation, window, progress, verdict)


@double_precision
def known_sight(
    scenario: Scenario,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    expectation: Expectation | None = None,
    progress: Progress | None = None,
) -> Result:
    """Posterior Cramér-Rao bound for a known sight schedule.

    Parameters
    ----------
    scenario, rtol, samples, seed, expectation, progress
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
    return separated("known-sight", scenario, rtol, samples, seed, expectation, 1, progress)


def separated(id, scenario, rtol, samples, seed, expectation, window, progress) -> Result:
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
    index = np.array(scenario.motion.position_index)
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
            G = _geometry(scenario, expectation, seed_key, b, groups=groups, window=size, sharing=sharing)
            return jnp.stack(C, axis=1), G

        def evaluate(tables) -> Estimate:
            C, G = tables
            P = _covariances(scenario, C.mean(0), G.mean(0))
            return Estimate(P, P[:, index, index].sum(-1), _deviations(scenario, C, G))

        first_block = draw(0)
        truncation = 0.0 if size == scenario.steps or id == "known-sight" else np.nan  # known sight: nothing to cut
        if window is None and size < scenario.steps and not differentiable:
            truncation = _truncation(scenario, *first_block)
            if truncation > rtol_target / 10:
                size = min(2 * size, scenario.steps)
                continue
        estimate, done = refine(
            lambda block, first=first_block, draw=draw: draw(block) if block else first,
            evaluate,
            rtol=rtol_target,
            blocks=blocks,
            samples_per_block=groups * PATHS,
            progress=progress,
        )
        break
    how = f"noise and geometry separated, Louis' identity, window of {size} steps"
    diagnostics = {"truncation": np.float64(truncation), "window": np.int64(size)}
    return bound_result(id, scenario, estimate, verdict, expectation, seed, done * groups * PATHS, how, diagnostics)
