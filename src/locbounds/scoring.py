"""Scoring estimates that were made elsewhere: any filter, in any language, against a bound."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.evaluation import normalised_square, result_of_errors
from locbounds.precision import double_precision
from locbounds.result import Efficiency, Result
from locbounds.scenario import Scenario
from locbounds.simulation import Draws

UNITS = {"millimetres": 1e3, "centimetres": 1e2, "feet": 1 / 0.3048, "kilometres": 1e-3}
CLOSER = 0.2  # another unit is meant if the median error shrinks to less than this share with it
SEEN = ("ranges", "sight", "future-ranges")


class Score(NamedTuple):
    """How far a filter is from a bound.

    Attributes
    ----------
    result
        The filter's errors over time, as of :func:`locbounds.evaluate`.
    bound
        What it was compared with.
    efficiency
        Mean square error of the bound over that of the filter, averaged over the steps, with a 95 % interval.
    verdict
        What that means, in one sentence.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=10)
    >>> runs = lb.simulate(scenario, runs=50, seed=1)
    >>> always_north = runs.states[..., :2] + np.array([0.0, 100.0])
    >>> lb.score(always_north, runs, lb.bcrb(scenario), scenario=scenario).result.name
    'own filter'
    """

    result: Result
    bound: Result
    efficiency: Efficiency
    verdict: str

    def __str__(self) -> str:
        return f"{self.result}\n{self.bound}\n{self.verdict}"


def score(
    estimates: Any,
    truth: Any,
    bound: Result,
    *,
    scenario: Scenario | None = None,
    covariance: Any = None,
    name: str = "own filter",
    sees: Iterable[str] = ("ranges",),
) -> Score:
    """Compare estimates with the truth and with a bound.

    Parameters
    ----------
    estimates
        [runs, steps+1, space] positions in metres, or [runs, steps+1, state] with ``scenario``. Rows for the steps
        1..K only are taken as following an estimate at step 0 that is the mean of the true positions there.
    truth
        Of the same runs in the same order: positions, states, or what :func:`locbounds.simulate` returned (the latter
        two with ``scenario``). At least two tracks, drawn from the model of the bound.
    bound
        Result of a bound on the same time steps.
    scenario
        What the tracks were drawn from: says where the position is in a state, and what the prior's mean is.
    covariance
        [runs, steps+1, state, state] as the filter believes, for estimates of whole states: gives
        ``result.diagnostics["nees"]``, one if consistent.
    name
        Name in tables and figures.
    sees
        What the filter is told: ``("ranges",)``, or ``("ranges", "sight")`` if it knows which links are LOS.

    Returns
    -------
    Score

    Raises
    ------
    InputError
        If shapes do not match, numbers are missing or not finite, or estimates look like another unit.
    RefusedError
        If the bound does not hold for such a filter.

    Examples
    --------
    A filter that always answers with the true position, give or take a metre, would be too good to be true:

    >>> import numpy as np, locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=10)
    >>> truth = lb.simulate(scenario, runs=200, seed=1).states[..., :2]
    >>> estimates = truth + np.random.default_rng(0).normal(size=truth.shape)
    >>> print(lb.score(estimates, truth, lb.bcrb(scenario)).verdict[:37])
    own filter is BELOW the bound BCRB by
    """
    seen = frozenset(sees)
    if isinstance(sees, str) or not seen <= frozenset(SEEN) or "ranges" not in seen:
        raise InputError(
            f"the filter sees {sees!r}",
            'Give ("ranges",), and "sight" or "future-ranges" with it if the filter sees these',
        )
    if not isinstance(bound, Result):
        raise InputError(f"the bound is {type(bound).__name__}", "Give the result of a bound, such as bcrb(scenario)")
    steps = len(bound.time_s) - 1
    true = _truth(truth.states if isinstance(truth, Draws) else truth, steps, scenario)
    mean = _estimates(estimates, true, steps, scenario)
    place, true_place = _positions(mean, scenario), _positions(true, scenario)
    refuse_other_units(place, true_place)
    error = np.linalg.norm(place - true_place, axis=-1)
    squares, consistency = np.full_like(np.asarray(bound.covariance), np.nan), None
    if mean.shape[-1] == true.shape[-1] == squares.shape[-1]:
        e = mean - true
        squares = np.matmul(e.transpose(1, 2, 0), e.transpose(1, 0, 2)) / len(e)
        if covariance is not None:
            consistency = normalised_square(e, _covariance(covariance, e.shape))
    elif covariance is not None:
        raise InputError("a covariance needs estimates and truth of whole states", "Give both, and the scenario")
    result = result_of_errors(
        error,
        np.asarray(bound.time_s),
        squares,
        consistency,
        name=name,
        sees=seen,
        seed=0,
        how="estimates made elsewhere",
        warnings=_blind(error, true_place, scenario),
        truth=scenario,
    )
    efficiency = result.efficiency(bound)
    return Score(result, bound, efficiency, verdict(result, bound, efficiency))


def verdict(result: Result, bound: Result, efficiency: Efficiency) -> str:
    """What an efficiency means, in one sentence."""
    who = f"{result.name} is"
    if efficiency.low > 1:
        return (
            f"{who} BELOW the bound {bound.name} by more than chance explains (efficiency {efficiency}): it sees more "
            f"than {', '.join(sorted(result.sees))} up to the present step, or these tracks are not drawn from the "
            "bound's scenario"
        )
    if efficiency.high >= 1:
        return (
            f"{who} as good as any filter can be, as far as {len(result.diagnostics['error_m']):,} runs can tell: "
            f"efficiency {efficiency} against {bound.name}"
        )
    return (
        f"{who} {'close to' if efficiency.value > 0.9 else 'above'} the bound {bound.name}: efficiency {efficiency}; a "
        f"better filter could save at most {1 - efficiency.low:.0%} of its mean square error"
    )


def _array(values: Any, what: str) -> Float[Array, "..."]:
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"the {what} are not an array of numbers", "Give one, [runs, steps+1, space]") from None
    if array.ndim != 3:
        hint = "; for one run add an axis in front: x[None]" if array.ndim == 2 else ""
        raise InputError(f"the {what} have the shape {array.shape}", f"Give three axes, [runs, steps+1, space]{hint}")
    return array


def _sizes(scenario: Scenario | None) -> tuple[int, ...]:
    return (2, 3) if scenario is None else (scenario.dim, scenario.motion.state_size)


def _components(size: int, what: str, scenario: Scenario | None) -> None:
    if size in _sizes(scenario):
        return
    if scenario is None:
        raise InputError(
            f"the {what} have {size} components", "Give positions (2 or 3 components), or whole states and scenario=..."
        )
    dim, state = _sizes(scenario)
    raise InputError(
        f"the {what} have {size} components",
        f"Give positions ({dim}) or states ({state}: {', '.join(scenario.motion.state_names)})",
    )


def _truth(values: Any, steps: int, scenario: Scenario | None) -> Float[Array, "runs times n"]:
    true = _array(values, "true positions")
    _components(true.shape[2], "true positions", scenario)
    if true.shape[1] != steps + 1:
        raise InputError(
            f"the truth has {true.shape[1]} times, the bound {steps + 1} (steps 0..{steps})",
            "Compute the bound for the scenario that the tracks were drawn from",
        )
    if len(true) < 2:
        raise InputError("the truth has one run", "Give at least two; hundreds for a useful interval")
    _finite(true, "truth", first=0)
    return true


def _estimates(values: Any, true: Array, steps: int, scenario: Scenario | None) -> Float[Array, "runs times n"]:
    mean = _array(values, "estimates")
    _components(mean.shape[2], "estimates", scenario)
    if scenario is None and mean.shape[2] != true.shape[2]:
        raise InputError(
            f"the estimates have {mean.shape[2]} components, the truth {true.shape[2]}", "Give positions in both"
        )
    if len(mean) != len(true):
        swapped = mean.shape[:2] in ((steps, len(true)), (steps + 1, len(true)))
        raise InputError(
            f"there are estimates of {len(mean):,} runs, but {len(true):,} true tracks",
            "The axes are [runs, steps, components]: swap the first two"
            if swapped
            else "Give one estimate per run and step, of the same runs in the same order",
        )
    if mean.shape[1] not in (steps, steps + 1):
        raise InputError(
            f"the estimates have {mean.shape[1]} steps, the bound the steps 0..{steps}",
            f"Give {steps + 1} rows per run, or {steps} without step 0",
        )
    _finite(mean, "estimates", first=steps + 1 - mean.shape[1])
    if mean.shape[1] == steps:
        full = true[:, 0].mean(0) if scenario is None else np.asarray(scenario.prior.mean)
        start = full if len(full) == mean.shape[2] else _positions(full, scenario)
        mean = np.concatenate([np.broadcast_to(start, (len(mean), 1, len(start))), mean], axis=1)
    return mean


def _finite(values: Array, what: str, *, first: int) -> None:
    bad = np.argwhere(~np.isfinite(values).all(-1))
    if len(bad):
        run, step = bad[0]
        more = f" (and {len(bad) - 1:,} more)" if len(bad) > 1 else ""
        raise InputError(
            f"the {what} at run {run}, step {step + first}{more} are not finite",
            "A filter always has an answer: repeat its last estimate where it broke down, and let the error count",
        )


def _positions(values: Array, scenario: Scenario | None) -> Float[Array, "*n space"]:
    whole = scenario is not None and values.shape[-1] != scenario.dim
    return np.asarray(scenario.motion.position(values)) if scenario is not None and whole else np.asarray(values)


def _covariance(values: Any, shape: tuple[int, ...]) -> Float[Array, "runs times state state"]:
    spread = np.asarray(values, dtype=float)
    if spread.shape != (*shape, shape[-1]):
        raise InputError(f"the covariances have the shape {spread.shape}", f"Give {(*shape, shape[-1])}")
    return spread


def refuse_other_units(place: Array, true: Array) -> None:
    """Raise an InputError where estimates agree with the truth only in another unit, or with swapped coordinates."""
    moved = np.median(np.linalg.norm(place - true, axis=-1)[:, 1:])
    left = {unit: np.median(np.linalg.norm(place / f - true, axis=-1)[:, 1:]) for unit, f in UNITS.items()}
    best = min(left, key=lambda unit: left[unit])
    if left[best] < CLOSER * moved:
        raise InputError(f"the estimates look like {best}, the truth is in metres", "Convert them to metres")
    swapped = place[..., [1, 0, *range(2, place.shape[-1])]]
    if np.median(np.linalg.norm(swapped - true, axis=-1)[:, 1:]) < CLOSER * moved:
        raise InputError("the estimates have x and y swapped", "Order them as in the truth: x, y")


@double_precision
def _blind(error: Array, true: Array, scenario: Scenario | None) -> tuple[str, ...]:
    """A warning where estimates are worse than never looking at the ranges."""
    if scenario is None:
        return ()
    state, places = np.asarray(scenario.prior.mean), []
    for F in [np.eye(len(state)), *np.asarray(scenario.transition)]:
        state = F @ state
        places.append(state)
    predicted = np.asarray(scenario.motion.position(np.stack(places)))
    blind = float(np.mean(np.sum((true - predicted) ** 2, -1)))
    if np.mean(error**2) <= blind:
        return ()
    return (
        f"worse than never looking at the ranges ({np.sqrt(blind):.3g} m): do the runs come in the order of the truth, "
        "from the same seed, and in the same coordinates?",
    )
