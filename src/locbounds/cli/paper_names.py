"""Papers by name."""

import difflib
from types import ModuleType

from locbounds.errors import InputError


def paper(name: str, also: tuple[str, ...] = ()) -> ModuleType:
    """The module of a paper, or an InputError with the nearest known name; ``also`` what else could be meant.

    >>> paper("fritsche2013").__name__
    'locbounds.papers.fritsche2013'
    """
    from locbounds import papers

    if name in papers.__all__:
        return getattr(papers, name)
    known = [*papers.__all__, *also]
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
    hint = f"Did you mean {close[0]}? " if close else ""
    raise InputError(f"unknown paper {name!r}", f"{hint}Known: {', '.join(known)}")
