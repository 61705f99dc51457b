"""From samples to a model: noise from repeats, twins, silence, and what is no survey."""

import numpy as np
import pytest

import locbounds as lb
from datasets import need
from locbounds.survey import Fingerprints, estimate_noise
from locbounds.survey.hold_out import folds, refuse_outside, split

PLACES = np.repeat(np.stack(np.meshgrid(np.arange(10.0), np.arange(6.0)), -1).reshape(-1, 2), 5, axis=0)


def repeats(deviation, correlation=None, seed=0):
    rng = np.random.default_rng(seed)
    columns = len(deviation)
    noise = rng.standard_normal((len(PLACES), columns))
    if correlation is not None:
        noise = noise @ np.linalg.cholesky(correlation).T
    mean = -60 + 5 * np.sin(PLACES @ rng.normal(size=(2, columns)))
    return Fingerprints.at(PLACES, mean + noise * np.asarray(deviation))


def test_deviations_are_found_within_their_errors():
    true = np.array([1.0, 2.0, 4.0])
    freedom = 60 * 4
    each = estimate_noise(repeats(true)).deviation
    assert np.abs(np.log(each / true)).max() < 4 / np.sqrt(2 * freedom)
    common = estimate_noise(repeats(true), shape="common").deviation
    np.testing.assert_allclose(common, np.sqrt(np.mean(true**2)), rtol=4 / np.sqrt(2 * freedom))


def test_columns_with_few_repeats_are_pulled_to_the_pooled_deviation():
    survey = repeats(np.full(12, 2.0), seed=3)
    value = survey.value.copy()
    value[10:, 0] = np.nan  # two points are left
    estimate = estimate_noise(Fingerprints.at(PLACES, value)).deviation
    raw = np.sqrt(np.sum((value[:10, 0].reshape(2, 5) - value[:10, 0].reshape(2, 5).mean(1)[:, None]) ** 2) / 8)
    assert abs(estimate[0] - 2.0) < abs(raw - 2.0) / 2
    assert np.ptp(estimate) < 0.3


def test_correlations_are_found_and_vanish_where_there_are_none():
    true = np.array([[1, 0.8, 0], [0.8, 1, 0], [0, 0, 1]])
    found = estimate_noise(repeats([1.0, 1.0, 1.0], true), shape="full").correlation
    assert found is not None
    assert np.abs(found - true).max() < 4 / np.sqrt(240)
    none = estimate_noise(repeats([1.0] * 8, seed=2), shape="full").correlation
    assert none is None or np.abs(none - np.eye(8)).max() < 0.1


def test_addresses_of_one_access_point_are_merged_and_others_are_not():
    survey = repeats([1.0, 1.0])
    twin = survey.value[:, :1] - 3 + 0.1 * np.random.default_rng(1).normal(size=(len(PLACES), 1))
    twin[::7] = np.nan
    lookalike = repeats([1.0, 1.0], seed=0).value[:, :1] + repeats([1.0], seed=9).value - survey.value[:, :1].mean()
    all_three = Fingerprints.at(PLACES, np.hstack([survey.value, twin, lookalike]), names=("a", "b", "a2", "c"))
    merged = lb.survey_model(all_three)
    assert merged.names == ("a", "b", "c")
    assert "merged: a (a2)" in merged.notes[0]
    assert lb.survey_model(all_three, twins=True).names == ("a", "b", "a2", "c")
    assert (
        lb.survey_bound(merged, scale=4).mse_m2
        > lb.survey_bound(lb.survey_model(all_three, twins=True), scale=4).mse_m2
    )


def test_the_virtual_networks_of_the_hall_are_found():
    read = lb.read_survey(need("wut_wifi_117") / "fingerprints.csv")
    model = lb.survey_model(read.survey)
    assert (model.points, len(read.survey.names), len(model.names)) == (117, 78, 70)
    rms = estimate_noise(read.survey, shape="common").deviation[0]
    assert rms == pytest.approx(1.15, abs=0.15)  # the README of the set: 1.02 where there are three values or more


