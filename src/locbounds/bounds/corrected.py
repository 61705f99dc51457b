"""Long horizons: the recursion of a short window, corrected with the information of all lags.

Work is linear in steps and links, and nothing that is kept grows with the window times the steps times the links. The
value is a lower bound of the bound in expectation, whatever the window; see docs/theory/score.md.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS, check_seed
from locbounds.bounds.all_lags import Corrected, corrected_bound
from locbounds.bounds.common import bound_result, prepare
from locbounds.bounds.precision_control import Estimate, Progress, check_rtol, refine
from locbounds.errors import InputError, RefusedError
from locbounds.precision import double_precision, traced
from locbounds.result import Result
from locbounds.scenario import Scenario, beyond_separation
from locbounds.verdict import Status, Verdict

FIRST_WINDOW = 2
LONGEST_WINDOW = 32  # longer ones are taken only where asked for: work per step grows with their square
FEWEST_GROUPS = 16  # for so many links that these are draws enough
DRAWS = 3072  # link by link, per block: with fewer links more paths are drawn
PILOT = 4  # groups that make V, as a share of the others: an error of V matters to second order only


class _Sums(NamedTuple):
    """What is averaged over blocks."""

    covariance: Float[Array, "times state state"]
    replicates: Float[Array, "groups times"]
    windowed: Float[Array, "times state state"]
    position_mse: Float[Array, "2 times"]


def _relative(position_mse: Float[Array, "2 times"]) -> Float[Array, " times"]:
    """Relative difference of the position RMSE without and with the information outside the window."""
    inside, everything = np.asarray(position_mse)
    return np.sqrt(np.divide(inside, everything, out=np.ones_like(inside), where=everything > 0)) - 1


def _blocks(scenario, expectation, rtol, samples, seed, window, progress):
    """Windows until the remainder is small, then blocks until the value is precise enough."""
    target = check_rtol(rtol, samples)
    if window is not None and (int(window) != window or window < 1):
        raise InputError(f"the window is {window}", "Give a whole number of steps, at least 1")
    scenario = scenario.anonymous()
    seed_key = np.uint32(check_seed(seed))
    groups = GROUPS if GROUPS * len(scenario.links) <= DRAWS else FEWEST_GROUPS
    paths = int(np.clip(DRAWS // (groups * len(scenario.links)), 1, 32))
    size = min(FIRST_WINDOW if window is None else int(window), scenario.steps)
    index = np.array(scenario.motion.position_index)

    while True:
        increments = jnp.zeros((scenario.steps + 1, size * scenario.dim, size * scenario.dim))

        def draw(block: int, size: int = size) -> _Sums:
            nonlocal increments
            one: Corrected = corrected_bound(
                scenario,
                expectation,
                seed_key,
                np.uint32(block),
                increments,
                groups=groups,
                paths=paths,
                pilot=groups // PILOT,
                window=size,
            )
            increments = (block * increments + one.increments) / (block + 1)
            return _Sums(one.covariance, one.replicates, one.windowed, one.position_mse)

        first = draw(0)
        truncation = float(np.abs(_relative(first.position_mse)).max())
        if window is not None or truncation**2 <= target / 10 or size >= min(scenario.steps, LONGEST_WINDOW):
            break
        size = min(2 * size, scenario.steps, LONGEST_WINDOW)

    def estimate(sums: _Sums) -> Estimate:
        return Estimate(sums.covariance, sums.covariance[:, index, index].sum(-1), sums.replicates)

    total = first

    def kept(block: int) -> _Sums:
        nonlocal total
        one = draw(block)
        total = _Sums(*(a + b for a, b in zip(total, one, strict=True)))
        return one

    found, done = refine(
        kept,
        estimate,
        rtol=target,
        blocks=None if samples is None else -(-samples // (groups * paths)),
        samples_per_block=groups * paths,
        progress=progress,
        first=(first, estimate(first)),
    )
    means = _Sums(*(a / done for a in total))
    return found, means, size, done * groups * paths


def corrected(scenario, rtol, samples, seed, expectation, window, progress, why: str) -> Result:
    """The engine as :func:`locbounds.bcrb` calls it, and ``why`` it was chosen."""
    if traced(scenario, expectation):
        raise InputError("the corrected engine cannot be transformed by JAX", "Use engine='windowed' with a window")
    expectation, verdict = prepare("bcrb", scenario, expectation)
    estimate, means, size, used = _blocks(scenario, expectation, rtol, samples, seed, window, progress)
    difference = _relative(means.position_mse)
    truncation = np.abs(difference).max()
    how = (
        f"corrected engine, because {why}; recursion of a window of {size} steps, corrected with all lags to second "
        f"order (the window alone: {100 * difference[np.abs(difference).argmax()]:+.2g} % at the worst step)"
    )
    diagnostics = {
        "truncation": np.float64(truncation),
        "window": np.int64(size),
        "remainder": np.float64(truncation**2),
    }
    return bound_result("bcrb", scenario, estimate, verdict, expectation, seed, used, how, diagnostics)


@double_precision
def bcrb_block_tridiagonal(
    scenario: Scenario,
    *,
    rtol: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Result:
    """The recursion of Fritsche 2013, section IV, between neighbouring steps only; not a bound.

    What the ranges say about steps that are two or more apart is dropped, and what later ranges add about earlier
    steps too, so that the information matrix is block tridiagonal and a recursion over the last two steps suffices.
    What is dropped has no sign: the number can lie above the bound as well as below it. :func:`locbounds.bcrb` uses
    the same recursion only to choose a matrix V and then takes all of the information.

    Parameters
    ----------
    scenario, rtol, samples, seed, progress
        As for :func:`locbounds.bcrb`. The paper's own example is large enough to see the loss.

    Returns
    -------
    Result
        ``diagnostics["loss"]`` [steps+1]: relative error of the position RMSE against the bound with all lags, from
        the same draws; positive where the number lies above it. The verdict says that it may not be quoted as a
        bound. Standard errors are those of the value with all lags; draws are added until that one is as precise as
        asked for.

    Raises
    ------
    RefusedError
        As for :func:`locbounds.bcrb`, and where noise and geometry do not separate.

    Examples
    --------
    >>> import locbounds as lb
    >>> paper = lb.bcrb_block_tridiagonal(lb.papers.fritsche2013.scenario(steps=12), samples=1024)
    >>> bool(0 < paper.diagnostics["loss"][-1] < 0.02), paper.verdict.status.value
    (True, 'valid under')
    """
    if traced(scenario):
        raise InputError("the block-tridiagonal recursion cannot be transformed by JAX", "Use locbounds.bcrb")
    why = beyond_separation(scenario)
    if why is not None:
        raise RefusedError(f"{why}: the block-tridiagonal recursion does not take that", "Use locbounds.bcrb")
    expectation, _ = prepare("bcrb", scenario, None)
    estimate, means, size, used = _blocks(scenario, expectation, rtol, samples, seed, 2, progress)
    index = np.array(scenario.motion.position_index)
    windowed = means.windowed
    loss = _relative(means.position_mse)
    verdict = Verdict(
        Status.CONDITIONAL,
        ("a block-tridiagonal approximation, which is no bound: it may lie above or below the BCRB",),
        (
            f"information between steps two or more apart is dropped: {100 * loss[np.abs(loss).argmax()]:+.2g} % "
            "in the position RMSE at the worst step",
        ),
    )
    estimate = Estimate(windowed, windowed[:, index, index].sum(-1), estimate.replicates)
    how = f"block-tridiagonal recursion, window of {size} steps, not corrected"
    return bound_result(
        "bcrb", scenario, estimate, verdict, expectation, seed, used, how, {"loss": loss, "window": np.int64(size)}
    )
