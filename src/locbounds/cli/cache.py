"""Kernels compiled by earlier runs, kept in the user's cache folder."""

import os
import sys
from pathlib import Path

SWITCH = "LOCBOUNDS_CACHE"  # a folder, or "off"


def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None if switched off."""
    chosen = os.environ.get(SWITCH)
    if chosen is not None:
        return None if chosen.lower() in ("off", "0", "no", "") else Path(chosen)
    from platformdirs import user_cache_path

    return user_cache_path("locbounds", appauthor=False) / "kernels"


def use_compile_cache() -> None:
    """Tell JAX, before it is imported, to keep compiled kernels.

    The user's own JAX settings win. A folder that cannot be written is left alone: the program then compiles anew.
    """
    folder = cache_folder()
    if folder is None or "jax" in sys.modules:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return
    if os.access(folder, os.W_OK):
        os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
