"""TOML with errors that teach."""

import os
import tomllib
from pathlib import Path
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


def read_toml(path: str | os.PathLike, remedy: str) -> dict[str, Any]:
    """The keys of a TOML file.

    Parameters
    ----------
    path
        The file, in UTF-8.
    remedy
        What to do if there is none.

    Raises
    ------
    InputError
        If it cannot be read or is not TOML.

    Examples
    --------
    >>> read_toml("absent.toml", "Make one with: locbounds new absent.toml")
    Traceback (most recent call last):
    ...
    locbounds.errors.InputError: cannot read absent.toml: no such file or directory. Make one with: locbounds new ...
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        what = remedy if isinstance(error, FileNotFoundError) else "Give a TOML file"
        raise InputError(f"cannot read {path}: {(error.strerror or str(error)).lower()}", what) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a text file in UTF-8", "Save it as UTF-8") from error
    return parse_toml(text, path.name)
