"""From a log to a scenario: parts in place, comments for every number, and what is missing named."""

from dataclasses import replace

import numpy as np
import pytest

from datasets import need
from locbounds.errors import InputError
from locbounds.fit import RangeLog, Track, fit_quality, fit_scenario
from locbounds.io.logs import read_log
from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import GaussianMixture
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight
from locbounds.simulation import simulate
from locbounds.times import Times

ANCHORS = np.array([[0.0, 0.0], [40.0, 0.0], [0.0, 40.0]])


def simulated_log(*, tracks=6, steps=250, labels=False):
    """Ranges drawn from a scenario at irregular times, with gaps."""
    shares = [0.98, 0.02]
    noises = (
        GaussianMixture(shares, [0.2, 5.0], [0.3, 40.0]),
        GaussianMixture(shares, [3.0, 5.0], [1.0, 40.0]),
    )
    sight = DwellSight(None, [8.0, 4.0])
    rng = np.random.default_rng(5)
    found = []
    for i in range(tracks):
        time = np.r_[0, rng.choice([0.3, 0.5, 2.0], size=steps, p=[0.6, 0.35, 0.05]).cumsum()]
        scenario = Scenario(
            title="log",
            times=Times(time),
            motion=ConstantVelocity(0.02),
            prior=GaussianPrior(np.array([20.0, 20.0, 0.3, 0.0]), np.diag([25.0, 25.0, 0.1, 0.1])),
            links=[Link(str(m), Range(a), sight, noises) for m, a in enumerate(ANCHORS)],
        )
        draws = simulate(scenario, runs=1, seed=i)
        z = np.where(rng.random((steps, 3)) < 0.1, np.nan, np.asarray(draws.measurements[0]))
        label = np.asarray(draws.sight[0]) if labels else None
        found.append(Track(f"t{i}", time + 100.0, z, np.asarray(draws.states[0])[:, :2], label))
    return RangeLog(("0", "1", "2"), ANCHORS, tuple(found))


@pytest.fixture(scope="module")
def log():
    return simulated_log(labels=True)


def unlabelled(log):
    return replace(log, tracks=tuple(replace(t, sight=None) for t in log.tracks))


def test_scenario_has_the_parameters_that_made_the_log(log):
    train, held = unlabelled(log).hold_out(2)
    fitted = fit_scenario(train, held_out=held)
    fit = fitted.noise["1"]
    for name, true in {
        "los_mean_m": 0.2,
        "los_std_m": 0.3,
        "nlos_mean_m": 3.0,
        "nlos_std_m": 1.0,
        "los_dwell_s": 8.0,
        "nlos_dwell_s": 4.0,
        "outlier_share": 0.02,
    }.items():
        assert abs(getattr(fit, name) - true) < 4 * fit.stderr_model[name], name
    assert fitted.motion is not None
    assert abs(fitted.motion.psd_m2_s3 - 0.02) < 5 * fitted.motion.stderr  # the s.e. itself is from four tracks
    scenario = fitted.scenario
    assert fitted.layout in {t.name for t in held.tracks}
    typical = next(t for t in held.tracks if t.name == fitted.layout)
    np.testing.assert_allclose(scenario.times.time_s, typical.time_s - 100.0)
    np.testing.assert_array_equal(scenario.reports, typical.reports)
    noise, sight = scenario.links[2].noises[1], scenario.links[0].sight
    assert isinstance(noise, GaussianMixture)
    assert isinstance(sight, DwellSight)
    np.testing.assert_allclose(noise.means, fit.law(1)[1], rtol=1e-3)  # written with four digits
    np.testing.assert_allclose(sight.dwell_s, fit.dwell_s, rtol=1e-3)
    keys = {"links.los", "links.nlos", "links.sight", "links.outlier", "motion.psd_m2_s3", "prior"}
    assert keys <= set(fitted.comments)
    assert "4 tracks" in fitted.comments["links.los"]
    assert np.isfinite(simulate(scenario, runs=2, seed=0).states).all()


