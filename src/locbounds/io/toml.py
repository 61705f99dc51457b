"""TOML with errors that teach."""

import tomllib
from typing import Any

from locbounds.errors import InputError


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The keys of a TOML text.

    Raises
    ------
    InputError
        If it is not TOML; ``source`` names it.

    Examples
    --------
    >>> parse_toml("steps = 3", "scenario.toml")
    {'steps': 3}
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"{source} is not valid TOML: {error}", "Look at that line: quotes, brackets, one key = value per line"
        ) from error
