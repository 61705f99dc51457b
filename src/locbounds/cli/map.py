"""``locbounds map``: what accuracy is possible over an area."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from locbounds.cli.options import ForceOption, JsonOption, OutOption, SeedOption, default_out

OF_PLANS = ("grid", "cells", "methods", "share", "weights", "rtol")  # options that a city file does not take


class MapCommand(TyperCommand):
    """Hands its function the context that the function's annotation promises, not the base class of it."""

    context_class = typer.Context


def map_command(
    ctx: typer.Context,
    plan: Annotated[Path, typer.Argument(metavar="PLAN.toml", help="Plan file or city file.", show_default=False)],
    grid: Annotated[int, typer.Option("--grid", metavar="N", help="Points along the longer side.")] = 101,
    cells: Annotated[
        int, typer.Option("--cells", metavar="N", min=0, help="Cells along the longer side, for Bayesian numbers.")
    ] = 6,
    methods: Annotated[
        str,
        typer.Option("--methods", metavar="LIST", help="Beside crlb: of bcrb, wwb, ezzb, mmse, ml, ls; or none."),
    ] = "bcrb,wwb,ezzb,mmse",
    share: Annotated[
        float, typer.Option("--share", metavar="P", help="Of the error quantile that is tabulated beside the CEP.")
    ] = 0.67,
    weights: Annotated[
        str | None,
        typer.Option(
            "--weights",
            metavar="LIST",
            help="For dilutions of precision of unequal stations: one number per measurement, "
            "(reference deviation / deviation)^2.",
        ),
    ] = None,
    rtol: Annotated[
        float | None,
        typer.Option(
            "--rtol",
            help="Relative precision of the Bayesian numbers, over the prior and per cell; left out: 0.005 and 0.01.",
        ),
    ] = None,
    out: OutOption = None,
    seed: SeedOption = 0,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    r"""What accuracy is possible over an area: Cramér-Rao bound, GDOP, CEP; Bayesian bounds and the least error.

    Writes map.csv and map.nc (every point), methods.csv (numbers over the prior with their verdicts), cells.csv (the
    same for a device known to be in one cell), map.png and cells.png. An example to edit: locbounds new plan.toml
    --like plan.

    A city file, with a section \[city] that names the footprints of buildings, says everything itself: of the options
    it takes --out, --seed, --json and --force. Writes map.csv (every street point), cells.csv (bounds per set of
    nearest anchors), sight.png, excess.png, toa.png or tdoa.png.

    [bold]Example[/bold]: locbounds map plan.toml
    """
    from locbounds.io.kinds import kind_of_file

    if kind_of_file(plan) == "city":
        from locbounds.cli.map_city import map_city

        _refuse_plan_options(ctx)
        map_city(plan, default_out(plan, out), seed=seed, json=json, force=force)
        return
    map_plan(
        plan,
        default_out(plan, out),
        grid=grid,
        cells=cells,
        methods=methods,
        share=share,
        weights=weights,
        rtol=rtol,
        seed=seed,
        json=json,
        force=force,
    )


def _refuse_plan_options(ctx: typer.Context) -> None:
    """Raise an InputError if an option was given that a city file does not take."""
    from locbounds.errors import InputError

    for name in OF_PLANS:
        source = ctx.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            raise InputError(f"--{name} is for plan files, this is a city file", "Its keys say what is computed")


def map_plan(
    path: Path,
    out: Path,
    *,
    grid: int,
    cells: int,
    methods: str,
    share: float,
    weights: str | None,
    rtol: float | None,
    seed: int,
    json: bool,
    force: bool,
) -> None:
    """Write the map of a plan file into a folder, and print what it says."""
    from locbounds.cli.output import count_progress, output_folder, status
    from locbounds.errors import InputError, RefusedError
    from locbounds.io.plans import read_plan
    from locbounds.report import map_plot, map_tables
    from locbounds.report.tables import csv_text
    from locbounds.static.cells import CELL_RTOL, MOST_CELLS, PER_CELL, per_cell
    from locbounds.static.common import check_rtol
    from locbounds.static.maps import AccuracyMap
    from locbounds.static.over_prior import RTOL, over_prior
    from locbounds.static.tightest import choose

    ids = _ids(methods)
    rtol, cell_rtol = (check_rtol(usual if rtol is None else rtol) for usual in (RTOL, CELL_RTOL))
    if cells > MOST_CELLS:
        raise InputError(f"--cells is {cells}", f"Give a number from 0 to {MOST_CELLS}")
    read = read_plan(path)
    local = [id for id in ids if id in PER_CELL]
    notes = list(read.notes)
    found, refused = None, ""
    try:
        found = AccuracyMap(
            read.plan, read.area, grid=grid, height_m=read.height_m, share=share, weights=_weights(weights)
        )
    except RefusedError as error:
        refused = error.cause
        if not ids:
            raise
    if cells and local and read.plan.dim == 3 and read.heights_m is None:
        notes.append("no numbers per cell: area.height_m is one height; give [lowest, highest]")
        cells = 0
    with output_folder(out, force=force) as folder:
        marks: dict[str, Any] = {"names": read.names, "anchors": read.positions}
        if found is not None:
            notes += found.notes
            folder.write_text("map.csv", csv_text(map_tables.point_columns(found), map_tables.point_rows(found)))
            table = found.to_dataset()
            folder.write("map.nc", lambda target: table.to_netcdf(target, engine="h5netcdf"))
            figure = map_plot.draw_map(found, read.area, **marks)
            folder.write("map.png", lambda target: figure.savefig(target, dpi=150))
        with status("over the prior") as say:
            numbers = over_prior(read.plan, ids, rtol=rtol, seed=seed, announce=say)
        rows = [*_crlb_rows(found, refused), *map_tables.method_rows(numbers)]
        folder.write_text("methods.csv", csv_text(map_tables.METHOD_COLUMNS, rows))
        parts = []
        if cells and local:
            with count_progress("numbers per cell") as progress:
                parts = per_cell(
                    read.plan, read.area, local, cells=cells, height=read.heights_m, rtol=cell_rtol, seed=seed,
                    progress=progress,
                )  # fmt: skip
            folder.write_text("cells.csv", csv_text(map_tables.cell_columns(local), map_tables.cell_rows(parts, local)))
            picture = map_plot.draw_cells(read.plan, read.area, parts, local, anchors=read.positions)
            folder.write("cells.png", lambda target: picture.savefig(target, dpi=150))
    best = choose(numbers)
    notes += [
        f"warning: {id}: {w}" for id, r in numbers.items() for w in getattr(getattr(r, "verdict", None), "warnings", ())
    ]
    if json:
        _print_json(read, found, rows, best, parts, local, notes)
        return
    _print(read, path, found, rows, best, notes)
    typer.echo(f"wrote {', '.join(str(p) for p in folder.written)}")


def _ids(text: str) -> list[str]:
    from locbounds.errors import InputError
    from locbounds.io.complain import close_key
    from locbounds.static.over_prior import OVER_PRIOR

    if text.strip().lower() == "none":
        return []
    ids = list(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    for id in ids:
        if id not in OVER_PRIOR:
            near = close_key(id, list(OVER_PRIOR))
            raise InputError(
                f"unknown method {id!r}", f"{f'Did you mean {near}? ' if near else ''}Known: {', '.join(OVER_PRIOR)}"
            )
    return ids


def _weights(text: str | None) -> Any:
    import numpy as np

    from locbounds.errors import InputError

    if text is None:
        return None
    try:
        return np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise InputError(f'--weights is "{text}"', "Give numbers with commas between, one per measurement") from None


def _crlb_rows(found: Any, refused: str) -> list[tuple[Any, ...]]:
    what = "bound at a point, median over the area"
    if found is None:
        return [("crlb", what, "", "", "refused", refused)]
    verdict = found.bounds.verdict
    median = next(row[1] for row in found.statistics() if row[0] == "crlb_rmse_m")
    return [("crlb", what, median, 0.0, str(verdict.status), "; ".join(verdict.reasons))]


def _print(read: Any, path: Path, found: Any, rows: list[tuple[Any, ...]], best: Any, notes: list[str]) -> None:
    from locbounds.cli.output import print_table

    title = read.plan.title or path.stem
    if found is not None:
        print_table(
            f"{title}: what is possible without prior knowledge, at {len(found.bounds.status):,} points (CRLB)",
            ["", "half of the area", "95 % of it", "worst", "no bound"],
            [
                (_words(name), _below(a, name), _below(b, name), _below(worst, name, ""), f"{share:.1%}")
                for name, a, b, worst, share in found.statistics()
                if name in _shown(found)
            ],
        )
    print_table(
        "Position RMSE, and whether it may be quoted",
        ["method", "what it is", "RMSE", "verdict"],
        [
            (id, what, _metres(value, error), f"{verdict} ({why})" if why else verdict)
            for id, what, value, error, verdict, why in rows
        ],
    )
    for text in (*([best.reason] if best else []), *notes):
        typer.echo(text)


def _shown(found: Any) -> set[str]:
    """Quantities of the table: without what equals another one."""
    names = {name for name in found.figures if not name.startswith(("crlb_std", "ellipse95"))}
    if "tdop" not in names:
        names -= {"pdop"}
    return names if found.plan.dim == 3 else names - {"hdop"}


WORDS = {
    "crlb_rmse_m": "RMSE",
    "crlb_mde_m": "mean error (MDE)",
    "crlb_cep_m": "median error (CEP)",
    "crlb_clock_m": "clock, times c",
    "gdop": "GDOP",
    "pdop": "PDOP, position",
    "hdop": "HDOP, horizontal",
    "vdop": "VDOP, vertical",
    "tdop": "TDOP, clock",
}


def _words(name: str) -> str:
    if name.startswith("crlb_q"):
        return f"{name[6:-2].replace('_', '.')} % of the errors"
    return WORDS.get(name, name)


def _below(value: float, name: str, sign: str = "<= ") -> str:
    if value == float("inf"):
        return "no bound"
    return f"{sign}{value:.3g}{' m' if name.endswith('_m') else ''}"


def _metres(value: Any, error: Any) -> str:
    if value == "" or value != value:
        return ""
    if value == float("inf"):
        return "no bound"
    return f"{value:.3f} m" + (f" ± {error:.3f}" if error else "")


def _print_json(
    read: Any, found: Any, rows: list[tuple[Any, ...]], best: Any, parts: Any, local: list[str], notes: list[str]
) -> None:
    from locbounds.cli.output import print_json
    from locbounds.report import map_tables

    def plain(columns: Any, row: Any) -> dict[str, Any]:
        return {k: None if v == "" else v for k, v in zip(columns, row, strict=True)}

    print_json(
        {
            "title": read.plan.title,
            "points": 0 if found is None else len(found.bounds.status),
            "crlb": []
            if found is None
            else [
                dict(zip(("quantity", "half", "share_95", "worst", "share_without"), row, strict=True))
                for row in found.statistics()
            ],
            "methods": [plain(map_tables.METHOD_COLUMNS, row) for row in rows],
            "tightest": best
            and {
                "id": best.best.id,
                "rmse_m": best.rmse_m,
                "runner_up": best.runner_up.id if best.runner_up else "",
                "why": best.reason,
            },
            "cells": [plain(map_tables.cell_columns(local), row) for row in map_tables.cell_rows(parts, local)],
            "notes": notes,
        }
    )
