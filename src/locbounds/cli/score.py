"""``locbounds score``: estimates of a filter in any language, against bounds."""

from pathlib import Path
from typing import Annotated

import typer

from locbounds.cli import compliance
from locbounds.cli.options import (
    ForceOption,
    JsonOption,
    OutOption,
    RequirementOption,
    ScenarioArgument,
    SeedOption,
    requirements,
)
from locbounds.errors import InputError, RefusedError


def score(
    scenario: ScenarioArgument,
    estimates: Annotated[
        Path | None,
        typer.Option("--estimates", metavar="FILE", help="Estimates (.csv, .csv.gz, .npz, .npy)."),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option("--truth", metavar="PATH", help="Truth, or folder of simulate; by default drawn again by --seed."),
    ] = None,
    bounds: Annotated[
        str | None, typer.Option("--bounds", metavar="IDS", help="Bounds, comma separated; by default all that apply.")
    ] = None,
    sees: Annotated[
        str, typer.Option("--sees", metavar="WHAT", help="What the filter was told: ranges, or ranges,sight.")
    ] = "ranges",
    name: Annotated[str, typer.Option("--name", help="Name of the filter in table and figure.")] = "own filter",
    columns: Annotated[
        list[str] | None,
        typer.Option("--column", metavar="FILE.KEY=NAME", help="Own column names, e.g. estimates.x=east; repeatable."),
    ] = None,
    rtol: Annotated[
        float | None, typer.Option("--rtol", help="Relative standard error of the bounds; default 1e-3.")
    ] = None,
    requirement: RequirementOption = "e911",
    seed: SeedOption = 0,
    out: OutOption = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """How far a filter of your own, in any language, is from what is possible.

    Reads its estimates for the runs that simulate wrote. Writes score.csv, rmse.csv and rmse.png.

    [bold]Example[/bold]: locbounds score scenario.toml --estimates mine.csv --truth runs
    """
    from locbounds import registry
    from locbounds.cli.output import output_folder, precision_progress, print_json, print_table
    from locbounds.cli.track import applicable_bounds
    from locbounds.io.estimates import Runs, ScoreColumns, read_estimates, read_truth, same_runs
    from locbounds.io.log_columns import renamed
    from locbounds.io.scenario_file import load
    from locbounds.report import plot, tables
    from locbounds.result import format_with_error, tightest
    from locbounds.scoring import score as compare
    from locbounds.simulation import simulate

    if estimates is None:
        raise InputError("there are no estimates to score", "Name their file with --estimates")
    wanted = requirements(requirement)
    model = load(scenario)
    chosen = applicable_bounds(model, bounds)
    if not chosen:
        raise InputError("no bound was asked for, or none applies", "See locbounds check, or name one with --bounds")
    told = frozenset(part.strip() for part in sees.split(","))
    names = renamed(ScoreColumns(), columns or [])
    mine = read_estimates(estimates, model, names.estimates)
    if truth is not None:
        true = read_truth(truth, model, names.truth)
    else:
        true = Runs(simulate(model, runs=len(mine.values), seed=seed).states)
    same_runs(mine, true)
    with output_folder(default_folder(estimates, out), force=force) as folder:
        results, scores, refused = [], {}, {}
        for entry in chosen:
            with precision_progress(entry.name) as progress:
                bound = registry.load(entry)(model, rtol=rtol, seed=seed, progress=progress)
            results.append(bound)
            try:
                scores[entry.id] = compare(
                    mine.values, true.values, bound, scenario=model, covariance=mine.covariance, name=name, sees=told
                )
            except RefusedError as error:
                refused[entry.id] = error.cause
        if not scores:
            raise RefusedError("; ".join(refused.values()), "Name a bound that holds for such a filter")
        own = next(iter(scores.values())).result
        best = tightest([b for b in results if b.id in scores]) or [scores[next(iter(scores))].bound]
        verdicts = [scores[b.id].verdict for b in best]
        folder.write_text("score.csv", tables.csv_text(SCORE_COLUMNS, _rows(own, results, scores)))
        folder.write_text("rmse.csv", tables.csv_text(tables.RMSE_COLUMNS, tables.rmse_rows([own, *results])))
        folder.write("rmse.png", lambda path: plot.rmse([*results, own], title=model.title).savefig(path, dpi=150))
    complied = compliance.of_results(wanted, [own])
    if json:
        rows = [dict(zip(SCORE_COLUMNS, row, strict=True)) for row in _rows(own, results, scores)]
        print_json(
            {"scores": rows, "refused": refused, "verdicts": verdicts, "warnings": own.verdict.warnings}
            | {"requirement": compliance.plain(complied, own.id)}
        )
        return
    table = []
    for r in [own, *results]:
        number = format_with_error(r.mean_position_rmse(), r.mean_position_rmse_stderr())
        efficiency = str(scores[r.id].efficiency) if r.id in scores else refused.get(r.id, "")
        table.append([r.name, r.kind, number, efficiency])
    print_table(
        f"Position RMSE, mean over steps 0..{model.steps} of {len(true.values):,} runs (± one standard error)",
        ["method", "kind", "RMSE", "efficiency of the filter [95 %]"],
        table,
    )
    for text in verdicts:
        typer.echo(text)
    compliance.echo(complied)
    for warning in own.verdict.warnings:
        typer.echo(f"warning: {warning}")
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")


SCORE_COLUMNS = ("method", "kind", "position_rmse_m", "stderr_m", "efficiency", "low", "high")


def _rows(own, results, scores) -> list[tuple]:
    rows = []
    for r in [own, *results]:
        e = scores[r.id].efficiency if r.id in scores else None
        ratio = (e.value, e.low, e.high) if e is not None else ("", "", "")
        rows.append((r.id, r.kind, float(r.mean_position_rmse()), r.mean_position_rmse_stderr(), *ratio))
    return rows


def default_folder(estimates: Path, out: Path | None) -> Path:
    """The folder for results: the one asked for, or ``./NAME-score``."""
    return out if out is not None else Path(f"{estimates.name.split('.')[0]}-score")
