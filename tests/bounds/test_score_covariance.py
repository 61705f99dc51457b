"""The covariance of the noise score against explicit sums over all mode sequences: no recursion of the package."""

import jax
import numpy as np
import pytest
from scipy import integrate

import locbounds as lb
from locbounds.bounds.score_covariance import NoiseProcess, score_covariance_increments
from scenarios import sequence_probabilities, sequences

GROUPS, PATHS, STEPS = 128, 128, 5
SIGMAS = 4.0  # with 128 groups and at most 6 entries a case: false alarm below 1e-3 for the whole file
ROUNDING = 1e-12  # exact identities, numbers of order one
QUADRATURE = 1e-6  # the trapezoidal sums below change by less when the grid is refined

CHAIN = np.array([[0.9, 0.1], [0.35, 0.65]])
START = np.array([0.2, 0.8])
LAWS = ((0.0, 1.0), (2.5, 2.0))


def increments(start=START, chain=CHAIN, laws=LAWS, reports=None, window=STEPS, seed=0):
    transitions = np.broadcast_to(chain, (STEPS, 2, 2)) if np.ndim(chain) == 2 else chain
    reports = np.ones(STEPS, bool) if reports is None else np.asarray(reports)
    with jax.enable_x64(True):
        process = NoiseProcess(np.asarray(start), transitions, tuple(lb.Gaussian(*law) for law in laws), reports)
        out = score_covariance_increments(
            process, np.uint32(seed), np.uint32(0), groups=GROUPS, paths=PATHS, window=window
        )
        return np.asarray(out)


def covariance(rows, horizon):
    """C(n, n'; k) of every group, [groups, k, k], steps 1..k in order."""
    C = np.zeros((len(rows), horizon, horizon))
    for k in range(1, horizon + 1):
        for i in range(min(k, rows.shape[-1])):
            for j in range(min(k, rows.shape[-1])):
                C[:, k - 1 - i, k - 1 - j] += rows[:, k - 1, i, j]
    return C


def normal(w, mean, std):
    return np.exp(-0.5 * ((w - mean) / std) ** 2) / (std * np.sqrt(2 * np.pi))


def smoothed_scores(w, start, transitions, laws, reports):
    """a(n, k) = E[s_n | w_{1:k}] by a sum over all mode sequences; w [..., k]."""
    steps = w.shape[-1]
    weight = np.zeros(w.shape[:-1])
    a = np.zeros(w.shape)
    for r, p in zip(sequences(steps), sequence_probabilities(start, transitions[:steps]), strict=True):
        mean, std = np.array(laws)[r].T
        density = p * np.prod(np.where(reports[:steps], normal(w, mean, std), 1.0), axis=-1)
        weight += density
        a += density[..., None] * np.where(reports[:steps], (w - mean) / std**2, 0.0)
    return a / weight[..., None], weight


@pytest.fixture(scope="module")
def table():
    return increments()


def within(C, expected, stderr=0.0):
    mean = C.mean(0)
    error = np.hypot(C.std(0, ddof=1) / np.sqrt(len(C)), stderr)
    np.testing.assert_array_less(np.abs(mean - expected), SIGMAS * error + QUADRATURE)


@pytest.mark.parametrize("horizon", [1, 2, 3])
def test_all_entries_against_quadrature_over_the_noise(table, horizon):
    grid, step = np.linspace(-11.5, 16.5, 81, retstep=True)  # seven deviations to either side
    w = np.stack(np.meshgrid(*[grid] * horizon, indexing="ij"), -1).reshape(-1, horizon)
    a, density = smoothed_scores(w, START, [CHAIN] * horizon, LAWS, np.ones(horizon, bool))
    assert density.sum() * step**horizon == pytest.approx(1.0, abs=1e-9)
    expected = np.einsum("ni,nj,n->ij", a, a, density) * step**horizon
    within(covariance(table, horizon), expected)


def sample(rng, n, start, transitions, laws):
    r = rng.choice(2, n, p=start)
    w = []
    for T in transitions:
        r = (rng.random(n) >= np.asarray(T)[r, 0]).astype(int)
        mean, std = np.array(laws)[r].T
        w.append(rng.normal(mean, std))
    return np.stack(w, -1)


