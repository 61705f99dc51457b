import numpy as np
import pytest

import locbounds as lb
from filter_scenarios import awkward
from locbounds.evaluation import evaluate_on


def test_where_both_sights_are_alike_two_passes_suffice_and_it_is_the_kalman_filter():
    scenario = awkward(2)
    noise = lb.Gaussian(3.0, 30.0)
    scenario = scenario.replace(links=[lb.Link(a.name, a.measurement, a.sight, (noise, noise)) for a in scenario.links])
    found = lb.reference(scenario, runs=20, seed=1)
    exact = evaluate_on(lb.OracleEkf(), scenario, lb.simulate(scenario, runs=20, seed=1))
    np.testing.assert_allclose(found.position_mse, exact.position_mse, rtol=1e-9)
    assert found.diagnostics["particles"].tolist() == [50, 200]
    assert abs(found.diagnostics["change"][1]) < 1e-9
    assert found.name == "reference"
    assert not found.verdict.warnings


@pytest.mark.slow
def test_what_has_not_converged_says_so():
    found = lb.reference(awkward(2), runs=8, rtol=1e-9, most=200)
    assert "not converged: from 50 to 200 particles" in found.verdict.warnings[-1]


@pytest.mark.parametrize("options", [{"rtol": 0.0}, {"rtol": 2.0}, {"runs": 1}, {"most": 100}])
def test_bad_options(options):
    with pytest.raises(lb.InputError):
        lb.reference(awkward(2), **options)
