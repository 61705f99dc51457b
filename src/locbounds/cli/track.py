"""``locbounds track``: bounds and filters over time, on a model or along measured tracks."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from locbounds.cli import compliance
from locbounds.cli.log_options import (
    AnchorsOption,
    ColumnsOption,
    EveryOption,
    HoldOutOption,
    MergeOption,
    RangesOption,
    SelectOption,
    TimeOffsetOption,
    TruthOption,
    read,
)
from locbounds.cli.options import (
    ForceOption,
    JsonOption,
    OutOption,
    RequirementOption,
    ScenarioArgument,
    SeedOption,
    default_out,
    requirements,
)
from locbounds.cli.output import count_progress, output_folder, precision_progress, print_json, print_table, status
from locbounds.errors import InputError

if TYPE_CHECKING:
    from locbounds.horizon import Horizon
    from locbounds.registry import Method
    from locbounds.result import Result
    from locbounds.scenario import Scenario

JOINT_ANCHORS = 6  # up to here the IMM over all joint modes is the default filter, beyond it the factorised one
LOG_RTOL = 1e-2  # along measured tracks, where nothing is known to better than some per cent
BIN_S = 10.0  # width of the time bins for errors pooled over measured tracks


def track(
    scenario: ScenarioArgument,
    bounds: Annotated[
        str | None, typer.Option("--bounds", metavar="IDS", help="Bounds, comma separated; by default all that apply.")
    ] = None,
    filters: Annotated[
        str | None, typer.Option("--filters", metavar="IDS", help="Filters, comma separated, or none.")
    ] = None,
    rtol: Annotated[
        float | None, typer.Option("--rtol", help="Relative standard error to reach at every step; default 1e-3.")
    ] = None,
    runs: Annotated[int, typer.Option("--runs", min=2, help="Simulated tracks for every filter.")] = 1_000,
    horizon: Annotated[
        str,
        typer.Option(
            "--horizon",
            metavar="filter|predict:N|smooth",
            help="Ranges that an estimate of a step may use: up to it, up to N steps before, or all of the record.",
        ),
    ] = "filter",
    requirement: RequirementOption = "e911",
    seed: SeedOption = 0,
    ranges: RangesOption = None,
    anchors: AnchorsOption = None,
    truth: TruthOption = None,
    select: SelectOption = None,
    hold_out: HoldOutOption = None,
    time_offset: TimeOffsetOption = "0",
    merge: MergeOption = 0.0,
    every: EveryOption = 1,
    columns: ColumnsOption = None,
    out: OutOption = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Bounds on the tracking error over time, and what filters reach.

    Writes rmse.csv, run.nc and rmse.png. With a log of real ranges (--ranges, --anchors, --truth) the filters run on
    the measured ranges instead of simulated ones and the bound is computed along the measured tracks. After Ctrl-C
    what was finished is in partial-rmse.csv, partial-run.nc and partial-rmse.png.

    With --horizon predict:N the filters' estimates are moved on N steps; with --horizon smooth a pass backwards
    follows them, and the bounds are those of smoothers.

    [bold]Example[/bold]: locbounds track scenario.toml --bounds bcrb,enumer --filters imm-ekf --rtol 1e-3
    """
    from locbounds.horizon import Horizon
    from locbounds.io.scenario_file import load

    wanted = requirements(requirement)
    model = load(scenario)
    reach = Horizon.parse(horizon, None if ranges is not None else model.steps)
    chosen_bounds = applicable_bounds(model, bounds)
    chosen_filters = _filters(model, filters, reach)
    if not chosen_bounds and not chosen_filters:
        raise InputError("neither a bound nor a filter was asked for", "Name at least one with --bounds or --filters")
    with output_folder(default_out(scenario, out), force=force) as folder:
        if ranges is not None or anchors is not None or truth is not None:
            log = read(ranges, anchors, truth, select, time_offset, merge, every, columns, None)
            _along_log(model, log, hold_out, chosen_bounds, chosen_filters, rtol, seed, folder, json, wanted, reach)
        else:
            _on_model(model, chosen_bounds, chosen_filters, rtol, runs, seed, folder, json, wanted, reach)


