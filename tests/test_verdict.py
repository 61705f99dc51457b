"""The registry and the verdicts that follow from it."""

import importlib
import re
from types import SimpleNamespace

import jax
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


class Rounded(lb.Range):
    """A range in steps of ten metres."""

    def __call__(self, position):
        return 10 * jnp.round(super().__call__(position) / 10)


def measured(scenario, measurement, *more):
    """The scenario with another measurement at its anchors, which get ``more`` coordinates."""
    links = [
        lb.Link(a.name, measurement([*a.measurement.anchor, *more]), a.sight, a.noises, a.reports)
        for a in scenario.links
    ]
    if not more:
        return scenario.replace(links=links)
    n = scenario.dim + len(more)
    return scenario.replace(
        motion=lb.ConstantVelocity(0.4, dim=n), prior=lb.GaussianPrior(np.zeros(2 * n), np.eye(2 * n)), links=links
    )


def changed(scenario, kind):
    """The scenario with one assumption violated."""
    if kind == "rounded":
        return measured(scenario, Rounded)
    if kind == "noise":
        return noise_of(scenario, noises=(Rough(0.0, 1.0), lb.Gaussian(3.0, 2.0)))
    if kind == "chain":
        return noise_of(scenario, sight=Leaky(None, [[0.9, 0.1], [0.2, 0.8]]))
    if kind == "motion":
        return scenario.replace(motion=Indefinite(0.4))
    if kind == "steep":
        return measured(scenario, Loudness)
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
    "what is measured is continuous in the state": ("rounded", "anchor a0 jumps by 10"),
    "what is measured has a slope of finite mean square": ("steep", "anchor a0 grows infinitely steep"),
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
    for law in (Loudness, lb.PathLoss, lb.Range):
        assert method("bcrb").verdict(measured(scenario, law, 0.0)).status is Status.VALID


def level(scenario, heights_of_anchors):
    """The scenario in three dimensions, with a mobile whose height is known to be zero."""
    high = measured(scenario, lb.PathLoss, heights_of_anchors)
    (z, vz), P = (2, 5), np.eye(6)
    P[[z, vz], [z, vz]] = 0.0
    F, Q = (np.stack([m, m, m]) for m in (np.eye(6), np.diag([1.0, 1, 0, 0, 0, 0])))
    return high.replace(
        times=lb.Times.uniform(step_s=1.0, steps=3),
        motion=lb.LinearMotion(F, Q, position_index=(0, 1, 2)),
        prior=lb.GaussianPrior(np.zeros(6), P),
        links=[a.replace(reports=None) for a in high.links],
    )


def test_what_counts_is_in_how_many_directions_the_position_spreads(scenario):
    assert method("bcrb").verdict(level(scenario, 0.0)).status is Status.REFUSED
    assert method("bcrb").verdict(level(scenario, 3.0)).status is Status.VALID  # never comes to the anchors


def test_bearings_are_infinitely_steep_on_the_vertical_through_the_anchor(scenario):
    verdict = method("bcrb").verdict(measured(scenario, lb.Bearing, 0.0))
    assert verdict.status is Status.REFUSED
    assert "steep on the vertical" in verdict.reasons[0]
    own = method("bcrb").verdict(measured(scenario, Turned, 0.0))
    assert own.status is Status.REFUSED
    assert "grows like r^-1.00" in own.reasons[0]


class Turned(lb.Bearing):
    """A bearing from the y-axis, written anew: its kind is not known."""

    def __call__(self, position):
        return jnp.arctan2(position[0] - self.anchor[0], position[1] - self.anchor[1])


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


# ---- models built in Python -----------------------------------------------------------------------------------------


ONE = np.ones((1, 1, 1))


def model(**changes):
    """A number that is measured once."""
    options = dict(
        times=lb.Times.uniform(step_s=1.0, steps=1),
        prior=lb.GaussianPrior([0.0], [[4.0]]),
        motion=lb.LinearMotion(ONE, 0 * ONE, position_index=(0,)),
        channels=of(lambda x: x[0]),
        chains=lb.MarkovSight([1.0], [[1.0]]),
    )
    return lb.JumpMarkov(**(options | changes))


class Shrinking(lb.LinearMotion):
    """A motion with a negative variance."""

    def covariances(self, intervals):
        return -super().covariances(intervals)


def of(h, noise=None):
    return lb.AdditiveChannel(lambda x, mode, k: h(x), [noise or lb.Gaussian(0.0, 0.5)])


