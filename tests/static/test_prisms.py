"""Laws with heights: the overlap of a prism is that of its base times that of the heights."""

import numpy as np
import pytest

import locbounds as lb
from locbounds.priors import Prism
from locbounds.static.plan_laws import support_of

STATIONS = [[0, 15, 8.0], [-13, -7.5, 2], [13, -7.5, 3.0], [4, 4, 9]]


@pytest.mark.parametrize(
    "base",
    [
        lb.UniformBox([-10, -8], [10, 8]),
        pytest.param(lb.UniformPolygon([[-10, -8], [10, -8], [10, 8], [-10, 8]]), marks=pytest.mark.slow),
    ],
)
def test_bounds_of_a_prism_are_those_of_the_box(base):
    box, prism = lb.UniformBox([-10, -8, 0], [10, 8, 4]), Prism(base, 0.0, 4.0)
    vectors = np.array([[1.5, 0.0, 0.3], [0.0, 1.5, 0.0], [0.0, 0.2, 2.0]])
    one, other = (lb.toa(STATIONS, 1.0, prior=p) for p in (box, prism))
    for bound in (lambda plan: lb.wwb(plan, tests=vectors), lb.ezzb):
        assert bound(other).position_mse[0] == pytest.approx(bound(one).position_mse[0], rel=2e-3)


def test_overlap_of_cylinders():
    radius, height = 3.0, 2.0
    law = support_of(Prism(lb.UniformDisc([1.0, 2.0], radius), 0.0, height))
    for shift in ([0.0, 0.0, 0.5], [2.0, 0.0, 0.5], [2.0, 1.0, 0.0]):
        d = np.hypot(*shift[:2])
        lens = 2 * radius**2 * np.arccos(d / (2 * radius)) - d / 2 * np.sqrt(4 * radius**2 - d**2)
        rule = law.overlap(np.array([[0.0, 0.0, 0.0], shift, shift]), 8)
        assert rule.weights.sum() == pytest.approx(lens * (height - shift[2]), rel=1e-6)
    assert not len(law.overlap(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.5]]), 8).weights)
    assert law.reach(np.array([0.6, 0.0, 0.8])) == pytest.approx(2.5)
