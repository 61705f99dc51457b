"""``locbounds fit --noise``: the table of laws, and the best law of each labelled sight in the scenario."""

from types import SimpleNamespace

import numpy as np
import pytest

import locbounds as lb
from locbounds.cli.fit_noise import compare, with_best_laws
from locbounds.fit import RangeLog, Track


@pytest.fixture(scope="module")
def log():
    """Labelled ranges: Laplace errors in LOS, an exponential excess with Gaussian noise in NLOS."""
    rng, anchors, tracks = np.random.default_rng(0), np.array([[0.0, 0.0], [60.0, 10.0]]), []
    for k in range(6):
        steps = 150
        position = np.stack([np.linspace(5, 50, steps + 1), np.full(steps + 1, 5.0 + k)], 1)
        sight = rng.integers(0, 2, (steps, 2))
        excess = rng.normal(0, 0.3, (steps, 2)) + rng.exponential(3.0, (steps, 2))
        error = np.where(sight == 0, rng.laplace(0, 0.5, (steps, 2)), excess)
        distance = np.linalg.norm(position[1:, None] - anchors, axis=-1)
        tracks.append(Track(f"t{k}", np.arange(steps + 1.0), distance + error, position, sight))
    return RangeLog(("a", "b"), anchors, tuple(tracks))


def test_labelled_laws_go_into_the_scenario(log):
    few = "gaussian,laplace,exponentially-modified-gaussian"
    laws = compare(log, None, few, lambda text: None)
    assert {name: rows[0][1] for name, rows in laws.items()} == {
        "LOS": "laplace",
        "NLOS": "exponentially-modified-gaussian",
    }

    comments = {"links.los": "Gaussian", "time": "log"}
    fitted = SimpleNamespace(scenario=lb.papers.fritsche2013.scenario(steps=5), comments=comments, notes=())
    scenario, comments, notes = with_best_laws(fitted, laws)
    assert isinstance(scenario.links[2].noises[0], lb.Laplace)
    assert isinstance(scenario.links[0].noises[1], lb.ExponentiallyModifiedGaussian)
    assert float(scenario.links[0].noises[1].scale) == pytest.approx(3.0, rel=0.15)
    assert "best of 3 laws" in comments["links.los"]
    assert comments["time"] == "log"
    assert notes == ()


def test_one_track_is_refused_and_unknown_families_are_named(log):
    from dataclasses import replace

    with pytest.raises(lb.InputError, match="one track cannot be split"):
        compare(replace(log, tracks=log.tracks[:1]), None, "auto", lambda text: None)
    with pytest.raises(lb.InputError, match="unknown noise family 'laplac'") as error:
        compare(log, None, "laplac", lambda text: None)
    assert "Did you mean laplace?" in error.value.remedy
