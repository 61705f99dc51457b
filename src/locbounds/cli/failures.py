"""Failures a user can read: cause and remedy on stderr, exit code 2, never a traceback unless asked for."""

import os
import sys
import traceback
from pathlib import Path
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from locbounds.errors import LocboundsError

BAD_INPUT = 2
UNEXPECTED = 1
INTERRUPTED = 130
_kept: list[Path] = []  # files that the running command has finished


def name_after_ctrl_c(finished: list[Path]) -> None:
    """Have the files of this list, which the running command still extends, named after Ctrl-C."""
    global _kept
    _kept = finished


def fail(cause: str, remedy: str, code: int) -> NoReturn:
    """Print a failure and leave."""
    typer.echo(f"error: {cause}", err=True)
    if remedy:
        typer.echo(f"remedy: {remedy}", err=True)
    raise typer.Exit(code)


class Program(TyperGroup):
    """The group of commands, with readable failures."""

    def main(self, *args: Any, standalone_mode: bool = True, **options: Any) -> Any:
        """Run; wrong options end like wrong files: ``error:``, ``remedy:``, exit code 2."""
        if not standalone_mode:
            return super().main(*args, standalone_mode=False, **options)
        try:
            code = super().main(*args, standalone_mode=False, **options)
        except typer.TyperException as error:
            context = getattr(error, "ctx", None)
            typer.echo(f"error: {error.format_message().rstrip('.')}", err=True)
            typer.echo(f"remedy: see {context.command_path if context else 'locbounds'} --help", err=True)
            code = error.exit_code
        except typer.Abort:
            code = UNEXPECTED
        sys.exit(code if isinstance(code, int) else 0)

    def invoke(self, ctx: Any) -> Any:
        """Run a command and explain its failure."""
        name_after_ctrl_c([])
        try:
            return super().invoke(ctx)
        except LocboundsError as error:
            fail(error.cause, error.remedy, BAD_INPUT)
        except KeyboardInterrupt:
            names = ", ".join(str(path) for path in _kept)
            fail("interrupted", f"kept what was finished: {names}" if names else "", INTERRUPTED)
        except (typer.TyperException, typer.Exit, typer.Abort, BrokenPipeError):
            raise
        except Exception as error:
            if os.environ.get("LOCBOUNDS_DEBUG"):
                traceback.print_exc()
            reason = f"{type(error).__name__}: {error}".strip().splitlines()[0]
            fail(
                f"unexpected: {reason}",
                "This is a defect of locbounds; locbounds --debug COMMAND shows where it happened",
                UNEXPECTED,
            )
