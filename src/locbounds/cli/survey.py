"""``locbounds survey``: what fingerprints can tell."""

from pathlib import Path
from typing import Annotated

import typer

from locbounds.cli.options import ForceOption, JsonOption, OutOption, SeedOption, default_out
from locbounds.cli.output import output_folder, print_json, print_table, status
from locbounds.errors import InputError

RANKED = 8  # access points shown on the screen


def survey(
    fingerprints: Annotated[Path, typer.Argument(metavar="FINGERPRINTS.csv", help="The survey.", show_default=False)],
    noise: Annotated[
        str, typer.Option("--noise", metavar="DB|auto", help="RSS noise; auto: from repeated samples at a point.")
    ] = "auto",
    test: Annotated[
        str,
        typer.Option(
            "--test",
            metavar="WHAT",
            help="Held out: points, samples, COLUMN=VALUE, COLUMN:N (its last N values), or another CSV.",
        ),
    ] = "points",
    points: Annotated[
        Path | None, typer.Option("--points", metavar="CSV", help="Positions, if the samples have point_id only.")
    ] = None,
    columns: Annotated[
        list[str] | None,
        typer.Option("--column", metavar="KEY=NAME", help="Own column names, e.g. x=east; repeatable."),
    ] = None,
    select: Annotated[
        str | None, typer.Option("--select", metavar="COLUMN=VALUE", help="Only these rows, e.g. scene=office.")
    ] = None,
    access_points: Annotated[
        str | None, typer.Option("--access-points", metavar="PATTERN", help="Columns of a wide file, e.g. 'WAP*'.")
    ] = None,
    values: Annotated[str, typer.Option("--values", metavar="rss|range|both", help="Of a long file.")] = "rss",
    not_heard: Annotated[
        float | None, typer.Option("--not-heard", metavar="VALUE", help="Code for not heard, besides an empty cell.")
    ] = None,
    silence: Annotated[
        str,
        typer.Option(
            "--silence",
            metavar="level|censored",
            help="What not heard means: a reading at the weakest level, or censored below it.",
        ),
    ] = "level",
    noise_shape: Annotated[
        str,
        typer.Option("--noise-shape", metavar="common|each|full", help="One deviation, one per column, or correlated."),
    ] = "each",
    merge: Annotated[
        float | None, typer.Option("--merge", metavar="M", help="Merge samples within cells of so many metres.")
    ] = None,
    neighbours: Annotated[int, typer.Option("--neighbours", min=1, help="k of the nearest neighbours.")] = 4,
    mw: Annotated[bool, typer.Option("--mw", help="RSS is in mW: convert to dBm.")] = False,
    keep_twins: Annotated[
        bool, typer.Option("--keep-twins", help="Do not merge addresses of one access point.")
    ] = False,
    flat: Annotated[bool, typer.Option("--flat", help="Leave heights out.")] = False,
    map: Annotated[bool, typer.Option("--map/--no-map", help="Interpolate between the points.")] = True,
    seed: SeedOption = 0,
    out: OutOption = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """The rigorous bound of a fingerprint survey, the least error, and what k-NN reaches on held-out samples.

    Writes survey.csv, access_points.csv (which ones matter), map.png (where it fails), fig9.csv and fig9.png (the
    bound over noise levels).

    [bold]Example[/bold]: locbounds survey fingerprints.csv --test points
    """
    from locbounds.io.surveys import SurveyColumns, read_survey
    from locbounds.report import survey_plot
    from locbounds.report.tables import csv_text
    from locbounds.survey import study as about

    level: float | str = "auto"
    if noise != "auto":
        try:
            level = float(noise)
        except ValueError:
            raise InputError(f'the noise level is "{noise}"', "Give a positive number of dB, or auto") from None
    options = {
        "columns": SurveyColumns.parse(columns or []),
        "access_points": access_points,
        "values": values,
        "not_heard": not_heard,
        "milliwatts": mw,
        "flat": flat,
    }
    where = default_out(fingerprints.name.split(".")[0], out)
    with output_folder(where, force=force) as folder, status("reading") as say:
        read = read_survey(fingerprints, points=points, select=select, **options)
        other = test if not test.endswith((".csv", ".csv.gz")) else read_survey(test, **options).survey
        found = about.study(
            read.survey,
            read.labels,
            test=other,
            noise_db=level,
            shape=noise_shape,
            silence=silence,
            merge_m=merge,
            neighbours=neighbours,
            twins=keep_twins,
            map=map,
            seed=seed,
            announce=say,
        )
        rows = [(r.method, r.noise_db, r.rmse_m, r.stderr_m, r.valid) for r in found.rows]
        folder.write_text("survey.csv", csv_text(about.COLUMNS, _without_nan(rows)))
        ranking = [(a.name, a.unit, a.heard, a.deviation, a.rmse_without_m, a.rise_m) for a in found.ranking]
        names = ("access_point", "unit", "heard_share", "noise", "rmse_without_m", "rise_m")
        folder.write_text("access_points.csv", csv_text(names, ranking))
        title = fingerprints.name + (f", {select}" if select else "")
        folder.write("map.png", lambda path: survey_plot.where_it_fails(found, title=title).savefig(path, dpi=150))
        folder.write_text("fig9.csv", csv_text(about.CURVE_COLUMNS, _without_nan(about.curve_rows(title, found))))
        figure = survey_plot.curve({title: (found.curve, found.rows)})
        folder.write("fig9.png", lambda path: figure.savefig(path, dpi=150))
    lost = about.lost_in_words(found.bound)
    if json:
        keys = about.COLUMNS
        print_json(
            {
                "rows": [dict(zip(keys, row, strict=True)) for row in rows],
                "verdict": str(found.bound.verdict.status),
                "conditions": list(found.bound.verdict.reasons),
                "lost_to_grid_m2": found.bound.lost_to_grid_m2,
                "lost_to_pairs_m2": found.bound.lost_to_pairs_m2,
                "access_points": [a._asdict() for a in found.ranking],
                "notes": list(found.notes),
            }
        )
        return
    print_table(
        f"Position RMSE: {found.model.points:,} points, {found.model.samples:,} samples, "
        f"{len(found.model.names)} columns",
        ("method", "what", "RMSE", "valid"),
        [(r.method, about.name_of(r.method), about.in_metres(r), r.valid) for r in found.rows],
    )
    print_table(
        "What the bound rises by without one access point"
        + (f", at {found.visible_factor:.2g} times this noise" if found.visible_factor != 1 else ""),
        ("access point", "heard at", "noise", "rise"),
        [
            (a.name, f"{a.heard:.0%}", f"{a.deviation:.2g} {a.unit}", f"{a.rise_m:.3g} m")
            for a in found.ranking[:RANKED]
        ],
    )
    for text in (*(f"valid under: {reason}" for reason in found.bound.verdict.reasons), lost, *found.notes):
        typer.echo(text)
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")


def _without_nan(rows: list[tuple]) -> list[tuple]:
    return [tuple("" if isinstance(cell, float) and cell != cell else cell for cell in row) for row in rows]
