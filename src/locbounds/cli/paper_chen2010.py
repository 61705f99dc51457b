"""``locbounds paper chen2010``: files and screen."""

from typing import Any

import typer

from locbounds.cli.output import print_json, print_table, status


def chen2010(folder: Any, *, runs: int | None, seed: int, wanted: tuple[Any, ...], json: bool) -> None:
    """Run the study, write its files into the folder, print what was found."""
    from locbounds.papers.chen2010 import outputs, statements, study
    from locbounds.papers.chen2010.study import RUNS
    from locbounds.report.tables import csv_text
    from locbounds.requirement import comply

    with status("chen2010: starting") as say:
        found = study(runs=RUNS if runs is None else runs, seed=seed, announce=lambda text: say(f"chen2010: {text}"))
    said = statements(found)
    complied = [
        (name, c)
        for name, result in found.results.items()
        if result.kind == "filter"
        for c in comply(wanted, result.diagnostics["error_m"][:, 1:])
    ]
    folder.write_text("fig1.csv", outputs.fig1_csv(found))
    folder.write_text("fig2.csv", outputs.fig2_csv(found))
    folder.write_text("quantiles.csv", outputs.quantiles_csv(found))
    folder.write_text("segments.csv", outputs.segments_csv(found))
    folder.write_text("settings.csv", outputs.settings_csv(found))
    folder.write_text("bounds.csv", outputs.bounds_csv(found))
    columns = ("method", "limit_m", "required_share", "share", "low", "high", "decision")
    rows = [(name, *c.requirement, c.share, c.low, c.high, str(c.decision)) for name, c in complied]
    folder.write_text("requirement.csv", csv_text(columns, rows))
    for name in ("fig1", "fig2"):
        figure = getattr(outputs, name)(found)
        folder.write(f"{name}.png", lambda path, figure=figure: figure.savefig(path, dpi=150))
    if json:
        print_json(
            {
                "settings": [dict(zip(outputs.SETTING_COLUMNS, row, strict=True)) for row in outputs.settings(found)],
                "quantiles": [
                    dict(zip(outputs.QUANTILE_COLUMNS, row, strict=True)) for row in outputs.quantiles(found)
                ],
                "segments": [dict(zip(outputs.SEGMENT_COLUMNS, row, strict=True)) for row in outputs.segments(found)],
                "bounds": [dict(zip(outputs.BOUND_COLUMNS, row, strict=True)) for row in outputs.bounds(found)],
                "requirement": [dict(zip(columns, row, strict=True)) for row in rows],
                "statements": [s._asdict() for s in said],
            }
        )
        return
    _print(found, said, complied)
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")


def _print(found: Any, said: Any, complied: list[tuple[str, Any]]) -> None:
    from locbounds.papers.chen2010 import outputs

    runs = found.along_tracks.shape[1]
    by_method: dict[str, list[str]] = {}
    for name, _, value, _ in outputs.segments(found):
        by_method.setdefault(name, []).append(f"{value:.1f}")
    tails = {(name, share): (value, error) for name, share, value, error in outputs.quantiles(found)}
    print_table(
        f"Position RMSE in m (total) by period of Table 1, and quantiles ± one s.e., over {runs} random tracks",
        ["method", *(f"T({s})" for s in range(1, 9)), "67 %", "95 %"],
        [
            [name, *cells, *("{:.1f} ± {:.1f}".format(*tails[name, share]) for share in outputs.SHARES)]
            for name, cells in by_method.items()
        ],
    )
    print_table(
        "What the filters assume: probability of keeping the sight over one sample",
        ["method", "stay", "RMSE", "67 %", "95 %"],
        [
            [
                method,
                f"{stay:g}",
                *(f"{value:.2f} ± {error:.2f}" for value, error in zip(*[iter(rest)] * 2, strict=True)),
            ]
            for method, stay, *rest in outputs.settings(found)
        ],
    )
    print_table(
        "The bound's values over time in m: the first is Bayesian (random tracks), the others belong to one track",
        ["expectation over", "reading", "67 %", "95 %", "least", "largest"],
        [[name, reading, *(f"{v:.1f}" for v in values)] for name, reading, *values in outputs.bounds(found)],
    )
    if complied:
        typer.echo("Requirement, at 95 % confidence of this Monte Carlo:")
        for name, c in complied:
            typer.echo(f"  {name}: {c}")
        typer.echo()
    typer.echo("What the paper says:")
    for s in said:
        typer.echo(f"- {s.paper}\n  {s.verdict}: {s.why}")
    typer.echo()
    for name, result in found.results.items():
        extra = {"clipped": "of the updates clipped", "effective": "mean effective share of the particles"}
        for key, text in extra.items():
            if key in result.diagnostics:
                typer.echo(f"{name}: {100 * float(result.diagnostics[key].mean()):.1f} % {text}")
        if result.kind == "filter" and int(result.diagnostics["lost"]):
            typer.echo(f"{name}: {int(result.diagnostics['lost'])} of {runs} tracks lost (counted fully)")
