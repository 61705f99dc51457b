"""Recursive Weiss-Weinstein: closed forms, a dense Gram matrix, minimum mean square errors on a grid, refusals."""

from itertools import pairwise, product

import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.bounds.weinstein import path, path_bound, weiss_weinstein_recursion
from locbounds.noise.log_coefficient import log_bhattacharyya, log_coefficient
from locbounds.registry import method
from locbounds.verdict import Status

ROUNDING = 1e-8  # relative, of the closed form; the same algebra through some hundred operations
TABLE = 5e-4  # relative, of the logarithm of a tabulated coefficient
SIGMAS = 4.0
LOOSE = 1 / 3  # in the root: what the registry says of hard edges
NOT_VACUOUS = 3.0  # in the mean square, of states that are moved one at a time


def gaussian_problem(steps=4, n=2):
    rng = np.random.default_rng(1)
    F = 0.7 * rng.normal(size=(steps, n, n))
    root = rng.normal(size=(steps + 1, n, n))
    S = root @ np.swapaxes(root, 1, 2) + 0.3 * np.eye(n)
    return F, S[1:], S[0], rng.normal(size=(steps, n))


def joint_information(F, Q, P0, H):
    """Of x_0..x_k from the prior and all measurements ``H_j x_j + N(0, 1)`` up to k, for every k."""
    n, found = len(P0), []
    J = np.zeros((n * (len(F) + 1),) * 2)
    J[:n, :n] = np.linalg.inv(P0)
    found.append(J[:n, :n].copy())
    for k in range(1, len(F) + 1):
        E = np.zeros((n, len(J)))
        E[:, n * k : n * (k + 1)], E[:, n * (k - 1) : n * k] = np.eye(n), -F[k - 1]
        J = J + E.T @ np.linalg.inv(Q[k - 1]) @ E
        J[n * k : n * (k + 1), n * k : n * (k + 1)] += np.outer(H[k - 1], H[k - 1])
        found.append(J[: n * (k + 1), : n * (k + 1)])
    return found


class Gaussians:
    def __init__(self, H):
        self.H = H

    def single(self, j, u):
        return np.zeros(u.shape[:-1]) if j == 0 else -((u @ self.H[j - 1]) ** 2) / 8

    def excess(self, j, g, h):
        return np.zeros((len(h), len(g)))


def test_linear_gaussian_is_the_closed_form_and_tends_to_the_kalman_variance():
    F, Q, P0, H = gaussian_problem()
    n = len(P0)
    for h in (1.0, 0.3, 1e-3):
        shifts = h * np.broadcast_to(np.eye(n), (len(F) + 1, n, n))
        got = weiss_weinstein_recursion(F, Q, P0, shifts, Gaussians(H))
        for k, J in enumerate(joint_information(F, Q, P0, H)):
            closed = (h**2 / 4) * np.linalg.inv(np.sinh(h**2 * J / 4))[-n:, -n:]
            np.testing.assert_allclose(got[k], closed, rtol=ROUNDING if h > 0.01 else 1e-6)
            kalman = np.linalg.inv(J)[-n:, -n:]
            assert np.trace(got[k]) <= np.trace(kalman) * (1 + 1e-6)
            if h < 0.01:
                np.testing.assert_allclose(got[k], kalman, rtol=1e-6)


@pytest.mark.parametrize(("ratio", "kept"), [(1e-4, 0.999), (1e-8, 0.99), (1e-12, 0.0), (1e-16, 0.0), (1e-20, 0.0)])
@pytest.mark.parametrize("n", [1, 2])
def test_rounding_never_lifts_the_bound_where_the_motion_is_nearly_noiseless(n, ratio, kept):
    """Differences of blocks are then nothing but rounding; the exact value is the Kalman covariance."""
    F, Q = np.array([[1.0, 1.0], [0.0, 1.0]])[:n, :n], ratio * np.array([[4 / 3, 2.0], [2.0, 4.0]])[:n, :n]
    P0, H = np.diag([4.0, 1.0])[:n, :n], np.eye(n)[0]
    P, exact = P0, [P0]
    for _ in range(6):
        P = F @ P @ F.T + Q
        P = P - np.outer(P @ H, H @ P) / (H @ P @ H + 1.0)
        exact.append(P)
    inverse = [np.linalg.inv(S) for S in (P0, *[Q] * 6)]
    ahead = [F.T @ np.linalg.inv(Q) @ F] * 6 + [0.0]
    seen = [0.0] + [np.outer(H, H)] * 6
    alone = np.stack([np.linalg.inv(sum(parts)) for parts in zip(inverse, ahead, seen, strict=True)])
    axes = np.swapaxes(np.linalg.cholesky(alone), 1, 2)  # each state given all others
    found = []
    for size in (0.03, 0.06, 0.12, 0.25, 0.5, 1.0):
        shifts = (size * np.array([0.6, 1.2, 2.0])[:, None, None] * axes[:, None]).reshape(7, -1, n)
        got = weiss_weinstein_recursion(np.tile(F, (6, 1, 1)), np.tile(Q, (6, 1, 1)), P0, shifts, Gaussians([H] * 6))
        found.append(got[:, 0, 0] / np.array(exact)[:, 0, 0])
    best = np.max(found, 0)
    assert np.all(best <= 1 + 1e-12)
    assert np.all(best >= kept)
    assert best[0] == pytest.approx(1.0, rel=1e-9)  # nothing is subtracted before the first measurement


