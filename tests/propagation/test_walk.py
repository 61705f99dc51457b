"""A walk through streets as a scenario with known sight."""

import numpy as np
import pytest
import shapely
from typer.testing import CliRunner

import locbounds as lb
from locbounds.propagation import City, street_links
from locbounds.street_walk import street_walk

BLOCK = shapely.box(0, 0, 30, 40)
ANCHORS = {"west": (-20.0, 60.0), "south": (60.0, -30.0)}
STOPS = [[-10.0, -10.0], [-10.0, 50.0], [40.0, 20.0]]


@pytest.fixture(scope="module")
def walk():
    return street_walk(City([BLOCK]), ANCHORS, STOPS, speed_m_s=2.0, step_s=1.0)


def test_the_way_is_the_shortest_and_evenly_walked(walk):
    steps = np.linalg.norm(np.diff(walk.positions, axis=0), axis=1)
    assert (steps <= 2.0 + 1e-9).all()
    assert np.isclose(steps, 2.0).mean() > 0.9  # shorter only where the way bends
    assert not shapely.contains_xy(shapely.buffer(BLOCK, -1e-6), *walk.positions.T).any()
    bend = np.hypot(40, 10) + np.hypot(10, 20)
    assert len(walk.positions) == int((60 + bend) / 2) + 1


def test_the_schedule_is_that_of_the_places(walk):
    links = street_links(City([BLOCK]), ANCHORS, walk.positions)
    for m, name in enumerate(ANCHORS):
        assert walk.letters(name) == "".join("LN"[s] for s in links.sight[1:, m])
    assert set(walk.letters("south")) == {"L", "N"}
    assert len(walk.table()) == 2 * len(walk.positions)


def test_the_scenario(walk, tmp_path):
    scenario = walk.scenario(std_m=1.0, nlos_std_m=2.0)
    blocked = walk.links.sight[1:, 1] == 1
    excess = walk.links.excess_m[1:, 1][blocked]
    noise = scenario.links[1].noises[1]
    assert noise.mean == pytest.approx(excess.mean())
    assert noise.std == pytest.approx(np.hypot(2.0, excess.std()))
    fine = walk.scenario(std_m=1.0, nlos_std_m=2.0, levels=3)
    stds = [float(noise.std) for noise in fine.links[1].noises[1:]]
    assert max(stds) < float(noise.std)
    lb.save(scenario, tmp_path / "walk.toml")
    again = lb.load(tmp_path / "walk.toml")
    for one, other in zip(scenario.links, again.links, strict=True):
        np.testing.assert_array_equal(one.sight.modes, other.sight.modes)
        assert [float(n.mean) for n in one.noises] == pytest.approx([float(n.mean) for n in other.noises])


@pytest.mark.slow
def test_locbounds_track_takes_it(walk, tmp_path):
    from locbounds.cli.app import app

    lb.save(walk.scenario(std_m=1.0), tmp_path / "walk.toml")
    options = ["--bounds", "known-sight", "--filters", "oracle-ekf", "--runs", "50", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, ["track", str(tmp_path / "walk.toml"), *options])
    assert done.exit_code == 0, done.output
    assert "known-sight" in " ".join(p.read_text() for p in (tmp_path / "out").glob("*.csv"))


@pytest.mark.parametrize(
    "stops, options, cause",
    [
        ([[0.0, -5.0]], {}, "shape"),
        ([[5.0, 5.0], [50.0, 5.0]], {}, "waypoint 1 at (5, 5) m is inside building 0"),
        ([[-5.0, 5.0], [-5.0, 5.5]], {}, "shorter than one step"),
        ([[-5.0, 5.0], [-5.0, 50.0]], {"speed_m_s": -1.0}, "-1.0 m/s"),
    ],
)
def test_walks_are_refused(stops, options, cause):
    with pytest.raises(lb.InputError) as caught:
        street_walk(City([BLOCK]), ANCHORS, stops, **options)
    assert cause in caught.value.cause


def test_closed_courtyards():
    ring = City([shapely.box(0, 0, 40, 40).difference(shapely.box(10, 10, 30, 30))])
    with pytest.raises(lb.InputError, match="no way from waypoint 1 to waypoint 2"):
        street_walk(ring, ANCHORS, [[-5.0, -5.0], [20.0, 20.0]])
    walk = street_walk(ring, {"yard": (20.0, 20.0)}, [[-5.0, -5.0], [20.0, -5.0]])
    with pytest.raises(lb.InputError, match="anchor yard is out of reach at step 0"):
        walk.scenario(std_m=1.0)
