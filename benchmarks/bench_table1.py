"""Table I at equal standard error: Algorithm 1 as printed in vectorised NumPy against the separated engine.

The NumPy version is normalised (as printed it underflows near step 35) and averages by one matrix product per step. It
is timed twice: as printed, with gradients with respect to the whole state, and made as lean as it can be, with
respect to positions only (all others are zero). Its cost is linear in samples; it is timed at a size that takes some
seconds and scaled to the samples that the target precision needs.
"""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import locbounds as lb

TARGET_M = 0.03  # standard error of the time average that both sides have to reach
SAMPLES = 1_000
GROUPS = 10
REPEATS = 5


def algorithm1(stay: float, samples: int, rng: np.random.Generator, c: int = 2) -> tuple[float, float, float, float]:
    """Time average of the position RMSE, its jackknife standard error, seconds for sampling and for solving.

    Gradients are kept with respect to the first c components of every state.
    """
    T, q, K = 0.2, 0.5, 100
    F = np.kron([[1, T], [0, 1]], np.eye(2))
    Q = q * np.kron([[T**3 / 3, T**2 / 2], [T**2 / 2, T]], np.eye(2))
    P0, mean = np.diag([2500.0, 2500, 4, 4]), np.array([500.0, 500, 5, 5])
    anchors = np.array([[-3000.0, -2000], [3000, 5000], [6000, 2000]])
    mu, sigma = np.array([0.0, 513.0]), np.array([150.0, np.hypot(150, 409)])
    modes = np.array([[(r >> (2 - m)) & 1 for m in range(3)] for r in range(8)])
    one = np.array([[stay, 1 - stay], [1 - stay, stay]])
    Pi = np.kron(np.kron(one, one), one)

    start = time.perf_counter()
    x = rng.multivariate_normal(mean, P0, samples)
    r = rng.integers(0, 2, (samples, 3))
    f = np.full((samples, 8), 1 / 8)
    D = np.zeros((samples, 8, K, c))
    J = np.zeros((K, GROUPS, c * K, c * K))
    for k in range(K):
        x = x @ F.T + rng.multivariate_normal(np.zeros(4), Q, samples)
        r = np.where(rng.random((samples, 3)) < stay, r, 1 - r)
        difference = x[:, None, :2] - anchors
        h = np.linalg.norm(difference, axis=-1)
        z = h + mu[r] + sigma[r] * rng.standard_normal((samples, 3))
        e = (z[:, None] - h[:, None] - mu[modes]) / sigma[modes]
        log_l = -0.5 * (e**2).sum(-1) - np.log(sigma[modes]).sum(-1)
        l = np.exp(log_l - log_l.max(1, keepdims=True))
        gradient = np.zeros((samples, 8, c))
        gradient[..., :2] = np.einsum("srm,smd->srd", e / sigma[modes], difference / h[..., None])
        f = l * (f @ Pi)
        D[:, :, :k] = l[:, :, None, None] * np.einsum("sikd,ij->sjkd", D[:, :, :k], Pi, optimize=True)
        D[:, :, k] = f[..., None] * gradient
        total = f.sum(1)
        f /= total[:, None]
        D[:, :, : k + 1] /= total[:, None, None, None]
        score = D[:, :, : k + 1].sum(1).reshape(GROUPS, -1, c * (k + 1))
        J[k, :, : c * (k + 1), : c * (k + 1)] = np.einsum("gsi,gsj->gij", score, score, optimize=True)
    sampling = time.perf_counter() - start

    start = time.perf_counter()
    Q_inv = np.linalg.inv(Q)
    total, without = np.zeros(K + 1), np.zeros((GROUPS, K + 1))
    total[0] = without[:, 0] = np.sqrt(P0[0, 0] + P0[1, 1])
    J_x = np.zeros((4 * (K + 1), 4 * (K + 1)))
    J_x[:4, :4] = np.linalg.inv(P0)
    solve_once = 0.0
    for k in range(1, K + 1):
        a, b = slice(4 * (k - 1), 4 * k), slice(4 * k, 4 * (k + 1))
        J_x[a, a] += F.T @ Q_inv @ F
        J_x[a, b] -= F.T @ Q_inv
        J_x[b, a] -= Q_inv @ F
        J_x[b, b] += Q_inv
        n = 4 * (k + 1)
        index = (4 * np.arange(1, k + 1)[:, None] + np.arange(c)).ravel()
        sums = J[k - 1, :, : c * k, : c * k]

        def rmse(J_z, n=n, index=index):
            A = J_x[:n, :n].copy()
            A[np.ix_(index, index)] += J_z
            return np.sqrt(np.trace(np.linalg.solve(A, np.eye(n)[:, n - 4 : n - 2])[n - 4 : n - 2]))

        before = time.perf_counter()
        total[k] = rmse(sums.sum(0) / samples)
        solve_once += time.perf_counter() - before
        kept = samples * (GROUPS - 1) / GROUPS
        without[:, k] = [rmse((sums.sum(0) - s) / kept) for s in sums]
    average = without.mean(1)
    error = float(np.sqrt((GROUPS - 1) * np.var(average)))
    return float(total.mean()), error, sampling, solve_once


