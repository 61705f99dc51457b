"""Ask for a precision and get it: blocks of draws until the largest relative standard error is small enough."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.precision import traced
from locbounds.quadrature import standard_error

DEFAULT_RTOL = 1e-3
MAX_BLOCKS = 4096
Progress = Callable[[int, float, float], None]
"""Called with (samples so far, largest relative standard error so far, target)."""


class Estimate(NamedTuple):
    """What one evaluation of the blocks so far yields."""

    covariance: Float[Array, "times state state"]
    position_mse: Float[Array, " times"]
    replicates: Float[Array, "groups times"]


def check_rtol(rtol: float | None, samples: int | None, is_traced: bool = False) -> float:
    """The precision to aim for; an InputError where it cannot be reached by any number of draws."""
    if samples is not None and (int(samples) != samples or samples < 1):
        raise InputError(f"the number of samples is {samples}", "Give a whole number of at least 1")
    if rtol is None:
        return DEFAULT_RTOL
    if is_traced:
        raise InputError("rtol is given, but no error can be looked at while JAX traces the bound", "Give samples")
    if not 0 < rtol < 1:
        raise InputError(f"rtol is {rtol}", "Give a relative standard error between 0 and 1, for example 1e-3")
    return float(rtol)


def relative_error(estimate: Estimate) -> float:
    """Largest relative standard error of the position RMSE over the steps."""
    mse = np.asarray(estimate.position_mse)
    return float((0.5 * standard_error(np.asarray(estimate.replicates)) / np.where(mse > 0, mse, 1.0)).max())


def refine(
    draw: Callable[[int], Any],
    evaluate: Callable[[Any], Estimate],
    *,
    rtol: float,
    blocks: int | None,
    samples_per_block: int,
    progress: Progress | None = None,
    first: tuple[Any, Estimate] | None = None,
) -> tuple[Estimate, int]:
    """Average blocks in index order until the estimate is precise enough.

    Parameters
    ----------
    draw
        Tables of block ``b``, a pytree of group means.
    evaluate
        From averaged tables to an estimate.
    rtol
        Target; looked at after 1, 2, 4, ... blocks only, so that the result does not depend on scheduling.
    blocks
        A fixed number of blocks instead (no look at the target).
    samples_per_block, progress
        For reporting.
    first
        Tables of block 0 and the estimate from them, where they are known already.

    Returns
    -------
    Estimate, int
        The estimate and the number of blocks used; at most ``MAX_BLOCKS`` where the target cannot be reached.
    """
    if first is None:
        tables = draw(0)
        first = tables, evaluate(tables)
    total, estimate = first
    done, look = 1, blocks or 1
    while True:
        if done < look:
            while done < look:
                total = jax.tree.map(lambda a, b: a + b, total, draw(done))
                done += 1
            estimate = evaluate(jax.tree.map(lambda t, n=done: t / n, total))
        if traced(estimate):
            return estimate, done
        error = relative_error(estimate)
        if progress is not None:
            progress(done * samples_per_block, error, rtol)
        if blocks is not None or error <= rtol or done >= MAX_BLOCKS:
            return estimate, done
        look = min(2 * done, MAX_BLOCKS)