MODELS = {
    "the motion is linear with Gaussian noise, Q positive semidefinite": (
        dict(motion=Shrinking(ONE, ONE, position_index=(0,))),
        Status.REFUSED,
        "negative variance",
    ),
    "the sight of every link is a Markov chain of its own": (
        dict(chains=Leaky([1.0], [[1.0]])),
        Status.REFUSED,
        "chain 0 is no Markov chain",
    ),
    "what is measured is continuous in the state": (
        dict(channels=of(lambda x: 3 * jnp.sign(x[0]))),
        Status.REFUSED,
        "h of channel 0 jumps by 6 at (0)",
    ),
    "what is measured has a slope of finite mean square": (
        dict(channels=of(lambda x: 10 * jnp.log10(jnp.abs(x[0])))),
        Status.REFUSED,
        "grows like r^-1.00 towards (0)",
    ),
    "every noise has a finite Fisher information about a shift": (
        dict(channels=of(lambda x: x[0], Rough(0.0, 1.0))),
        Status.REFUSED,
        "vanishes linearly at an edge",
    ),
    "log-densities of the user's own are normalised, smooth, and those of their samplers": (
        dict(prior=lb.DensityPrior(lambda x: -0.5 * x @ x, lambda key: jax.random.normal(key, (1,)))),
        Status.CONDITIONAL,
        "log-density of the prior is normalised",
    ),
}  # fmt: skip


@pytest.mark.parametrize("assumption", METHODS["bcrb"].on_model, ids=lambda a: a.text)
def test_every_assumption_has_a_model_that_violates_it_and_a_verdict_that_says_so(assumption):
    changes, status, words = MODELS[assumption.text]
    bad = model(**changes)
    verdict = method("bcrb").verdict(bad)
    assert verdict.status is status
    assert any(words in reason for reason in verdict.reasons)
    assert f"{'violated' if status is Status.REFUSED else 'trusted '} {assumption.text}: " in lb.explain("bcrb", bad)
    if status is Status.REFUSED:
        with pytest.raises(lb.RefusedError, match=re.escape(words)):
            lb.bcrb(bad)
    assert method("bcrb").verdict(model()).status is Status.VALID


@pytest.mark.parametrize(
    ("h", "status"),
    [
        (lambda x: jnp.abs(x[0] - 0.3), Status.VALID),
        (lambda x: jnp.tanh(50 * x[0]), Status.VALID),
        (lambda x: jnp.abs(x[0] - 0.3) ** 0.75, Status.VALID),
        (lambda x: jnp.abs(x[0] - 0.3) ** 0.6, Status.CONDITIONAL),
        (lambda x: jnp.abs(x[0] - 0.3) ** 0.5, Status.REFUSED),
        (lambda x: jnp.round(x[0], 1), Status.REFUSED),
    ],
)
def test_how_steep_a_function_may_be(h, status):
    """E|h'|^2 over a density that is positive at 0.3: of |x|^p finite for p > 1/2; near that it cannot be seen."""
    verdict = method("bcrb").verdict(model(channels=of(h)))
    assert verdict.status is status
    if status is Status.CONDITIONAL:
        assert "h continuous, E|grad h|^2 finite" in verdict.reasons[0]


def test_a_steep_function_of_a_state_with_a_density_of_its_own_is_left_to_the_user():
    """Nobody knows whether that density vanishes where the function is steep: here it does."""
    positive = lb.DensityPrior(
        lambda x: -0.5 * jnp.sum(jnp.log(x) ** 2) - jnp.sum(jnp.log(x)),
        lambda key: jnp.exp(jax.random.normal(key, (1,))),
    )
    verdict = method("bcrb").verdict(model(prior=positive, channels=of(lambda x: jnp.log(x[0]))))
    assert verdict.status is Status.CONDITIONAL


def test_a_function_that_jumps_at_a_later_step_or_in_another_mode_only_is_found():
    times, ones = lb.Times.uniform(step_s=1.0, steps=5), np.ones((5, 1, 1))
    motion = lb.LinearMotion(ones, ones, position_index=(0,))
    late = lb.AdditiveChannel(lambda x, m, k: x[0] + jnp.where(k == 4, jnp.sign(x[0] - 1), 0.0), [lb.Gaussian(0, 1)])
    assert method("bcrb").verdict(model(times=times, motion=motion, channels=late)).status is Status.REFUSED
    mode = lb.AdditiveChannel(lambda x, m, k: x[0] if m == 0 else jnp.floor(x[0]), [lb.Gaussian(0, 1)] * 2)
    both = model(times=times, motion=motion, channels=mode, chains=lb.MarkovSight.stay(0.9))
    assert method("bcrb").verdict(both).status is Status.REFUSED


def test_measurements_of_this_library_are_decided_without_a_search(scenario, monkeypatch):
    def no_search(*_, **__):
        raise AssertionError("searched")

    monkeypatch.setattr(importlib.import_module("locbounds.assumptions.functions"), "_search", no_search)
    for one in (scenario, measured(scenario, lb.PathLoss, 0.0), lb.jump_markov(scenario)):
        assert method("bcrb").verdict(one).status is Status.VALID
