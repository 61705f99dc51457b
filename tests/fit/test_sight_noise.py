"""The two-sight fit against hmmlearn, closed forms, and its own standard errors on simulated data."""

import numpy as np
import pytest

from fit.simulated import TRUE, errors
from locbounds.errors import InputError
from locbounds.fit import fit_sight_noise


def test_recovers_simulated_parameters_within_standard_errors():
    time, error, _ = errors(1)
    fit = fit_sight_noise(time, error, groups=np.arange(24) // 2)
    assert fit.notes == ()
    z = {name: (getattr(fit, name) - true) / fit.stderr_model[name] for name, true in TRUE.items()}
    # Nine correlated statistics, each beyond 4 s.e. with 6e-5: a false alarm in less than 1 of 1,000 seeds.
    assert max(map(abs, z.values())) < 4, z
    assert (fit.sequences, fit.groups, fit.ranges) == (24, 12, int(np.isfinite(error).sum()))
    for name in ("los_mean_m", "nlos_std_m", "los_dwell_s"):  # the model is true: both kinds of error agree
        assert 0.4 < fit.stderr[name] / fit.stderr_model[name] < 2.5


def test_standard_errors_are_those_of_repeated_fits():
    fits = []
    for seed in range(40):
        time, error, _ = errors(100 + seed, sequences=6, steps=200, missing=0.0, outliers=False)
        fits.append(fit_sight_noise(time, error, outliers=False, initial=fits[0] if fits else None))
    for name in ("los_mean_m", "nlos_mean_m", "los_std_m", "nlos_dwell_s"):
        spread = np.std([getattr(f, name) for f in fits], ddof=1)
        said = np.sqrt(np.mean([f.stderr_model[name] ** 2 for f in fits]))
        assert 0.65 < said / spread < 1.55, name  # 40 fits: the spread itself is known to 11 %; four times that


def test_is_the_gaussian_hidden_markov_model_on_complete_equal_steps():
    """hmmlearn's EM reaches the same likelihood and parameters."""
    from hmmlearn.hmm import GaussianHMM

    time, error, _ = errors(2, sequences=6, steps=200, irregular=False, missing=0.0, outliers=False, free_start=0.6)
    fit = fit_sight_noise(time, error, outliers=False, stationary=False)
    oracle = GaussianHMM(2, "diag", covars_prior=0.0, min_covar=1e-9, n_iter=2000, tol=1e-10, init_params="")
    oracle.startprob_, oracle.transmat_ = np.array([0.5, 0.5]), np.array([[0.9, 0.1], [0.1, 0.9]])
    oracle.means_, oracle.covars_ = np.array([[0.0], [3.0]]), np.array([[0.25], [1.0]])
    oracle.fit(error.reshape(-1, 1), np.full(6, 200))
    assert fit.log_likelihood == pytest.approx(oracle.score(error.reshape(-1, 1), np.full(6, 200)), abs=1e-4)
    loose = 2e-4  # both stop where the likelihood is flat to 1e-6
    assert (fit.los_mean_m, fit.nlos_mean_m) == pytest.approx(tuple(oracle.means_[:, 0]), rel=loose)
    assert (fit.los_std_m, fit.nlos_std_m) == pytest.approx(tuple(np.sqrt(oracle.covars_[:, 0, 0])), rel=loose)
    assert fit.start == pytest.approx(tuple(oracle.startprob_), abs=1e-3)
    p = oracle.transmat_
    total = -np.log(p[0, 0] + p[1, 1] - 1) / 0.5  # eigenvalue of P(0.5 s)
    rates = total * np.array([p[0, 1], p[1, 0]]) / (p[0, 1] + p[1, 0])
    assert fit.dwell_s == pytest.approx(tuple(1 / rates), rel=1e-3)


def test_known_sights_give_the_closed_form():
    """With every sight known: sample moments, and transition counts."""
    time, error, sight = errors(3, sequences=6, steps=200, irregular=False, missing=0.0, outliers=False)
    fit = fit_sight_noise(time, error, labels=sight, outliers=False, stationary=False)
    for r, name in enumerate(("los", "nlos")):
        e = error[sight == r]
        assert getattr(fit, f"{name}_mean_m") == pytest.approx(e.mean(), rel=1e-4)
        assert getattr(fit, f"{name}_std_m") == pytest.approx(e.std(), rel=1e-4)
        # Known sights make the parameters independent: s.e. of a mean of independent draws.
        assert fit.stderr_model[f"{name}_mean_m"] == pytest.approx(e.std() / np.sqrt(len(e)), rel=1e-3)
    now, after = sight[:, :-1].ravel(), sight[:, 1:].ravel()
    p = [np.mean(after[now == r] != r) for r in (0, 1)]
    rates = -np.log(1 - sum(p)) / 0.5 * np.array(p) / sum(p)
    assert fit.dwell_s == pytest.approx(tuple(1 / rates), rel=1e-4)
    assert fit.start_nlos == pytest.approx(sight[:, 0].mean(), abs=1e-3)


def test_labels_may_be_partial_and_decide_which_sight_is_which():
    time, error, sight = errors(3, sequences=6, steps=200, irregular=False, missing=0.0, outliers=False)
    few = np.where(np.arange(200) % 10 == 0, 1 - sight, -1)  # the other way round: "LOS" has the larger mean
    fit = fit_sight_noise(time, error, labels=few, outliers=False, stationary=False)
    assert fit.los_mean_m > fit.nlos_mean_m


def test_units_of_the_errors_do_not_matter():
    scale = 1000.0
    time, error, _ = errors(4, sequences=6, steps=200, outliers=True)
    small, large = (fit_sight_noise(time, s * error) for s in (1.0, scale))
    for name in ("los_mean_m", "nlos_std_m", "outlier_std_m"):
        assert getattr(large, name) == pytest.approx(scale * getattr(small, name), rel=1e-3)
    assert large.dwell_s == pytest.approx(small.dwell_s, rel=1e-3)
    assert large.log_likelihood == pytest.approx(small.log_likelihood - small.ranges * np.log(scale), abs=1e-2)


def test_no_outliers_means_no_component():
    time, error, _ = errors(5, sequences=6, steps=200, outliers=False)
    fit = fit_sight_noise(time, error)
    assert fit.outlier_share == 0
    assert np.isnan(fit.outlier_std_m)
    assert fit.law(0)[0].tolist() == [1.0]


def test_law_of_a_sight_is_a_mixture():
    time, error, _ = errors(4, sequences=6, steps=200)
    fit = fit_sight_noise(time, error)
    weights, means, stds = fit.law(1)
    assert weights.sum() == pytest.approx(1)
    assert (means[0], stds[1]) == (fit.nlos_mean_m, fit.outlier_std_m)
    assert fit.stderr["outlier_share"] > 0


def test_reports_a_sight_that_changes_faster_than_the_log_samples():
    rng = np.random.default_rng(0)
    time = np.tile(np.arange(200) * 1.0, (6, 1))
    error = np.where(rng.random(time.shape) < 0.5, rng.normal(0, 0.1, time.shape), rng.normal(3, 0.5, time.shape))
    assert any("not resolved" in note for note in fit_sight_noise(time, error, outliers=False).notes)


@pytest.mark.parametrize(
    "error, options, cause",
    [
        (np.r_[1.0, np.full(99, np.nan)], {}, "there is 1 range"),
        (np.ones(100), {}, "all range errors are equal"),
        (np.arange(100.0), {"labels": np.zeros((1, 100), int)}, "no range is labelled NLOS"),
        (np.arange(100.0), {"outlier_width": 0.0}, "outlier_width"),
    ],
)
def test_what_cannot_be_fitted_is_said(error, options, cause):
    with pytest.raises(InputError, match=cause) as caught:
        fit_sight_noise(np.arange(100.0)[None], error[None], **options)
    assert caught.value.remedy
