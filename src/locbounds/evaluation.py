"""Monte Carlo evaluation of filters: root mean square error, consistency, quantiles, with confidence."""

from collections.abc import Callable
from typing import Any

import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import GROUPS
from locbounds.errors import InputError
from locbounds.quadrature import deviations
from locbounds.registry import METHODS, RANGES
from locbounds.result import Provenance, Result
from locbounds.scenario import Scenario
from locbounds.simulation import Draws, simulate
from locbounds.verdict import Status, Verdict

RUNS_AT_ONCE = 5_000
DIVERGED = 10.0  # a run whose final error exceeds this many times the median one counts as lost


def evaluate(
    filter: Callable[..., Any],
    scenario: Scenario,
    *,
    runs: int = 1_000,
    seed: int = 0,
    name: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Run a filter on tracks drawn from a scenario and score it.

    Parameters
    ----------
    filter
        One of the library's filters, or any callable ``(scenario, z, seed) -> estimates`` with ranges ``z``
        [runs, steps, links] (NaN: no report) and estimates [runs, steps+1, state] or [runs, steps+1, space]; rows for
        steps 1..K only are taken as following the prior's mean at step 0.
    scenario
        What tracks, sight and ranges are drawn from. The filter starts from its prior, never from the truth.
    runs
        Number of tracks. The same seed gives every filter the same tracks.
    seed
        Seed of the draws; handed to the filter as well.
    name
        Name in results; by default the filter's own.
    progress
        Called with (runs done, runs).

    Returns
    -------
    Result
        ``position_mse`` with its spread over groups of runs. ``diagnostics``: ``error_m`` [runs, steps+1] position
        errors; ``nees`` [steps+1] mean normalised squared error of the state divided by its size (1 if consistent;
        only for filters that return covariances); ``lost`` number of runs whose last error is not finite or exceeds
        ten times the median. Lost runs are counted, never dropped. What a filter says about its own work is there
        too, [runs, ...] each.

    Raises
    ------
    InputError
        If the estimates have another shape than the tracks.

    Examples
    --------
    A filter that never looks at the ranges has the prior's predicted error:

    >>> import numpy as np, locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=10)
    >>> def stand_still(scenario, z, seed):
    ...     return np.broadcast_to(scenario.prior.mean, (len(z), 11, 4))
    >>> result = lb.evaluate(stand_still, scenario, runs=500)
    >>> print(result.efficiency(lb.bcrb(scenario)).value < 0.9)
    True
    """
    if runs < 2 or int(runs) != runs:
        raise InputError(f"the number of runs is {runs}", "Give a whole number of at least 2")
    draws = simulate(scenario, runs=runs, seed=seed)
    return evaluate_on(filter, scenario, draws, seed=seed, name=name, progress=progress, truth=scenario)


def evaluate_on(
    filter: Callable[..., Any],
    scenario: Scenario,
    draws: Draws,
    *,
    seed: int = 0,
    name: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    truth: Scenario | None = None,
) -> Result:
    """As :func:`evaluate`, on tracks that were drawn before: several filters then see the same ones.

    ``scenario`` is what the filter assumes, ``truth`` what the tracks were drawn from: if given, the result can only be
    compared with bounds of that.
    """
    runs, n = len(draws.states), scenario.motion.state_size
    errors, nees = [], []
    diagnostics: dict[str, list[Any]] = {}
    covariance = np.zeros((scenario.steps + 1, n, n))
    for start in range(0, runs, RUNS_AT_ONCE):
        part = Draws(*(x[start : start + RUNS_AT_ONCE] for x in draws))
        mean, spread, more = _run(filter, scenario, part.measurements, part.sight, seed)
        for key, values in more.items():
            diagnostics.setdefault(key, []).append(np.asarray(values))
        errors.append(position_error(scenario, mean, part.states))
        if mean.shape[-1] == n:
            e = mean - part.states
            covariance += np.matmul(e.transpose(1, 2, 0), e.transpose(1, 0, 2)) / runs
            if spread is not None:
                nees.append(normalised_square(e, spread))
        else:
            covariance[:] = np.nan
        if progress is not None:
            progress(min(start + RUNS_AT_ONCE, runs), runs)
    error = np.concatenate(errors)
    consistency = np.concatenate(nees) if nees else None
    return result_of_errors(
        error,
        scenario.times.time_s,
        covariance,
        consistency,
        filter=filter,
        name=name,
        seed=seed,
        how="tracks drawn from the model",
        truth=truth,
        diagnostics={key: np.concatenate(parts) for key, parts in diagnostics.items()},
    )


def estimates(
    filter: Callable[..., Any], scenario: Scenario, z: Array, sight: Array | None, seed: int
) -> tuple[Float[Array, "runs times n"], Float[Array, "runs times state state"] | None]:
    """Run a filter of the library or a callable; estimates at steps 0..K and covariances where it has them."""
    return _run(filter, scenario, z, sight, seed)[:2]


def _run(
    filter: Callable[..., Any], scenario: Scenario, z: Array, sight: Array | None, seed: int
) -> tuple[Array, Array | None, dict[str, Array]]:
    """As :func:`estimates`, and what else the filter says about its work."""
    if isinstance(filter, type) or not callable(filter):
        name = filter.__name__ if isinstance(filter, type) else repr(filter)
        raise InputError(f"{name} is not a filter that can be called", "Give an instance, for example ImmEkf()")
    if "sight" in getattr(filter, "sees", RANGES):
        output = filter(scenario, z, seed, sight)
    else:
        output = filter(scenario, z, seed)
    mean = np.asarray(getattr(output, "mean", output) if not isinstance(output, np.ndarray) else output, dtype=float)
    spread = None if isinstance(output, np.ndarray) else getattr(output, "covariance", None)
    allowed = (scenario.dim, scenario.motion.state_size)
    if mean.ndim == 3 and mean.shape[1] == scenario.steps and mean.shape[2] in allowed:
        start = np.broadcast_to(scenario.prior.mean, (len(mean), 1, scenario.motion.state_size))
        start = start if mean.shape[2] == scenario.motion.state_size else scenario.motion.position(start)
        mean = np.concatenate([start, mean], axis=1)
    if mean.ndim != 3 or mean.shape[:2] != (len(z), scenario.steps + 1) or mean.shape[2] not in allowed:
        raise InputError(
            f"the filter returned estimates of shape {mean.shape} for {len(z)} runs of {scenario.steps} steps",
            f"Return [runs, steps+1, state] with {allowed[1]} components, or [runs, steps+1, space] with {allowed[0]}",
        )
    return mean, spread, getattr(output, "diagnostics", {})


def position_error(scenario: Scenario, mean: Array, states: Array) -> Float[Array, "runs times"]:
    """Length of the position error in metres, infinite where an estimate is not finite."""
    position = mean if mean.shape[-1] == scenario.dim else scenario.motion.position(mean)
    error = np.linalg.norm(position - scenario.motion.position(states), axis=-1)
    return np.where(np.isfinite(error), error, np.inf)


def normalised_square(error: Array, covariance: Array) -> Float[Array, "runs times"]:
    """``e' P^-1 e / n``; one on average for a consistent filter. NaN where P is singular."""
    n = error.shape[-1]
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", covariance), np.finfo(float).tiny))
    correlation = covariance / (scale[..., :, None] * scale[..., None, :])
    regular = np.linalg.cond(correlation[:, :1]).max() < 1e12 and np.all(np.isfinite(correlation))
    if not regular:
        return np.full(error.shape[:-1], np.nan)
    e = error / scale
    return np.einsum("...i,...i->...", e, np.linalg.solve(correlation, e[..., None])[..., 0]) / n


