"""The ``locbounds`` program: its commands, and what happens when something goes wrong."""

import os
from typing import Annotated

import typer

from locbounds.cli.cache import use_compile_cache
from locbounds.cli.check import check
from locbounds.cli.explain import explain
from locbounds.cli.failures import Program
from locbounds.cli.fit import fit
from locbounds.cli.map import MapCommand, map_command
from locbounds.cli.new import new
from locbounds.cli.paper import paper
from locbounds.cli.score import score
from locbounds.cli.simulate import simulate
from locbounds.cli.survey import survey
from locbounds.cli.track import track

app = typer.Typer(
    name="locbounds",
    cls=Program,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> bool:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"locbounds {version('locbounds')}")
        raise typer.Exit
    return wanted


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of unexpected errors.")] = False,
) -> None:
    """How accurately a mobile can be located over links that switch between LOS and NLOS, and how close a filter comes.

    [bold]First steps[/bold]: locbounds new scenario.toml; locbounds check scenario.toml
    """
    if debug:
        os.environ["LOCBOUNDS_DEBUG"] = "1"
    use_compile_cache()


app.command()(new)
app.command()(check)
app.command()(track)
app.command()(simulate)
app.command()(score)
app.command()(fit)
app.command("map", cls=MapCommand)(map_command)
app.command()(survey)
app.command()(paper)
app.command()(explain)


def main() -> None:
    """Run the program with the arguments of the shell."""
    app()
