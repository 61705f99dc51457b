"""``locbounds explain``: what a method assumes, when it fails, whom to cite."""

from typing import Annotated

import typer

from locbounds.cli.options import JsonOption


def explain(
    id: Annotated[
        str | None, typer.Argument(metavar="[ID]", help="A bound or filter, or regularity; left out: the list of all.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Say what a bound or filter assumes, when it fails and whom to cite.

    Example: locbounds explain bcrb
    """
    from locbounds import registry
    from locbounds.cli.output import print_json, print_table

    if id in registry.TOPICS:
        return print_json({"id": id, "text": registry.explain(id)}) if json else typer.echo(registry.explain(id))
    entries = [registry.describe(m) for m in (registry.METHODS.values() if id is None else [registry.method(id)])]
    if json:
        print_json(entries if id is None else entries[0])
    elif id is None:
        columns = ("id", "kind", "summary")
        print_table("Bounds and filters", columns, [[entry[c] for c in columns] for entry in entries])
        typer.echo("More about one: locbounds explain ID; when bounds exist at all: locbounds explain regularity")
    else:
        typer.echo(registry.explain(id))
