"""Bursts of ranges, clock differences, anchors that stand elsewhere, labels of the truth: asynchronous 3-D logs."""

import numpy as np
import pandas as pd
import pytest

import datasets
import locbounds as lb
from locbounds.fit.clock import LARGEST_OFFSET_S, bursts
from locbounds.fit.held_out import on_track

ANCHORS = np.array([[0.0, 0.0, 2.0], [6.0, 0.0, 0.5], [0.0, 9.0, 3.0]])
LAG = 0.31


def path(t):
    return np.stack([10 + 8 * np.sin(0.3 * t), 5 + 8 * np.cos(0.23 * t), 1 + 0.2 * np.sin(t)], axis=-1)


def write(folder, *, lag=LAG, tracks=2, seconds=40.0, noise=0.05, outliers=0.02, shift=0.0, seed=0):
    """Every anchor reports 3 ms after the one before it, every 0.2 s, with stamps that lag by ``lag``."""
    rng = np.random.default_rng(seed)
    ranges, anchors, truth = [], [], []
    for name in (f"t{i}" for i in range(tracks)):
        place = ANCHORS + shift * rng.normal(size=ANCHORS.shape)
        anchors += [(name, f"a{m}", *p) for m, p in enumerate(place)]
        t = np.arange(0, seconds, 0.1)
        truth += [(name, "LOS" if name == "t0" else "NLOS", k, *x) for k, x in zip(t, path(t), strict=True)]
        for k in np.arange(3.0, seconds - 3.0, 0.2):
            for m in rng.permutation(3):
                if rng.random() < 0.9:
                    at = k + 0.003 * m
                    e = rng.normal(0, noise) + (rng.exponential(20) if rng.random() < outliers else 0)
                    ranges.append((name, round(at + lag, 6), f"a{m}", np.linalg.norm(path(at) - place[m]) + e))
    columns = ["track_id", "condition", "time_s", "x_true_m", "y_true_m", "z_true_m"]
    pd.DataFrame(truth, columns=columns).to_csv(folder / "truth.csv", index=False)
    pd.DataFrame(anchors, columns=["track_id", "anchor_id", "x_m", "y_m", "z_m"]).to_csv(
        folder / "anchors.csv", index=False
    )
    table = pd.DataFrame(ranges, columns=["track_id", "time_s", "anchor_id", "range_m"])
    table.sort_values(["track_id", "time_s"]).to_csv(folder / "ranges.csv", index=False)


def read(folder, **options):
    return lb.read_log(folder / "ranges.csv", anchors=folder / "anchors.csv", truth=folder / "truth.csv", **options)


def test_a_burst_ends_with_its_width_and_with_a_link_that_returns():
    t = np.array([0.0, 0.01, 0.02, 0.021, 0.1])
    assert bursts(t, np.array([0, 1, 2, 0, 0]), 0.05).tolist() == [0, 0, 0, 1, 2]
    assert bursts(t, np.arange(5), 0.01).tolist() == [0, 0, 1, 1, 2]


def test_the_offset_is_found_within_its_error_and_removes_the_errors(tmp_path):
    write(tmp_path, tracks=4)
    log = read(tmp_path, time_offset_s="auto", merge_s=0.02)
    (note,) = [note for note in log.notes if "offset" in note]
    value, error = (float(part.split()[0]) for part in (note.split("estimated as ")[1], note.split("s.e. ")[1]))
    assert abs(value + LAG) < 4 * max(error, 0.002)  # the grid of the search and the burst's 6 ms
    assert error < 0.02
    assert np.nanmedian(np.abs(log.errors().error_m)) < 0.06
    raw = read(tmp_path, merge_s=0.02)
    assert np.nanmedian(np.abs(raw.errors().error_m)) > 0.2


def test_merged_steps_hold_the_ranges_of_a_burst(tmp_path):
    write(tmp_path, lag=0.0)
    apart, together = read(tmp_path), read(tmp_path, merge_s=0.02)
    assert any("--merge" in note for note in apart.notes)
    assert apart.ranges + 2 >= together.ranges >= apart.ranges - 4  # those of step 0 are not used
    assert all(np.diff(t.time_s).min() > 0.1 for t in together.tracks)
    assert np.isfinite(together.tracks[0].ranges_m).sum(1).mean() == pytest.approx(2.7, abs=0.15)
    thin = read(tmp_path, merge_s=0.02, every=4)
    assert thin.tracks[0].time_s.tolist() == together.tracks[0].time_s[::4].tolist()
    np.testing.assert_array_equal(thin.tracks[0].ranges_m, together.tracks[0].ranges_m[3::4])