@pytest.mark.parametrize("shift", [(1, 1, 1, 1, 1), (1, -1, 1, -1, 1), (1, 0, 0, 0, -1)])
def test_information_about_a_shift_of_five_steps_against_enumeration(shift):
    """The information about a common, an alternating and an end-to-end shift; step 3 did not report."""
    reports = np.array([True, True, False, True, True])
    transitions = np.stack([CHAIN, CHAIN @ CHAIN, CHAIN[::-1], CHAIN, np.array([[0.5, 0.5], [0.02, 0.98]])])
    shift = np.array(shift, float)
    w = sample(np.random.default_rng(1), 60_000, START, transitions, LAWS)
    a, _ = smoothed_scores(w, START, transitions, LAWS, reports)
    expected = (a @ shift) ** 2
    C = covariance(increments(chain=transitions, reports=reports), STEPS)
    within(np.einsum("gij,i,j->g", C, shift, shift), expected.mean(), expected.std() / np.sqrt(len(expected)))
    assert np.all(C[:, 2] == 0)
    assert np.all(C[:, :, 2] == 0)


def mixture_information(p, laws=LAWS):
    """Fisher information of a shift of a two-component mixture, by adaptive quadrature."""

    def integrand(w):
        f = np.array([normal(w, *law) for law in laws])
        score = np.array([(w - mean) / std**2 for mean, std in laws])
        return (p @ (f * score)) ** 2 / (p @ f)

    return integrate.quad(integrand, -12, 22, epsabs=1e-12, limit=200)[0]


def test_modes_drawn_afresh_give_the_information_of_the_mixture():
    p = np.array([0.3, 0.7])
    C = covariance(increments(chain=np.stack([p, p])), STEPS)
    off = ~np.eye(STEPS, dtype=bool)
    np.testing.assert_allclose(C[:, off], 0.0, atol=ROUNDING)
    expected = mixture_information(p)
    within(C[:, range(STEPS), range(STEPS)].mean(1), expected)


def test_a_law_that_differs_only_at_the_first_step():
    """Even where later modes are drawn afresh, step 1 has the law start @ transition, not the start."""
    expected = mixture_information(START @ CHAIN)
    transitions = np.stack([CHAIN] + [np.array([[0.5, 0.5], [0.5, 0.5]])] * (STEPS - 1))
    within(covariance(increments(chain=transitions), STEPS)[:, 0, 0], expected)


@pytest.mark.parametrize("chain", [CHAIN, np.eye(2)])
def test_equal_modes_leave_the_information_of_one_noise_exactly(chain):
    C = covariance(increments(chain=chain, laws=((1.0, 2.0), (1.0, 2.0))), STEPS)
    np.testing.assert_allclose(C, np.broadcast_to(np.eye(STEPS) / 4, C.shape), atol=ROUNDING)


def test_certain_modes_leave_the_information_of_each_mode_exactly():
    modes = np.array([0, 1, 1, 0, 1])
    with jax.enable_x64(True):
        transitions = np.asarray(lb.KnownSight(modes).transitions(np.ones(STEPS)))
    C = covariance(increments(start=(0.5, 0.5), chain=transitions), STEPS)
    information = np.array([1 / std**2 for _, std in LAWS])[modes]
    np.testing.assert_allclose(C, np.broadcast_to(np.diag(information), C.shape), atol=ROUNDING)


def test_a_common_centre_of_symmetry_makes_it_diagonal():
    C = covariance(increments(laws=((1.0, 1.0), (1.0, 4.0))), STEPS)
    upper = C[:, *np.triu_indices(STEPS, 1)]
    within(upper.sum(1), 0.0)
    within((upper * np.array([1, -1] * 5)).sum(1), 0.0)


def test_it_never_exceeds_the_known_mode_information(table):
    """J <= J_c, the known-mode information averaged over the modes: with a margin here, beyond its error."""
    law, known = START, []
    for _ in range(STEPS):
        law = law @ CHAIN
        known.append(law @ [1 / std**2 for _, std in LAWS])
    C = covariance(table, STEPS).mean(0)
    assert np.linalg.eigvalsh(np.diag(known) - C).min() > 0
    assert np.linalg.eigvalsh(C).min() > 0


def test_the_same_seed_gives_the_same_bits_and_another_one_other_draws(table):
    assert np.array_equal(increments(), table)
    assert not np.array_equal(increments(seed=1), table)
