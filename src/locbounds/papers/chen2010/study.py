"""The computations of the study."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds import AlongTrack, Gaussians, known_sight
from locbounds.bounds.conditional import conditional_recursion
from locbounds.errors import InputError
from locbounds.evaluation import evaluate_on
from locbounds.filters import EkfBanks, ImmKf, OracleEkf, Rbpf
from locbounds.papers.chen2010.setting import LASTS, MATCHED_STAY, STAY, scenario, schedule
from locbounds.precision import double_precision
from locbounds.result import Result
from locbounds.scenario import Scenario
from locbounds.simulation import Draws, simulate

RUNS = 400
BOUND_SAMPLES = 4096
PARTICLES = 100
TRACKS_AT_ONCE = 100


class Setting(NamedTuple):
    """A filter's result under one assumed chain."""

    method: str
    stay: float
    result: Result


class Evaluator(NamedTuple):
    """The bound with the expectation taken in one way."""

    name: str
    total_m: Float[Array, " times"]


class Study(NamedTuple):
    """Everything that was computed.

    Attributes
    ----------
    results
        By the method's name in the files; the filters assume the chain as printed.
    settings
        Further filters and the matched chain.
    evaluators
        The bound in four ways.
    along_tracks
        The bound along each drawn track, [steps+1, runs] m.
    typical
        Number of the track whose average bound is the median; the evaluators that need one track use it.
    """

    results: dict[str, Result]
    settings: list[Setting]
    evaluators: list[Evaluator]
    along_tracks: Float[Array, "times runs"]
    typical: int

    @property
    def segments(self) -> int:
        """Length of a segment in steps: one period of the schedule."""
        return (len(self.along_tracks) - 1) // 8


def study(
    *,
    runs: int = RUNS,
    seed: int = 0,
    steps: int = 8 * LASTS,
    samples: int = BOUND_SAMPLES,
    announce: Callable[[str], None] | None = None,
) -> Study:
    """Draw tracks with the sight of Table 1, run all filters on them, and compute the bound in all ways.

    Parameters
    ----------
    runs
        Tracks, each with its own trajectory, ranges and particles; the paper has 50 of one trajectory.
    seed
        Seed of all random numbers.
    steps
        Samples of a track; the paper's are 1600.
    samples
        Tracks that the bound averages over.
    announce
        Called with the name of every piece of work before it starts.

    Examples
    --------
    >>> study(runs=1)
    Traceback (most recent call last):
        ...
    locbounds.errors.InputError: the number of runs is 1. Give a whole number of at least 2
    """
    if runs < 2 or int(runs) != runs:
        raise InputError(f"the number of runs is {runs}", "Give a whole number of at least 2")
    say = announce or (lambda what: None)
    truth = scenario(steps=steps).with_known_sight(schedule(steps=steps))
    say(f"drawing {runs:,} tracks")
    draws = simulate(truth, runs=runs, seed=seed)
    say("the bound")
    bound = known_sight(truth, samples=samples, seed=seed)

    def run(name: str, filter: Any, stay: float) -> Result:
        say(f"{name}, stay {stay:g}")
        return evaluate_on(filter, scenario(stay, steps=steps), draws, seed=seed, name=name)

    filters = {
        "IMM-KF": ImmKf(weighted=False, covariance=False),
        "EKF banks": EkfBanks(covariance=False),
        "RBPF": Rbpf(PARTICLES, covariance=False),
    }
    printed = {name: run(name, filter, STAY) for name, filter in filters.items()}
    oracle = run("oracle", OracleEkf(covariance=False), STAY)
    further = {"IMM-KF weighted": ImmKf(covariance=False)}
    settings = [Setting(name, STAY, r) for name, r in printed.items()]
    settings += [Setting(name, STAY, run(name, filter, STAY)) for name, filter in further.items()]
    settings += [
        Setting(name, MATCHED_STAY, run(name, filter, MATCHED_STAY)) for name, filter in (filters | further).items()
    ]
    say("the bound along tracks")
    along = along_every_track(truth, draws)
    typical = int(np.argsort(along.mean(0))[runs // 2])
    return Study(
        {"known-sight": bound, **printed, "oracle": oracle},
        settings,
        _evaluators(truth, draws, typical, bound),
        along,
        typical,
    )


@double_precision
def along_every_track(scenario: Scenario, draws: Draws) -> Float[Array, "times runs"]:
    """The bound sqrt(C11 + C22) along each of the drawn tracks in metres, [steps+1, runs]."""
    index = np.array(scenario.motion.position_index)
    precision = [np.array([float(noise.information()) for noise in link.noises]) for link in scenario.links]
    parts = []
    for begin in range(0, len(draws.states), TRACKS_AT_ONCE):
        place = scenario.motion.position(draws.states[begin : begin + TRACKS_AT_ONCE, 1:])
        J = 0.0
        for m, (anchor, of_mode) in enumerate(zip(scenario.anchors, precision, strict=True)):
            u = place - anchor
            u = u / np.linalg.norm(u, axis=-1, keepdims=True)
            weight = of_mode[draws.sight[begin : begin + TRACKS_AT_ONCE, :, m]]
            J = J + np.einsum("rk,rka,rkb->kabr", weight, u, u)
        mse = conditional_recursion(scenario, jnp.asarray(J), lambda P: P[index, index].sum(0))
        parts.append(np.sqrt(np.asarray(mse)))
    return np.concatenate(parts, axis=1)


def _evaluators(truth: Scenario, draws: Draws, typical: int, bound: Result) -> list[Evaluator]:
    one = Draws(*(a[typical : typical + 1] for a in draws))

    def value(expectation: AlongTrack | Gaussians) -> Array:
        return known_sight(truth, expectation=expectation).position_rmse.values

    def of_filter(printed_gain: bool) -> Array:
        found = OracleEkf(printed_gain=printed_gain)(truth, one.measurements, sight=one.sight)
        return value(Gaussians(found.mean[0], np.asarray(found.covariance)[0]))

    return [
        Evaluator("prior Monte Carlo: the Bayesian bound", bound.position_rmse.values),
        Evaluator("along one true track", value(AlongTrack(truth.motion.position(one.states[0])))),
        Evaluator("EKF + sigma points on it, corrected gain", of_filter(False)),
        Evaluator("EKF + sigma points on it, gain as printed", of_filter(True)),
    ]


def paired(a: Result, b: Result, first_step: int = 1) -> tuple[float, float]:
    """RMSE of filter b minus that of filter a on the same runs, and the standard error of the difference, in metres."""
    squares = [np.square(np.asarray(r.diagnostics["error_m"])[:, first_step:]).mean(axis=1) for r in (a, b)]
    rmse = [np.sqrt(s.mean()) for s in squares]
    slope = squares[1] / (2 * rmse[1]) - squares[0] / (2 * rmse[0])  # delta method
    return float(rmse[1] - rmse[0]), float(np.std(slope, ddof=1) / np.sqrt(len(slope)))


def overall(result: Result, steps: slice = slice(1, None)) -> tuple[float, float]:
    """Position RMSE over runs and these steps in metres, with its standard error."""
    value = float(np.sqrt(np.mean(np.asarray(result.position_mse)[steps])))
    each = np.asarray(result.replicates)[:, steps].mean(axis=1)
    groups = len(each)
    error = np.sqrt(np.sum(each**2) / (groups * (groups - 1))) if groups > 1 else 0.0
    return value, float(error / (2 * value))
