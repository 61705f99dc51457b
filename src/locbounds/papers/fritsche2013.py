"""Fritsche 2013: scenario, Table I and Fig. 1.

C. Fritsche, A. Klein, F. Gustafsson, "Bayesian Cramér-Rao bound for mobile terminal tracking in mixed LOS/NLOS
environments", IEEE Wireless Communications Letters, 2013.
"""

import numpy as np

from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import MarkovSight
from locbounds.times import Times

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
