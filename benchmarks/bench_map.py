"""The Cramér-Rao bound over a grid, with its circular error probable; growth with points and anchors; a million points.

Run with ``python -m benchmarks map``. The alternative is what one writes today: NumPy, one 2 x 2 inverse per point, and
the CEP by the rule of thumb that is off by up to 10 %, or point by point by solving for the quantile.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

import locbounds as lb

REPEATS = 30
SIDE = 101
EXACT_POINTS = 20  # the quantile point by point is timed at so many


def anchors(n: int) -> np.ndarray:
    """On a circle of 60 m around the area, not quite evenly."""
    angle = 2 * np.pi * np.arange(n) / n + 0.3 * np.sin(np.arange(n))
    return 60 * np.stack([np.cos(angle), np.sin(angle)], -1)


def grid(side: int) -> np.ndarray:
    x = np.linspace(-50, 50, side)
    return np.stack(np.meshgrid(x, x), -1).reshape(-1, 2)


def seconds(run: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float]:
    """Fastest and median warm run; the first one compiles."""
    run()
    out = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        out.append(time.perf_counter() - start)
    return min(out), float(np.median(out))


def ours(plan: lb.Plan, points: np.ndarray) -> Callable[[], object]:
    return lambda: lb.crlb(plan, points).cep()


def numpy_way(places: np.ndarray, points: np.ndarray, std: float) -> np.ndarray:
    """Covariances of TDoA with the first anchor as reference."""
    gap = points[:, None] - places
    unit = gap / np.linalg.norm(gap, axis=-1, keepdims=True)
    H = unit[:, 1:] - unit[:, :1]
    W = np.linalg.inv(std**2 * (np.eye(len(places) - 1) + 1))
    return np.linalg.inv(np.einsum("nia,ij,njb->nab", H, W, H))


def rule_of_thumb(C: np.ndarray) -> np.ndarray:
    return 0.75 * np.sqrt(C[:, 0, 0] + C[:, 1, 1])


def exact_cep(C: np.ndarray) -> float:
    """Of one covariance: the distribution by quadrature over the angle, then a root."""
    b, a = np.linalg.eigvalsh(C)

    def below(r: float) -> float:
        def density(psi: float) -> float:
            v = a * np.cos(psi) ** 2 + b * np.sin(psi) ** 2
            return -np.expm1(-(r**2) / (2 * v))

        return quad(density, 0, np.pi / 2)[0] / (np.pi / 2)

    return float(brentq(lambda r: below(r) - 0.5, 1e-3, 3 * np.sqrt(a)))


def sweep(name: str, sizes: list[int], run: Callable[[int], Callable[[], object]]) -> None:
    t = np.array([seconds(run(n), 10)[0] for n in sizes])
    slope = np.log(t[-1] / t[-2]) / np.log(sizes[-1] / sizes[-2])
    row = ", ".join(f"{n:,}: {1e3 * s:.2f} ms" for n, s in zip(sizes, t, strict=True))
    print(f"{name:8s} last exponent {slope:.2f}; {row}", flush=True)


def main(largest: int = 1000) -> None:
    places, points = anchors(4), grid(SIDE)
    plan = lb.tdoa(places, 2.0)
    best, middle = seconds(ours(plan, points))
    print(
        f"TDoA, 4 anchors, {SIDE} x {SIDE} points, CRLB and exact CEP: {1e3 * best:.2f} ms (median {1e3 * middle:.2f})"
    )
    C = numpy_way(places, points, 2.0)
    theirs, _ = seconds(lambda: rule_of_thumb(numpy_way(places, points, 2.0)))
    found = lb.crlb(plan, points)
    gap = np.abs(np.asarray(found.covariance) / C - 1)[np.abs(C) > 1e-3 * np.trace(C, axis1=1, axis2=2)[:, None, None]]
    off = rule_of_thumb(C) / found.cep() - 1
    print(f"NumPy, CEP by rule of thumb: {1e3 * theirs:.2f} ms; covariances differ by {gap.max():.0e}, ", end="")
    print(f"the rule of thumb is off by {off.min():+.1%} to {off.max():+.1%}")
    index = np.linspace(0, len(points) - 1, EXACT_POINTS).astype(int)
    start = time.perf_counter()
    exact = np.array([exact_cep(C[i]) for i in index])
    total = (time.perf_counter() - start) / EXACT_POINTS * len(points)
    wrong = np.abs(found.cep()[index] / exact - 1).max()
    print(f"exact CEP point by point: {total:.1f} s (from {EXACT_POINTS} points); ours differs by {wrong:.0e}")

    sides = [100, 200, 400, 800]
    plans = {n: lb.tdoa(anchors(n), 2.0) for n in (4, 8, 16, 32, 64)}
    sweep("points", [n * n for n in sides], lambda n: ours(plan, grid(round(n**0.5))))
    sweep("anchors", list(plans), lambda n: ours(plans[n], points))

    many = grid(largest)
    on_anchors = lb.tdoa(np.concatenate([places[:3], many[:1]]), 2.0)  # the corner of the grid is an anchor
    start = time.perf_counter()
    bounds = lb.crlb(on_anchors, many)
    cep = bounds.cep()
    took = time.perf_counter() - start
    print(
        f"{len(many):,} points: {took:.2f} s in the first call; NaN: {int(np.isnan(cep).sum())}, without a bound and "
        f"marked: {int(np.sum(bounds.singular))}, infinite: {int(np.isinf(cep).sum())}"
    )


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
