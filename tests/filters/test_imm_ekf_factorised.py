import numpy as np
import pytest

import locbounds as lb
import textbook_filters as textbook
from filter_scenarios import awkward, with_gaps
from locbounds.filters import FactorisedImmEkf, ImmEkf, OracleEkf
from locbounds.filters.lowering import lower
from locbounds.precision import double_precision

ROUNDING = 1e-8  # metres; the same algebra in another order


@pytest.mark.parametrize(
    "options",
    [
        {"dim": 2},
        pytest.param({"dim": 2, "outliers": True}, marks=pytest.mark.slow),
        pytest.param({"dim": 3}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_linear_cost_equals_the_quadratic_textbook(options):
    scenario = awkward(**options)
    model = double_precision(lower)(scenario)
    z = with_gaps(lb.simulate(scenario, runs=3, seed=1).measurements)
    expected = [textbook.imm_ekf_factorised(model, track) for track in z]
    ours = FactorisedImmEkf()(scenario, z)
    np.testing.assert_allclose(ours.mean, [mean for mean, _ in expected], atol=ROUNDING)
    np.testing.assert_allclose(np.asarray(ours.covariance), [P for _, P in expected], rtol=1e-9, atol=1e-7)


@pytest.mark.slow
def test_one_link_is_the_joint_filter():
    scenario = awkward(2, links=2, outliers=True)
    scenario = scenario.replace(links=scenario.links[1:])
    z = with_gaps(lb.simulate(scenario, runs=3, seed=1).measurements)
    ours, joint = FactorisedImmEkf()(scenario, z), ImmEkf()(scenario, z)
    np.testing.assert_allclose(ours.mean, joint.mean, atol=ROUNDING)
    np.testing.assert_allclose(np.asarray(ours.covariance), np.asarray(joint.covariance), rtol=1e-9, atol=1e-7)


@pytest.mark.slow
def test_as_accurate_as_the_joint_filter(paper):
    """Paired over the same tracks: the mean square errors agree within 4 standard errors and within 1 %."""
    scenario, draws = paper
    mse = [
        ((f(scenario, draws.measurements).mean - draws.states)[..., :2] ** 2).sum(-1).mean(-1)
        for f in (FactorisedImmEkf(), ImmEkf())
    ]
    difference = mse[0] - mse[1]
    assert abs(difference.mean()) < 4 * difference.std() / np.sqrt(len(difference))
    assert abs(difference.mean()) < 0.01 * mse[1].mean()


def test_a_hundred_anchors():
    """Two to the hundredth joint modes: close to the oracle, and its covariance tells the truth (mean NEES)."""
    rng = np.random.default_rng(0)
    scenario = awkward(2)
    sight = lb.MarkovSight.stay((0.8, 0.9))
    noises = lb.Gaussian(0.0, 10.0), lb.Gaussian(30.0, 30.0)
    links = [lb.Link(f"a{m}", lb.Range(rng.uniform(-500, 500, 2)), sight, noises) for m in range(100)]
    scenario = scenario.replace(links=links)
    states = lb.simulate(scenario.replace(links=links[:3]), runs=256, seed=1).states
    now, sight = rng.random((256, 100)) < 1 / 3, np.empty((256, 12, 100), int)
    for k in range(12):
        now = rng.random((256, 100)) < np.where(now, 0.9, 0.2)
        sight[:, k] = now
    distance = np.linalg.norm(states[:, 1:, None, :2] - scenario.anchors, axis=-1)
    z = distance + rng.normal(np.where(sight, 30.0, 0.0), np.where(sight, 30.0, 10.0))
    estimates = FactorisedImmEkf()(scenario, z)
    assert not estimates.diverged.any()
    error = (estimates.mean - states)[:, 3:]
    oracle = (OracleEkf()(scenario, z, 0, sight).mean - states)[:, 3:]
    assert (error[..., :2] ** 2).mean() < 2 * (oracle[..., :2] ** 2).mean()
    nees = np.einsum("rki,rkij,rkj->rk", error, np.linalg.inv(np.asarray(estimates.covariance)[:, 3:]), error).mean(1)
    assert abs(nees.mean() - 4) < 4 * nees.std() / 16 + 0.2  # 0.2: linearisation and mode errors, 5 %


def test_a_mobile_at_an_anchor_is_no_surprise():
    scenario = awkward(2)
    here = lb.Link("here", lb.Range(scenario.prior.mean[:2]), scenario.links[0].sight, scenario.links[0].noises)
    still = lb.GaussianPrior(np.r_[scenario.prior.mean[:2], 0, 0], np.zeros((4, 4)))
    scenario = scenario.replace(links=[here, *scenario.links[1:]], prior=still)
    assert not FactorisedImmEkf()(scenario, lb.simulate(scenario, runs=3, seed=1).measurements).diverged.any()
