"""``locbounds explain``: what a method assumes, when it fails, whom to cite."""

from pathlib import Path
from typing import Annotated, Any

import typer

from locbounds.cli.options import JsonOption
from locbounds.errors import InputError


def explain(
    id: Annotated[
        str | None, typer.Argument(metavar="[ID]", help="A bound or filter, or regularity; left out: the list of all.")
    ] = None,
    scenario: Annotated[
        Path | None,
        typer.Option("--scenario", metavar="FILE.toml", help="Check every assumption for a scenario, or plan, file."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Say what a bound or filter assumes, when it fails, whom to cite; with a scenario or plan file, what holds there.

    Example: locbounds explain bcrb --scenario scenario.toml
    """
    from locbounds import registry
    from locbounds.cli.output import print_json, print_table

    model = None
    if scenario is not None:
        if id is None:
            raise InputError("a scenario was given, but no method", "Name one: locbounds explain bcrb --scenario FILE")
        model = _read(scenario)
    if id in registry.TOPICS:
        return print_json({"id": id, "text": registry.explain(id)}) if json else typer.echo(registry.explain(id))
    entries = [registry.describe(m) for m in (registry.METHODS.values() if id is None else [registry.method(id)])]
    if json:
        if model is not None and id is not None:
            registry.check_subject(registry.method(id), model)
            checks = [{"assumption": text, "violated": why} for text, why in registry.method(id).check(model)]
            entries[0] |= {"checks": checks, "verdict": str(registry.method(id).verdict(model))}
        print_json(entries if id is None else entries[0])
    elif id is None:
        columns = ("id", "kind", "summary")
        print_table("Bounds and filters", columns, [[entry[c] for c in columns] for entry in entries])
        typer.echo("More about one: locbounds explain ID; when bounds exist at all: locbounds explain regularity")
    else:
        typer.echo(registry.explain(id, model))


def _read(path: Path) -> Any:
    """The scenario of a scenario file, or the plan of a plan file."""
    from locbounds.io.kinds import kind_of_file

    if kind_of_file(path) == "plan":
        from locbounds.io.plans import read_plan

        return read_plan(path).plan
    from locbounds.io.scenario_file import load

    return load(path)