def test_silence_reads_as_the_weakest_value():
    heard = np.array([[-40.0, -60], [-43, np.nan], [-50, -58]])
    survey = Fingerprints.at(np.array([[0.0, 0], [1, 0], [2, 0]]), heard)
    model = lb.survey_model(survey, noise_db=2.0)
    assert model.mean[1].tolist() == [-43.0, -60.0]
    assert model.level.tolist() == [-60.0, -60.0]
    assert lb.survey_model(survey, noise_db=2.0, silence="censored").silence == "censored"


def points(n=3, columns=2):
    x = np.arange(float(n))[:, None] * [1.0, 0.0]
    return x, -50 - 3 * np.arange(float(n))[:, None] * np.ones(columns) + np.arange(columns)


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (lambda x, z: (x[:1], z[:1]), {}, "one point"),
        (lambda x, z: (0 * x, z), {}, "one point"),
        (lambda x, z: (x, np.nan * z), {}, "no access point is heard"),
        (lambda x, z: (x, 0 * z - 50), {}, "one value everywhere"),
        (lambda x, z: (x, z), {"noise_db": "auto"}, "no point has two samples"),
        (lambda x, z: (x, z), {"noise_db": -1.0}, "noise level is -1"),
        (lambda x, z: (x, z), {"noise_db": "loud"}, '"loud"'),
        (lambda x, z: (x, z), {"noise_db": 1.0, "shape": "round"}, '"round"'),
        (lambda x, z: (x, z), {"noise_db": 1.0, "silence": "gold"}, '"gold"'),
        (lambda x, z: (x, z), {"noise_db": 1.0, "silence": "censored", "shape": "full"}, "not implemented"),
    ],
)
def test_what_is_no_survey_is_refused(change, options, words):
    x, z = change(*points())
    with pytest.raises(lb.InputError, match=words) as error:
        lb.survey_model(Fingerprints.at(x, z), **({"noise_db": 1.0} | options))
    assert error.value.remedy


def test_silent_and_constant_columns_are_left_out_and_named():
    x, z = points(4, 3)
    z[:, 1], z[:, 2] = np.nan, -70
    model = lb.survey_model(Fingerprints.at(x, z, names=("a", "b", "c")), noise_db=1.0)
    assert model.names == ("a",)
    assert model.notes == ("Left out, never heard: b.", "Left out, with one value everywhere: c.")


def test_merging_puts_samples_into_cells():
    survey = repeats([1.0, 1.0]).merged(2.0)
    assert survey.points == 15
    assert survey.samples == len(PLACES)
    np.testing.assert_allclose(np.sort(np.unique(survey.position_m[:, 0])), [0.5, 2.5, 4.5, 6.5, 8.5])


def test_held_out_parts_are_disjoint_and_complete():
    survey = repeats([1.0])
    seen = 0
    for train, test in folds(survey, "points"):
        assert not set(map(tuple, train.position_m)) & set(map(tuple, test.position_m))
        seen += test.samples
    assert seen == survey.samples
    for train, test in folds(survey, "samples"):
        assert set(map(tuple, test.position_m)) <= set(map(tuple, train.position_m))
    labels = {"walk": tuple("abcde"[k % 5] for k in range(survey.samples))}
    train, test = split(survey, labels, "walk:2")
    assert test.samples == 2 * survey.samples // 5
    assert split(survey, labels, "walk=a|b")[1].samples == test.samples
    for bad, words in (("floor=1", "no column floor"), ("walk=z", "walk = z"), ("walk:9", "cannot hold out 9")):
        with pytest.raises(lb.InputError, match=words):
            split(survey, labels, bad)


def test_walks_are_held_out_as_wholes():
    survey = repeats([1.0])
    walks = Fingerprints.at(PLACES, survey.value, group=tuple(f"w{k // 20}" for k in range(len(PLACES))))
    for train, test in folds(walks, "points"):
        assert not set(train.group) & set(test.group)


def test_a_test_point_outside_the_survey_is_refused():
    survey = repeats([1.0])
    refuse_outside(survey, Fingerprints.at(np.array([[0.4, 5.4]]), np.array([[-50.0]])))
    with pytest.raises(lb.InputError, match="nearest survey point"):
        refuse_outside(survey, Fingerprints.at(np.array([[40.0, 5.0]]), np.array([[-50.0]])))
