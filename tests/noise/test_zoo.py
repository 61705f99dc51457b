"""The verdict on every density of the zoo is the truth, or undecided where nothing but a declaration can decide."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.noise.regularity import NO_BOUND
from locbounds.noise.singularity import Singularity, findings, of_sum
from locbounds.noise.sum_of_two import at_most_a_part
from locbounds.registry import method
from locbounds.result import Provenance
from locbounds.verdict import Status, Verdict
from noise import zoo
from scenarios import asymmetric, noise_of

EXPONENT = 0.01  # measured ones


def test_the_zoo_is_large_enough():
    assert len(zoo.DECLARED) + len(zoo.BLACK_BOX) >= 20
    assert len(zoo.UNDECIDED) >= 2


@pytest.mark.parametrize("name", zoo.DECLARED | zoo.BLACK_BOX)
def test_the_verdict_is_the_truth_and_names_the_place(name):
    specimen, regularity = (zoo.DECLARED | zoo.BLACK_BOX)[name], zoo.noise(name).regularity()
    assert regularity.finite is specimen.finite, str(regularity)
    if specimen.place is not None:
        (finding,) = [f for f in regularity.findings if abs(f.place - specimen.place) < 1e-6]
        assert finding.kind.startswith(specimen.kind)
        assert finding.exponent == pytest.approx(specimen.exponent, abs=EXPONENT)
    if specimen.finite is False:
        assert NO_BOUND in str(regularity)
        assert np.isinf(zoo.noise(name).information())


@pytest.mark.parametrize("name", zoo.UNDECIDED)
def test_what_cannot_be_decided_is_called_undecided_and_never_valid(name):
    regularity = zoo.noise(name).regularity()
    assert regularity.status == "undecided", str(regularity)
    assert regularity.reason
    assert "valid" not in str(regularity)


def test_an_undecided_noise_leaves_bounds_undecided_and_unquoted():
    scenario = noise_of(asymmetric(), noises=(zoo.noise("t log(1/t)"), lb.Gaussian(3.0, 2.0)))
    verdict = method("bcrb").verdict(scenario)
    assert verdict.status is Status.UNDECIDED
    assert str(verdict).startswith("undecided (whether the LOS noise of anchor a0")
    good = lb.Result(
        id="bcrb",
        name="BCRB",
        kind="bound",
        sees=frozenset(["ranges"]),
        time_s=np.arange(3.0),
        position_mse=np.ones(3),
        replicates=np.linspace(-0.1, 0.1, 16)[:, None] * np.ones(3),
        covariance=np.zeros((3, 4, 4)),
        verdict=Verdict(Status.VALID, ("by construction",)),
        provenance=Provenance(seed=0, samples=16, how="by hand", references=()),
    )
    doubtful = dataclasses.replace(good, verdict=verdict)
    assert lb.tightest([doubtful]) == []
    assert lb.tightest([doubtful, good]) == [good]
    filtered = dataclasses.replace(good, id="own", kind="filter")
    with pytest.raises(lb.RefusedError, match="not known to be a bound"):
        filtered.efficiency(doubtful)


@pytest.mark.parametrize("id", ["bcrb", "enumer", "los-only"])
def test_irregular_noise_is_refused_before_anything_is_drawn(id):
    scenario = noise_of(asymmetric(), noises=(zoo.noise("RSS of Prieto"), lb.Gaussian(3.0, 2.0)))
    verdict = method(id).verdict(scenario)
    assert verdict.status is Status.REFUSED
    assert "LOS noise of anchor a0" in str(verdict)
    assert "vanishes linearly at -9.2 m" in str(verdict)


def test_numbers_that_jax_traces_are_undecided():
    with jax.enable_x64(True):
        seen = []
        jax.jit(lambda shape: seen.append(lb.Gamma(shape, 1.0).regularity().status) or shape)(jnp.asarray(3.0))
    assert seen == ["undecided"]


def test_singular_parts_of_sums_by_quadrature():
    """t_+^a convolved with t_-^b: the change of the sum's k-th derivative, from a convolution on a fine grid."""
    a, b = Singularity(0.0, 0.5, 0.0, 1.0), Singularity(0.0, 0.25, 1.0, 0.0)
    (s,) = of_sum([a], [b])
    assert s.exponent == pytest.approx(1.75)

    def value(t):  # x^0.5 (x - t)^0.25 over x from max(0, t) to 1, by substitution of the singular end
        low = max(0.0, t)
        u = (np.arange(200_000) + 0.5) / 200_000
        x = low + (1 - low) * u**4
        return np.mean(x**0.5 * (x - t) ** 0.25 * 4 * (1 - low) * u**3)

    # an analytic part c0 + c1 t + c2 t^2 + c3 t^3 and both singular coefficients, by least squares
    t = np.concatenate([-np.geomspace(1e-4, 0.05, 40), np.geomspace(1e-4, 0.05, 40)])
    sides = [np.maximum(-t, 0) ** 1.75, np.maximum(t, 0) ** 1.75]
    sides += [np.maximum(-t, 0) ** 2.75, np.maximum(t, 0) ** 2.75]
    basis = np.stack([t**0, t, t**2, t**3, t**4, *sides], 1)
    fit = np.linalg.lstsq(basis, np.array([value(x) for x in t]), rcond=None)[0]
    np.testing.assert_allclose(fit[5:7], [s.left, s.right], rtol=2e-3)


