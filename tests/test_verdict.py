"""The registry and the verdicts that follow from it."""

import importlib
from types import SimpleNamespace

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
    assert entry.kind in ("bound", "filter", "estimator")
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

OF_PLANS = {"crlb": lb.crlb, "barankin": lb.barankin, "wwb": lb.wwb, "ezzb": lb.ezzb, "mmse": lb.mmse, "ml": lb.ml,
            "ls": lb.ls}  # fmt: skip


def test_the_table_of_bounds_is_complete():
    assert {m.id for m in bounds_of("scenario")} == set(BOUNDS)
    assert found(METHODS["survey"].function) is lb.survey_bound
    assert [m.id for m in bounds_of("survey")] == ["survey"]
    assert {m.id for m in METHODS.values() if m.subject == "plan"} == set(OF_PLANS)
    assert found(METHODS["wwb-recursive"].function) is lb.wwb_recursive
    assert [m.id for m in bounds_of("model")] == ["wwb-recursive"]
    for id, function in (BOUNDS | OF_PLANS).items():
        assert found(METHODS[id].function) is function


@pytest.mark.parametrize("id", BOUNDS)
def test_a_violated_assumption_refuses_before_anything_is_drawn(scenario, id):
    rough = noise_of(scenario, noises=(Rough(0.0, 1.0), lb.Gaussian(3.0, 2.0)))
    rough = rough.with_known_sight(np.zeros(STEPS, int))
    assert method(id).verdict(rough).status is Status.REFUSED
    with pytest.raises(lb.RefusedError, match="vanishes linearly"):
        BOUNDS[id](rough)


class Leaky(lb.MarkovSight):
    """A chain that loses probability."""

    def transitions(self, intervals):
        return 0.9 * super().transitions(intervals)


class Indefinite(lb.ConstantVelocity):
    """A motion with a negative variance."""

    def covariance(self, dt):
        return super().covariance(dt) - 1.0 * np.eye(4)


class Loudness(lb.Range):
    """A level that falls with the logarithm of the distance: infinitely steep at the anchor."""

    def __call__(self, position):
        return 10 * jnp.log(jnp.sum((position - self.anchor) ** 2, axis=-1))


def changed(scenario, kind):
    """The scenario with one assumption violated."""
    if kind == "noise":
        return noise_of(scenario, noises=(Rough(0.0, 1.0), lb.Gaussian(3.0, 2.0)))
    if kind == "chain":
        return noise_of(scenario, sight=Leaky(None, [[0.9, 0.1], [0.2, 0.8]]))
    if kind == "motion":
        return scenario.replace(motion=Indefinite(0.4))
    if kind == "steep":
        links = [lb.Link(a.name, Loudness(a.measurement.anchor), a.sight, a.noises) for a in scenario.links]
        return scenario.replace(links=links)
    if kind == "modes":
        laws = (lb.Gaussian(0.0, 1.0), lb.Gaussian(3.0, 2.0), lb.Gaussian(6.0, 2.0))
        return noise_of(scenario, sight=lb.MarkovSight(None, np.full((3, 3), 1 / 3)), noises=laws)
    if kind == "shared":
        links = [a.replace(sight=scenario.links[0].sight, chain="one") for a in scenario.links]
        return scenario.replace(links=links)
    return scenario  # its sight is random


VIOLATIONS = {
    "every noise has a finite Fisher information about a shift": ("noise", "vanishes linearly at an edge"),
    "the sight of every link is a Markov chain of its own": ("chain", "anchor a0 is no Markov chain: its transition"),
    "the motion is linear with Gaussian noise, Q positive semidefinite": ("motion", "negative variance"),
    "no measurement is infinitely steep at its anchor": ("steep", "anchor a0 grows infinitely steep"),
    "motion without modes, one chain per link, measurements that do not depend on it": ("shared", "share a chain"),
    "every link is either LOS or NLOS": ("modes", "do not have exactly the modes LOS and NLOS"),
    "the sight of every link is known at every step": ("random", "sight of a0, a1 is random"),
}


@pytest.mark.parametrize(("id", "assumption"), [(m.id, a) for m in bounds_of("scenario") for a in m.assumptions],
                         ids=lambda x: getattr(x, "text", x))  # fmt: skip
def test_every_assumption_has_a_scenario_that_violates_it_and_a_verdict_that_says_so(scenario, id, assumption):
    kind, words = VIOLATIONS[assumption.text]
    entry = METHODS[id]
    bad = changed(scenario, kind)
    reason = assumption.violated(bad)
    assert reason is not None
    assert words in reason
    verdict = entry.verdict(bad)
    assert verdict.status is Status.REFUSED
    assert reason in verdict.reasons
    assert f"violated {assumption.text}: {reason}" in lb.explain(id, bad)
    good = scenario.with_known_sight(np.zeros(STEPS, int)) if id == "known-sight" else scenario
    assert entry.check(good) == [(a.text, None) for a in entry.assumptions]


def test_a_survey_of_one_point_is_no_survey():
    verdict = method("survey").verdict(SimpleNamespace(points=1, dangers=lambda: ()))
    assert verdict.status is Status.REFUSED
    assert verdict.reasons == ("the survey has 1 point",)


def test_a_steep_measurement_is_refused_where_its_information_is_infinite_only(scenario):
    """E[1/r^2] over a density that is positive at the anchor: infinite in two dimensions, finite in three."""
    steep = changed(scenario, "steep")
    with pytest.raises(lb.RefusedError, match="infinitely steep"):
        lb.bcrb(steep)
    links = [lb.Link(a.name, Loudness([*a.measurement.anchor, 0.0]), a.sight, a.noises) for a in scenario.links]
    high = scenario.replace(
        motion=lb.ConstantVelocity(0.4, dim=3), prior=lb.GaussianPrior(np.zeros(6), np.eye(6)), links=links
    )
    assert method("bcrb").verdict(high).status is Status.VALID


def test_explain_is_made_from_the_table():
    for entry in METHODS.values():
        text = lb.explain(entry.id)
        for part in (entry.name, entry.summary, entry.fails, *entry.grounds, *entry.conditions, *entry.references):
            assert part in text
        assert all(a.text in text for a in entry.assumptions)


def test_a_scenario_without_any_range_is_remarked(scenario):
    (text,) = dangers(scenario.with_reports(np.zeros((STEPS, 2), bool)))
    assert "no range is ever reported" in text


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