def applicable_bounds(model: "Scenario", ids: str | None) -> "list[Method]":
    """The bounds that were named, or all that apply."""
    from locbounds.registry import REMEDIES, bounds_of, method
    from locbounds.verdict import Status

    if ids is not None:
        chosen = [] if ids == "none" else [method(id.strip(), "bound") for id in ids.split(",")]
        for m in chosen:
            if m.subject != "scenario":
                raise InputError(f"{m.id} speaks of a {m.subject}, not of a scenario", REMEDIES[m.subject])
        return chosen
    applicable = [m for m in bounds_of("scenario") if m.verdict(model).status is not Status.REFUSED]
    known = any(m.id == "known-sight" for m in applicable)  # then nothing is left to average over
    return [m for m in applicable if not (known and m.id in ("bcrb", "enumer"))]


def _filters(model: "Scenario", ids: str | None, horizon: "Horizon") -> list[Any]:
    from locbounds import registry
    from locbounds.filters import with_horizon

    if ids is None:
        ids = "imm-ekf" if len(model.links) <= JOINT_ANCHORS else "imm-ekf-factorised"
        if model.motion.state_size == 2 * model.dim:  # imm-kf smooths ranges and range rates
            ids += ",imm-kf-smoother" if horizon.kind == "smooth" else ",imm-kf"
    chosen = [] if ids == "none" else ids.split(",")
    return [with_horizon(registry.load(registry.method(id.strip(), "filter"))(), horizon) for id in chosen]


def _on_model(model, bounds, filters, rtol, runs, seed, folder, json, wanted, horizon) -> None:
    from locbounds import registry
    from locbounds.evaluation import evaluate_on, quantile
    from locbounds.result import format_with_error, tightest
    from locbounds.simulation import simulate

    results: list[Result] = []
    try:
        for entry in bounds:
            with precision_progress(entry.name) as progress:
                results.append(registry.load(entry)(model, rtol=rtol, seed=seed, progress=progress, horizon=horizon))
        if filters:
            with status(f"drawing {runs:,} tracks"):
                draws = simulate(model, runs=runs, seed=seed)
        for filter in filters:
            with count_progress(filter.name) as progress:
                results.append(evaluate_on(filter, model, draws, seed=seed, progress=progress, truth=model))
    except KeyboardInterrupt:
        folder.partial = True
        _save(results, model, folder)
        raise
    _save(results, model, folder)
    seen = horizon.sees(registry.RANGES)
    best = tightest(results, sees=seen)
    complied = compliance.of_results(wanted, results)

    rows = []
    for r in results:
        efficient, tails = "", ""
        if r.kind == "filter":
            matching = [b for b in best if r.sees <= b.sees]
            efficient = str(r.efficiency(matching[0])) if matching else ""
            tails = " / ".join(f"{quantile(r, share)[0]:.3g}" for share in (0.67, 0.95))
        number = format_with_error(r.mean_position_rmse(), r.mean_position_rmse_stderr())
        rows.append([r.id, r.kind, number, efficient, tails, str(r.verdict._replace(warnings=()))])
    if json:
        keys = ("method", "kind", "position_rmse_m", "stderr_m", "verdict")
        values = [
            (r.id, r.kind, float(r.mean_position_rmse()), r.mean_position_rmse_stderr(), str(r.verdict))
            for r in results
        ]
        rows = [dict(zip(keys, value, strict=True)) for value in values]
        extra = [{"requirement": compliance.plain(complied, r.id)} if r.kind == "filter" else {} for r in results]
        print_json([row | more for row, more in zip(rows, extra, strict=True)])
        return
    print_table(
        f"Position RMSE{horizon.label}, mean over steps 0..{model.steps} (± one standard error)",
        ["method", "kind", "RMSE", "efficiency [95 %]", "67 % / 95 % in m", "verdict"],
        rows,
    )
    if len(best) == 1:
        whom = {"predict": "predictor", "smooth": "smoother"}.get(horizon.kind, "filter")
        typer.echo(f"tightest valid bound for a {whom} that sees the ranges only: {best[0].id}")
    elif best:
        names = " and ".join(b.id for b in best)
        typer.echo(f"tightest valid bounds: {names}, equal within four standard errors")
    compliance.echo(complied)
    for warning in dict.fromkeys(w for r in results for w in r.verdict.warnings):
        typer.echo(f"warning: {warning}")
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")


