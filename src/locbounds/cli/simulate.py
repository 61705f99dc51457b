"""``locbounds simulate``: runs to filter with programs of one's own."""

from typing import Annotated

import typer

from locbounds.cli.options import ForceOption, JsonOption, OutOption, ScenarioArgument, SeedOption


def simulate(
    scenario: ScenarioArgument,
    runs: Annotated[int, typer.Option("--runs", min=1, help="Number of tracks.")] = 1_000,
    seed: SeedOption = 0,
    format: Annotated[str, typer.Option("--format", metavar="csv|npz|both", help="Files to write.")] = "both",
    out: OutOption = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Draw tracks, sight conditions and ranges from a scenario, for a filter in any language.

    Writes what a filter may see (ranges.csv, ranges.npz, anchors.csv, scenario.toml) and what it may not (truth.csv,
    sight.csv, truth.npz). The same seed gives the same numbers.

    [bold]Example[/bold]: locbounds simulate scenario.toml --runs 1000 --seed 1 --out runs
    """
    from pathlib import Path

    from locbounds.cli.output import count_progress, output_folder, print_json
    from locbounds.io.runs import write_runs
    from locbounds.io.scenario_file import load

    model = load(scenario)
    target = out if out is not None else Path(f"{scenario.stem}-runs")
    with output_folder(target, force=force) as folder, count_progress("simulating") as progress:
        write_runs(folder, model, runs=runs, seed=seed, format=format, progress=progress)
    if json:
        print_json({"runs": runs, "steps": model.steps, "seed": seed, "files": [str(path) for path in folder.written]})
        return
    typer.echo(f"{runs:,} runs of {model.steps:,} steps, {len(model.links)} links, seed {seed}")
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")
    typer.echo(f"next: locbounds score {scenario} --estimates YOURS.csv --truth {folder.path}")