def test_jumps_that_cancel_and_logarithms():
    whole = ((-np.inf, np.inf),)
    step = [Singularity(0.0, 0.0, 0.3, 0.0), Singularity(0.0, 0.0, 0.0, 0.3)]
    assert findings(step, whole) == ()
    poles = of_sum([Singularity(0.0, -0.5, 0.0, 1.0)], [Singularity(0.0, -0.5, 1.0, 0.0)])
    assert poles[0].logarithm  # the two halves of a pole, convolved, make log |t|: unbounded
    assert [f.kind for f in findings(poles, whole)] == ["pole"]


def test_a_sum_is_regular_if_a_part_is():
    black_box = zoo.noise("beta 2 2")
    noise = lb.Gaussian(0.0, 1.0) + black_box
    assert noise.regularity().status == "regular"
    assert "no more information" in noise.regularity().reason
    assert at_most_a_part("", zoo.noise("uniform").regularity(), black_box.regularity()).status == "undecided"


@pytest.mark.parametrize(
    "build, match",
    [
        (lambda: lb.FromLogDensity(lambda w: -jnp.abs(w)), "integrates to 2, not to one"),
        (lambda: lb.FromLogDensity(lambda w: jnp.zeros_like(w)), "integrates to"),
        (lambda: lb.FromLogDensity(lambda w: float(w)), "cannot be traced"),
        (lambda: lb.FromLogDensity(lambda w: jnp.sum(w)), "has shape"),
        (lambda: lb.FromLogDensity(lambda w: -w, support=(1.0, 0.0)), "support"),
        (lambda: zoo.numpyro("Poisson", 3.0), "not continuous"),
        (lambda: zoo.numpyro("Normal", np.zeros(2), 1.0), "not a distribution of one number"),
    ],
)
def test_what_is_no_density_is_an_input_error(build, match):
    with pytest.raises(lb.InputError, match=match):
        build()


def test_adapted_laws_are_those_of_scipy():
    from scipy import stats

    for name, numbers, reference in (
        ("Logistic", (1.0, 2.0), stats.logistic(1.0, 2.0)),
        ("Gamma", (0.5, 1.0), stats.gamma(0.5)),
        ("Cauchy", (0.0, 1.0), stats.cauchy()),
    ):
        noise = zoo.numpyro(name, *numbers)
        q = np.array([1e-6, 0.01, 0.5, 0.99, 1 - 1e-6])
        with jax.enable_x64(True):
            draws = np.asarray(jax.jit(lambda noise: noise.sample(jax.random.key(2), (4000,)))(noise))
            cdf = np.asarray(noise.cdf(reference.ppf(q)))
        np.testing.assert_allclose(cdf, q, rtol=1e-7)
        assert stats.kstest(draws, reference.cdf).pvalue > 1e-4
