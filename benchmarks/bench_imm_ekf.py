"""IMM-EKF over eight joint modes, 20,000 tracks of 100 steps, beside FilterPy's IMM of the same eight EKFs.

Run with ``python benchmarks/bench_imm_ekf.py [tracks]``; both sides filter the same ranges of Fritsche et al. 2013, on
this machine, one after the other.
"""

import sys
import time

import filterpy.kalman as kalman
import numpy as np

import locbounds as lb

FILTERPY_TRACKS = 3
REPEATS = 5


def filterpy_imm(scenario: lb.Scenario, z: np.ndarray) -> np.ndarray:
    """One track through FilterPy; state estimates [steps, 4]."""
    anchors, stay = scenario.anchors, np.asarray(scenario.links[0].sight.transitions(scenario.times.intervals))[0]
    dt = scenario.times.intervals[0]
    F = np.kron([[1.0, dt], [0.0, 1.0]], np.eye(2))
    Q = 0.5 * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(2))
    bias, std = np.array([0.0, 513.0]), np.array([150.0, np.hypot(150.0, 409.0)])

    def jacobian(x):
        offset = x[:2] - anchors
        return np.hstack([offset / np.linalg.norm(offset, axis=1)[:, None], np.zeros((3, 2))])

    class RangeEkf(kalman.ExtendedKalmanFilter):
        bias: np.ndarray = np.zeros(3)

        def update(self, z):
            super().update(z, HJacobian=jacobian, Hx=lambda x: np.linalg.norm(x[:2] - anchors, axis=1) + self.bias)

    filters, T = [], np.ones((1, 1))
    for joint in np.ndindex(2, 2, 2):
        f = RangeEkf(dim_x=4, dim_z=3)
        f.x, f.P = np.array(scenario.prior.mean), np.array(scenario.prior.covariance)
        f.F, f.Q = F, Q  # pyright: ignore
        f.bias, f.R = bias[list(joint)], np.diag(std[list(joint)] ** 2)
        filters.append(f)
    for _ in range(3):
        T = np.kron(T, stay)
    imm = kalman.IMMEstimator(filters, np.full(8, 1 / 8), T)
    estimates = []
    for ranges in z:
        imm.predict(0)
        imm.update(ranges)
        estimates.append(imm.x.copy())
    return np.array(estimates)


def main(tracks: int = 20_000) -> None:
    scenario = lb.papers.fritsche2013.scenario(0.9)
    draws = lb.simulate(scenario, runs=tracks, seed=1)
    z = draws.measurements

    start = time.perf_counter()
    theirs = np.array([filterpy_imm(scenario, track) for track in z[:FILTERPY_TRACKS]])
    filterpy_rate = FILTERPY_TRACKS / (time.perf_counter() - start)
    print(f"FilterPy, IMM of 8 EKFs     {filterpy_rate:12.1f} tracks/s")

    oracle = lb.OracleEkf(covariance=False)
    for name, run in (
        ("IMM-EKF, means only", lambda: lb.ImmEkf(covariance=False)(scenario, z)),
        ("IMM-EKF, with covariances", lambda: lb.ImmEkf()(scenario, z)),
        ("IMM-EKF factorised, means", lambda: lb.FactorisedImmEkf(covariance=False)(scenario, z)),
        ("IMM-KF, means", lambda: lb.ImmKf(covariance=False)(scenario, z)),
        ("Oracle EKF, means", lambda: oracle(scenario, z, 0, draws.sight)),
    ):
        start = time.perf_counter()
        mean = run().mean
        first = time.perf_counter() - start
        warm = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            run()
            warm.append(time.perf_counter() - start)
        rate = tracks / min(warm)
        print(f"{name:27s} {rate:12.0f} tracks/s, {rate / filterpy_rate:8.0f} x FilterPy, first call {first:.1f} s")
        if name.startswith("IMM-EKF, "):
            print(f"    largest difference to FilterPy {np.abs(mean[: len(theirs), 1:] - theirs).max():.1e} m")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