ONE = np.ones((3, 1, 1))
SURE = lb.MarkovSight([1.0], [[1.0]])


def walk(noises, chain=SURE, **changes):
    """A random walk of three steps, seen through 1.5 x + noise."""
    options = dict(
        times=lb.Times.uniform(step_s=1.0, steps=3),
        prior=lb.GaussianPrior([1.0], [[4.0]]),
        motion=lb.LinearMotion(ONE, 0.5 * ONE, position_index=(0,)),
        channels=lb.AdditiveChannel(lambda x, mode, k: 1.5 * x[0] + 2.0, noises),
        chains=chain,
    )
    return lb.JumpMarkov(**(options | changes))


def test_a_smooth_linear_model_gives_the_kalman_variance_at_all_horizons():
    smooth = walk([lb.Gaussian(0.3, 1.2)])
    J = joint_information(ONE, 0.5 * ONE, np.array([[4.0]]), np.full((3, 1), 1.5 / 1.2))
    found = np.array([np.linalg.inv(j)[-1, -1] for j in J])
    states = lb.wwb_recursive(smooth, moved="states").position_mse
    np.testing.assert_allclose(states, found, rtol=1e-3)
    assert np.all(states <= found * (1 + 1e-9))
    np.testing.assert_allclose(lb.wwb_recursive(smooth).position_mse, found, rtol=ROUNDING)
    ahead = lb.wwb_recursive(smooth, horizon="predict:2")
    np.testing.assert_allclose(ahead.position_mse, [4.0, 4.5, 5.0, found[1] + 1.0], rtol=ROUNDING)
    assert "ranges-2-steps-old" in ahead.sees
    whole = lb.wwb_recursive(smooth, horizon="smooth")
    np.testing.assert_allclose(whole.position_mse, np.diag(np.linalg.inv(J[-1])), rtol=ROUNDING)
    with pytest.raises(lb.RefusedError, match="no smoothing bound"):
        lb.wwb_recursive(smooth, horizon="smooth", moved="states")


def test_whole_paths_of_a_singular_motion_give_its_kalman_covariance():
    """Rank-one Q, a state component that is known at the start, two channels, one of them silent at step 2."""
    F = np.broadcast_to([[1.0, 1.0], [0.0, 1.0]], (3, 2, 2))
    Q = np.broadcast_to(np.outer([0.5, 1.0], [0.5, 1.0]), (3, 2, 2))
    model = walk(
        [lb.Gaussian(0.0, 1.0)],
        prior=lb.GaussianPrior([0.0, 0.0], np.diag([4.0, 0.0])),
        motion=lb.LinearMotion(F, Q, position_index=(0,)),
        channels=[
            lb.AdditiveChannel(lambda x, mode, k: x[0], [lb.Gaussian(0.0, 1.0)]),
            lb.AdditiveChannel(lambda x, mode, k: x[1] - x[0], [lb.Gaussian(0.0, 2.0)], reports=[True, False, True]),
        ],
    )
    bound = lb.wwb_recursive(model)
    P, found = np.diag([4.0, 0.0]), [np.diag([4.0, 0.0])]
    for k in range(3):
        P = F[k] @ P @ F[k].T + Q[k]
        for h, r in [((1.0, 0.0), 1.0)] + ([((-1.0, 1.0), 4.0)] if k != 1 else []):
            P = P - np.outer(P @ h, P @ h) / (h @ P @ np.array(h) + r)
        found.append(P)
    np.testing.assert_allclose(bound.covariance, found, rtol=1e-6, atol=1e-9)
    with pytest.raises(lb.RefusedError, match="singular"):
        lb.wwb_recursive(model, moved="states")