@pytest.mark.slow
def test_each_anchor_its_own(log):
    fitted = fit_scenario(log, per_anchor=True, psd_m2_s3=0.02, prior="start")
    assert len(set(map(id, fitted.noise.values()))) == 3
    pooled = np.mean([f.nlos_mean_m for f in fitted.noise.values()])
    assert pooled == pytest.approx(3.0, abs=0.15)
    assert fitted.motion is None
    assert fitted.comments["motion.psd_m2_s3"] == "given"
    assert "anchors.2.nlos" in fitted.comments
    assert len({f.outlier_std_m for f in fitted.noise.values()}) == 1  # pooled
    assert len(fit_quality(log, fitted.noise).links) == 3


def test_what_the_log_cannot_tell_is_named(log):
    blind = replace(log, tracks=tuple(replace(t, position_m=None) for t in log.tracks))
    with pytest.raises(InputError, match=r"links\.los, links\.nlos, motion\.psd_m2_s3 and prior"):
        fit_scenario(blind)
    still = replace(log, tracks=tuple(replace(t, position_m=np.full((len(t.time_s), 2), 7.0)) for t in log.tracks))
    with pytest.raises(InputError, match=r"motion\.psd_m2_s3"):
        fit_scenario(still)
    track = Track("short", np.arange(2.0), np.array([[1.0, np.nan, np.nan]]), np.zeros((2, 2)))
    with pytest.raises(InputError, match="there is 1 range"):
        fit_scenario(replace(log, tracks=(track,)))


@pytest.mark.parametrize("which, held", [(2, ["t4", "t5"]), ("1", ["t5"]), ("t0, t3", ["t0", "t3"])])
def test_hold_out(log, which, held):
    train, test = log.hold_out(which)
    assert [t.name for t in test.tracks] == held
    assert len(train.tracks) + len(held) == 6


@pytest.mark.parametrize("which", ["6", "0", "t9", "t0,t1,t2,t3,t4,t5"])
def test_hold_out_refuses(log, which):
    with pytest.raises(InputError):
        log.hold_out(which)


def canteen():
    folder = need("wifi_rtt_walks")
    return read_log(
        folder / "ranges.csv.gz", anchors=folder / "anchors.csv", truth=folder / "truth.csv.gz", select="scene=canteen"
    )


def test_real_walks_have_the_errors_published_with_them():
    """README of the data: 79,797 ranges (ours lack those of step 0), mean error 2.064 m, median 1.530 m."""
    log = canteen()
    assert (len(log.tracks), len(log.anchor_names), log.notes) == (16, 6, ())
    assert 79_797 - 16 * 6 <= log.ranges < 79_797
    errors = log.errors().error_m
    seen = errors[np.isfinite(errors)]
    assert np.isclose(seen.mean(), 2.064, atol=0.005)
    assert np.isclose(np.median(seen), 1.530, atol=0.002)


@pytest.mark.slow
def test_real_walks_agree_with_the_two_state_fit_published_with_them():
    """README of the data: discrete-time Gaussian hidden Markov model, pooled, without outliers over 20 m.

    Ours is in continuous time and takes 1 % outliers, which shortens the NLOS tail: similar, not equal.
    """
    fitted = fit_scenario(canteen())
    fit = next(iter(fitted.noise.values()))
    readme = {"los_mean_m": 1.232, "los_std_m": 0.673, "nlos_mean_m": 4.037, "nlos_std_m": 2.468}
    for name, value in (readme | {"los_dwell_s": 10.8, "nlos_dwell_s": 4.4}).items():
        assert 0.7 < getattr(fit, name) / value < 1.4, name
    assert 0.0003 < fit.outlier_share < 0.02
    assert "not white" in fitted.quality.statement
    assert fitted.quality.links[0].ranges > 13_500
