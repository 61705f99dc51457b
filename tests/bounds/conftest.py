"""The tests of the bounds share one scenario shape: its kernels are compiled once for all of them."""

import jax
import pytest


@pytest.fixture(scope="package", autouse=True)
def _free_compiled_kernels():
    yield
    jax.clear_caches()
