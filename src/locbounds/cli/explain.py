"""``locbounds explain``: what a method assumes, when it fails, whom to cite."""

from typing import Annotated

import typer

from locbounds.cli.options import JsonOption


def explain(
    id: Annotated[
        str | None, typer.Argument(metavar="[ID]", help="A bound or filter; left out: the list of all.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Say what a bound or filter assumes, when it fails and whom to cite.

    Example: locbounds explain bcrb
    """
    from locbounds.cli.output import print_json, print_table
    from locbounds.registry import METHODS, method

    chosen = list(METHODS.values()) if id is None else [method(id)]
    described = [
        {
            "id": m.id,
            "name": m.name,
            "kind": m.kind,
            "summary": m.summary,
            "sees": sorted(m.sees),
            "assumes": [*m.grounds, *(a.text for a in m.assumptions)],
            "fails": m.fails,
            "cite": list(m.references),
        }
        for m in chosen
    ]
    if json:
        print_json(described if id is None else described[0])
    elif id is None:
        print_table("Bounds and filters", ("id", "kind", "what it is"), [[m.id, m.kind, m.summary] for m in chosen])
        typer.echo("More about one: locbounds explain ID")
    else:
        entry = described[0]
        typer.echo(f"{entry['name']} ({entry['id']}), a {entry['kind']}\n{entry['summary']}\n")
        typer.echo(f"sees     {', '.join(entry['sees'])}")
        for text in entry["assumes"]:
            typer.echo(f"assumes  {text}")
        typer.echo(f"careful  {entry['fails']}")
        typer.echo(f"cite     {', '.join(entry['cite'])}")
