"""Results on stdout, progress on stderr, files in the output folder."""

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from locbounds.cli.failures import name_after_ctrl_c


@contextmanager
def output_folder(path: Path, *, force: bool) -> Iterator[Any]:
    """The output folder of a command; after Ctrl-C the files finished so far stay and are named."""
    from locbounds.io.files import OutputFolder

    with OutputFolder(path, force=force) as out:
        name_after_ctrl_c(out.written)
        yield out


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """A table for people; numbers are aligned to the right."""
    from rich.console import Console
    from rich.table import Table

    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=None,
        pad_edge=False,
        header_style="dim",
        show_header=any(columns),
    )
    for k, column in enumerate(columns):
        numeric = all(isinstance(row[k], int | float) for row in rows)
        table.add_column(column, justify="right" if numeric else "left", overflow="fold")
    for row in rows:
        table.add_row(*(f"{cell:g}" if isinstance(cell, float) else str(cell) for cell in row))
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 160  # a pipe or a file has no width: do not fold
    console.print(table)
    console.print()


def print_json(value: Any) -> None:
    """One JSON document; NumPy numbers as numbers, what is not finite as null."""
    sys.stdout.write(json.dumps(_plain(value), indent=2, ensure_ascii=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


@contextmanager
def precision_progress(name: str) -> Iterator[Callable[[int, float, float], None]]:
    """A bar with the precision reached so far.

    Yields the callback ``(samples, relative standard error, target)`` that bounds take. Errors fall with the square
    root of the samples, so the bar shows ``(target / error)^2``.
    """
    with _bar(name) as show:

        def report(samples: int, error: float, target: float) -> None:
            share = min(1.0, (target / error) ** 2) if error > 0 else 1.0
            show(share, f"s.e. {error:.2%} of {target:.2%}, {samples:,} draws")

        yield report


@contextmanager
def count_progress(name: str) -> Iterator[Callable[[int, int], None]]:
    """A bar for counted work; yields the callback ``(done, total)`` that :func:`locbounds.evaluate` takes."""
    with _bar(name) as show:
        yield lambda done, total: show(done / total, f"{done:,} of {total:,}")


@contextmanager
def _bar(name: str) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on stderr that vanishes when done; nothing where stderr is not a terminal."""
    if not sys.stderr.isatty():
        yield lambda share, reached: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[reached]}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=1.0, reached="compiling")
        yield lambda share, reached: bar.update(task, completed=share, reached=reached)


@contextmanager
def status(first: str) -> Iterator[Callable[[str], None]]:
    """What is being done now, on stderr; silent where stderr is not a terminal. Yields a function of the next text."""
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console

    with Console(stderr=True).status(first) as spinner:
        yield spinner.update
