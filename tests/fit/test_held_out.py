"""Bounds and filters along measured tracks."""

import numpy as np
import pytest

import locbounds as lb
from locbounds.fit import RangeLog, Track
from locbounds.fit.held_out import along_tracks, on_track
from locbounds.quadrature import standard_error

ROUNDING = 1e-9  # the same computation, padded


@pytest.fixture(scope="module")
def model():
    noises = (lb.Gaussian(0.0, 1.0), lb.Gaussian(3.0, 2.0))
    sight = lb.DwellSight(None, [4.0, 3.0])
    places = ([0.0, 0.0], [30.0, 0.0], [0.0, 30.0])
    return lb.Scenario(
        "three anchors",
        lb.Times.uniform(step_s=0.5, steps=12),
        lb.ConstantVelocity(0.1),
        lb.GaussianPrior([12.0, 12.0, 0.0, 0.0], np.diag([9.0, 9.0, 1.0, 1.0])),
        [lb.Link(f"a{m}", lb.Range(place), sight, noises) for m, place in enumerate(places)],
    )


@pytest.fixture(scope="module")
def log(model):
    """Two simulated tracks of unequal length with uneven times and gaps, dressed up as measured ones."""
    rng = np.random.default_rng(3)
    tracks = []
    for name, steps in (("long", 12), ("short", 7)):
        time_s = 100.0 + np.cumsum(rng.uniform(0.3, 0.7, steps + 1))
        there = model.with_times(time_s - time_s[0]).with_reports(rng.uniform(size=(steps, 3)) < 0.8)
        draws = lb.simulate(there, runs=1, seed=steps)
        tracks.append(Track(name, time_s, draws.measurements[0], draws.states[0, :, :2]))
    return RangeLog(("a0", "a1", "a2"), model.anchors, tuple(tracks))


@pytest.mark.slow
def test_padding_changes_nothing(model, log):
    bound, filtered = along_tracks(model, log, bounds=[lb.bcrb], filters=[lb.ImmEkf()], rtol=0.05)
    assert (bound.id, filtered.id, bound.tracks) == ("bcrb", "imm-ekf", ("long", "short"))
    for m, track in enumerate(log.tracks):
        alone = on_track(model, track)
        direct = lb.bcrb(alone, rtol=0.05, expectation=lb.AlongTrack(track.position_m))
        assert len(bound.square_m2[m]) == len(track.time_s)
        # random numbers are drawn per shape, so that a padded track has other ones: compare within their errors
        error = np.sqrt(2) * standard_error(direct.replicates.mean(axis=1))
        assert error < 0.05 * direct.position_mse.mean()
        assert abs(np.mean(bound.square_m2[m] - direct.position_mse)) < 4 * error
        own = lb.ImmEkf()(alone, track.ranges_m[None])
        square = np.sum((own.mean[0, :, :2] - track.position_m) ** 2, axis=-1)
        np.testing.assert_allclose(filtered.square_m2[m], square, rtol=ROUNDING, atol=ROUNDING)


def test_pooled_numbers(model, log):
    (filtered,) = along_tracks(model, log, bounds=[], filters=[lb.ImmEkf()])
    squares = np.concatenate([s[1:] for s in filtered.square_m2])
    value, error = filtered.rmse()
    assert value == pytest.approx(np.sqrt(squares.mean()))
    assert error > 0
    assert filtered.rmse_by_track()[1] == pytest.approx(np.sqrt(filtered.square_m2[1][1:].mean()))
    rows = filtered.over_time(width_s=2.0)
    assert [row[0] for row in rows] == sorted({int(t // 2.0) for time in filtered.time_s for t in time})
    assert filtered.quantile(0.5) == pytest.approx(np.median(np.sqrt(squares)))


def test_what_does_not_fit_is_refused(model, log):
    blind = RangeLog(log.anchor_names, log.anchors_m, (Track("t", log.tracks[0].time_s, log.tracks[0].ranges_m),))
    with pytest.raises(lb.InputError, match="no true positions"):
        along_tracks(model, blind, bounds=[], filters=[])
    other = RangeLog(("a0", "a1", "b2"), log.anchors_m, log.tracks)
    with pytest.raises(lb.InputError, match="b2"):
        along_tracks(model, other, bounds=[], filters=[])
