"""The picture of a scenario shows what is where, in metres and to scale."""

import numpy as np

from locbounds.measurement import Range
from locbounds.papers import fritsche2013
from locbounds.report.scenario_plot import draw_scenario
from locbounds.scenario import Link, Scenario


def near(scenario: Scenario) -> Scenario:
    anchors = ([400.0, 400.0], [650.0, 500.0], [500.0, 700.0])
    links = [Link(a.name, Range(x), a.sight, a.noises) for a, x in zip(scenario.links, anchors, strict=True)]
    return scenario.replace(links=links)


def test_far_anchors_get_a_close_up_of_the_mobile():
    figure = draw_scenario(fritsche2013.scenario(steps=10))
    assert [axes.get_aspect() for axes in figure.axes] == [1.0, 1.0]
    assert [axes.get_xlabel() for axes in figure.axes] == ["x in m", "x in m"]
    (low, high), (left, right) = figure.axes[0].get_xlim(), figure.axes[1].get_xlim()
    assert low < -3000 < 6000 < high
    assert 500 - 3 * 122.4 < left < 500 - 122.4 < 500 + 122.4 < right < 1100  # the 95 % circle of 50 m has 122.4 m


def test_near_anchors_share_one_panel_with_every_name():
    figure = draw_scenario(near(fritsche2013.scenario(steps=10)))
    assert len(figure.axes) == 1
    assert {text.get_text() for text in figure.axes[0].texts} == {"bs1", "bs2", "bs3"}


def test_prior_ellipse_holds_95_percent():
    """The drawn ellipse against the quantile of a chi-square law with two degrees of freedom, 5.9915."""
    patch = draw_scenario(near(fritsche2013.scenario(steps=10))).axes[0].patches[0]
    radius = np.linalg.norm(np.asarray(patch.get_path().vertices)[:100] - [500, 500], axis=1)
    np.testing.assert_allclose(radius, 50 * np.sqrt(5.9915), rtol=1e-4)
