import numpy as np
import pytest

import locbounds as lb
import textbook_trackers as textbook
from filter_scenarios import awkward, with_gaps
from locbounds.filters.lowering import lower
from locbounds.precision import double_precision


@pytest.mark.parametrize(
    "options", [{"dim": 2, "outliers": True}, pytest.param({"dim": 3, "discrete": True}, marks=pytest.mark.slow)]
)
def test_reproduces_the_textbook_with_inverses(options):
    scenario = awkward(**options)
    model = double_precision(lower)(scenario)
    z = with_gaps(lb.simulate(scenario, runs=6, seed=4).measurements)
    ours = lb.EkfBanks()(scenario, z)
    clipped = []
    for i, track in enumerate(z):
        mean, covariance, times = textbook.ekf_banks(model, track)
        np.testing.assert_allclose(ours.mean[i], mean, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(ours.covariance[i], covariance, rtol=1e-6, atol=1e-6)
        clipped.append(times / np.isfinite(track).sum())
    np.testing.assert_allclose(ours.diagnostics["clipped"], clipped)
    assert max(clipped) > 0, "otherwise clipping is not tested"


def test_where_both_sights_are_alike_fusion_is_the_joint_ekf():
    scenario = awkward(2)
    noise = lb.Gaussian(3.0, 30.0)
    scenario = scenario.replace(
        links=[lb.Link(a.name, a.measurement, a.sight, (noise, noise)) for a in scenario.links],
    )
    draws = lb.simulate(scenario, runs=3, seed=1)
    banks = lb.EkfBanks()(scenario, draws.measurements)
    joint = lb.OracleEkf()(scenario, draws.measurements, sight=draws.sight)
    np.testing.assert_allclose(banks.mean, joint.mean, atol=1e-8)
    np.testing.assert_allclose(banks.covariance, joint.covariance, atol=1e-8)
    assert not banks.diagnostics["clipped"].any()
