"""Noise families in scenario files: every law is read, written and read back exactly; mistakes name the nearest key."""

import equinox as eqx
import numpy as np
import pytest

import locbounds as lb
from locbounds.io.scenario_file import dumps, loads
from locbounds.noise import Convolution, TruncatedGaussianSum, UniformSum
from locbounds.report.understood import understood

BASE = """
format = 1
[time]
step_s = 0.2
steps = 10
[motion]
model = "constant-velocity"
psd_m2_s3 = 0.5
[prior]
position_m = [500, 500]
position_std_m = 50
velocity_m_s = [5, 5]
velocity_std_m_s = 2
[links]
measure = "range"
sight = { stay = 0.9 }
los = LOS_
nlos = NLOS_
[anchors]
a = { position_m = [-3000, -2000] }
b = { position_m = [3000, 5000] }
"""
TABLES = {
    "{ std_m = 2, family = 'gaussian' }": lb.Gaussian(0.0, 2.0),
    "{ family = 'truncated-gaussian', std_m = 2, low_m = -4, high_m = 4 }": lb.TruncatedGaussian(0.0, 2.0, -4.0, 4.0),
    "{ family = 'truncated-gaussian', center_m = 1, std_m = 2, low_m = 0 }": lb.TruncatedGaussian(1.0, 2.0, 0.0),
    "{ family = 'uniform', low_m = 0, high_m = 3 }": lb.Uniform(0.0, 3.0),
    "{ family = 'exponential', scale_m = 5, start_m = 1 }": lb.Exponential(5.0, 1.0),
    "{ family = 'exponentially-modified-gaussian', std_m = 1, scale_m = 5 }": lb.ExponentiallyModifiedGaussian(
        0.0, 1.0, 5.0
    ),
    "{ family = 'student-t', degrees = 4, scale_m = 2 }": lb.StudentT(4.0, 0.0, 2.0),
    "{ family = 'laplace', center_m = 1, scale_m = 2 }": lb.Laplace(1.0, 2.0),
    "{ family = 'gamma', shape = 2.5, scale_m = 2 }": lb.Gamma(2.5, 2.0),
    "{ family = 'log-normal', median_m = 3, log_std = 0.7 }": lb.LogNormal(3.0, 0.7),
    "{ mixture = [{ share = 0.9, family = 'laplace', scale_m = 1 }, { share = 0.1, std_m = 9 }] }": lb.Mixture(
        [0.9, 0.1], [lb.Laplace(0.0, 1.0), lb.Gaussian(0.0, 9.0)]
    ),
    "{ sum = [{ std_m = 3 }, { std_m = 4, mean_m = 1 }] }": lb.Gaussian(1.0, 5.0),
}


def with_los(table, nlos="{ std_m = 9 }"):
    return loads(BASE.replace("NLOS_", nlos.replace("'", '"')).replace("LOS_", table.replace("'", '"')))


@pytest.mark.parametrize("table", TABLES)
def test_every_family_is_read_and_written_back_exactly(table):
    scenario = with_los(table)
    noise = scenario.links[0].noises[0]
    assert eqx.tree_equal(noise, TABLES[table])
    assert eqx.tree_equal(loads(dumps(scenario)), scenario)


SUMS = {
    "{ family = 'truncated-gaussian', std_m = 3, low_m = -6, high_m = 6 }": TruncatedGaussianSum,
    "{ family = 'uniform', low_m = 0, high_m = 3 }": UniformSum,
    "{ family = 'laplace', scale_m = 3 }": Convolution,
}


@pytest.mark.parametrize("excess", SUMS)
def test_an_excess_is_the_sum_with_the_noise_in_los_and_is_written_as_such(excess):
    los = "{ family = 'truncated-gaussian', std_m = 1.6, low_m = -3.2, high_m = 3.2 }"
    los = los if SUMS[excess] is not Convolution else "{ std_m = 2 }"
    scenario = with_los(los, excess.replace("{ ", "{ plus_los = true, "))
    assert type(scenario.links[0].noises[1]) is SUMS[excess]
    text = dumps(scenario)
    assert "plus_los = true, family" in text
    assert eqx.tree_equal(loads(text), scenario)


def test_an_exponential_excess_on_gaussian_noise_is_written_as_such():
    scenario = with_los("{ std_m = 2 }", "{ plus_los = true, family = 'exponential', scale_m = 5 }")
    assert eqx.tree_equal(scenario.links[0].noises[1], lb.ExponentiallyModifiedGaussian(0.0, 2.0, 5.0))
    text = dumps(scenario)
    assert 'nlos = { plus_los = true, family = "exponential", scale_m = 5 }' in text
    assert eqx.tree_equal(loads(text), scenario)


def test_outliers_on_any_law_and_an_anchor_of_its_own():
    text = BASE.replace("NLOS_", "{ std_m = 9 }").replace("LOS_", '{ family = "laplace", scale_m = 1 }')
    text = text.replace("[anchors]", "outlier = { share = 0.1, std_m = 50 }\n[anchors]")
    text = text.replace("b = {", 'b = { los = { family = "student-t", degrees = 3, scale_m = 2 }, ')
    scenario = loads(text)
    first, second = (link.noises[0] for link in scenario.links)
    assert eqx.tree_equal(first, lb.Mixture([0.9, 0.1], [lb.Laplace(0.0, 1.0), lb.Gaussian(0.0, 50.0)]))
    assert isinstance(second.parts[0], lb.StudentT)
    assert isinstance(scenario.links[0].noises[1], lb.GaussianMixture)
    assert eqx.tree_equal(loads(dumps(scenario)), scenario)


