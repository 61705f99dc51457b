"""Posterior CRLB for known sight along 1,000 trajectories x 100 steps x 4 anchors, beside Stone Soup's PCRBMetric.

Stone Soup works object by object: it is timed on a few trajectories and scaled linearly. It has no range-only model, so
that it is lent one with an analytic Jacobian. The vectorised NumPy version is the same recursion, written for all
trajectories at once. All three see the same trajectories, and their numbers are asserted to agree.
"""

import sys
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from stonesoup.base import Property
from stonesoup.metricgenerator.pcrbmetric import PCRBMetric
from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.types.array import StateVector, StateVectors
from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
from stonesoup.types.state import GaussianState

import locbounds as lb
from locbounds.bounds.conditional import conditional_recursion

STEPS, DT, INTENSITY, STD = 100, 0.2, 0.5, 150.0
ANCHORS = np.array([[-3000.0, -2000.0], [3000.0, 5000.0], [6000.0, 2000.0], [0.0, -4000.0]])
THEIR_TRAJECTORIES = 4
REPEATS = 15
AGREEMENT = 1e-8  # relative, between three orders of the same operations
ORDER = [0, 2, 1, 3]  # Stone Soup's states: x, vx, y, vy


def known() -> lb.Scenario:
    noises = lb.Gaussian(0.0, STD), lb.Gaussian(513.0, 436.0)
    links = [lb.Link(f"a{m}", lb.Range(a), lb.MarkovSight.stay(0.9), noises) for m, a in enumerate(ANCHORS)]
    prior = lb.GaussianPrior([500.0, 500.0, 5.0, 5.0], np.diag([2500.0, 2500.0, 4.0, 4.0]))
    times, motion = lb.Times.uniform(step_s=DT, steps=STEPS), lb.ConstantVelocity(INTENSITY)
    return lb.Scenario("pcrlb", times, motion, prior, links).with_known_sight(np.zeros(STEPS, int))


class RangeOnly(NonLinearGaussianMeasurement):
    translation_offset: Any = Property(default=None)

    @property
    def ndim_meas(self) -> int:
        return 1

    def function(self, state, noise=False, **kwargs):
        return np.linalg.norm(state.state_vector[self.mapping, :] - self.translation_offset, axis=0)[None]

    def jacobian(self, state, **kwargs):
        offset = (
            np.asarray(state.state_vector, float)[list(self.mapping), 0] - np.asarray(self.translation_offset).ravel()
        )
        H = np.zeros((1, self.ndim_state))
        H[0, list(self.mapping)] = offset / np.hypot(*offset)
        return H


def stonesoup(scenario: lb.Scenario, states: np.ndarray) -> np.ndarray:
    """Position mean square error bounds, [trajectories, steps+1]."""
    start = datetime(2020, 1, 1)
    prior = GaussianState(scenario.prior.mean[ORDER], scenario.prior.covariance[np.ix_(ORDER, ORDER)], timestamp=start)
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(INTENSITY), ConstantVelocity(INTENSITY)])
    paths = [
        GroundTruthPath(
            [
                GroundTruthState(StateVector(x[ORDER]), timestamp=start + timedelta(seconds=DT * k))
                for k, x in enumerate(track)
            ]
        )
        for track in states
    ]
    metric = PCRBMetric(
        prior=prior,
        transition_model=motion,
        measurement_model=RangeOnly(ndim_state=4, mapping=(0, 2), noise_covar=np.array([[STD**2]])),
        sensor_locations=StateVectors(ANCHORS.T),
        position_mapping=(0, 2),
    )

    class Manager:
        states_sets = {"groundtruth_paths": paths}  # noqa: RUF012

    inverse = np.stack([m.value["inverse_j"] for m in metric.compute_metric(Manager())])
    return inverse[:, :, 0, 0] + inverse[:, :, 2, 2]


def vectorised_numpy(scenario: lb.Scenario, F: np.ndarray, Q: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """The covariance recursion for all trajectories at once; positions [trajectories, steps, 2]."""
    offset = positions[:, :, None] - ANCHORS
    u = offset / np.linalg.norm(offset, axis=-1, keepdims=True)
    J = np.swapaxes(u, -1, -2) @ u / STD**2
    P = np.broadcast_to(scenario.prior.covariance, (len(positions), 4, 4))
    out = [P[:, 0, 0] + P[:, 1, 1]]
    for k in range(STEPS):
        P = F @ P @ F.T + Q
        P = P - P[:, :, :2] @ np.linalg.solve(np.eye(2) + J[:, k] @ P[:, :2, :2], J[:, k] @ P[:, :2])
        out.append(P[:, 0, 0] + P[:, 1, 1])
    return np.stack(out, 1)


def warm_seconds(run: Callable[[], object]) -> list[float]:
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        jax.block_until_ready(run())
        seconds.append(time.perf_counter() - start)
    return seconds


def main(trajectories: int = 1_000) -> None:
    scenario = known()
    states = lb.simulate(scenario, runs=trajectories, seed=1).states
    tracks = scenario.motion.position(states)

    start = time.perf_counter()
    theirs = stonesoup(scenario, states[:THEIR_TRAJECTORIES])
    scaled = (time.perf_counter() - start) * trajectories / THEIR_TRAJECTORIES
    print(f"Stone Soup PCRBMetric        {scaled:9.2f} s, scaled from {THEIR_TRAJECTORIES} trajectories")

    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition[0]), np.asarray(scenario.process_noise[0])

        @jax.jit
        def public(tracks):
            def one(track):
                return lb.known_sight(scenario, expectation=lb.AlongTrack(track)).position_mse

            return jax.vmap(one)(tracks)

        @jax.jit
        def kernel(tracks):
            offset = jnp.moveaxis(tracks[:, 1:, None] - ANCHORS, 0, -1)  # [steps, anchors, space, trajectories]
            u = offset / jnp.linalg.norm(offset, axis=2, keepdims=True)
            J = jnp.sum(u[:, :, :, None] * u[:, :, None], 1) / STD**2
            return conditional_recursion(scenario, J, lambda P: P[0, 0] + P[1, 1]).T

        rows = {
            "vectorised NumPy": lambda: vectorised_numpy(scenario, F, Q, tracks[:, 1:]),
            "locbounds, lb.known_sight": lambda: public(tracks),
            "locbounds, recursion alone": lambda: kernel(tracks),
        }
        numpy_s = np.nan
        for name, run in rows.items():
            values = np.asarray(run())
            np.testing.assert_allclose(values[:THEIR_TRAJECTORIES], theirs, rtol=AGREEMENT)
            np.testing.assert_allclose(values, rows["vectorised NumPy"](), rtol=AGREEMENT)
            warm = warm_seconds(run)
            middle = float(np.median(warm))
            numpy_s = middle if name == "vectorised NumPy" else numpy_s
            print(
                f"{name:28s} {middle:9.4f} s (median; min {min(warm):.4f}, max {max(warm):.4f}), "
                f"{scaled / middle:8,.0f} x Stone Soup, {numpy_s / middle:6.2f} x NumPy"
            )


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
