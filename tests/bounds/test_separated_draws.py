"""The separated engine on the draws that it makes itself: no Monte Carlo error between it and the sums.

For every noise path that the engine draws, smoothed scores and their covariances are summed over all mode sequences
and their products compared with the engine's, path by path. From these the whole information matrix is assembled and
inverted, which covers window, edges, lags, links, missing ranges and geometry of the bound itself.
"""

import jax
import numpy as np
import pytest

import locbounds as lb
from locbounds.blocks import Stream, block_key
from locbounds.bounds.bcrb import PATHS
from locbounds.bounds.score_covariance import noise_process, score_covariance_increments
from locbounds.bounds.separated import TRACKS
from locbounds.simulation import draw_noise, draw_sight, draw_states
from scenarios import prior, sequence_probabilities, sequences

EXACT = 1e-9  # relative, and absolute in units of the largest entry
STEPS, GROUPS, SEED = 5, 32, 3
REPORTS = np.array([[1, 1], [1, 0], [0, 1], [1, 1], [1, 1]], bool)
CHAIN = [[0.7, 0.2, 0.1], [0.3, 0.6, 0.1], [0.05, 0.25, 0.7]]


def scenario():
    """Asymmetric chains of two and of three modes away from their long-run laws; ranges missing."""
    links = [
        lb.Link(
            "two modes",
            lb.Range([-60.0, -20.0]),
            lb.MarkovSight.stay((0.9, 0.6), (0.1, 0.9)),
            (lb.Gaussian(0.0, 3.0), lb.Gaussian(5.0, 7.0)),
            REPORTS[:, 0],
        ),
        lb.Link(
            "three modes",
            lb.Range([30.0, 90.0]),
            lb.MarkovSight([0.2, 0.1, 0.7], CHAIN),
            (lb.Gaussian(1.0, 2.0), lb.Gaussian(4.0, 3.0), lb.Gaussian(9.0, 6.0)),
            REPORTS[:, 1],
        ),
    ]
    times = lb.Times.uniform(step_s=0.5, steps=STEPS)
    return lb.Scenario("own draws", times, lb.ConstantVelocity([0.4, 0.3]), prior(), links)


def dwelling():
    """The first link with a chain that is another one at every step: dwell times, irregular intervals."""
    link = scenario().links[0].replace(sight=lb.DwellSight([0.9, 0.1], [3.0, 0.8]))
    times = lb.Times(np.cumsum([0.0, 0.3, 1.0, 0.1, 2.0, 0.5]))
    return noise_process(scenario().replace(times=times, links=[link]), link)


def drawn_noise(process, paths):
    """The engine's noises of block 0, [paths, steps]."""
    chain, noise = jax.random.split(block_key(SEED, Stream.SIGHT_AND_NOISE, 0))
    sight = draw_sight(chain, process.start, process.transitions, paths)
    return draw_noise(noise, process.noises, sight).T


def smoothed(process, w, k):
    """E[s_n | w_{1:k}] and Cov(s_n, s_k | w_{1:k}) for n = 1..k, s_n the location score; [paths, k] each."""
    law = np.array([(float(noise.mean), float(noise.std)) for noise in process.noises])
    r = sequences(k, len(law))
    mean, std = np.where(np.asarray(process.reports)[:k, None], law[r].T, [[[0.0]], [[np.inf]]])
    u = (w[:, :k, None] - mean) / std  # [paths, k, sequences]
    p = sequence_probabilities(process.start, np.asarray(process.transitions)[:k])
    p = p * np.exp(-0.5 * np.sum(u**2, 1)) / np.prod(np.where(np.isinf(std), 1.0, std), 0)
    p = p / p.sum(1, keepdims=True)
    a = np.einsum("pr,pnr->pn", p, u / std)
    return a, np.einsum("pr,pnr,pr->pn", p, u / std, (u / std)[:, -1]) - a * a[:, -1:]


def known_information(process):
    """Intrinsic accuracy averaged over the modes, by step: laws from the sum over sequences."""
    out = []
    for k in range(1, STEPS + 1):
        p = sequence_probabilities(process.start, np.asarray(process.transitions)[:k])
        modes = sequences(k, len(process.noises))[:, -1]
        out.append(p @ np.array([1 / float(noise.std) ** 2 for noise in process.noises])[modes])
    return np.array(out) * np.asarray(process.reports)


