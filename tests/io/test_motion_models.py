"""Scenario files with other motions: they read back as they were, and what does not fit is named."""

import numpy as np
import pytest

import locbounds as lb
from locbounds.io.scenario_file import dumps, loads
from locbounds.report.understood import understood

START = lb.papers.fritsche2013.scenario(steps=3)


def start(order, dim=2, correlated=False):
    covariance = np.diag(np.repeat([400.0, 4.0, 0.25][:order], dim))
    covariance[0, -1] = covariance[-1, 0] = 0.1 if correlated else 0.0
    return lb.GaussianPrior(np.arange(1.0, order * dim + 1), covariance)


def moving(motion, order, dim=2, correlated=False):
    links = [a.replace(measurement=lb.Range([*a.measurement.anchor, 10.0][:dim])) for a in START.links]
    return START.replace(motion=motion, prior=start(order, dim, correlated), links=links)


MOTIONS = {
    "random walk": (lb.RandomWalk([0.5, 2.0]), 1),
    "constant acceleration": (lb.ConstantAcceleration(0.1), 3),
    "turn": (lb.CoordinatedTurn(-0.3, 0.5), 2),
}


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("correlated", [False, True])
def test_a_motion_reads_back_as_it_was(name, correlated):
    motion, order = MOTIONS[name]
    scenario = moving(motion, order, correlated=correlated and order > 1)
    again = loads(dumps(scenario))
    assert type(again.motion) is type(motion)
    for a, b in ((again.motion, motion), (again.prior, scenario.prior)):
        for x, y in zip(vars(a).values(), vars(b).values(), strict=True):
            np.testing.assert_array_equal(x, y)


def test_three_dimensions_read_back():
    again = loads(dumps(moving(lb.ConstantAcceleration([0.1, 0.2, 0.3], 3), 3, 3)))
    assert again.motion.intensity.tolist() == [0.1, 0.2, 0.3]
    assert again.prior.mean.tolist() == list(range(1, 10))


@pytest.mark.parametrize("name", MOTIONS)
def test_what_was_understood_says_how_it_moves(name):
    motion, order = MOTIONS[name]
    said = understood(moving(motion, order))["model"]
    assert name in said["motion"]
    assert ("velocity" in said["prior"]) == (order > 1)
    assert ("acceleration" in said["prior"]) == (order > 2)


WRONG = [
    ("diffusion_m2_s = ", "psd_m2_s3 = ", "takes diffusion_m2_s and nothing else"),
    ("position_std_m = 20", "position_std_m = 20\nvelocity_m_s = [1, 1]\nvelocity_std_m_s = 1", "does not know"),
    ('"random-walk"\ndiffusion_m2_s', '"constant-acceleration"\njerk_psd_m2_s5', "prior has no velocity_m_s"),
    ("position_std_m = 20", "position_std_m = 20\nacceleration_std_m_s2 = 1", "without acceleration_m_s2"),
]


@pytest.mark.parametrize("old, new, cause", WRONG)
def test_what_does_not_fit_is_named(old, new, cause):
    plain = "\n".join(line.split("#")[0].rstrip() for line in dumps(moving(lb.RandomWalk(0.5), 1)).splitlines())
    assert old in plain
    with pytest.raises(lb.InputError, match=cause):
        loads(plain.replace(old, new))


def test_what_a_file_cannot_say_is_kept_in_python():
    chain = lb.MarkovSight.stay(0.9)
    switching = lb.SwitchingMotion([lb.CoordinatedTurn(w, 0.1) for w in (0.2, -0.2)], chain)
    reflected = START.links[0].replace(measurement=lb.BySight([lb.Range([0, 0]), lb.Range([9, 0])]))
    for changed in (
        START.replace(motion=switching),
        START.replace(links=[reflected]),
        START.replace(links=[a.replace(chain="door") for a in START.links]),
    ):
        with pytest.raises(lb.InputError, match="Keep this scenario in Python"):
            dumps(changed)