STICKY = lb.MarkovSight([0.7, 0.3], [[0.8, 0.2], [0.4, 0.6]])
FRESH = lb.MarkovSight([0.7, 0.3], [[0.7, 0.3], [0.7, 0.3]])
SIGHTS = (lb.Gaussian(0.0, 0.5), lb.Uniform(0.0, 6.0))


def test_a_chain_that_is_told_agrees_with_the_dense_gram_matrix_over_all_its_sequences():
    """Every product of coefficients averaged over the 2^3 sequences, no recursion, no blocks."""
    scale, sizes, model = 0.7, np.array([0.5, 1.3]), walk(SIGHTS, STICKY)
    got = lb.wwb_recursive(model, sizes=sizes, scale=scale, moved="states")
    assert got.verdict.status is Status.CONDITIONAL
    assert "told the modes" in got.verdict.reasons[0]
    assert got.sees == {"ranges", "sight"}
    T, start = np.array([[0.8, 0.2], [0.4, 0.6]]), np.array([0.7, 0.3])
    log_rho = [lambda u: -(u**2) / 8 / 0.25, lambda u: np.log(np.maximum(1 - np.abs(u) / 6, 0.0))]
    least = 0.25
    for k in range(4):
        last = np.arange(k + 1) == k
        after, seen = np.where(last, 0.0, 1 / 0.5), np.where(np.arange(k + 1) > 0, 1.5**2 / least, 0.0)
        before = np.where(np.arange(k + 1) == 0, 1 / 4.0, 1 / 0.5)
        whole = before + np.append(np.full(k, 1 / 0.5), 1 / 0.5 if k < 3 else 0.0) + seen
        lengths = scale * sizes * (1 / np.sqrt(whole))[:, None]  # test shifts of every state, as the library has them
        moves = np.concatenate([np.outer(h, np.eye(k + 1)[j]) for j, h in enumerate(lengths)])
        J = np.diag(before + after) - (np.eye(k + 1, k=1) + np.eye(k + 1, k=-1)) / 0.5

        def eta(u, J=J, k=k):
            total = 0.0
            for modes in product((0, 1), repeat=k + 1):
                p = start[modes[0]] * np.prod([T[a, b] for a, b in pairwise(modes)])
                total += p * np.exp(sum(log_rho[modes[j]](1.5 * u[j]) for j in range(1, k + 1)))
            return np.exp(-u @ J @ u / 8) * total

        with np.errstate(divide="ignore"):
            single = np.array([eta(u) for u in moves])
            G = np.array([[2 * (eta(u - v) - eta(u + v)) for v in moves] for u in moves]) / np.outer(single, single)
        target = moves[:, -1]
        assert got.position_mse[k] == pytest.approx(float(target @ np.linalg.solve(G, target)), rel=TABLE)


def at_scale(monkeypatch, scale):
    """One common scale of the test shifts in place of a search."""
    monkeypatch.setattr(path, "SCALES", np.array([scale]))
    monkeypatch.setattr(path, "LONGEST", 0.0)


