"""Scenarios that the filters are tested on."""

import numpy as np
import pytest

import locbounds as lb

CHAINS = ([[0.9, 0.1], [0.3, 0.7]], [[0.6, 0.4], [0.05, 0.95]], [[0.8, 0.2], [0.5, 0.5]])
STARTS = ([0.7, 0.3], [0.2, 0.8], [0.5, 0.5])


def awkward(dim: int, *, links: int = 3, outliers: bool = False, discrete: bool = False) -> lb.Scenario:
    """Asymmetric chains, noises that differ, a correlated prior; everything that a transposed matrix would show."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(2 * dim, 2 * dim)) * np.repeat([20.0, 1.0], dim)[:, None]

    def noises(m: int):
        los = lb.Gaussian(1.0 * m, 20.0 + 5 * m)
        nlos = lb.GaussianMixture([0.8, 0.2], [60.0, 90.0], [40.0, 200.0]) if outliers else lb.Gaussian(70.0, 60.0)
        return los, nlos

    return lb.Scenario(
        title="awkward",
        times=lb.Times.uniform(step_s=0.7, steps=12),
        motion=lb.ConstantVelocity(0.4, dim=dim, discrete=discrete),
        prior=lb.GaussianPrior(np.repeat([10.0, 2.0], dim), root @ root.T),
        links=[
            lb.Link(f"a{m}", lb.Range(rng.uniform(-300, 300, dim)), lb.MarkovSight(STARTS[m], CHAINS[m]), noises(m))
            for m in range(links)
        ],
    )


def with_gaps(measurements) -> np.ndarray:
    """The measurements with a few missing, and one step without any."""
    z = np.array(measurements)
    z[:, 2] = np.nan
    z[:, 4, 0] = z[:, 5, -1] = np.nan
    return z


@pytest.fixture(scope="module")
def paper():
    """Scenario of Fritsche et al. 2013 at stay 0.9, with tracks."""
    scenario = lb.papers.fritsche2013.scenario(0.9)
    return scenario, lb.simulate(scenario, runs=1024, seed=3)