def test_check_says_which_law_it_is_and_that_no_bound_exists():
    seen = understood(with_los("{ family = 'uniform', low_m = 0, high_m = 3 }"))
    assert seen["links"][0]["LOS error"] == "uniform: mean 1.5 m, deviation 0.866025 m, irregular"
    (bcrb,) = [b for b in seen["bounds"] if b["id"] == "bcrb"]
    assert bcrb["status"] == "refused"
    assert "LOS noise of anchor a has no finite Fisher information: the density jumps at 0 m" in bcrb["reasons"][0]


def test_laws_without_a_file_form_are_named():
    import jax.numpy as jnp

    scenario = with_los("{ std_m = 1 }")
    link = scenario.links[0]
    own = lb.FromLogDensity(lambda w: -jnp.abs(w) - np.log(2))
    odd = lb.Link(link.name, link.measurement, link.sight, (own, link.noises[1]))
    with pytest.raises(lb.InputError, match="noise FromLogDensity has no form"):
        dumps(scenario.replace(links=[odd]))


SAMPLES = {
    "{ sum = [{ std_m = 1.6, samples = 10 }, { family = 'uniform', low_m = 0, high_m = 3 }] }": lb.Epoch(
        lb.Gaussian(0.0, 1.6), lb.Uniform(0.0, 3.0), 10
    ).as_noise(),
    "{ samples = 10, sum = [{ std_m = 3, mean_m = 1 }, { std_m = 4 }] }": lb.Gaussian(1.0, 5.0 / np.sqrt(10.0)),
}


@pytest.mark.parametrize("table", SAMPLES)
def test_samples_with_a_bias_in_common_or_of_their_own(table):
    scenario = with_los(table)
    assert eqx.tree_equal(scenario.links[0].noises[0], SAMPLES[table])
    assert eqx.tree_equal(loads(dumps(scenario)), scenario)


def test_an_excess_on_averaged_noise_is_a_common_bias():
    scenario = with_los("{ std_m = 4, samples = 4 }", "{ plus_los = true, family = 'exponential', scale_m = 5 }")
    assert eqx.tree_equal(scenario.links[0].noises[1], lb.ExponentiallyModifiedGaussian(0.0, 2.0, 5.0))
    assert eqx.tree_equal(loads(dumps(scenario)), scenario)


BAD = [
    ("{ std_m = 1, samples = 0 }", "links.los.samples is 0, but must be at least 1", "averaged"),
    ("{ std_m = 1, samples = 2.5 }", "links.los.samples is 2.5, not a whole number", "averaged"),
    ("{ family = 'laplace', scale_m = 1, samples = 4 }", "samples of an error that is not Gaussian", "locbounds.Epoch"),
    ("{ samples = 4, sum = [{ std_m = 1 }, { family = 'laplace', scale_m = 1 }] }", "not Gaussian", "outside"),
    ("{ family = 'gama', shape = 2, scale_m = 1 }", "unknown family 'gama'", "Did you mean gamma?"),
    ("{ family = 'gamma', shape = 2 }", 'family = "gamma" but no scale_m', "Add scale_m"),
    ("{ family = 'gamma', shape = 2, scale_m = 1, std_m = 3 }", 'std_m, which family = "gamma"', "It takes: shape"),
    ("{ family = 'exponential', scale_km = 2 }", "unknown key links.los.scale_km", "Did you mean scale_m?"),
    ("{ scale_m = 2 }", "scale_m but no family", "exponential"),
    ("{ family = 'uniform', low_m = 3, high_m = 1 }", "uniform noise from 3.0 to 1.0", "low < high"),
    ("{ family = 'laplace', scale_m = 0 }", "links.los.scale_m is 0, but must be positive", "metres"),
    ("{ family = 'truncated-gaussian', std_m = 1, low_m = 90, high_m = 91 }", "leave no mass", "limits"),
    ("{ family = 3 }", "links.los.family is 3, not text", "quotes"),
    ("{ sum = [{ std_m = 1 }] }", "sum of 1 errors", "two"),
    ("{ sum = [{ std_m = 1 }, { std_m = 2 }], std_m = 3 }", "sum and std_m", "Keep sum"),
    ("{ sum = [{ std_m = 1, share = 0.5 }, { std_m = 2 }] }", "share in a sum", "mixture"),
    ("{ mixture = [{ std_m = 1 }, { std_m = 2 }] }", "without share", "share"),
    ("{ mixture = [{ share = 0.5, std_m = 1 }, { share = 0.4, std_m = 2 }] }", "shares are [0.5, 0.4]", "sum to one"),
    ("{ sum = [{ std_m = 1 }, { famly = 'laplace', scale_m = 2 }] }", "links.los.sum.1.famly", "Did you mean family?"),
]


@pytest.mark.parametrize("table, cause, remedy", BAD)
def test_mistakes_name_the_key_and_the_remedy(table, cause, remedy):
    with pytest.raises(lb.InputError) as error:
        with_los(table)
    assert cause in error.value.cause
    assert remedy in error.value.remedy
