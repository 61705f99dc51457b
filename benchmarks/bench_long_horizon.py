"""The bound at every step for 100 anchors with different chains over 10,000 steps: seconds, memory, precision.

Run with ``python benchmarks/bench_long_horizon.py [steps] [anchors] [samples]``. No alternative exists: enumerating the
joint sight of 100 anchors takes 2^100 modes, and the information matrix of all positions has 20,000 rows. Slopes with
steps and anchors are measured first, on smaller scenarios.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import locbounds as lb

AREA_M = 2000.0  # anchors lie in a square of twice this side
STEP_S = 0.2


def scenario(steps: int, anchors: int, seed: int = 0) -> lb.Scenario:
    """Anchors spread over a square, stay probabilities from 0.8 to 0.95, a mobile that remains in the middle.

    The velocity forgets in 30 s and the position is pulled back in 200 s, so that tracks spread by some hundred metres
    however long they are.
    """
    rng = np.random.default_rng(seed)
    place, stay = rng.uniform(-AREA_M, AREA_M, (anchors, 2)), np.linspace(0.8, 0.95, anchors)
    one = np.array([[1 - STEP_S / 200, STEP_S], [0.0, np.exp(-STEP_S / 30)]])
    noise = 0.5 * np.array([[STEP_S**3 / 3, STEP_S**2 / 2], [STEP_S**2 / 2, STEP_S]])
    F, Q = (np.broadcast_to(np.kron(a, np.eye(2)), (steps, 4, 4)) for a in (one, noise))
    noises = (lb.Gaussian(0.0, 150.0), lb.Gaussian(513.0, 436.0))
    return lb.Scenario(
        "many anchors, long",
        lb.Times.uniform(step_s=STEP_S, steps=steps),
        lb.LinearMotion(F, Q),
        lb.GaussianPrior([0.0, 0.0, 0.0, 0.0], np.diag([2500.0, 2500.0, 4.0, 4.0])),
        [lb.Link(f"a{m}", lb.Range(place[m]), lb.MarkovSight.stay(stay[m]), noises) for m in range(anchors)],
    )


def measure(steps: int, anchors: int, samples: int) -> tuple[float, float, lb.Result]:
    """Seconds and CPU seconds of a second run, when kernels are compiled, and its result."""
    model = scenario(steps, anchors)
    lb.bcrb(model, samples=1, window=2, engine="corrected")
    start, cpu = time.perf_counter(), time.process_time()
    bound = lb.bcrb(model, samples=samples, window=2, engine="corrected", seed=1)
    return time.perf_counter() - start, time.process_time() - cpu, bound


def main(steps: int = 10_000, anchors: int = 100, samples: int = 16) -> None:
    for K, M in ((steps // 20, anchors), (steps // 10, anchors), (steps // 20, anchors // 2), (steps, anchors)):
        seconds, cpu, bound = measure(K, M, samples)
        relative = (bound.position_rmse_stderr / bound.position_rmse).values[1:]
        print(
            f"{M} anchors, {K:,} steps, {bound.provenance.samples} paths per anchor: {seconds:.1f} s "
            f"({cpu:.1f} s CPU), mean RMSE {bound.mean_position_rmse():.3f} "
            f"+- {bound.mean_position_rmse_stderr():.3f} m, relative s.e. of a step {np.median(relative):.4f} "
            f"(largest {relative.max():.4f}), truncation {bound.diagnostics['truncation']:.4f}",
            flush=True,
        )
    memory(steps, anchors)


def memory(steps: int, anchors: int) -> None:
    """Peak of whole processes: one that compiles, and one that finds the kernels in JAX's cache."""
    with tempfile.TemporaryDirectory() as cache:
        own = {"JAX_COMPILATION_CACHE_DIR": cache, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
        for what in ("kernels compiled", "kernels from JAX's cache"):
            command = [sys.executable, __file__, "peak", str(steps), str(anchors)]
            done = subprocess.run(command, env=os.environ | own, check=True, capture_output=True, text=True)
            print(f"peak memory of a process with {steps:,} steps, {what}: {done.stdout.strip()}", flush=True)


def peak(steps: int, anchors: int) -> None:
    """Compute once; print the peak memory of this process (getrusage would report its parent's, if larger)."""
    lb.bcrb(scenario(steps, anchors), samples=16, window=2, engine="corrected")
    high_water = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    print(f"{int(high_water[1]) / 1e3:.0f} MB" if high_water else "unknown")


if __name__ == "__main__":
    if sys.argv[1:2] == ["peak"]:
        peak(*(int(a) for a in sys.argv[2:]))
    else:
        main(*(int(a) for a in sys.argv[1:]))
