"""Per-sample and common bias of the samples of one epoch."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from compiling import QUICKLY
from locbounds.precision import double_precision

SIGMAS = 4.0


def test_gaussian_epochs_have_the_information_of_their_covariance():
    """1' C^-1 1 with C = s^2 I + b^2 11' or (s^2 + b^2) I."""
    M, s, b = 10, 1.6, 3.0
    one = np.ones(M)
    for common, C in ((True, s**2 * np.eye(M) + b**2 * np.outer(one, one)), (False, (s**2 + b**2) * np.eye(M))):
        epoch = lb.Epoch(lb.Gaussian(0.0, s), lb.Gaussian(0.0, b), M, common=common)
        assert epoch.information().value == pytest.approx(one @ np.linalg.solve(C, one), rel=1e-9)


def test_the_mean_is_sufficient_for_gaussian_noise_and_any_common_bias():
    """The joint density, integrated over the bias numerically, has the score of the mean's density."""
    epoch = lb.Epoch(lb.Gaussian(0.0, 2.0), lb.Exponential(3.0), 4)

    @double_precision
    @partial(jax.jit, compiler_options=QUICKLY)
    def scores(epoch, mean):
        w = epoch.sample(jax.random.key(0), (6,))
        return -jax.jvp(epoch.log_prob, (w,), (jnp.ones_like(w),))[1], mean.score(w.mean(-1))

    joint, mean = scores(epoch, epoch.as_noise())
    np.testing.assert_allclose(joint, mean, rtol=1e-6)


def test_samples_do_not_remove_a_common_bias():
    noise, bias = lb.Laplace(0.0, 1.0), lb.Gaussian(0.0, 2.0)
    common = lb.Epoch(noise, bias, 5).information(draws=2048)
    single = lb.Epoch(noise, bias, 1).information()
    own = lb.Epoch(noise, bias, 5, common=False).information()
    assert single.value < common.value - SIGMAS * common.stderr
    assert common.value - SIGMAS * common.stderr < 1 / 4.0  # never above that of the bias alone
    assert own.value == pytest.approx(5 * single.value)
    assert own.value > 1 / 4.0


def test_irregular_epochs_and_bad_input():
    epoch = lb.Epoch(lb.TruncatedGaussian(0.0, 1.6, -3.2, 3.2), lb.Uniform(0.0, 3.0), 10)
    assert epoch.regularity().status == "irregular"
    assert np.isinf(epoch.information().value)
    with pytest.raises(lb.RefusedError, match="not sufficient"):
        epoch.as_noise()
    with pytest.raises(lb.InputError, match="0 samples"):
        lb.Epoch(lb.Gaussian(0, 1), lb.Gaussian(0, 1), 0)
