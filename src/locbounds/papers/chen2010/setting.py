"""What is simulated: section 4 of the paper, with what it leaves open."""

import numpy as np

from locbounds.axes import Array, Int
from locbounds.errors import InputError
from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import MarkovSight
from locbounds.times import Times

ANCHORS_M = {"bs1": (-10_000.0, 0.0), "bs2": (0.0, 10_000.0), "bs3": (10_000.0, 0.0)}
"""Not in the paper: chosen, with the start below, because the level of the printed quantiles fits."""
START = (0.0, 0.0, 10.0, 0.0)
START_STD = (50.0, 50.0, 2.0, 2.0)
STEP_S, LASTS = 0.5, 200  # one sight condition of Table 1 lasts 200 samples
LOS_STD_M, NLOS_MEAN_M, NLOS_STD_M = 150.0, 513.0, 409.0
ACCELERATION_VARIANCE = 0.5  # (m/s^2)^2; the paper writes m/s^2
SCHEDULE = {"bs1": (1, 0, 0, 0, 0, 0, 0, 0), "bs2": (0,) * 8, "bs3": (0, 1, 1, 0, 0, 0, 0, 0)}
"""Table 1: sight in each of eight periods of 200 samples, 0 = LOS, 1 = NLOS."""
STAY = 0.85
"""As printed: the filters' probability of keeping the sight over one sample."""
MATCHED_STAY = 1.0 - (1.0 - STAY) / LASTS
"""The same chain where it may change every 200 samples only, as an average over samples."""
PUBLISHED_BOUND_M = {0.67: 31.9, 0.95: 32.9}
"""Quantiles of the bound's values over time, as printed."""
PUBLISHED_RANGE_M = (30.0, 32.9)


def scenario(stay: float = STAY, *, steps: int = LASTS * 8) -> Scenario:
    """What the filters assume: a chain with this probability of keeping the sight over one sample.

    Parameters
    ----------
    stay
        0.85 as printed, or :data:`MATCHED_STAY`.
    steps
        Number of samples; the paper's is 1600.

    Notes
    -----
    Positions of the stations, start and prior are not in the paper; see :data:`ANCHORS_M`. The deviations 436 m of its
    section 2 and 409 m of its section 4 agree: ``436^2 = 150^2 + 409^2``.

    Examples
    --------
    >>> scenario(steps=2).steps, [link.name for link in scenario(steps=2).links]
    (2, ['bs1', 'bs2', 'bs3'])
    """
    noises = (Gaussian(0.0, LOS_STD_M), Gaussian(NLOS_MEAN_M, np.hypot(LOS_STD_M, NLOS_STD_M)))
    sight = MarkovSight.stay(stay, start=(0.5, 0.5))
    return Scenario(
        title="Three base stations, LOS/NLOS ranges, sight of Table 1",
        times=Times.uniform(step_s=STEP_S, steps=steps),
        motion=ConstantVelocity(ACCELERATION_VARIANCE, discrete=True),
        prior=GaussianPrior(START, np.diag(np.square(START_STD))),
        links=[Link(name, Range(anchor), sight, noises) for name, anchor in ANCHORS_M.items()],
    )


def schedule(
    periods: dict[str, tuple[int, ...]] = SCHEDULE, *, steps: int = LASTS * 8
) -> dict[str, Int[Array, " steps"]]:
    """Sight of every station at steps 1..K from one entry per period, for :meth:`Scenario.with_known_sight`.

    Parameters
    ----------
    periods
        Per station, 0 = LOS, 1 = NLOS; all periods last equally long.
    steps
        Number of samples, a multiple of the number of periods.

    Raises
    ------
    InputError
        If the steps are no multiple of the periods.

    Examples
    --------
    >>> schedule({"bs1": (0, 1)}, steps=4)["bs1"].tolist()
    [0, 0, 1, 1]
    """
    for name, sights in periods.items():
        if not len(sights) or steps % len(sights):
            raise InputError(
                f"{steps} steps cannot be divided into the {len(sights)} periods of {name}",
                f"Give a multiple of {max(len(sights), 1)} steps",
            )
    return {name: np.repeat(np.asarray(sights, dtype=int), steps // len(sights)) for name, sights in periods.items()}


def least_steady_bound(stations: int = 3) -> float:
    """The least possible steady bound sqrt(C11 + C22) in metres with so many LOS stations, for any layout.

    The information of the ranges about the position, ``sum u u^T / sigma^2``, has the trace ``stations / sigma^2``
    whatever the directions u. The trace of the steady covariance is a convex function of it that does not change when
    the axes are turned, so that it is least where both axes get the same half. Each axis then is the alpha-beta filter
    with the measurement variance ``R = 2 sigma^2 / stations``, whose steady position variance is known (Kalata 1984):
    ``(1 - r^2) R`` with ``r = (4 + t - sqrt(8 t + t^2)) / 4`` and the tracking index ``t = sigma_a T^2 / sqrt(R)``.

    Examples
    --------
    >>> round(least_steady_bound(), 2)
    39.61
    """
    R = 2 * LOS_STD_M**2 / stations
    t = np.sqrt(ACCELERATION_VARIANCE / R) * STEP_S**2
    r = (4 + t - np.sqrt(8 * t + t**2)) / 4
    return float(np.sqrt(2 * (1 - r**2) * R))
