"""``locbounds paper``: a published study, published beside computed."""

from pathlib import Path
from typing import Annotated

import typer

from locbounds.cli.options import (
    ForceOption,
    JsonOption,
    OutOption,
    RequirementOption,
    SeedOption,
    default_out,
    requirements,
)
from locbounds.cli.output import output_folder, print_json, print_table, status
from locbounds.cli.paper_names import paper as find_paper
from locbounds.errors import InputError


def paper(
    name: Annotated[
        str,
        typer.Argument(metavar="PAPER", help="chen2010, fritsche2013, mcguire2009 or prieto2011", show_default=False),
    ],
    samples: Annotated[
        int | None,
        typer.Option(
            "--samples",
            min=1,
            help="Draws of every bound, in blocks of 2048; by default until the s.e. is below 0.1 %. For prieto2011 "
            "those of the information as printed, by default 10,000.",
        ),
    ] = None,
    runs: Annotated[
        int | None,
        typer.Option(
            "--runs",
            min=2,
            help="Tracks for every filter; by default 10,000 (the paper: 20,000), for chen2010 400 (the paper: 50), "
            "for prieto2011 96.",
        ),
    ] = None,
    requirement: RequirementOption = "e911",
    data: Annotated[
        Path | None,
        typer.Option(
            "--data", metavar="DIR", help="Measured data of mcguire2009 and prieto2011; by default $LOCBOUNDS_DATA."
        ),
    ] = None,
    figures: Annotated[
        str | None, typer.Option("--figures", metavar="NAMES", help="Of mcguire2009, e.g. fig3,fig6; by default all.")
    ] = None,
    seed: SeedOption = 0,
    out: OutOption = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Reproduce a paper: its tables and figures, published beside computed with standard errors.

    fritsche2013 writes table1.csv, fig1.csv and fig1.png; after Ctrl-C the finished columns of Table I in
    partial-table1.csv. The table on the screen compares every published entry with the computed one. chen2010 writes
    fig1 and fig2 (csv, png), quantiles.csv, segments.csv, settings.csv, bounds.csv and requirement.csv, and says which
    statements of the paper hold. mcguire2009 writes fig3 to fig6 and fig8 (csv, png), fig7.png and, given the measured
    surveys, fig9 (csv, png). prieto2011 writes fig1, fig2 and fig3 (csv, png), as-printed.csv, settings.csv and, where
    the data are there, measured.csv.

    [bold]Example[/bold]: locbounds paper fritsche2013 --runs 2000 --out quick-look
    """
    find_paper(name)
    if figures is not None and name != "mcguire2009":
        raise InputError(f"--figures is for mcguire2009, this is {name}", "Leave it out: all figures are made")
    wanted = requirements(requirement)
    with output_folder(default_out(name, out), force=force) as folder:
        if name == "chen2010":
            from locbounds.cli.paper_chen2010 import chen2010

            chen2010(folder, runs=runs, seed=seed, wanted=wanted, json=json)
        elif name == "prieto2011":
            from locbounds.cli.paper_prieto2011 import prieto2011

            prieto2011(folder, samples=samples, runs=runs, data=data, seed=seed, json=json)
        elif name == "fritsche2013":
            _fritsche2013(folder, samples, 10_000 if runs is None else runs, seed, json)
        else:
            from locbounds.cli.paper_mcguire2009 import mcguire2009

            mcguire2009(folder, data=data, figures=figures, seed=seed, json=json)


def _fritsche2013(folder, samples: int | None, runs: int, seed: int, json: bool) -> None:
    from locbounds.papers import fritsche2013 as study

    columns = []
    try:
        with status("fritsche2013: starting") as say:
            columns.extend(study.study(samples=samples, runs=runs, seed=seed, announce=say))
    except KeyboardInterrupt:
        if columns:
            folder.partial = True
            folder.write_text("table1.csv", study.table1_csv(columns))
        raise
    cells = study.table1(columns)
    folder.write_text("table1.csv", study.table1_csv(columns))
    folder.write_text("fig1.csv", study.fig1_csv(columns))
    figure = study.fig1(columns)
    folder.write("fig1.png", lambda path: figure.savefig(path, dpi=150))
    if json:
        print_json({"table1": [cell._asdict() for cell in cells], "remarks": study.REMARKS})
        return
    stays = list(dict.fromkeys(cell.stay for cell in cells))
    rows = []
    for method in dict.fromkeys(cell.method for cell in cells):
        row = {cell.stay: cell for cell in cells if cell.method == method}
        rows.append([method, "published", *(f"{row[s].published_m:.1f}" for s in stays)])
        rows.append(["", "computed", *(f"{row[s].computed_m:.2f} ± {row[s].stderr_m:.2f}" for s in stays)])
    print_table(
        "Table I: position RMSE in m, averaged over steps 0..100 (± one standard error), by stay probability",
        ["method", "", *(f"{s:g}" for s in stays)],
        rows,
    )
    for remark in study.REMARKS:
        typer.echo(remark)
    typer.echo(f"\nwrote {', '.join(str(path) for path in folder.written)}")
