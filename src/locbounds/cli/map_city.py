"""``locbounds map`` of a city file: which links are blocked, how long their paths are, what accuracy is possible."""

from collections import Counter
from pathlib import Path
from typing import Any

import typer

KINDS = {"toa": "ToA", "tdoa": "TDoA"}


def map_city(path: Path, out: Path, *, seed: int = 0, json: bool = False, force: bool = False) -> None:
    """Write the map of a city file into a folder, and print what it says.

    Writes map.csv (every street point), cells.csv (bounds per set of nearest anchors), sight.png, excess.png and a
    picture of the Cramér-Rao bound per kind of measurement.
    """
    import numpy as np

    from locbounds.cli.output import output_folder, print_json, status
    from locbounds.io.city_file import load_city
    from locbounds.propagation import street_cells
    from locbounds.report import city_plot
    from locbounds.report.tables import csv_text
    from locbounds.static import street_map as about

    file = load_city(path)
    if file.table is not None:
        return _map_table(file, path, out, seed=seed, json=json, force=force)
    assert file.city is not None
    std_m = file.keys.measure.std_m
    assert std_m is not None
    keys, city, where = file.keys, file.city, file.bounds
    kinds, names = tuple(dict.fromkeys(keys.measure.kinds)), tuple(file.anchors)
    with output_folder(out, force=force) as folder, status("tracing paths") as say:
        x, y, points = city_plot.raster(city, where, keys.city.step_m)
        streets = city.streets(_box(where), margin_m=keys.city.margin_m, courtyards=keys.city.courtyards)
        found = about.street_map(
            city,
            file.anchors,
            points,
            std_m=std_m,
            count=keys.measure.nearest,
            roof=file.roof,
            measures=kinds,
            streets=streets,
        )
        links = found.links
        if keys.city.courtyards:
            links.refuse_unreached()
        cells = []
        for k, cell in enumerate(every := street_cells(streets, links.anchors, count=keys.measure.nearest)):
            for kind in kinds:
                say(f"bounds: {k + 1} of {len(every)} sets of anchors, {kind}")
                got = about.cell_bounds(
                    city, links.anchors, cell, std_m=std_m, measure=kind, step_m=keys.city.bound_step_m,
                    roof=[str(i + 1) for i, m in enumerate(cell.nearest) if names[m] in file.roof], seed=seed,
                )  # fmt: skip
                cells += [got] if got else []
        folder.write_text("map.csv", csv_text(_columns(kinds), _rows(found, points, kinds)))
        folder.write_text("cells.csv", csv_text(CELL_COLUMNS, [_cell_row(c, names) for c in cells]))
        marks: dict[str, Any] = {"anchors": links.anchors, "names": names}
        free = ~links.inside & np.isfinite(np.take_along_axis(links.length_m, found.used, axis=1)).all(axis=1)
        excess = np.take_along_axis(links.excess_m, found.used, axis=1).mean(axis=1)
        title = keys.title or path.stem
        pictures = {
            "sight": city_plot.draw_map(
                city, x, y, np.where(free, found.in_sight, np.nan), high=float(keys.measure.nearest), **marks,
                label=f"anchors in sight of the {keys.measure.nearest} nearest", title=title,
            ),
            "excess": city_plot.draw_map(
                city, x, y, np.where(free, excess, np.nan), **marks,
                label="mean excess delay in m", title=f"{title}: paths to the {keys.measure.nearest} nearest anchors",
            ),
        }  # fmt: skip
        for kind in kinds:
            pictures[kind] = city_plot.draw_map(
                city, x, y, found.rmse_m[kind], streets=free, **marks,
                label="Cramér-Rao bound: position RMSE in m", title=f"{title}, {KINDS[kind]}",
            )  # fmt: skip
        for name, figure in pictures.items():
            folder.write(f"{name}.png", lambda target, figure=figure: figure.savefig(target, dpi=150))
    overall = _overall_rows(cells, kinds)
    if json:
        counts = {k: {s or "value": n for s, n in Counter(found.status_of(k)).items()} for k in kinds}
        print_json({"overall": overall, "points": counts, "verdict": found.verdict, "notes": city.notes})
        return
    _print_overall(overall, title, keys.measure.nearest, names)
    for text in (found.verdict, *city.notes):
        typer.echo(text)
    typer.echo(f"\nwrote {', '.join(str(p) for p in folder.written)}")


