"""``locbounds fit``: a log of ranges becomes a scenario."""

from pathlib import Path
from typing import Annotated

import typer

from locbounds.cli.log_options import (
    AnchorsOption,
    ColumnsOption,
    DistanceOption,
    ErrorsOption,
    EveryOption,
    HoldOutOption,
    LabelsOption,
    MergeOption,
    PointsOption,
    SelectOption,
    TimeOffsetOption,
    TruthOption,
    read,
)
from locbounds.cli.options import ForceOption, JsonOption, OutOption, default_out
from locbounds.cli.output import output_folder, print_json, print_table, status


def fit(
    ranges: Annotated[Path, typer.Argument(metavar="RANGES.csv", help="Measured ranges.", show_default=False)],
    anchors: AnchorsOption = None,
    truth: TruthOption = None,
    select: SelectOption = None,
    hold_out: HoldOutOption = None,
    time_offset: TimeOffsetOption = "0",
    merge: MergeOption = 0.0,
    every: EveryOption = 1,
    labels: LabelsOption = None,
    points: PointsOption = None,
    distance: DistanceOption = None,
    errors: ErrorsOption = None,
    columns: ColumnsOption = None,
    per_anchor: Annotated[bool, typer.Option("--per-anchor", help="Noise and dwell times for every anchor.")] = False,
    psd: Annotated[
        float | None,
        typer.Option("--psd", metavar="M2_S3", help="Acceleration intensity, if the truth cannot tell it."),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option("--noise", metavar="FAMILY|auto", help="Also compare laws of the error; auto: all families."),
    ] = None,
    out: OutOption = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Fit noise, sight, motion and prior to a log of real ranges; write a scenario that track runs as it is.

    Writes scenario.toml (its comments say where every number came from), quality.csv, autocorrelation.csv and
    quality.png; with --noise also noise.csv and noise.png: which law the errors follow, and how far the others lie
    behind. Where the log has labels, scenario.toml then takes the best law of each sight.

    With --points, --distance or --errors the ranges are no tracks, and only their laws are compared.

    [bold]Example[/bold]: locbounds fit ranges.csv --anchors anchors.csv --truth truth.csv --select scene=canteen
    --hold-out 4
    """
    from locbounds.cli.fit_noise import compare, compare_only, print_laws, with_best_laws, write
    from locbounds.errors import InputError
    from locbounds.fit import errors_of_log, fit_scenario, quality_figure
    from locbounds.fit.quality import PROBABILITIES
    from locbounds.io.log_columns import LogColumns
    from locbounds.io.scenario_file import dumps
    from locbounds.report.tables import csv_text

    target = default_out(ranges.name.split(".")[0], out)
    if points is not None or distance is not None or errors is not None:
        of_tracks = {
            "--time-offset": time_offset != "0",
            "--merge": merge,
            "--every": every != 1,
            "--per-anchor": per_anchor,
            "--psd": psd is not None,
        }
        for name in (name for name, given in of_tracks.items() if given):
            raise InputError(f"{name} is for tracks, and these ranges have no order in time", f"Leave {name} out")
        compare_only(
            ranges,
            noise or "auto",
            target,
            force=force,
            json=json,
            errors=errors,
            distance=distance,
            points=points,
            anchors=anchors,
            truth=truth,
            columns=LogColumns.parse(columns or []),
            select=select,
            labels=labels,
            hold_out=hold_out,
        )
        return
    with output_folder(target, force=force) as folder:
        with status("reading") as say:
            log = read(ranges, anchors, truth, select, time_offset, merge, every, columns, labels)
            kept, held = log.hold_out(hold_out) if hold_out is not None else (log, None)
            say(f"fitting {kept.ranges:,} ranges of {len(kept.tracks)} tracks")
            title = f"Fitted to {ranges.name}" + (f", {select}" if select else "")
            fitted = fit_scenario(kept, held_out=held, per_anchor=per_anchor, psd_m2_s3=psd, title=title)
            errors_m = None if noise is None else errors_of_log(kept, held)
            laws = None if errors_m is None or noise is None else compare(errors_m, noise, say)
        quality = fitted.quality
        scenario, comments, notes = with_best_laws(fitted, laws or {})
        folder.write_text("scenario.toml", dumps(scenario, comments))
        law_rows = write(folder, errors_m, laws) if errors_m is not None and laws is not None else []
        quantiles = [f"{kind}_q{100 * p:02.0f}_m" for p in PROBABILITIES for kind in ("measured", "fitted")]
        rows = [
            (q.name, q.ranges, q.mean_m, q.fitted_mean_m, q.std_m, q.fitted_std_m, q.nlos_share, q.ks)
            + tuple(x for pair in zip(q.quantiles_m, q.fitted_quantiles_m, strict=True) for x in pair)
            for q in quality.links
        ]
        columns_out = ("anchor", "ranges", "mean_m", "fitted_mean_m", "std_m", "fitted_std_m", "nlos_share", "ks")
        folder.write_text("quality.csv", csv_text((*columns_out, *quantiles), rows))
        lags = list(
            zip(
                quality.lags,
                quality.error_autocorrelation,
                quality.model_autocorrelation,
                quality.residual_autocorrelation,
                strict=True,
            )
        )
        folder.write_text("autocorrelation.csv", csv_text(("lag_steps", "errors", "fitted_chain", "residuals"), lags))
        figure = quality_figure(kept, fitted.noise, quality)
        folder.write("quality.png", lambda path: figure.savefig(path, dpi=150))
    if json:
        print_json({"comments": comments, "notes": notes, "links": rows, "autocorrelation": lags, "noise": law_rows})
        return
    print_table("Where the numbers came from", ("key", "source"), list(comments.items()))
    print_table(
        "Errors per link, measured and fitted",
        ("anchor", "ranges", "mean m", "fitted", "std m", "fitted", "NLOS share", "KS distance"),
        [tuple(round(x, 3) if isinstance(x, float) else x for x in row[:8]) for row in rows],
    )
    print_table(
        "Autocorrelation of the errors",
        ("lag in steps", "errors", "explained by the chain", "left in the residuals"),
        [tuple(round(x, 3) if isinstance(x, float) else x for x in row) for row in lags],
    )
    if laws is not None:
        print_laws(laws)
    for note in notes:
        typer.echo(note)
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")
    typer.echo(f"next: locbounds track {folder.path / 'scenario.toml'}")
