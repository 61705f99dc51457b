"""The small scenario on which bounds and filters are checked: linear measurements, so that a Kalman filter is exact."""

import jax.numpy as jnp
import numpy as np

from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import MarkovSight
from locbounds.times import Times

STEPS = 6
DIRECTIONS = ((0.8, 0.6), (-0.28, 0.96))


class Projection(Range):
    """The coordinate along a direction: what a range to an anchor far away is, but for a constant."""

    def __call__(self, position):
        return jnp.sum(self.anchor * position, axis=-1)


def scenario(*, same_noise: bool = False, reports=None, measurement: type[Range] = Projection) -> Scenario:
    """Two links with different asymmetric chains; with ``same_noise`` LOS and NLOS are one law."""
    noises = ((Gaussian(0.0, 3.0), Gaussian(8.0, 7.0)), (Gaussian(1.0, 2.0), Gaussian(5.0, 4.0)))
    if same_noise:
        noises = tuple((los, los) for los, _ in noises)
    stays, starts = ((0.9, 0.6), (0.7, 0.95)), ((0.1, 0.9), (0.7, 0.3))
    reports = np.ones((STEPS, 2), bool) if reports is None else reports
    far = 1.0 if measurement is Projection else -1e4
    links = [
        Link(f"a{m}", measurement(far * np.array(DIRECTIONS[m])), MarkovSight.stay(stays[m], starts[m]), noises[m],
             reports[:, m])
        for m in range(2)
    ]  # fmt: skip
    prior = GaussianPrior([5.0, 10.0, 1.0, -1.0], np.diag([64.0, 100.0, 1.0, 4.0]))
    return Scenario("small", Times.uniform(step_s=0.5, steps=STEPS), ConstantVelocity(0.4), prior, links)


def kalman(model: Scenario) -> np.ndarray:
    """Position mean square error of the Kalman filter at steps 0..K, LOS noise everywhere; exact for `Projection`."""
    P = np.asarray(model.prior.covariance)
    found = [P[:2, :2].trace()]
    for k in range(model.steps):
        F, Q = np.asarray(model.transition[k]), np.asarray(model.process_noise[k])
        P = F @ P @ F.T + Q
        for m, link in enumerate(model.links):
            if model.reports[k, m]:
                h = np.concatenate([np.asarray(link.measurement.anchor), np.zeros(2)])
                gain = P @ h / (h @ P @ h + float(link.noises[0].variance))
                P = P - np.outer(gain, h @ P)
        found.append(P[:2, :2].trace())
    return np.array(found)
