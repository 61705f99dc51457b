"""Where the measured data sets are: the one setting that tests, benchmarks and pages share.

The environment variable ``LOCBOUNDS_DATA`` names the folder that holds them (``wifi_rtt_walks/`` and others);
without it ``../shared/data`` beside the project is taken. They are not part of the project: without the setting, what
needs one that is missing is skipped. Who sets it promises that all are there: then a missing one is a failure.
"""

import os
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]


def folder() -> Path:
    """The folder of all data sets, which need not exist."""
    return Path(os.environ.get("LOCBOUNDS_DATA") or PROJECT.parent / "shared" / "data").expanduser()


def find(name: str) -> Path | None:
    """The folder of one data set, or None where it is missing."""
    path = folder() / name
    return path if path.is_dir() else None


def need(name: str) -> Path:
    """The folder of one data set; where it is missing the running test fails if the setting is made, else it skips."""
    import pytest

    path = find(name)
    if path is None:
        missing = f"data set {name} is not in {folder()}"
        if os.environ.get("LOCBOUNDS_DATA"):
            pytest.fail(f"{missing}, which LOCBOUNDS_DATA names; put it there or unset LOCBOUNDS_DATA", pytrace=False)
        pytest.skip(f"{missing}; set LOCBOUNDS_DATA to the folder that has it")
    return path
