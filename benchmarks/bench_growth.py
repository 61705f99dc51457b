"""How the cost of ``bcrb`` grows: with steps, anchors, modes and samples; exponents of power laws fitted to warm times.

Each sweep doubles one size and keeps the others. An exponent is the slope
of log seconds over log size between the two largest sizes (what growth is heading for) and over all of them.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

import locbounds as lb

REPEATS = 5
SAMPLES = 2_048


def scenario(*, steps: int = 50, anchors: int = 3, modes: int = 2, chain: str | None = None) -> lb.Scenario:
    """Every anchor with noises of its own, so that no two links share draws; modes ever later."""
    rng = np.random.default_rng(1)
    stay = 0.9 * np.eye(modes) + 0.1 / (modes - 1) * (1 - np.eye(modes))
    sight = lb.MarkovSight(np.full(modes, 1 / modes), stay)
    links = []
    for m in range(anchors):
        noises = tuple(lb.Gaussian(300.0 * r, 150.0 + 10 * m + 80 * r) for r in range(modes))
        links.append(lb.Link(f"a{m}", lb.Range(rng.uniform(-5000, 5000, 2)), sight, noises, chain=chain))
    prior = lb.GaussianPrior([500.0, 500.0, 5.0, 5.0], np.diag([2500.0, 2500.0, 4.0, 4.0]))
    times = lb.Times.uniform(step_s=0.2, steps=steps)
    return lb.Scenario("growth", times, lb.ConstantVelocity(0.5), prior, links)


def seconds(run: Callable[[int], object]) -> float:
    """Median of warm runs; the first one compiles."""
    run(0)
    out = []
    for seed in range(1, REPEATS + 1):
        start = time.perf_counter()
        run(seed)
        out.append(time.perf_counter() - start)
    return float(np.median(out))


def bound(s: lb.Scenario, samples: int = SAMPLES) -> Callable[[int], object]:
    return lambda seed: lb.bcrb(s, samples=samples, window=12, seed=seed)


def main(scale: int = 1) -> None:
    sweeps: dict[str, tuple[list[int], Callable[[int], Callable[[int], object]]]] = {
        "steps": ([50, 100, 200, 400], lambda n: bound(scenario(steps=n))),
        "anchors, distinct chains": ([2, 4, 8, 16], lambda n: bound(scenario(anchors=n))),
        "samples": ([4096, 8192, 16384, 32768], lambda n: bound(scenario(), n)),
        "modes, general engine": ([2, 4, 8, 16], lambda n: bound(scenario(steps=20, anchors=2, modes=n, chain="door"))),
        "steps, general engine": ([25, 50, 100, 200], lambda n: bound(scenario(steps=n, anchors=2, chain="door"))),
        "samples, general engine": (
            [4096, 8192, 16384, 32768],
            lambda n: bound(scenario(steps=20, anchors=2, chain="door"), n),
        ),
    }
    print(f"bcrb, window of 12 steps, {SAMPLES} samples, 3 anchors, 50 steps and 2 modes unless said otherwise")
    print("the general engine: 2 anchors on one chain, 20 steps")
    for name, (sizes, run) in sweeps.items():
        sizes = [scale * n for n in sizes] if name != "modes, general engine" else sizes
        t = np.array([seconds(run(n)) for n in sizes])
        x = np.log(sizes)
        slope = np.polyfit(x, np.log(t), 1)[0]
        last = np.log(t[-1] / t[-2]) / (x[-1] - x[-2])
        row = ", ".join(f"{n}: {s:.3f} s" for n, s in zip(sizes, t, strict=True))
        print(f"{name:26s} exponent {slope:.2f} (last doubling {last:.2f}); {row}", flush=True)


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
