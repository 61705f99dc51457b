"""The registry and the verdicts that follow from it."""

import importlib

import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.noise import Regularity
from locbounds.registry import METHODS, bounds_of, method
from locbounds.verdict import Status, dangers
from scenarios import STEPS, asymmetric, noise_of


class Rough(lb.Gaussian):
    """A noise that says that it has no Fisher information."""

    def regularity(self):
        return Regularity(False, "the density vanishes linearly at an edge")


@pytest.fixture(scope="module")
def scenario():
    return asymmetric()


def found(function):
    module, _, name = function.partition(":")
    return getattr(importlib.import_module(module), name)


@pytest.mark.parametrize("id", METHODS)
def test_every_method_has_an_id_a_function_and_words(id):
    entry = METHODS[id]
    assert entry.id == id
    assert entry.kind in ("bound", "filter")
    assert entry.sees
    assert entry.summary.endswith(".")
    assert entry.fails.endswith(".")
    assert entry.references
    if entry.kind == "filter" and importlib.util.find_spec("locbounds.filters") is None:
        pytest.skip("no filters here")
    assert callable(found(entry.function))
    if entry.kind == "filter":
        value = found(entry.function)()
        assert (value.id, value.name, value.sees) == (entry.id, entry.name, entry.sees)


BOUNDS = {"bcrb": lb.bcrb, "enumer": lb.enumer, "los-only": lb.los_only, "known-sight": lb.known_sight}


def test_the_table_of_bounds_is_complete():
    assert {m.id for m in bounds_of("scenario")} == set(BOUNDS)
    assert found(METHODS["survey"].function) is lb.survey_bound
    assert [m.id for m in bounds_of("survey")] == ["survey"]
    for id, bound in BOUNDS.items():
        assert found(METHODS[id].function) is bound


@pytest.mark.parametrize("id", BOUNDS)
def test_a_violated_assumption_refuses_before_anything_is_drawn(scenario, id):
    rough = noise_of(scenario, noises=(Rough(0.0, 1.0), lb.Gaussian(3.0, 2.0)))
    rough = rough.with_known_sight(np.zeros(STEPS, int))
    assert method(id).verdict(rough).status is Status.REFUSED
    with pytest.raises(lb.RefusedError, match="vanishes linearly"):
        BOUNDS[id](rough)


def test_known_sight_refuses_random_sight_and_names_the_anchors(scenario):
    with pytest.raises(lb.RefusedError, match="sight of a0, a1 is random"):
        lb.known_sight(scenario)


def test_los_only_needs_the_two_modes(scenario):
    three = lb.MarkovSight(None, np.full((3, 3), 1 / 3))
    laws = (lb.Gaussian(0.0, 1.0), lb.Gaussian(3.0, 2.0), lb.Gaussian(6.0, 2.0))
    other = noise_of(scenario, sight=three, noises=laws)
    assert method("bcrb").verdict(other).status is Status.VALID
    with pytest.raises(lb.RefusedError, match="LOS and NLOS"):
        lb.los_only(other)


def test_what_is_dangerous_is_reported_once_with_all_its_anchors(scenario):
    assert dangers(scenario) == ()
    sticky = noise_of(scenario, sight=lb.MarkovSight.stay(0.9999))
    (text,) = dangers(sticky)
    assert "anchor a0, a1" in text
    assert "nearly deterministic" in text
    weak = noise_of(scenario, noises=(lb.Gaussian(0.0, 1.0), lb.Gaussian(0.0, 100.0)))
    assert "information" in dangers(weak)[0]
    swapped = noise_of(scenario, noises=(lb.Gaussian(0.0, 2.0), lb.Gaussian(0.0, 1.0)))
    assert "swapped" in dangers(swapped)[0]
    verdict = method("bcrb").verdict(sticky)
    assert verdict.status is Status.VALID
    assert "warning" in str(verdict)


def test_dangers_do_not_touch_the_precision_of_the_caller(scenario):
    dangers(scenario)
    assert jnp.ones(1).dtype == jnp.float32


def test_an_unknown_id_is_answered_with_the_nearest_one():
    with pytest.raises(lb.InputError, match="Did you mean enumer"):
        method("enumr")
    with pytest.raises(lb.InputError, match="unknown filter"):
        method("bcrb", "filter")
