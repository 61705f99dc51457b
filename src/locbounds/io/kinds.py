"""Which kind of TOML file one has, told from its sections: a scenario, a plan or a city."""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from locbounds.errors import InputError

SECTIONS = {"city": ("city",), "plan": ("area",), "scenario": ("time", "motion")}
TAKEN_BY = {
    "city": "It goes to: locbounds map {name}",
    "plan": "It goes to: locbounds map {name}, or locbounds explain ID --scenario {name}",
    "scenario": "It goes to: locbounds check {name}, or locbounds track {name}",
}


def kind_of(keys: Mapping[str, Any]) -> str | None:
    """``"city"``, ``"plan"`` or ``"scenario"`` by the sections that no other kind of file has; None without any.

    >>> kind_of({"format": 1, "area": {}, "links": {}}), kind_of({"links": {}})
    ('plan', None)
    """
    return next((kind for kind, names in SECTIONS.items() if any(name in keys for name in names)), None)


def kind_of_file(path: str | os.PathLike) -> str | None:
    """The kind of a TOML file; None where it cannot be read or has no telling section.

    >>> kind_of_file("absent.toml") is None
    True
    """
    try:
        return kind_of(tomllib.loads(Path(path).read_text(encoding="utf-8-sig")))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return None


def expect(keys: Mapping[str, Any], wanted: str, source: str) -> None:
    """Raise an InputError if the keys are those of another kind of file.

    Examples
    --------
    >>> expect({"area": {}}, "scenario", "hall.toml")
    Traceback (most recent call last):
    ...
    locbounds.errors.InputError: hall.toml is a plan file, it has a section [area], not a scenario file. It goes to: ...
    """
    kind = kind_of(keys)
    if kind in (None, wanted) or any(name in keys for name in SECTIONS[wanted]):
        return
    section = next(name for name in SECTIONS[kind] if name in keys)
    raise InputError(
        f"{source} is a {kind} file, it has a section [{section}], not a {wanted} file",
        TAKEN_BY[kind].format(name=source),
    )