def main() -> None:
    rng = np.random.default_rng(0)
    theirs = 0.0
    whole, lean = (algorithm1(0.9, SAMPLES // 2, np.random.default_rng(1), c)[2] for c in (4, 2))
    print(f"Algorithm 1 in NumPy, {SAMPLES} samples timed and scaled to a standard error of {TARGET_M} m")
    for stay in lb.papers.fritsche2013.STAY:
        value, error, sampling, solving = algorithm1(stay, SAMPLES, rng)
        needed = SAMPLES * (error / TARGET_M) ** 2
        seconds = solving + sampling * needed / SAMPLES
        theirs += seconds
        print(
            f"  stay {stay}: {value:.2f} +- {error:.2f} m in {sampling + solving:.1f} s; "
            f"{needed:,.0f} samples, {seconds:.0f} s for the target"
        )

    scenarios = [lb.papers.fritsche2013.scenario(stay) for stay in lb.papers.fritsche2013.STAY]

    def ours(seed: int):  # two columns at a time, as the study of the paper does; NumPy's products use all cores too
        def column(pair):
            stay, s = pair
            schedules = 1024 if stay <= 0.9 else 2048  # what the target takes
            return [lb.bcrb(s, samples=2048, seed=seed), lb.enumer(s, samples=schedules, seed=seed)]

        with ThreadPoolExecutor(2) as pool:
            pairs = zip(lb.papers.fritsche2013.STAY, scenarios, strict=True)
            return [result for column in pool.map(column, pairs) for result in column]

    start = time.perf_counter()
    results = ours(0)
    cold = time.perf_counter() - start
    warm = []
    for seed in range(1, REPEATS + 1):
        start = time.perf_counter()
        results = ours(seed)
        warm.append(time.perf_counter() - start)
    worst = max(r.mean_position_rmse_stderr() for r in results)
    for s, b, e in zip(lb.papers.fritsche2013.STAY, results[::2], results[1::2], strict=True):
        print(
            f"  stay {s}: BCRB {b.mean_position_rmse():.2f} +- {b.mean_position_rmse_stderr():.3f} m, "
            f"Enumer {e.mean_position_rmse():.2f} +- {e.mean_position_rmse_stderr():.3f} m"
        )
    middle = float(np.median(warm))
    print(
        f"locbounds, five BCRB and five Enumer-BCRB columns, largest s.e. {worst:.3f} m: median {middle:.3f} s "
        f"(min {min(warm):.3f}, max {max(warm):.3f}) warm, {cold:.1f} s the first time, compilation included"
    )
    print(
        f"ratio, Algorithm 1 (BCRB columns alone) / locbounds (both): {theirs * whole / lean / middle:,.0f} as "
        f"printed, "
        f"{theirs / middle:,.0f} with gradients of positions only ({whole / lean:.1f} times cheaper)"
    )