def _save(results, model, folder) -> None:
    """Files of what was computed; after Ctrl-C they are called partial."""
    from locbounds.report import dataset, plot, tables

    title = f"{model.title} (interrupted)" if folder.partial else model.title

    if results:
        folder.write_text("rmse.csv", tables.csv_text(tables.RMSE_COLUMNS, tables.rmse_rows(results)))
        folder.write("run.nc", lambda path: dataset.save(results, path))
        folder.write("rmse.png", lambda path: plot.rmse(results, title=title).savefig(path, dpi=150))


def _along_log(model, log, hold_out, bounds, filters, rtol, seed, folder, json, wanted, horizon) -> None:
    from locbounds import registry
    from locbounds.fit.held_out import EXPLANATION, along_tracks
    from locbounds.report import tables, track_plot

    if hold_out is not None:
        _, log = log.hold_out(hold_out)
    bounds = [entry for entry in bounds if entry.id != "los-only"] or bounds
    with status("reading") as say:
        results = along_tracks(
            model,
            log,
            bounds=[registry.load(entry) for entry in bounds],
            filters=filters,
            horizon=horizon,
            rtol=LOG_RTOL if rtol is None else rtol,
            seed=seed,
            announce=say,
        )
    pooled = [(r.id, r.kind, *row) for r in results for row in r.over_time(BIN_S)]
    folder.write_text("rmse.csv", tables.csv_text(tables.RMSE_COLUMNS, pooled))
    by_track = [
        (r.id, r.kind, name, value) for r in results for name, value in zip(r.tracks, r.rmse_by_track(), strict=True)
    ]
    folder.write_text("tracks.csv", tables.csv_text(("method", "kind", "track", "position_rmse_m"), by_track))
    folder.write("rmse.png", lambda path: track_plot.along_tracks(results, width_s=BIN_S).savefig(path, dpi=150))
    measured = [(r.id, [square[1:] ** 0.5 for square in r.square_m2]) for r in results if r.kind == "filter"]
    complied = compliance.judged(wanted, measured)
    if json:
        rows = [
            {"method": r.id, "kind": r.kind, "position_rmse_m": r.rmse()[0], "stderr_m": r.rmse()[1]} for r in results
        ]
        extra = [{"requirement": compliance.plain(complied, r.id)} if r.kind == "filter" else {} for r in results]
        print_json([row | more for row, more in zip(rows, extra, strict=True)])
        return
    noun = "tracks" if len(log.tracks) > 1 else "track"
    rows = []
    for r in results:
        value, error = r.rmse()
        tails = f"{r.quantile(0.5):.2f} / {r.quantile(0.95):.2f}" if r.kind == "filter" else ""
        rows.append([r.id, r.kind, f"{value:.3f} m" + (f" ± {error:.3f}" if error > 0 else ""), tails])
    print_table(
        f"Position RMSE{horizon.label} over {len(log.tracks)} measured {noun} after the first step "
        "(± one s.e. over tracks)",
        ["method", "kind", "RMSE", "50 % / 95 % in m"],
        rows,
    )
    compliance.echo(complied)
    typer.echo(EXPLANATION)
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")
