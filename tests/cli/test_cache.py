"""Kernels are kept between runs, where the user wants it."""

import pytest

from locbounds.cli.cache import cache_folder, use_compile_cache


@pytest.mark.parametrize("off", ["off", "OFF", "0", ""])
def test_switched_off(monkeypatch, off):
    monkeypatch.setenv("LOCBOUNDS_CACHE", off)
    assert cache_folder() is None


def test_a_folder_of_ones_own(monkeypatch, tmp_path):
    monkeypatch.setenv("LOCBOUNDS_CACHE", str(tmp_path / "k"))
    assert cache_folder() == tmp_path / "k"
    monkeypatch.delenv("LOCBOUNDS_CACHE")
    folder = cache_folder()
    assert folder is not None
    assert "locbounds" in folder.parts


def test_settings_reach_jax_and_respect_the_users_own(monkeypatch, tmp_path):
    monkeypatch.setattr("sys.modules", {})  # as in a fresh process, before JAX
    monkeypatch.setenv("LOCBOUNDS_CACHE", str(tmp_path / "k"))
    monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "7")
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.delenv("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", raising=False)
    import os

    use_compile_cache()
    assert os.environ["JAX_COMPILATION_CACHE_DIR"] == str(tmp_path / "k")
    assert os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] == "7"
    assert (tmp_path / "k").is_dir()


def test_a_folder_that_cannot_be_made_is_no_failure(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("x")
    monkeypatch.setattr("sys.modules", {})
    monkeypatch.setenv("LOCBOUNDS_CACHE", str(tmp_path / "file" / "k"))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    import os

    use_compile_cache()
    assert "JAX_COMPILATION_CACHE_DIR" not in os.environ
