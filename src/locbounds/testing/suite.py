"""How a suite of checks runs: all of them, and one error at the end."""

from collections.abc import Callable, Mapping
from typing import Any

from locbounds.precision import double_precision


class Nonconforming(AssertionError):  # noqa: N818 - reads as what it says of the model
    """A model that does not keep what its interface promises.

    Attributes
    ----------
    failures : dict
        Name of every failed check, and what was found.
    """

    def __init__(self, what: str, failures: Mapping[str, str]):
        self.failures = dict(failures)
        lines = [f"{what} fails {len(self.failures)} check{'s' if len(self.failures) > 1 else ''}:"]
        super().__init__("\n".join([*lines, *(f"  {name}: {text}" for name, text in self.failures.items())]))


Check = Callable[..., str | None]
"""What was found wrong, or None; takes the model, and what the suite made of it."""


def run(what: Any, checks: Mapping[str, Check], *arguments: Any) -> None:
    """Run every check and raise one error that lists the failed ones; a check that raises has failed."""
    failures = {}
    for name, check in checks.items():
        try:
            found = double_precision(check)(what, *arguments)
        except Exception as error:
            found = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        if found:
            failures[name] = found
    if failures:
        raise Nonconforming(
            getattr(what, "name", None) or getattr(what, "__name__", None) or type(what).__name__, failures
        )