def _map_table(file: Any, path: Path, out: Path, *, seed: int, json: bool, force: bool) -> None:
    """Bounds from a ray tracer's links: no map of the Cramér-Rao bound, since a table has no derivatives."""
    from locbounds.cli.output import output_folder, print_json, status
    from locbounds.report.tables import csv_text
    from locbounds.static.street_map import table_bounds

    measure, kinds = file.keys.measure, tuple(dict.fromkeys(file.keys.measure.kinds))
    with output_folder(out, force=force) as folder, status("bounds of the links in the table"):
        cells = [b for k in kinds for b in table_bounds(file.table, count=measure.nearest, measure=k, seed=seed)]
        folder.write_text("cells.csv", csv_text(CELL_COLUMNS, [_cell_row(c, file.table.names) for c in cells]))
    overall, verdict = (
        _overall_rows(cells, kinds),
        "crlb: refused, a table of links has no derivatives; wwb and ezzb hold",
    )
    if json:
        print_json({"overall": overall, "verdict": verdict})
        return
    _print_overall(overall, file.keys.title or path.stem, measure.nearest, file.table.names)
    typer.echo(f"{verdict}\n\nwrote {', '.join(str(p) for p in folder.written)}")


def _overall_rows(cells: list[Any], kinds: tuple[str, ...]) -> list[dict[str, Any]]:
    return [_overall([c for c in cells if c.measure == kind], kind) for kind in kinds]


def _print_overall(overall: list[dict[str, Any]], title: str, nearest: int, names: tuple[str, ...]) -> None:
    from locbounds.cli.output import print_table

    rows = [[o["measure"], *(f"{o[k]:.2f} m" for k in ("wwb_m", "ezzb_m", "tightest_m")), _least(o)] for o in overall]
    heading = f"{title}: position RMSE over all streets, from the {nearest} nearest of {len(names)} anchors"
    print_table(heading, ["", "wwb", "ezzb", "tightest", "least possible"], rows)


CELL_COLUMNS = ("anchors", "share", "measure", "wwb_m", "ezzb_m", "tightest_m", "mmse_m", "mmse_stderr_m")


def _box(bounds: tuple[float, ...]) -> Any:
    import shapely

    xmin, ymin, xmax, ymax = bounds
    return shapely.box(xmin, ymin, xmax, ymax)


def _columns(kinds: tuple[str, ...]) -> tuple[str, ...]:
    status = tuple(f"status_{k}" for k in kinds)
    return ("x_m", "y_m", *status, "anchors", "sight", "excess_m", *(f"crlb_{k}_m" for k in kinds))


def _rows(found: Any, points: Any, kinds: tuple[str, ...]) -> list[tuple[Any, ...]]:
    import math

    names, rows, status = found.links.names, [], [found.status_of(k) for k in kinds]
    for i in range(len(points)):
        if found.status[i] == "building":
            continue
        used = found.used[i].tolist()
        sight = " ".join({0: "los", 1: "nlos"}.get(int(found.links.sight[i, m]), "none") for m in used)
        excess = " ".join(f"{found.links.excess_m[i, m]:.3f}" for m in used)
        values = [float(found.rmse_m[k][i]) for k in kinds]
        cells = ["" if not math.isfinite(v) else v for v in values]
        said = [s[i] or "ok" for s in status]
        rows.append((*map(float, points[i]), *said, " ".join(names[m] for m in used), sight, excess, *cells))
    return rows


def _cell_row(cell: Any, names: tuple[str, ...]) -> tuple[Any, ...]:
    who = " ".join(names[m] for m in cell.nearest)
    bounds = (cell.wwb_m, cell.ezzb_m, cell.tightest_m)
    return (who, cell.share, cell.measure, *bounds, cell.mmse_m, cell.mmse_stderr_m)


def _overall(cells: list[Any], kind: str) -> dict[str, Any]:
    from locbounds.static.street_map import over_cells

    if not cells:
        return {"measure": kind} | dict.fromkeys(
            ("wwb_m", "ezzb_m", "tightest_m", "mmse_m", "mmse_stderr_m"), float("nan")
        )
    out: dict[str, Any] = {"measure": kind}
    for key in ("wwb_m", "ezzb_m", "tightest_m", "mmse_m"):
        out[key] = over_cells(cells, lambda cell, key=key: getattr(cell, key))
    total = sum(c.share for c in cells)
    spread = sum((c.share / total * 2 * c.mmse_m * c.mmse_stderr_m) ** 2 for c in cells) ** 0.5
    return out | {"mmse_stderr_m": spread / (2 * out["mmse_m"])}


def _least(overall: dict[str, Any]) -> str:
    return f"{overall['mmse_m']:.2f} ± {overall['mmse_stderr_m']:.2f} m"