def test_a_path_bound_of_uniform_noise_is_that_of_sums_over_states_and_measurements(monkeypatch):
    """z = x + U(-a, a), x normal: test functions, their products and those with x on a grid of (x, w = z - x).

    Sums over x are exact up to rounding (a normal density on an even grid), those over w as well (a and the shifts are
    multiples of its step). The library integrates products of moved laws over all w; where no z is possible a test
    function may be left zero, which makes the bound larger.
    """
    a, std, step = 1.0, 2.0, 0.02
    deviation, lengths = 1 / np.sqrt(1 / std**2 + 3 / a**2), np.array([1, 2, 3])

    def log_rho(u):
        with np.errstate(divide="ignore"):
            return np.log(np.maximum(1 - np.abs(u[0]) / (2 * a), 0.0))

    def library():
        return path_bound(np.array([[std]]), log_rho, np.array([[3 / a**2]]), np.array([[std]]), np.array([0]))[0, 0]

    x = np.arange(-20.0, 20.0, 0.2)[:, None]

    def root(w, n):  # of the density at (z, x + h), where z = x + w and h = n steps; w counts steps
        return np.exp(-((x + n * step) ** 2) / (4 * std**2)) * (np.abs(w - n) < a / step)

    def sums(m):
        n = m * lengths
        w = np.arange(-a / step - n[-1] + 0.5, a / step + n[-1])
        here, moved = root(w, 0), np.stack([root(w, k) - root(w, -k) for k in n])
        moved = moved[(np.abs(moved) * here).any((1, 2))]  # too long a shift says nothing
        cross, mass = (x * here * moved).sum((1, 2)), (here**2).sum()
        whole, inside = (np.einsum("ixw,jxw->ij", f, f) for f in (moved, np.where(here > 0, moved, 0.0)))
        return [float(cross @ np.linalg.solve(G, cross)) / mass for G in (whole, inside)]

    searched, found = library(), []
    for m in (3, 10, 14, 20, 32, 45):
        at_scale(monkeypatch, m * step / deviation)
        found.append([library(), *sums(m)])
    got, whole, inside = np.array(found).T
    np.testing.assert_allclose(got, whole, rtol=1e-9)
    v = np.linspace(-a, a, 401)[1::2]  # x = z + v
    p = np.exp(-((np.linspace(-12.0, 12.0, 1201)[:, None] + v) ** 2) / (2 * std**2))
    variance = (p @ v**2) / p.sum(1) - (p @ v / p.sum(1)) ** 2
    least = (p.sum(1) @ variance) / p.sum()
    assert 0.99 * whole.max() < searched < inside.max() < least
    assert np.sqrt(searched / least) == pytest.approx(0.744, abs=0.005)  # the theory page has both
    assert np.sqrt(inside.max() / least) == pytest.approx(0.988, abs=0.005)


def test_bounds_of_whole_paths_agree_with_a_dense_gram_matrix_over_all_sequences_of_a_chain_that_is_told(monkeypatch):
    """Every test function by its two signs, every coefficient averaged over the 2^3 sequences."""
    scale = 0.4
    at_scale(monkeypatch, scale)
    got = np.asarray(lb.wwb_recursive(walk(SIGHTS, STICKY), moved="paths").position_mse)
    T, start = np.array([[0.8, 0.2], [0.4, 0.6]]), np.array([0.7, 0.3])
    X = np.array([[2.0, *np.sqrt(0.5) * (np.arange(1, 4) <= k)] for k in range(4)])
    assert got[0] == pytest.approx(4.0)
    for k in range(1, 4):
        D = 1.5 * X[1 : k + 1]

        def eta(u, D=D, k=k):
            total = 0.0
            for modes in product((0, 1), repeat=k + 1):
                p = start[modes[0]] * np.prod([T[a, b] for a, b in pairwise(modes)])
                each = [
                    max(1 - abs(w) / 6, 0.0) if r else np.exp(-(w**2) / 2)
                    for w, r in zip(D @ u, modes[1:], strict=True)
                ]
                total += p * np.prod(each)
            return np.exp(-(u @ u) / 8) * total

        moves = []
        for guess in (0.2, 1.0, 10.0):
            V = np.linalg.solve(np.eye(4) + guess / 0.25 * D.T @ D, X[k])
            moves += [length * scale * V / np.sqrt(X[k] @ V) for length in (1.0, 2.0, 3.0)]
        signs = list(product((1, -1), repeat=2))
        G = np.array([[sum(a * b * eta(a * u - b * v) for a, b in signs) for v in moves] for u in moves])
        cross = np.array([eta(u) * (u @ X[k]) for u in moves])
        d = np.sqrt(np.diag(G))
        solved = np.linalg.lstsq(G / np.outer(d, d), cross / d, rcond=1e-7)[0]
        assert got[k] == pytest.approx(float(cross / d @ solved), rel=4 * TABLE)


