"""What ``--requirement`` adds to a command: lines for people, entries for JSON."""

from collections.abc import Iterable
from typing import Any

import typer


def judged(wanted: tuple[Any, ...], errors: Iterable[tuple[str, Any]]) -> dict[str, tuple[Any, ...]]:
    """By filter name what its errors (rows: independent runs, metres) say about the requirements."""
    from locbounds.requirement import comply

    return {name: comply(wanted, rows) for name, rows in errors} if wanted else {}


def of_results(wanted: tuple[Any, ...], results: Iterable[Any]) -> dict[str, tuple[Any, ...]]:
    """As :func:`judged`, for the filters among results on simulated tracks; step 0, the prior, is left out."""
    filters = [r for r in results if r.kind == "filter"]
    return judged(wanted, [(r.id, r.diagnostics["error_m"][:, 1:]) for r in filters])


def echo(found: dict[str, tuple[Any, ...]]) -> None:
    """One line per filter and requirement."""
    for name, decisions in found.items():
        for c in decisions:
            typer.echo(f"requirement, {name}: {c}")


def plain(found: dict[str, tuple[Any, ...]], name: str) -> list[dict[str, Any]]:
    """What JSON holds for one filter."""
    return [
        {**c.requirement._asdict(), "within": c.share, "low": c.low, "high": c.high, "decision": str(c.decision)}
        for c in found.get(name, ())
    ]
