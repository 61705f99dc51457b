"""The least error by Monte Carlo against quadrature, with its own standard errors."""

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import norm

from locbounds.survey import Fingerprints, survey_model
from locbounds.survey.mmse import discrete_mmse
from small_surveys import exact_mmse, small_survey

FALSE_ALARMS = 1e-3


def test_both_kinds_of_draws_agree_with_quadrature():
    rng = np.random.default_rng(11)
    scores, hows = [], set()
    for seed in range(40):
        model = small_survey(rng, columns=1)
        exact, _ = exact_mmse(model)
        least = discrete_mmse(model, draws=4_000, seed=seed)
        hows.add(least.how)
        if exact.sum() < 1e-9:
            continue
        scores.append((least.mse_m2 - exact.sum()) / max(least.stderr_m2, 1e-9 * exact.sum()))
        assert least.axes_m2.sum() == pytest.approx(least.mse_m2)
    assert hows == {"points", "pairs"}
    assert np.abs(scores).max() < norm.isf(FALSE_ALARMS / 2 / len(scores))
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(scores)))


def test_rare_confusions_are_not_missed():
    """Two points at six deviations: a confusion happens once in a thousand; 200 draws at the points see none."""
    heard = np.array([[-50.0], [-56.0], [-90.0]])
    model = survey_model(Fingerprints.at(np.array([[0.0], [4.0], [8.0]]), heard), noise_db=0.8)
    least = discrete_mmse(model, draws=200)
    exact = float(exact_mmse(model)[0][0])
    assert least.how == "pairs"
    assert abs(least.mse_m2 - exact) < 4 * least.stderr_m2 < 0.8 * exact


def test_what_is_not_heard_tells_less():
    """Two points, one access point, censored in between: the error of the better of two tests, in closed form."""
    heard = np.array([[-50.0], [-54.0]])
    model = survey_model(Fingerprints.at(np.array([[0.0], [2.0]]), heard), noise_db=2.0, silence="censored")
    assert model.level.tolist() == [-54.0]
    z = np.arange(-54.0, -30.0, 0.01) + 0.005
    density = norm.pdf((z[:, None] - heard[:, 0]) / 2.0) / 2.0
    silent = ndtr((-54.0 - heard[:, 0]) / 2.0)

    def cost(p):
        return 4.0 * np.prod(p, -1) / np.sum(p, -1) / 2

    exact = np.sum(cost(density)) * 0.01 + cost(silent)
    least = discrete_mmse(model, draws=40_000)
    assert abs(least.mse_m2 - exact) < 4 * least.stderr_m2
    uncensored = survey_model(Fingerprints.at(np.array([[0.0], [2.0]]), heard), noise_db=2.0)
    assert least.mse_m2 > exact_mmse(uncensored)[0][0]


def test_points_may_be_drawn_from_and_the_error_covers_that():
    rng = np.random.default_rng(4)
    place = rng.random((4_000, 2)) * 50
    model = survey_model(Fingerprints.at(place, -50 + 0.3 * place + rng.normal(size=place.shape)), noise_db=3.0)
    every = discrete_mmse(model, draws=8_000)
    some = discrete_mmse(model, draws=2_000, most_points=500, seed=1)
    assert np.isfinite(some.at_m2).sum() == 500
    assert abs(every.mse_m2 - some.mse_m2) < 4 * np.hypot(every.stderr_m2, some.stderr_m2)
