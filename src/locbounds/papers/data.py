"""Where the measured data are that some figures need: the folder given, or the one that ``LOCBOUNDS_DATA`` names."""

import os
from collections.abc import Iterable
from pathlib import Path

from locbounds.errors import InputError

DATA = "LOCBOUNDS_DATA"


def named_folder(folder: str | Path | None = None) -> Path | None:
    """The folder given, otherwise the one that the environment names; None without either. It need not exist.

    >>> named_folder("measured").name
    'measured'
    """
    named = folder or os.environ.get(DATA)
    return Path(named).expanduser() if named else None


def data_folder(folder: str | Path | None, wanted: Iterable[str], what: str) -> Path:
    """The folder of the data sets.

    Parameters
    ----------
    folder
        As for :func:`named_folder`.
    wanted
        Data sets that are looked for in it.
    what
        What needs them, for the message.

    Raises
    ------
    InputError
        If none is named, or it does not exist.
    """
    path = named_folder(folder)
    if path is None:
        raise InputError(
            f"{what} needs measured data, which are not part of locbounds",
            f"Name the folder that holds {', '.join(dict.fromkeys(wanted))} with --data or in {DATA}",
        )
    if not path.is_dir():
        raise InputError(f"there is no folder {path}", f"Check --data or {DATA}")
    return path