@pytest.mark.slow
def test_anchors_of_every_track_are_its_own(tmp_path):
    write(tmp_path, lag=0.0, shift=2.0, outliers=0.0)
    log = read(tmp_path, merge_s=0.02)
    assert log.dim == 3
    assert not np.array_equal(log.anchors_of(log.tracks[0]), log.anchors_of(log.tracks[1]))
    assert np.nanstd(log.errors().error_m) < 0.07  # the noise and the truth interpolated over 0.1 s
    fitted = lb.fit_scenario(log, outliers=False)
    np.testing.assert_allclose(fitted.scenario.anchors, log.anchors_of(log.tracks[0]))
    for track in log.tracks:
        np.testing.assert_array_equal(on_track(fitted.scenario, track).anchors, log.anchors_of(track))
    write(tmp_path, lag=0.0, tracks=1)
    assert read(tmp_path).tracks[0].anchors_m is None


def test_motion_is_fitted_to_the_truth_as_it_was_given(tmp_path):
    write(tmp_path, lag=0.0)
    for track in read(tmp_path).tracks:
        t, x = track.path
        np.testing.assert_allclose(t, np.arange(0, 40, 0.1))
        np.testing.assert_allclose(x, path(t))


def test_labels_of_the_truth_reach_the_ranges(tmp_path):
    write(tmp_path)
    log = read(tmp_path, merge_s=0.02, labels="condition")
    assert [np.unique(t.sight[t.reports]).tolist() for t in log.tracks] == [[0], [1]]
    fitted = lb.fit_scenario(log, outliers=False)
    assert "no s.e. from one such track" in fitted.comments["links.los"]
    plain = lb.read_log(  # joined by steps
        _steps(tmp_path), anchors=tmp_path / "anchors.csv", truth=tmp_path / "steps.csv", labels="seen"
    )
    assert plain.tracks[0].sight.tolist() == [[1, 1, 1]]


def _steps(folder):
    (folder / "by_step.csv").write_text("track_id,step,anchor_id,range_m\n" + "".join(
        f"t0,{k},a{m},5\n" for k in (0, 1) for m in range(3)
    ))  # fmt: skip
    head = "track_id,step,time_s,x_true_m,y_true_m,z_true_m,seen\n"
    (folder / "steps.csv").write_text(head + "t0,0,0,1,2,3,los\nt0,1,1,1,3,3,nlos\n")
    return folder / "by_step.csv"


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"time_offset_s": "later"}, 'offset is "later"'),
        ({"merge_s": -1.0}, "within -1.0 s"),
        ({"every": 0}, "every 0 steps"),
        ({"labels": "sight"}, "no column sight"),
    ],
)
def test_bad_options(tmp_path, options, match):
    write(tmp_path, tracks=1, seconds=12.0)
    with pytest.raises(lb.InputError, match=match):
        read(tmp_path, **options)


def test_an_offset_that_cannot_be_told_is_refused(tmp_path):
    write(tmp_path, lag=2 * LARGEST_OFFSET_S, seconds=60.0)
    with pytest.raises(lb.InputError, match="beyond 2 s"):
        read(tmp_path, time_offset_s="auto")
    write(tmp_path, tracks=1, seconds=7.0)
    with pytest.raises(lb.InputError, match="long enough"):
        read(tmp_path, time_offset_s="auto")


def test_the_outdoor_log():
    """The lag and the spreads that the data set's own description gives: 0.15 to 0.20 s in every track."""
    data = datasets.need("uwb_outdoor")
    log = lb.read_log(
        data / "ranges.csv.gz", anchors=data / "anchors.csv", truth=data / "truth.csv.gz",
        time_offset_s="auto", merge_s=0.02, labels="condition",
    )  # fmt: skip
    (note,) = [note for note in log.notes if "offset" in note]
    each = [float(x) for x in note.split("by track: ")[1].rstrip(").").split(", ")]
    assert all(-0.205 < x < -0.145 for x in each)
    spread = {}
    for i, track in enumerate(log.tracks):
        e = log.errors().error_m[log.errors().track == i]
        spread[track.name] = np.std(e[np.abs(e) < 2])
    published = {"los_a1": 0.129, "los_b3": 0.111, "nlos_a1": 0.097, "nlos_b3": 0.086}
    assert spread == pytest.approx(published, rel=0.03)  # at a lag of 0.2 s, not the best one
    assert [np.unique(t.sight[t.reports]).tolist() for t in log.tracks] == [[0], [0], [1], [1]]
