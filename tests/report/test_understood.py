"""What `check` says about a scenario."""

import numpy as np
import pytest

from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian, GaussianMixture
from locbounds.papers import fritsche2013
from locbounds.priors import GaussianPrior
from locbounds.report.understood import understood
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight, KnownSight, MarkovSight
from locbounds.times import Times

LOS, NLOS = Gaussian(0, 150), Gaussian(513, 400)


def scenario(anchor=(3000.0, 5000.0), sight=None, noises=(LOS, NLOS), position=(500.0, 500.0)):
    start = np.array(position)
    return Scenario(
        "",
        Times([0.0, 1.0, 3.0]),
        ConstantVelocity(0.5),
        GaussianPrior([*start, 5, 5], np.diag([2500.0, 2500, 4, 4])),
        [Link("a", Range(anchor), sight or DwellSight(None, [3, 1]), noises, np.array([True, False]))],
    )


@pytest.mark.parametrize(
    ("odd", "danger"),
    [
        (scenario(sight=DwellSight(None, [1e6, 1e6])), "nearly deterministic"),
        (scenario(noises=(LOS, Gaussian(513, 40900))), "NLOS ranges carry less than"),
        (scenario(noises=(LOS, Gaussian(513, 15))), "more informative"),
        (scenario(anchor=(500.0, 500.0)), "exactly at the anchor"),
        (scenario(anchor=(11.57, 48.13), position=(11.58, 48.14)), "are these degrees?"),
    ],
)
def test_dangers_are_reported(odd, danger):
    assert any(danger in text for text in understood(odd)["dangers"])


def test_a_room_is_not_taken_for_degrees():
    assert understood(scenario(anchor=(0.2, 0.3), position=(0.5, 0.5)))["dangers"] == []


def test_rows_say_what_was_understood():
    seen = understood(scenario())
    assert seen["model"]["time"] == "2 steps of 1 to 2 s: steps 0..2 from 0 to 3 s, step 0 is the prior"
    assert "velocity (5, 5) m/s, deviation 2 m/s" in seen["model"]["prior"]
    assert seen["links"] == [
        {
            "anchor": "a",
            "position m": "(3000, 5000)",
            "sight": "LOS lasts 3 s, NLOS 1 s; starts NLOS with 0.25",
            "LOS error": "mean 0 m, deviation 150 m",
            "NLOS error": "mean 513 m, deviation 400 m",
            "ranges": "1 of 2",
        }
    ]


def test_other_pieces_in_words():
    mixture = GaussianMixture([0.5, 0.5], [-3, 3], [4, 4])  # variance 16 + 9
    link = understood(scenario(sight=KnownSight([1, 0]), noises=(mixture, NLOS)))["links"][0]
    assert link["sight"] == "known: NLOS at 1 of 2 steps"
    assert link["LOS error"] == "mean 0 m, deviation 5 m, 2 components"
    uneven = fritsche2013.scenario(steps=2)
    chain = MarkovSight.stay((0.9, 0.7))
    uneven = uneven.replace(links=[Link(a.name, a.measurement, chain, a.noises) for a in uneven.links])
    assert understood(uneven)["links"][0]["sight"] == "kept with 0.9 in LOS, 0.7 in NLOS a step; starts NLOS with 0.25"


def test_a_known_schedule_opens_the_known_sight_bound():
    status = {b["id"]: b["status"] for b in understood(scenario(sight=KnownSight([0, 1])))["bounds"]}
    assert status["known-sight"] == "valid"
    assert {b["id"]: b["status"] for b in understood(scenario())["bounds"]}["known-sight"] == "refused"
