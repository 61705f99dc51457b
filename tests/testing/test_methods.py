"""The public suites for bounds and filters: those of the library pass, every check catches a broken one."""

import numpy as np
import pytest

import locbounds as lb
from locbounds.registry import RANGES
from locbounds.result import Provenance, Result
from locbounds.testing import Nonconforming, check_bound, check_filter, small
from locbounds.testing import bound as bound_suite
from locbounds.testing import filter as filter_suite
from locbounds.verdict import Status, Verdict


def known(scenario):
    return scenario.with_known_sight(np.zeros(scenario.steps, int))


# The examples of check_bound and check_filter say that bcrb and ImmEkf conform.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("bound", "prepare"),
    [(lb.enumer, None), (lb.los_only, None), (lb.bcrb_algorithm1, None), (lb.known_sight, known)],
)
def test_bounds_of_the_library_conform(bound, prepare):
    check_bound(bound, prepare=prepare)


@pytest.mark.slow
@pytest.mark.parametrize("filter", [lb.FactorisedImmEkf(), lb.ImmKf(), lb.OracleEkf()], ids=lambda f: f.id)
def test_filters_of_the_library_conform(filter):
    check_filter(filter)


def bound_of(*, trace=1.0, scale=1.0, start=1.0, jitter=0.0, spread=0.0, shape=0, shrinks=False, drift=None):
    """A bound by a textbook Kalman filter that knows every link to be LOS, with something wrong."""
    calls = []

    def made(scenario, *, seed=0):
        calls.append(seed)
        rng = np.random.default_rng(seed if drift is None else len(calls))
        mse = small.kalman(scenario) * scale * (1 + jitter * rng.normal())
        mse = mse * (scenario.reports.sum() / 12) ** 6 if shrinks else mse
        P = np.zeros((len(mse), 4, 4))
        P[:, [0, 1], [0, 1]] = mse[:, None] / 2
        P[0] = start * np.asarray(scenario.prior.covariance)
        mse = P[:, [0, 1], [0, 1]].sum(-1) * trace
        replicates = spread * mse * np.array([[1.0], [-1.0]])
        return Result("own", "own", "bound", RANGES, scenario.times.time_s, mse[shape:], replicates[:, shape:],
                      P[shape:], Verdict(Status.VALID, ()), Provenance.now(seed, 1, "textbook", ()))  # fmt: skip

    return made


BROKEN_BOUNDS = {
    "result": {"shape": 1},
    "covariance": {"trace": 0.9},
    "start": {"start": 1.1},
    "reproducible": {"drift": True, "jitter": 0.01, "spread": 0.1},
    "standard error": {"jitter": 0.05, "spread": 1e-4},
    "optimal filter": {"scale": 1.1},
    "more ranges": {"shrinks": True},
}


def test_a_textbook_bound_conforms():
    check_bound(bound_of())


def test_every_bound_check_has_a_broken_bound():
    assert set(BROKEN_BOUNDS) == set(bound_suite.CHECKS)


@pytest.mark.parametrize("name", BROKEN_BOUNDS)
def test_a_broken_bound_is_caught(name):
    with pytest.raises(Nonconforming) as error:
        check_bound(bound_of(**BROKEN_BOUNDS[name]))
    assert name in error.value.failures


def ekf(scenario, z, seed, *, gaps=True, covariance=1.0):
    """A textbook extended Kalman filter that takes LOS and NLOS as one Gaussian law; runs one after the other."""
    F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    laws = [(np.mean([n.mean for n in a.noises]), 2 * max(n.variance for n in a.noises)) for a in scenario.links]
    means, covariances = [], []
    for run in z:
        x, P = np.asarray(scenario.prior.mean), np.asarray(scenario.prior.covariance)
        row, spread = [x], [P]
        for k in range(len(run)):
            x, P = F[k] @ x, F[k] @ P @ F[k].T + Q[k]
            for m, (bias, variance) in enumerate(laws):
                if gaps and np.isnan(run[k, m]):
                    continue
                away = x[:2] - np.asarray(scenario.links[m].measurement.anchor)
                h = np.concatenate([away / np.linalg.norm(away), np.zeros(2)])
                gain = P @ h / (h @ P @ h + variance)
                x = x + gain * (run[k, m] - bias - np.linalg.norm(away))
                P = P - np.outer(gain, h @ P)
            row.append(x)
            spread.append((P + P.T) / 2)
        means.append(row)
        covariances.append(spread)
    return lb.Estimates(np.array(means), covariance * np.array(covariances))


def changed(change):
    return lambda scenario, z, seed: change(ekf(scenario, z, seed).mean, z)


def smoother(scenario, z, seed):
    return ekf(scenario, z, seed).mean + 0.01 * np.nan_to_num(z).sum((1, 2))[:, None, None]


def eraser(scenario, z, seed):
    found = ekf(scenario, z, seed).mean
    z[:] = 0
    return found


BROKEN_FILTERS = {
    "estimates": changed(lambda mean, z: mean[:, :3]),
    "missing ranges": lambda scenario, z, seed: ekf(scenario, z, seed, gaps=False),
    "past only": smoother,
    "each run alone": changed(lambda mean, z: mean + 0.1 * (mean - mean.mean(0))),
    "reproducible": changed(lambda mean, z: mean + np.random.default_rng().normal(size=mean.shape)),
    "input": eraser,
    "covariances": lambda scenario, z, seed: ekf(scenario, z, seed, covariance=-1.0),
    "learns": changed(lambda mean, z: np.broadcast_to(mean[:1, :1], mean.shape)),
}


def test_a_textbook_filter_conforms():
    check_filter(ekf)


def test_every_filter_check_has_a_broken_filter():
    assert set(BROKEN_FILTERS) == set(filter_suite.CHECKS)


@pytest.mark.parametrize("name", BROKEN_FILTERS)
def test_a_broken_filter_is_caught(name):
    with pytest.raises(Nonconforming) as error:
        check_filter(BROKEN_FILTERS[name])
    assert name in error.value.failures