def result_of_errors(
    error: Float[Array, "runs times"],
    time_s: Float[Array, " times"],
    covariance: Float[Array, "times state state"],
    consistency: Float[Array, "runs times"] | None,
    *,
    filter: Any = None,
    name: str | None = None,
    sees: frozenset[str] = RANGES,
    seed: int,
    how: str,
    warnings: tuple[str, ...] = (),
    diagnostics: dict[str, Any] | None = None,
    truth: Scenario | None = None,
) -> Result:
    """The result of a filter from its position errors; ``filter`` lends its id, name and what it sees.

    ``truth`` is the scenario that the tracks were drawn from, if that is known.
    """
    runs = len(error)
    groups = min(GROUPS, runs)
    square = error**2
    group_means = np.stack([part.mean(0) for part in np.array_split(square, groups)])
    mean, spread = square.mean(0), np.asarray(deviations(group_means)[1])
    lost = int(np.sum(~(error[:, -1] <= DIVERGED * np.median(error[:, -1]))))
    if lost:
        warnings = (f"{lost} of {runs} runs were lost: their errors count fully", *warnings)
    id = getattr(filter, "id", "own")
    diagnostics = (diagnostics or {}) | {"error_m": error, "lost": np.int64(lost)}
    if consistency is not None:
        diagnostics["nees"] = consistency.mean(0)
    return Result(
        id=id,
        name=name or getattr(filter, "name", None) or getattr(filter, "__name__", "own filter"),
        kind="filter",
        sees=getattr(filter, "sees", sees),
        time_s=time_s,
        position_mse=mean,
        replicates=np.asarray(spread),
        covariance=covariance,
        verdict=Verdict(Status.VALID, (), warnings),
        provenance=Provenance.now(seed, runs, how, METHODS[id].references if id in METHODS else ()),
        diagnostics=diagnostics,
        scenario="" if truth is None else truth.fingerprint(),
    )


def quantile(result: Result, share: float, *, first_step: int = 1) -> tuple[float, float]:
    """Quantile of the position error over runs and steps, with its standard error.

    Parameters
    ----------
    result
        Result of a filter.
    share
        Between 0 and 1: 0.67 for the error that 67 % stay below.
    first_step
        Steps before it are left out; by default step 0, the prior.

    Returns
    -------
    float, float
        Metres, and the standard error from a jackknife over groups of runs (errors within a run are dependent).

    Examples
    --------
    >>> import numpy as np, locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=5)
    >>> guess = lb.evaluate(lambda s, z, seed: np.broadcast_to(s.prior.mean, (len(z), 6, 4)), scenario, runs=400)
    >>> bool(lb.quantile(guess, 0.67)[0] < lb.quantile(guess, 0.95)[0])
    True
    """
    if not 0 < share < 1:
        raise InputError(f"the share is {share}", "Give a number between 0 and 1, for example 0.67")
    if "error_m" not in result.diagnostics:
        raise InputError(f"{result.name} has no errors, it is a {result.kind}", "Give the result of a filter")
    error = np.asarray(result.diagnostics["error_m"])[:, first_step:]
    parts = np.array_split(error, min(GROUPS, len(error)))
    value = float(np.quantile(error, share))
    if len(parts) < 2:
        return value, float("nan")
    without = [np.quantile(np.concatenate(parts[:i] + parts[i + 1 :]), share) for i in range(len(parts))]
    return value, float(np.sqrt((len(parts) - 1) * np.var(without)))
