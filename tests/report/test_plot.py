"""Figures: what cannot be drawn is said."""

import pytest

import locbounds as lb


def test_nothing_to_draw_is_an_input_error():
    with pytest.raises(lb.InputError, match="nothing to draw"):
        lb.plot.rmse([])
    with pytest.raises(lb.InputError, match="against 'date'"):
        lb.plot.rmse([lb.bcrb(lb.papers.fritsche2013.scenario(steps=3), samples=1)], against="date")
