"""Sight and shortest paths against a textbook visibility graph, and what must hold of every path."""

import numpy as np
import pytest
import shapely
import shapely.affinity
from scipy.spatial.distance import cdist

from locbounds.propagation import City, street_links
from textbook_streets import random_city, visibility_graph

ROUNDING_M = 1e-9  # of sums of a few distances of some 100 m


def places(rng, city, n):
    points = rng.uniform(-5, 105, (4 * n, 2))
    return points[~shapely.intersects_xy(city.obstacles, *points.T)][:n]


@pytest.mark.parametrize("kind", ["stars", "overlapping", "courtyards", "blocks"])
@pytest.mark.parametrize("seed", range(4))
def test_against_the_textbook(kind, seed, monkeypatch):
    rng = np.random.default_rng(seed)
    monkeypatch.setattr("locbounds.propagation.city.OVERLAP", 2.0)
    city = City(random_city(rng, kind), gap_m=0.01 if kind == "blocks" else 0.0)  # blocks that touch in one point
    points = places(rng, city, 32)
    corner = shapely.get_coordinates(city.obstacles)[rng.integers(0, 8, 2)]
    wall = shapely.get_coordinates(shapely.boundary(city.obstacles).interpolate([7.0], normalized=False))
    anchors = np.concatenate([points[:2], corner[:1], wall])
    points = np.concatenate([points[2:], corner[1:]])
    if kind == "blocks":  # midpoints of walls and aligned places: every touching case there is
        points = np.concatenate([points, [[20.0, 30.0], [40.0, 0.0], [20.0, 100.0], [50.0, 40.0]]])
        points = points[~shapely.contains_xy(city.obstacles, *points.T)]
    links = street_links(city, anchors, points)
    length, free = visibility_graph(city.obstacles, links.anchors, points)
    np.testing.assert_allclose(links.length_m, length, rtol=0, atol=ROUNDING_M)
    np.testing.assert_array_equal(links.sight == 0, free)


def test_paths_are_as_long_as_said_and_cross_no_building():
    rng = np.random.default_rng(5)
    city = City(random_city(rng, "stars"), gap_m=0.0)
    points = places(rng, city, 20)
    links = street_links(city, points[:2], points[2:])
    bends = 0
    for i in range(len(links.points)):
        for m in range(2):
            path = links.path(i, m)
            bends += len(path) - 2
            assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(links.length_m[i, m], abs=1e-8)
            assert shapely.LineString(path).intersection(city.obstacles).area == 0
            assert not shapely.LineString(path).crosses(shapely.buffer(city.obstacles, -1e-6))
            assert (len(path) == 2) == (links.sight[i, m] == 0)
    assert bends > 10
    np.testing.assert_allclose(links.excess_m, links.length_m - cdist(links.points, links.anchors), atol=ROUNDING_M)
    assert links.excess_m.min() >= 0


def test_the_direction_is_the_gradient():
    rng = np.random.default_rng(6)
    city = City(random_city(rng, "stars"), gap_m=0.0)
    points, h = places(rng, city, 40), 1e-4
    here = street_links(city, points[:2], points[2:])
    moved = [street_links(city, points[:2], points[2:] + step).length_m for step in h * np.eye(2)]
    back = [street_links(city, points[:2], points[2:] - step).length_m for step in h * np.eye(2)]
    slope = (np.stack(moved, -1) - np.stack(back, -1)) / (2 * h)
    near = np.abs(np.linalg.norm(slope, axis=-1) - 1) > 1e-3  # two paths tie there: no gradient
    assert near.mean() < 0.02
    np.testing.assert_allclose(slope[~near], here.direction[~near], atol=1e-5)


@pytest.mark.parametrize("shift", [[0.0, 0.0], [4.5e5, 5.3e6]])
def test_places_far_from_the_origin_keep_their_digits(shift):
    rng = np.random.default_rng(1)
    polygons = random_city(rng, "courtyards")
    near = City(polygons, gap_m=0.0)
    points = places(rng, near, 30)
    far = City([shapely.affinity.translate(p, *shift) for p in polygons], gap_m=0.0)
    a, b = street_links(near, points[:3], points[3:]), street_links(far, points[:3] + shift, points[3:] + shift)
    np.testing.assert_array_equal(a.sight, b.sight)
    np.testing.assert_allclose(a.length_m, b.length_m, atol=1e-7)


def test_an_empty_plain_is_all_sight():
    city = City([shapely.box(-1e4, -1e4, -9.9e3, -9.9e3)])
    points = np.random.default_rng(0).uniform(0, 100, (50, 2))
    links = street_links(city, points[:2], points)
    assert (links.sight == 0).all()
    np.testing.assert_allclose(links.length_m, cdist(points, points[:2]), atol=ROUNDING_M)


def test_an_anchor_on_a_roof_looks_over_its_own_building_only():
    city = City([shapely.box(0, 0, 10, 10), shapely.box(20, 0, 30, 10)])
    links = street_links(city, {"roof": (5.0, 5.0)}, [[15.0, 5.0], [35.0, 5.0], [-5.0, 5.0]], roof=["roof"])
    assert links.sight[:, 0].tolist() == [0, 1, 0]
    around = np.hypot(15, 5) + 10 + np.hypot(5, 5)  # over its own roof to the corner (20, 10), along that wall
    assert links.length_m[1, 0] == pytest.approx(around, abs=ROUNDING_M)


def test_courtyards_without_a_way_out_are_out_of_reach():
    ring = shapely.box(0, 0, 40, 40).difference(shapely.box(10, 10, 30, 30))
    links = street_links(City([ring]), {"a": (-5.0, 20.0)}, [[20.0, 20.0], [50.0, 20.0], [5.0, 20.0]])
    assert links.sight[:, 0].tolist() == [-1, 1, -1]
    assert links.inside.tolist() == [False, False, True]
    assert np.isinf(links.length_m[0, 0])
    assert links.path(0, 0).shape == (0, 2)
    assert np.isnan(links.direction[0, 0]).all()
    with pytest.raises(ValueError, match="no anchor is in reach of the point"):
        links.refuse_unreached()
