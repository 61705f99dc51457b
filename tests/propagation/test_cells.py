"""The split of the streets by the nearest anchors, against sorting distances."""

import numpy as np
import pytest
import shapely

import locbounds as lb
from locbounds.propagation import City, street_cells, uniform_on


@pytest.mark.parametrize("count", [1, 2, 3])
def test_cells_are_where_sorting_says(count):
    rng = np.random.default_rng(count)
    anchors = rng.uniform(0, 100, (6, 2))
    streets = City([shapely.box(20, 20, 45, 80), shapely.box(60, 10, 90, 70)]).streets(shapely.box(0, 0, 100, 100))
    cells = street_cells(streets, anchors, count=count)
    assert sum(cell.share for cell in cells) == pytest.approx(1.0, abs=1e-9)
    points = rng.uniform(0, 100, (2000, 2))
    points = points[shapely.contains_xy(streets, *points.T)]
    order = np.argsort(np.linalg.norm(points[:, None] - anchors, axis=-1), axis=1)[:, :count]
    for cell in cells:
        mine = shapely.contains_xy(cell.region, *points.T)
        expected = (order[:, 0] == cell.nearest[0]) & (np.sort(order, axis=1) == np.sort(cell.nearest)).all(axis=1)
        np.testing.assert_array_equal(mine, expected)
        np.testing.assert_array_equal(np.isfinite(cell.prior.log_density(points)), mine)


def test_bad_regions():
    with pytest.raises(lb.InputError, match="3 nearest of 2 anchors"):
        street_cells(shapely.box(0, 0, 1, 1), [[0.0, 0.0], [1.0, 0.0]], count=3)
    for call in (lambda: street_cells(shapely.Polygon(), [[0.0, 0.0]], count=1), lambda: uniform_on(shapely.Polygon())):
        with pytest.raises(lb.InputError, match="street region is empty"):
            call()
