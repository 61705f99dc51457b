"""Fig. 3 three ways: as printed, with noise that is not cut, and with a bound that needs no information."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.blocks import check_seed
from locbounds.errors import InputError
from locbounds.noise import Noise
from locbounds.papers.prieto2011.setting import CASES, STEPS, scenario, trajectory
from locbounds.precision import double_precision
from locbounds.quadrature import standard_error
from locbounds.ranging import (
    DistanceEkf,
    DistanceParticles,
    distance_bcrb,
    distance_wwb,
    evaluate_distance,
)
from locbounds.ranging.bounds import slopes
from locbounds.result import Result

SAMPLES, RUNS, REPEATS = 10_000, 96, 12
COUNTS = (100, 1_000, 10_000, 100_000)  # draws whose effect on the numbers as printed is shown
RANDOM = "toa, random tracks"
VALID, CONDITIONAL, INVALID, ESTIMATOR = "valid", "conditional", "not a bound", "estimator"
PRINTED, REGULAR, WEINSTEIN = "PCRLB as printed", "PCRLB, noise not cut", "Weiss-Weinstein"
EKF, PAPER_EKF, PARTICLES = "EKF", "EKF as printed", "particle filter"
REGULAR_PARTICLES = "particle filter, noise not cut"


class Curve(NamedTuple):
    """One line of Fig. 3: root of the mean square error (or its bound), accumulated over seconds 1..k.

    Attributes
    ----------
    valid
        ``"valid"``, ``"conditional"`` on the trajectory, ``"not a bound"``, or ``"estimator"``.
    """

    case: str
    method: str
    rmse_m: Float[ndarray, " steps"]
    stderr_m: Float[ndarray, " steps"]
    valid: str


class Drift(NamedTuple):
    """What the number as printed does with the number of draws.

    Attributes
    ----------
    information
        Mean over repeats, 1/dB^2 or 1/cycle^2, and their standard deviation.
    growth
        What it grows by per factor of ten, from the slopes of the density at its edges.
    """

    case: str
    draws: int
    information: float
    spread: float
    rmse_m: float
    growth: float


class Setting(NamedTuple):
    """What a reading changes: root mean square of the bound over the trajectory, noise not cut."""

    case: str
    bias: str
    derivatives: str
    rmse_m: float


class Study(NamedTuple):
    """Everything that the outputs are made from.

    Attributes
    ----------
    gains
        By how much the particle filter's RMSE is below a filter's, by case and method, relative, with standard errors
        from the same draws.
    """

    curves: list[Curve]
    drifts: list[Drift]
    settings: list[Setting]
    gains: dict[tuple[str, str], tuple[float, float]]
    stranded: int
    runs: int


@double_precision
def squared_scores(noise: Noise, draws: int, seed: int) -> Float[ndarray, " draws"]:
    """Squared scores at draws of a noise, whose mean the paper takes for the information."""
    return np.asarray(_squares(noise, jax.random.key(seed), draws))


@jax.jit(static_argnums=2)
def _squares(noise, key, draws):
    return noise.score(noise.sample(key, (draws,))) ** 2


def accumulated(mse: Float[ndarray, "*n times"]) -> Float[ndarray, "*n steps"]:
    """Root of the mean over steps 1..k, for every k.

    >>> accumulated(np.array([9.0, 1.0, 7.0]))
    array([1., 2.])
    """
    later = np.asarray(mse)[..., 1:]
    return np.sqrt(np.cumsum(later, -1) / np.arange(1, later.shape[-1] + 1))


def _of(case: str, method: str, result: Result, valid: str) -> Curve:
    root = accumulated(np.asarray(result.position_mse))
    spread = np.asarray(result.replicates)[:, 1:]
    spread = np.cumsum(spread, 1) / np.arange(1, spread.shape[1] + 1) / (2 * root)
    error = np.zeros_like(root) if len(spread) < 2 else np.asarray(standard_error(spread))
    return Curve(case, method, root, error, valid)


def study(
    *,
    samples: int | None = None,
    runs: int | None = None,
    seed: int = 0,
    particles: int = 1_500,
    steps: int = STEPS,
    announce: Callable[[str], None] = lambda text: None,
) -> Study:
    """Run the whole study.

    Parameters
    ----------
    samples
        Draws of the Monte Carlo information as printed; 10,000 by default.
    runs
        Runs of every filter; 96 by default.
    seed
        Of all random numbers.
    particles
        Of the particle filter.
    steps
        Seconds; fewer for a quick look.
    announce
        Told what is being done.
    """
    samples, runs = SAMPLES if samples is None else samples, RUNS if runs is None else runs
    if samples < 2:
        raise InputError(f"the number of samples is {samples}", "Give at least 2")
    check_seed(seed)
    track = trajectory(steps)
    curves, drifts, gains, stranded = [], [], {}, 0
    for case in CASES:
        announce(f"{case}: bounds")
        cut, regular = scenario(case, steps=steps), scenario(case, noise="regular", steps=steps)
        printed, of_case = _printed(case, cut, track, samples, seed)
        curves.append(printed)
        drifts += of_case
        curves.append(_of(case, REGULAR, distance_bcrb(regular, track=track), CONDITIONAL))
        curves.append(_of(case, WEINSTEIN, distance_wwb(cut, track=track), CONDITIONAL))
        announce(f"{case}: filters")
        believed = scenario(case, noise="believed", steps=steps)
        results = {
            EKF: evaluate_distance(DistanceEkf(), cut, runs=runs, seed=seed, track=track),
            PAPER_EKF: evaluate_distance(DistanceEkf(), cut, runs=runs, seed=seed, track=track, believed=believed),
            PARTICLES: evaluate_distance(DistanceParticles(particles), cut, runs=runs, seed=seed, track=track),
        }
        curves += [_of(case, name, result, ESTIMATOR) for name, result in results.items()]
        gains |= {(case, name): gain(results[name], results[PARTICLES]) for name in (EKF, PAPER_EKF)}
        stranded += int(np.sum(results[PARTICLES].diagnostics["stranded"]))
    announce("times of arrival over random tracks")
    cut, regular = scenario("toa", steps=steps), scenario("toa", noise="regular", steps=steps)
    curves.append(_of(RANDOM, REGULAR, distance_bcrb(regular), VALID))
    curves.append(_of(RANDOM, WEINSTEIN, distance_wwb(cut), VALID))
    results = {
        EKF: evaluate_distance(DistanceEkf(), cut, runs=runs, seed=seed),
        PARTICLES: evaluate_distance(DistanceParticles(particles), cut, runs=runs, seed=seed),
        REGULAR_PARTICLES: evaluate_distance(DistanceParticles(particles), regular, runs=runs, seed=seed),
    }
    curves += [_of(RANDOM, name, result, ESTIMATOR) for name, result in results.items()]
    gains[RANDOM, EKF] = gain(results[EKF], results[PARTICLES])
    stranded += sum(int(np.sum(results[name].diagnostics["stranded"])) for name in (PARTICLES, REGULAR_PARTICLES))
    return Study(curves, drifts, settings(steps), gains, stranded, runs)


def gain(worse: Any, better: Any) -> tuple[float, float]:
    """By how much one RMSE over steps 1..K is below another one, relative, with a standard error from paired runs."""
    errors = [np.asarray(r.diagnostics["error_m"])[:, 1:] ** 2 for r in (worse, better)]
    a, b = (e.mean(1) for e in errors)
    ratio = b.mean() / a.mean()
    spread = np.std(b - ratio * a, ddof=1) / np.sqrt(len(a)) / a.mean()
    return float(1 - np.sqrt(ratio)), float(spread / (2 * np.sqrt(ratio)))


def edge_slopes(noise: Noise) -> float:
    """Sum of the slopes with which a density rises from its two ends.

    >>> import locbounds as lb
    >>> edge_slopes(lb.Uniform(0.0, 1.0) + lb.Uniform(0.0, 1.0))
    2.0
    """
    low, high = noise.support()[0]
    found = [s.right if s.place == low else s.left for s in noise.singularities() or () if s.place in (low, high)]
    return float(sum(found))


def _printed(case: str, model, track: ndarray, samples: int, seed: int) -> tuple[Curve, list[Drift]]:
    """The bound with the Monte Carlo information of the cut densities, and how it depends on the draws."""
    steep = slopes(model, track)
    most = max(samples, *COUNTS) if len(model.sensors) == 1 else samples
    squares = [
        np.stack([squared_scores(sensor.error, most, seed * REPEATS + r + 1_000 * m) for r in range(REPEATS)])
        for m, sensor in enumerate(model.sensors)
    ]

    def mse(count: int) -> Float[ndarray, "repeats times"]:
        each = [s[:, :count].mean(1) * sensor.samples for s, sensor in zip(squares, model.sensors, strict=True)]
        J = np.einsum("mr,mk->rk", np.stack(each), steep**2)
        return np.stack([np.asarray(distance_bcrb(model, track=track, given=j).position_mse) for j in J])

    found = accumulated(mse(samples))
    curve = Curve(case, f"{PRINTED}, N = {samples}", found.mean(0), found.std(0, ddof=1), INVALID)
    drifts = []
    if len(model.sensors) == 1:
        edges = edge_slopes(model.sensors[0].error)
        for count in COUNTS:
            mean = squares[0][:, :count].mean(1)
            root = accumulated(mse(count))[:, -1]
            growth = float(edges / 2 * np.log(10))
            drifts.append(Drift(case, count, float(mean.mean()), float(mean.std(ddof=1)), float(root.mean()), growth))
    return curve, drifts


def settings(steps: int = STEPS) -> list[Setting]:
    """Bounds with noise that is not cut, under all readings of bias and prior."""
    rows = []
    for case in CASES:
        for common, bias in ((False, "one per sample"), (True, "one per second")):
            model = scenario(case, noise="regular", common=common, steps=steps)
            for derivatives in ("initial", "every step"):
                bound = distance_bcrb(model, track=trajectory(steps), derivatives=derivatives)
                rows.append(Setting(case, bias, derivatives, float(accumulated(np.asarray(bound.position_mse))[-1])))
    return rows