def grid_mmse(model, densities, told, runs=200, seed=0):
    """Mean of the posterior variance at step 3 over draws, by a filter on a grid of places (and modes)."""
    rng = np.random.default_rng(seed)
    x = np.linspace(-9.0, 11.0, 401)
    T, start = np.asarray(model.transitions(0))[0], np.asarray(model.chains[0].start)
    kernel = np.exp(-((x[:, None] - x) ** 2) / (2 * 0.5))
    kernel /= kernel.sum(0)
    found = []
    for _ in range(runs):
        place, mode = 1.0 + 2.0 * rng.normal(), rng.choice(len(start), p=start)
        p = start[:, None] * np.exp(-((x - 1.0) ** 2) / 8)
        for _ in range(3):
            place, mode = place + np.sqrt(0.5) * rng.normal(), rng.choice(len(start), p=T[mode])
            z = 1.5 * place + 2.0 + densities[mode][1](rng)
            p = T.T @ (p @ kernel.T)
            likelihood = np.stack([f(z - 1.5 * x - 2.0) for f, _ in densities])
            p = p * likelihood
            if told:
                p[np.arange(len(start)) != mode] = 0.0
            p /= p.sum()
        q = p.sum(0)
        found.append(q @ x**2 - (q @ x) ** 2)
    return np.mean(found), np.std(found) / np.sqrt(runs)


def bell(std):
    return (lambda e: np.exp(-((e / std) ** 2) / 2) / std / np.sqrt(2 * np.pi)), (lambda rng: std * rng.normal())


def flat(low, high):
    return (lambda e: ((e > low) & (e < high)) / (high - low)), (lambda rng: rng.uniform(low, high))


def decay(mean):
    return (lambda e: np.exp(-np.maximum(e, 0) / mean) * (e > 0) / mean), (lambda rng: rng.exponential(mean))


@pytest.mark.parametrize(
    ("noises", "densities", "chain", "told"),
    [
        ([lb.Uniform(-2.0, 2.0)], [flat(-2, 2)], SURE, False),
        ([lb.Exponential(1.0)], [decay(1.0)], SURE, False),
        pytest.param(SIGHTS, [bell(0.5), flat(0, 6)], FRESH, False, marks=pytest.mark.slow),
        (SIGHTS, [bell(0.5), flat(0, 6)], STICKY, True),
    ],
    ids=["uniform", "exponential", "sight drawn anew", "told sight"],
)
def test_the_bound_is_below_the_minimum_mean_square_error_and_not_far(noises, densities, chain, told):
    model = walk(noises, chain)
    bound = lb.wwb_recursive(model)
    mmse, error = grid_mmse(model, densities, told)
    assert bound.position_mse[3] < mmse + SIGMAS * error
    assert bound.position_mse[3] > (1 - LOOSE) ** 2 * (mmse - SIGMAS * error)
    states = lb.wwb_recursive(model, moved="states")
    assert mmse / NOT_VACUOUS < states.position_mse[3] <= bound.position_mse[3]
    scale = float(states.diagnostics["scale"][3])
    assert 0.03 < scale < 60
    fewer = lb.wwb_recursive(model, sizes=(1.2,), scale=scale, moved="states")
    assert fewer.position_mse[3] <= states.position_mse[3] * (1 + 1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"motion": [lb.LinearMotion(ONE, q * ONE, position_index=(0,)) for q in (0.5, 1.0)], "chains": STICKY,
          "channels": lb.AdditiveChannel(lambda x, mode, k: x[0], SIGHTS)}, "the motion has modes"),
        ({"channels": lb.AdditiveChannel(lambda x, mode, k: jnp.abs(x[0]), [lb.Gaussian(0, 1)])}, "not linear"),
        ({"channels": lb.AdditiveChannel(lambda x, mode, k: x[0] + mode, SIGHTS), "chains": STICKY}, "the mode"),
        ({"channels": lb.AdditiveChannel(lambda x, mode, k: 3 * jnp.sign(x[0]), [lb.Gaussian(0, 0.5)]),
          "prior": lb.GaussianPrior([0.3], [[4.0]])}, "not linear"),
        ({"channels": lb.AdditiveChannel(lambda x, mode, k: jnp.round(x[0]), [lb.Uniform(-0.1, 0.1)])}, "not linear"),
        ({"channels": lb.AdditiveChannel(lambda x, mode, k: x[0] + jnp.sign(x[0]), [lb.Gaussian(0, 1)])}, "not linear"),
        ({"channels": lb.AdditiveChannel(lambda x, mode, k: jnp.sign(x[0] - 60.0), [lb.Gaussian(0, 1)]),
          "motion": lb.LinearMotion(ONE, 2000.0 * ONE, position_index=(0,))}, "not linear"),
    ],
)  # fmt: skip
def test_other_models_are_refused_with_the_reason(changes, words):
    model = walk([lb.Gaussian(0.0, 1.0)], **changes)
    verdict = method("wwb-recursive").verdict(model)
    assert verdict.status is Status.REFUSED
    with pytest.raises(lb.RefusedError, match=words):
        lb.wwb_recursive(model)


