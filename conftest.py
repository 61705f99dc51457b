"""What every test runs under. Nothing here switches JAX to double precision: the library has to do that itself."""

import os
from pathlib import Path

# compiled kernels outlive the modules that share them; before JAX is imported
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parent / ".pytest_cache" / "kernels"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.2")

import jax
import matplotlib
import pytest
from hypothesis import settings
from jaxtyping import install_import_hook

install_import_hook("locbounds", "beartype.beartype")  # shapes and types of every call, before anything is imported
matplotlib.use("Agg")
settings.register_profile("same-every-time", derandomize=True, deadline=None, database=None, max_examples=25)
settings.load_profile("same-every-time")


@pytest.fixture(scope="module", autouse=True)
def _free_compiled_kernels():
    yield
    jax.clear_caches()