def increments_by_enumeration(process, w):
    """What step k adds to the products of scores, draw by draw; [paths, steps, ages, ages]."""
    out, before = np.zeros((len(w), STEPS, STEPS, STEPS)), np.zeros((len(w), 0))
    for k, known in enumerate(known_information(process), start=1):
        a, covariance = smoothed(process, w, k)
        table = np.zeros((len(w), k, k))
        older = a[:, :-1] - before
        table[:, :-1, :-1] = older[:, :, None] * older[:, None]
        table[:, -1] = table[:, :, -1] = -covariance
        table[:, -1, -1] += known
        out[:, k - 1, :k, :k] = table[:, ::-1, ::-1]
        before = a
    return out


@pytest.fixture(scope="module")
def by_enumeration():
    """Of every link and of one that the scenario lacks, for the draws of one block."""
    model = scenario()
    with jax.enable_x64(True):
        processes = [*(noise_process(model, link) for link in model.links), dwelling()]
        w = [np.asarray(drawn_noise(process, GROUPS * PATHS)) for process in processes]
    return processes, [increments_by_enumeration(*each) for each in zip(processes, w, strict=True)]


@pytest.mark.parametrize("link", [0, 1, 2], ids=["two modes", "three modes", "dwell times, irregular steps"])
def test_increments_draw_by_draw(by_enumeration, link):
    """One path per group: nothing is averaged. The window cuts off older ages and changes no others."""
    processes, tables = by_enumeration
    with jax.enable_x64(True):
        n = GROUPS * PATHS
        found = score_covariance_increments(
            processes[link], np.uint32(SEED), np.uint32(0), groups=n, paths=1, window=STEPS
        )
    expected = tables[link]
    assert np.abs(expected[:, 4, 1:, 1:]).max() > 1e-3  # older steps learn from the last one
    assert np.abs(expected[:, 4, 0, 1:]).max() > 1e-3
    np.testing.assert_allclose(found, expected, rtol=EXACT, atol=EXACT * np.abs(expected).max())


def information(model, C, gradients):
    """J_{0:k} for every k: prior and motion, and sums of ``C(n, n'; k) E[u_n u_n']`` over links; states 0..k."""
    with jax.enable_x64(True):
        F, Q = np.asarray(model.transition), np.asarray(model.process_noise)
    n = 4
    J, out = np.zeros((n * (STEPS + 1),) * 2), []
    J[:n, :n] = np.linalg.inv(model.prior.covariance)
    products = np.einsum("mtia,mtjb->mijab", gradients, gradients) / gradients.shape[1]
    for k in range(1, STEPS + 1):
        T = np.hstack([-F[k - 1], np.eye(n)])
        J[n * (k - 1) : n * (k + 1), n * (k - 1) : n * (k + 1)] += T.T @ np.linalg.inv(Q[k - 1]) @ T
        for i in range(k):
            for j in range(k):
                a, b = n * (k - i), n * (k - j)
                J[a : a + 2, b : b + 2] += np.einsum("m,mab->ab", C[:, k - 1, i, j], products[:, k - i - 1, k - j - 1])
        out.append(J[: n * (k + 1), : n * (k + 1)].copy())
    return out


def test_the_bound_and_its_standard_error_draw_by_draw(by_enumeration):
    """The information matrix of all states from the engine's own draws, inverted whole; groups by the delta method."""
    model = scenario()
    bound = lb.bcrb(model, samples=1, window=STEPS, seed=SEED)
    with jax.enable_x64(True):
        states = draw_states(block_key(SEED, Stream.TRACKS, 0), model, GROUPS * TRACKS)
        x = np.asarray(states)[:, 1:, :2]
    gap = x - np.array([link.measurement.anchor for link in model.links])[:, None, None]
    u = gap / np.linalg.norm(gap, axis=-1, keepdims=True)
    C = np.array([table.reshape(GROUPS, PATHS, STEPS, STEPS, STEPS).mean(1) for table in by_enumeration[1][:2]])
    mean = information(model, C.mean(1), u)
    V = [np.linalg.inv(J)[:, -4:] for J in mean]
    expected = [V_k[-4:] for V_k in V]
    np.testing.assert_allclose(bound.covariance[1:], expected, rtol=EXACT, atol=EXACT)
    np.testing.assert_allclose(bound.position_mse[1:], [P[0, 0] + P[1, 1] for P in expected], rtol=EXACT)

    of_groups = np.split(u, GROUPS, axis=1)
    changes = np.zeros((GROUPS, STEPS + 1))
    for g in range(GROUPS):
        of_group = information(model, C[:, g], of_groups[g])
        for k, (J_g, J, V_k) in enumerate(zip(of_group, mean, V, strict=True), start=1):
            changes[g, k] = -np.einsum("ia,ij,ja->", V_k[:, :2], J_g - J, V_k[:, :2])
    np.testing.assert_allclose(bound.replicates, changes, rtol=EXACT, atol=EXACT * np.abs(changes).max())
