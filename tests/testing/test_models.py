"""The public suites for noise, measurement and motion: the library's models pass, every check catches a broken one."""

import jax
import jax.numpy as jnp
import pytest

import locbounds as lb
from locbounds.noise import Regularity
from locbounds.testing import Nonconforming, check_measurement, check_motion, check_noise
from locbounds.testing import measurement as measurement_suite
from locbounds.testing import motion as motion_suite
from locbounds.testing import noise as noise_suite


def caught(check, model, name, suite, **options):
    """The model fails the check of that name and, but for what hangs on it, no other."""
    with pytest.raises(Nonconforming) as error:
        check(model, **options)
    assert name in suite.CHECKS
    assert name in error.value.failures
    assert name in str(error.value)
    return error.value.failures


def variant(base, **members):
    """A subclass with members replaced."""
    return type("Broken", (base,), members)


NOISES = {
    "gaussian": lb.Gaussian(2.0, 3.0),
    "outliers": lb.GaussianMixture([0.85, 0.15], [0.5, 6.0], [1.0, 8.0]),
}
G = lb.Gaussian
BROKEN_NOISES = {
    "elementwise": {"log_prob": lambda self, w: jnp.sum(G.log_prob(self, w))},
    "normalised": {"log_prob": lambda self, w: G.log_prob(self, w) + 0.1},
    "moments": {"variance": property(lambda self: jnp.asarray(1.1 * self.std**2))},
    "score": {"score": lambda self, w: -G.score(self, w)},
    "information": {"information": lambda self: 1.05 / self.std**2},
    "sampler": {"sample": lambda self, key, shape: 1.05 * G.sample(self, key, shape)},
    "components": {"components": lambda self: (jnp.array([0.7]), jnp.array([2.0]), jnp.array([9.0]))},
}


@pytest.mark.parametrize("name", ["gaussian", pytest.param("outliers", marks=pytest.mark.slow)])
def test_noises_of_the_library_conform(name):
    check_noise(NOISES[name])


def test_every_noise_check_has_a_broken_noise():
    assert set(BROKEN_NOISES) == set(noise_suite.CHECKS)


@pytest.mark.parametrize("name", BROKEN_NOISES)
def test_a_broken_noise_is_caught(name):
    failures = caught(check_noise, variant(lb.Gaussian, **BROKEN_NOISES[name])(2.0, 3.0), name, noise_suite)
    if name not in ("elementwise", "normalised"):  # of these almost everything hangs
        assert set(failures) <= {name, "information"}


def test_information_that_does_not_exist_must_not_be_printed():
    members = {"regularity": lambda self: Regularity(False, "an edge")}
    failures = caught(check_noise, variant(lb.Gaussian, **members)(0.0, 1.0), "information", noise_suite)
    assert "does not exist" in failures["information"]


class Slanted(lb.Range):
    """A range with a derivative of its own, which is wrong."""

    def __call__(self, position):
        r = lb.Range.__call__(self, position)
        return jax.lax.stop_gradient(r) + 0.9 * (r - jax.lax.stop_gradient(r))


R = lb.Range
BROKEN_MEASUREMENTS = {
    "anchor": lb.Range([3.0, 4.0, 5.0]),
    "scalar": variant(R, __call__=lambda self, p: R.__call__(self, p)[None])([3.0, 4.0]),  # pyright: ignore
    "gradient": Slanted([3.0, 4.0]),
    "at the anchor": variant(R, __call__=lambda self, p: jnp.sqrt(jnp.sum((p - self.anchor) ** 2)))([3.0, 4.0]),
    "batches": variant(R, __call__=lambda self, p: R.__call__(self, p) + isinstance(p, jax.core.Tracer))([3.0, 4.0]),
}


@pytest.mark.parametrize("anchor", [[3.0, 4.0], [3.0, 4.0, 5.0]])
def test_ranges_conform(anchor):
    check_measurement(lb.Range(anchor))


def test_every_measurement_check_has_a_broken_measurement():
    assert set(BROKEN_MEASUREMENTS) == set(measurement_suite.CHECKS)


@pytest.mark.parametrize("name", BROKEN_MEASUREMENTS)
def test_a_broken_measurement_is_caught(name):
    caught(check_measurement, BROKEN_MEASUREMENTS[name], name, measurement_suite, dim=2)


CV = lb.ConstantVelocity
BROKEN_MOTIONS = {
    "names": {"position_index": property(lambda self: (0, 4))},
    "shapes": {"covariance": lambda self, dt: CV.covariance(self, dt)[:3, :3]},
    "covariance": {"covariance": lambda self, dt: CV.covariance(self, dt) - 0.1 * jnp.eye(4)},
    "composition": {"covariance": lambda self, dt: dt * CV.covariance(self, 1.0)},
    "traceable": {"transition": lambda self, dt: CV.transition(self, float(dt))},
}


@pytest.mark.parametrize(
    ("motion", "continuous"),
    [
        (lb.ConstantVelocity(0.5), True),
        (lb.ConstantVelocity([0.5, 0.1, 0.2], dim=3), True),
        (lb.ConstantVelocity(0.5, discrete=True), False),
    ],
)
def test_motions_of_the_library_conform(motion, continuous):
    check_motion(motion, continuous=continuous)


def test_every_motion_check_has_a_broken_motion():
    assert set(BROKEN_MOTIONS) == set(motion_suite.CHECKS)


@pytest.mark.parametrize("name", BROKEN_MOTIONS)
def test_a_broken_motion_is_caught(name):
    caught(check_motion, variant(lb.ConstantVelocity, **BROKEN_MOTIONS[name])(0.5), name, motion_suite)


def test_a_discrete_motion_does_not_compose_and_is_told_so():
    caught(check_motion, lb.ConstantVelocity(0.5, discrete=True), "composition", motion_suite)
