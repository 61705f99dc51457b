"""Path lengths inside plans: the compiled kernel against the one that works corner by corner."""

import jax
import numpy as np
import pytest
import shapely

import locbounds as lb
from locbounds.propagation import City, StreetRanges, street_links
from textbook_streets import random_city


@pytest.fixture(scope="module")
def links():
    rng = np.random.default_rng(3)
    city = City(random_city(rng, "stars"))
    points = rng.uniform(0, 100, (400, 2))
    points = points[~city.inside(points)][:203]
    anchors = dict(zip("abc", points[:3], strict=True))
    return city, anchors, street_links(city, anchors, points[3:203])


def test_values_and_gradients(links):
    city, anchors, found = links
    plan = lb.Plan([lb.Observations([StreetRanges(city, anchors)], 4.0 * np.eye(3))])
    np.testing.assert_allclose(plan.means(found.points), found.length_m, atol=1e-9)
    np.testing.assert_allclose(plan.gradients(found.points), found.direction, atol=1e-9)


def test_differences_and_bias(links):
    city, anchors, found = links
    plan = lb.Plan([lb.Observations([StreetRanges(city, anchors, difference_to=1, nlos_bias_m=5.0)], np.eye(2))])
    biased = found.length_m + 5.0 * (found.sight == 1)
    np.testing.assert_allclose(plan.means(found.points), biased[:, [0, 2]] - biased[:, [1]], atol=1e-9)


def test_inside_jit_and_alone(links):
    city, anchors, found = links
    ranges = StreetRanges(city, {"a": anchors["a"]})
    with jax.enable_x64(True):
        one = jax.jit(lambda r, p: r(p))(ranges, found.points[0])
    assert float(one) == pytest.approx(found.length_m[0, 0], abs=1e-9)


def test_too_few_anchors_for_differences():
    with pytest.raises(lb.InputError, match="differences to anchor number 0 of 1"):
        StreetRanges(City([shapely.box(0, 0, 9, 9)]), {"a": (20.0, 0.0)}, difference_to=0)
