"""``locbounds new``: a scenario file to edit."""

from pathlib import Path
from typing import Annotated

import typer

from locbounds.cli.options import ForceOption

HEADER = """A scenario of locbounds: edit the numbers, then
    locbounds check {name}      what was understood, and a picture
    locbounds track {name}      bounds and filters over time
Lines that begin with # are comments; positions are metres in a local plane, not degrees."""
LINKS = """What all links share; an anchor may override any key, for example
    bs1 = {{ position_m = [-3000, -2000], los = {{ std_m = 100 }} }}
Other ways to say how the sight changes:
    sight = {{ stay = {{ los = 0.95, nlos = 0.8 }} }}                   start left out: the chain's long-run shares
    sight = {{ dwell_s = {{ los = 2, nlos = 2 }} }}                     mean seconds; right for uneven times
    sight = {{ known = [{{ until_s = 8, sight = "los" }}, {{ sight = "nlos" }}] }}
Rare wide errors in both conditions:
    outlier = {{ share = 0.01, std_m = 2000 }}"""


def new(
    path: Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="File to write.", show_default=False)],
    like: Annotated[str, typer.Option("--like", metavar="PAPER", help="Paper to start from.")] = "fritsche2013",
    force: ForceOption = False,
) -> None:
    """Write a commented scenario file to edit.

    Example: locbounds new scenario.toml --like fritsche2013
    """
    from locbounds.cli.paper_names import paper
    from locbounds.io.files import refuse_existing
    from locbounds.io.scenario_file import save

    refuse_existing(path, force=force)
    comments = {"": HEADER.format(name=path), "links": LINKS.format()}
    save(paper(like).scenario(), path, comments)
    typer.echo(f"wrote {path}; next: locbounds check {path}")