def test_a_scenario_with_ranges_is_refused_and_wrong_numbers_are_named():
    with pytest.raises(lb.RefusedError, match="not linear"):
        lb.wwb_recursive(lb.papers.fritsche2013.scenario(steps=2))
    for wrong in ({"sizes": ()}, {"sizes": (1.0, -1.0)}, {"scale": 0.0}, {"moved": "all"}):
        with pytest.raises(lb.InputError, match=r"sizes|scale|moved"):
            lb.wwb_recursive(walk([lb.Gaussian(0.0, 1.0)]), **wrong)


def test_tables_of_coefficients_agree_with_quadrature_and_with_closed_forms():
    h = np.geomspace(1e-6, 3.9, 40)
    np.testing.assert_allclose(np.exp(log_coefficient(lb.Uniform(-2.0, 2.0))(h)), 1 - h / 4, rtol=TABLE)
    exponential = log_coefficient(lb.Exponential(1.0))
    np.testing.assert_allclose(exponential(h), -h / 2, rtol=1e-6)
    cut = lb.TruncatedGaussian(0.0, 1.0, -2.0, 2.0) + lb.Uniform(0.0, 1.0)
    h = np.geomspace(1e-3, 4.9, 30)
    np.testing.assert_allclose(log_coefficient(cut)(h), log_bhattacharyya(cut, h), rtol=TABLE)
    assert np.all(log_coefficient(cut)(np.array([5.0, 7.0])) == -np.inf)
    apart = lb.Mixture([0.5, 0.5], [lb.Uniform(0.0, 1.0), lb.Uniform(100.0, 101.0)])
    with pytest.raises(lb.RefusedError, match="far apart"):
        log_coefficient(apart)


def test_channels_that_share_a_chain_tell_each_other_its_modes():
    """One of two channels reveals modes that are drawn afresh: the least error is that of the known modes."""
    ones = np.ones((2, 1, 1))
    model = lb.JumpMarkov(
        times=lb.Times.uniform(step_s=1.0, steps=2),
        prior=lb.GaussianPrior([0.0], [[4.0]]),
        motion=lb.LinearMotion(ones, 0.25 * ones, position_index=(0,)),
        channels=(
            lb.AdditiveChannel(lambda x, m, k: x[0], [lb.Gaussian(-0.5, 0.5), lb.Gaussian(0.5, 0.5)]),
            lb.AdditiveChannel(lambda x, m, k: 1e-3 * x[0], [lb.Gaussian(-1.0, 0.05), lb.Gaussian(1.0, 0.05)]),
        ),
        chains=lb.MarkovSight([0.5, 0.5], [[0.5, 0.5], [0.5, 0.5]]),
    )
    found, least = lb.wwb_recursive(model), [4.0]
    for _ in range(2):
        least.append(1 / (1 / (least[-1] + 0.25) + 1 / 0.25 + 1e-6 / 0.05**2))
    assert "told" in str(found.verdict)
    np.testing.assert_allclose(found.position_mse, least, rtol=1e-4)


def test_noise_without_a_variance_has_a_bound():
    """Cauchy noise: above the Cramer-Rao bound, below the least error by quadrature."""
    ones = np.ones((1, 1, 1))
    model = lb.JumpMarkov(
        times=lb.Times.uniform(step_s=1.0, steps=1),
        prior=lb.GaussianPrior([0.0], [[4.0]]),
        motion=lb.LinearMotion(ones, 0.25 * ones, position_index=(0,)),
        channels=lb.AdditiveChannel(lambda x, m, k: x[0], [lb.StudentT(1.0, 0.0, 1.0)]),
        chains=lb.MarkovSight([1.0], [[1.0]]),
    )
    x, t = np.linspace(-14, 14, 701), np.linspace(-9, 9, 2001)
    z, prior = np.sinh(t), np.exp(-(x**2) / (2 * 4.25))
    joint = prior / prior.sum() / (np.pi * (1 + (z[:, None] - x) ** 2))
    density = joint.sum(1)
    variance = joint @ x**2 / density - (joint @ x / density) ** 2
    least = np.trapezoid(density * variance * np.cosh(t), t)
    value = float(lb.wwb_recursive(model).position_mse[1])
    assert 1 / (1 / 4.25 + 1 / 2) < value < least  # the information of Cauchy noise is one half
