"""Figs. 3 to 6 of McGuire and Plataniotis: 54 settings x (EZZB, WWB with finite support, CRLB) at 0.2 %.

Run with ``python -m benchmarks figures``. The alternative is what one writes today: vectorised NumPy, one grid of cells
over the disc for everything, so fine that the staircase along the rim costs less than 0.2 %; both run here, one
after the other.
"""

import sys
import time

import numpy as np
from scipy.special import erfc

from locbounds.papers.mcguire2009 import CASES
from locbounds.papers.mcguire2009.simple import AREA_M, anchors, expected_crlb
from locbounds.static.noise_levels import bounds_over_noise

RTOL = 2e-3
REPEATS = 3
STEP_M = 0.15  # of the cells: 31,000 in the disc
LENGTHS = 40  # of the Weiss-Weinstein sweep
SHIFTS = 80  # of the Ziv-Zakai integral
EVERY = 4  # one setting in so many is computed in the alternative, whose time is multiplied


def ours() -> dict[tuple[str, float], tuple[float, float, float]]:
    """(case, sigma) -> EZZB, WWB and CRLB."""
    found = {}
    for case in CASES:
        crlb = expected_crlb(case)[0]
        for x in bounds_over_noise(case.plan(), case.sigmas, printed=False, rtol=RTOL):
            found[case.name, x.scale] = (x.ezzb_m, x.wwb_m, x.scale * crlb)
    return found


def measure(case, points):
    gap = points[:, None] - anchors(case.radius_m)
    r = np.sqrt(np.square(gap).sum(-1))
    if case.kind == "RSS":
        return 30 * np.log10(np.maximum(r, 1e-9))
    return np.arctan2(gap[..., 1], gap[..., 0]) if case.kind == "AoA" else r


def squares(case, sigma, a, b):
    """Squared Mahalanobis distance of the measurements at two sets of places."""
    d = measure(case, a) - measure(case, b)
    if case.kind == "AoA":
        d -= 2 * np.pi * np.round(d / (2 * np.pi))
    if case.kind == "TDoA":
        d = d - d.mean(1, keepdims=True)
    return np.square(d).sum(1) / sigma**2


def numpy_way(case, sigma):
    """The same three numbers on cells."""
    axis = np.arange(-AREA_M + STEP_M / 2, AREA_M, STEP_M)
    cells = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)

    def inside(p):
        return np.square(p).sum(1) <= AREA_M**2

    cells = cells[inside(cells)]
    n = len(cells)
    top = 2 * AREA_M
    scale = min(top, 40 * sigma if case.unit == "m" else top)
    h = scale * ((np.arange(SHIFTS) + 0.5) / SHIFTS) ** 2
    dh = scale * np.diff((np.arange(SHIFTS + 1) / SHIFTS) ** 2)
    ezzb = 0.0
    for a in np.eye(2):
        A = []
        for k in h:
            both = cells[inside(cells + k * a)]
            A.append(np.sum(erfc(np.sqrt(squares(case, sigma, both + k * a, both) / 8))) / n if len(both) else 0.0)
        ezzb += 0.5 * np.sum(h * np.maximum.accumulate(A[::-1])[::-1] * dh)
    best = 0.0
    for k in top * np.geomspace(1e-3, 0.99, LENGTHS):

        def term(u, v):
            there = cells[inside(cells + u) & inside(cells + v)]
            if np.array_equal(u, v):
                return len(there) / n
            return np.sum(np.exp(squares(case, sigma, there + u, there + v) / -8)) / n

        x, y, zero = np.array([k, 0.0]), np.array([0.0, k]), np.zeros(2)
        tests = (x, y)
        mu = np.array([term(zero, u) for u in tests])
        q = np.array([[term(u, v) + term(-u, -v) - term(u, -v) - term(-u, v) for v in tests] for u in tests])
        if np.all(mu > 0):
            best = max(best, np.trace((k * np.diag(mu)) @ np.linalg.pinv(q) @ (k * np.diag(mu)).T))
    crlb = sigma * expected_crlb(case)[0]
    return np.sqrt(ezzb), np.sqrt(best), crlb


def main(every: int = EVERY) -> None:
    start = time.perf_counter()
    found = ours()
    first = time.perf_counter() - start
    warm = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        found = ours()
        warm.append(time.perf_counter() - start)
    print(f"locbounds, {len(found)} settings   {min(warm):7.2f} s warm, {first:.1f} s in the first call")

    keys = [(case, sigma) for case in CASES for sigma in case.sigmas][::every]
    start = time.perf_counter()
    theirs = [numpy_way(case, sigma) for case, sigma in keys]
    total = (time.perf_counter() - start) * len(found) / len(keys)
    print(f"NumPy on cells           {total:7.1f} s for all (from {len(keys)} settings), {total / min(warm):.0f} x")
    for k, name in enumerate(("EZZB", "WWB")):
        gap = [other[k] / found[case.name, sigma][k] - 1 for (case, sigma), other in zip(keys, theirs, strict=True)]
        print(f"    {name}: NumPy differs by {min(gap):+.2%} to {max(gap):+.2%}")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
