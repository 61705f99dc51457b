"""Maps of a city: scale of the colours, whole numbers, streets without a value."""

import numpy as np
import shapely
from matplotlib.colors import LogNorm, Normalize

from locbounds.propagation import City
from locbounds.report.city_plot import draw_map, raster

HOUSE = City([shapely.box(10, 10, 20, 20)])
X, Y, POINTS = raster(HOUSE, (0, 0, 40, 40), 2.0)
FREE = ~HOUSE.inside(POINTS)


def drawn(value, **options):
    return draw_map(HOUSE, X, Y, np.where(FREE, value, np.nan), label="RMSE in m", **options)


def test_wide_ranges_have_logarithmic_colours():
    x = POINTS[:, 0]
    for factor, scale in ((4.0, Normalize), (100.0, LogNorm)):
        (image,) = drawn(2.5 * factor ** (x / x.max()), high=2.5 * factor).axes[0].images
        assert type(image.norm) is scale
    assert image.norm.vmax == 250.0
    (image,) = drawn(x * 100.01).axes[0].images
    low = image.norm.vmin
    assert isinstance(low, float)
    assert low > 0
    (image,) = drawn(np.maximum(x - 10.5, 0.0)).axes[0].images  # zero has no logarithm
    assert type(image.norm) is Normalize


def test_whole_numbers_have_a_colour_each():
    (image,) = drawn(POINTS[:, 0] // 10, high=3.0).axes[0].images
    colours = {tuple(image.to_rgba(v)) for v in (0, 1, 2, 3)}
    assert len(colours) == image.cmap.N == 4
    assert (image.norm.vmin, image.norm.vmax) == (-0.5, 3.5)


def test_streets_without_a_value_are_grey_and_the_rest_is_empty():
    west, north = POINTS[:, 0] < 10, POINTS[:, 1] > 30
    figure = drawn(np.where(west | north, np.inf, 5.5), streets=FREE & ~north)
    grey, image = figure.axes[0].images
    shown = np.isfinite(np.ma.filled(grey.get_array(), np.nan)).ravel()
    assert shown[west & ~north].all()
    assert not shown[FREE & (north | ~west)].any()
    assert image.get_zorder() > grey.get_zorder()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["no bound"]
    assert not drawn(np.full(len(POINTS), 5.5), streets=FREE).legends
