"""Fritsche 2013: scenario, Table I and Fig. 1.

C. Fritsche, A. Klein, F. Gustafsson, "Bayesian Cramér-Rao bound for mobile terminal tracking in mixed LOS/NLOS
environments", IEEE Wireless Communications Letters, 2013.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from locbounds.bounds import bcrb, enumer
from locbounds.evaluation import evaluate_on
from locbounds.filters import ImmEkf, ImmKf
from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian
from locbounds.priors import GaussianPrior
from locbounds.report import plot
from locbounds.report.tables import csv_text
from locbounds.result import Result
from locbounds.scenario import Link, Scenario
from locbounds.sight import MarkovSight
from locbounds.simulation import simulate
from locbounds.times import Times

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ANCHORS_M = ((-3000.0, -2000.0), (3000.0, 5000.0), (6000.0, 2000.0))
STAY = (0.6, 0.7, 0.8, 0.9, 0.95)
TABLE1_M = {
    "IMM-KF": (61.6, 61.1, 60.6, 59.7, 59.4),
    "IMM-EKF": (54.6, 54.4, 53.9, 52.2, 51.5),
    "BCRB": (53.8, 53.5, 52.7, 51.3, 50.3),
    "Enumer-BCRB": (48.9, 49.0, 49.2, 49.5, 50.1),
}
"""Table I as published: position RMSE in metres averaged over steps 0..100, by stay probability."""


def scenario(stay: float = 0.9, *, steps: int = 100) -> Scenario:
    """The simulation scenario of section V.

    Parameters
    ----------
    stay
        Probability that a link keeps its sight over one step of 0.2 s, the same for LOS and NLOS.
    steps
        Number of steps; the paper's is 100.

    Examples
    --------
    >>> scenario().anchors.tolist()
    [[-3000.0, -2000.0], [3000.0, 5000.0], [6000.0, 2000.0]]
    """
    noises = (Gaussian(0.0, 150.0), Gaussian(513.0, np.hypot(150.0, 409.0)))
    sight = MarkovSight.stay(stay, start=(0.5, 0.5))
    return Scenario(
        title="Mobile terminal, three base stations, LOS/NLOS ranges",
        times=Times.uniform(step_s=0.2, steps=steps),
        motion=ConstantVelocity(0.5),
        prior=GaussianPrior([500, 500, 5, 5], np.diag([50.0**2, 50.0**2, 2.0**2, 2.0**2])),
        links=[Link(f"bs{i}", Range(anchor), sight, noises) for i, anchor in enumerate(ANCHORS_M, start=1)],
    )


FIG1_STAY = 0.9
RUNS = 10_000  # tracks per filter; the paper averages over 20,000
TABLE1_COLUMNS = ("method", "stay", "published_m", "computed_m", "stderr_m")
FIG1_COLUMNS = ("method", "step", "position_rmse_m", "stderr_m")
REMARKS = (
    "The average over time includes step 0, the prior (70.7 m); over steps 1..100 every entry is about 0.2 m lower.",
    "The published BCRB entries lie about 0.1 m above converged values; the cause is open.",
    "The paper cites its two filters without giving them; both are reconstructed here.",
)


class Stopped(Exception):  # noqa: N818 - not an error: nobody waits for the column any more
    """Ends a column of the study whose consumer has gone."""


class Cell(NamedTuple):
    """One entry of Table I: published, computed and its standard error, in metres."""

    method: str
    stay: float
    published_m: float
    computed_m: float
    stderr_m: float


def study(
    *,
    samples: int | None = None,
    runs: int = RUNS,
    seed: int = 0,
    announce: Callable[[str], None] | None = None,
) -> Iterator[tuple[float, list[Result]]]:
    """Compute Table I column by column: for every stay probability the results of the four methods.

    Parameters
    ----------
    samples
        Monte Carlo draws of every bound; by default as many as a relative standard error of 1e-3 at every step takes.
    runs
        Tracks for the filters.
    seed
        Seed of all random numbers.
    announce
        Called with the name of every piece of work before it starts.

    Examples
    --------
    >>> stay, results = next(study(samples=2048, runs=200))
    >>> stay, [r.name for r in results]
    (0.6, ['IMM-KF', 'IMM-EKF', 'BCRB', 'Enumer-BCRB'])
    """
    stopped = Event()  # after Ctrl-C running columns end at their next piece of work, not at their own end

    def go_on(*_: object) -> None:
        if stopped.is_set():
            raise Stopped

    def say(what: str) -> None:
        go_on()
        if announce is not None:
            announce(what)

    def filters(stay: float) -> list[Result]:
        model = scenario(stay)
        say(f"stay {stay}: drawing {runs:,} tracks")
        draws = simulate(model, runs=runs, seed=seed)
        results = []
        for filter in (ImmKf(covariance=False), ImmEkf(covariance=False)):
            say(f"stay {stay}: {filter.name}")
            results.append(evaluate_on(filter, model, draws, seed=seed, progress=go_on, truth=model))
        return results

    def bounds(stay: float) -> list[Result]:
        go_on()
        model = scenario(stay)
        return [bound(model, samples=samples, seed=seed, progress=go_on) for bound in (bcrb, enumer)]

    pool = ThreadPoolExecutor(1)  # bounds beside filters: no kernel is compiled twice
    beside = [pool.submit(bounds, stay) for stay in STAY]
    try:
        for stay, later in zip(STAY, beside, strict=True):
            yield stay, [*filters(stay), *later.result()]
    finally:
        stopped.set()
        pool.shutdown(wait=False, cancel_futures=True)


def table1(columns: list[tuple[float, list[Result]]]) -> list[Cell]:
    """Table I, published beside computed, from the columns of :func:`study`."""
    return [
        Cell(
            name,
            stay,
            TABLE1_M[name][STAY.index(stay)],
            float(result.mean_position_rmse()),
            result.mean_position_rmse_stderr(),
        )
        for name in TABLE1_M
        for stay, results in columns
        for result in results
        if result.name == name
    ]


def table1_csv(columns: list[tuple[float, list[Result]]]) -> str:
    """``table1.csv``: one row per method and stay probability."""
    return csv_text(TABLE1_COLUMNS, table1(columns))


def fig1_csv(columns: list[tuple[float, list[Result]]]) -> str:
    """``fig1.csv``: position RMSE at steps 0..100 for a stay probability of 0.9."""
    rows = []
    for result in dict(columns)[FIG1_STAY]:
        values = zip(result.position_rmse.values, result.position_rmse_stderr.values, strict=True)
        rows += [(result.name, step, float(value), float(error)) for step, (value, error) in enumerate(values)]
    return csv_text(FIG1_COLUMNS, rows)


def fig1(columns: list[tuple[float, list[Result]]]) -> "Figure":
    """Fig. 1: position RMSE over the time steps for a stay probability of 0.9."""
    title = "Three base stations, LOS/NLOS ranges, stay probability 0.9"
    return plot.rmse(dict(columns)[FIG1_STAY], title=title, against="step")
