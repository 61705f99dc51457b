"""``locbounds paper mcguire2009``: files and screen."""

from pathlib import Path
from typing import Any

import typer

from locbounds.cli.output import print_json, print_table, status
from locbounds.errors import InputError


def mcguire2009(folder: Any, *, data: Path | None, figures: str | None, seed: int, json: bool) -> None:
    """Compute the wanted figures, write their files into the folder, print what was found."""
    from locbounds.papers import mcguire2009 as study
    from locbounds.papers.data import DATA, data_folder

    wanted = _wanted(figures, data)
    if "fig9" in wanted:
        data_folder(data, [s.folder for s in study.SETS], "Fig. 9")
    simple = [name for name in wanted if name in set(study.FIGURE_OF.values())]
    found, surveys = {}, {}
    with status("mcguire2009: starting") as say:
        for name in simple:
            rows = found[name] = study.simple_study([name], seed=seed, announce=say)[name]
            folder.write_text(f"{name}.csv", study.figure_csv(rows))
            figure = study.simple_figure(rows)
            folder.write(f"{name}.png", lambda path, figure=figure: figure.savefig(path, dpi=150))
        if "fig7" in wanted:
            plot = study.fig7_figure()
            folder.write("fig7.png", lambda path: plot.savefig(path, dpi=150))
        said = study.statements(found)
        if "fig8" in wanted:
            rows = found["fig8"] = study.fig8(seed=seed, announce=say)
            folder.write_text("fig8.csv", study.figure_csv(rows))
            curves = study.fig8_figure(rows)
            folder.write("fig8.png", lambda path: curves.savefig(path, dpi=150))
            said += study.street_statements(rows)
        if "fig9" in wanted:
            surveys = study.fig9(data, seed=seed, announce=say)
            folder.write_text("fig9.csv", study.fig9_csv(surveys))
            figure = study.fig9_figure(surveys)
            folder.write("fig9.png", lambda path: figure.savefig(path, dpi=150))
        if "fig3" in found:
            say("Fig. 3: maximum likelihood")
            said.insert(2, study.on_maximum_likelihood(seed=seed))
    if json:
        print_json(
            {name: [row._asdict() for row in rows] for name, rows in found.items()}
            | {"statements": [s._asdict() for s in said]}
            | (
                {
                    "fig9": {title: [row._asdict() for row in (*s.rows, *s.curve)] for title, s in surveys.items()},
                    "published": study.PUBLISHED_FIG9._asdict(),
                    "remarks": study.REMARKS,
                }
                if surveys
                else {}
            )
        )
        return
    for name, rows in found.items():
        _print_simple(name, rows)
    if said:
        typer.echo("What the chapter says (its figures' numbers are not printed):")
    for s in said:
        typer.echo(f"- {s.paper}\n  {s.verdict}: {s.why}")
    if simple:
        typer.echo(
            "\nCRLB and BCRB are no bounds here: the prior ends at the rim, and estimators that know it are biased.\n"
            "They are the mean of the local bound (infinite for TDoA with stations inside) and the inverse of the\n"
            "mean information (zero for RSS and AoA).\n"
        )
    if surveys:
        _print_fig9(surveys)
    if "fig9" not in wanted and figures is None:
        typer.echo(f"Fig. 9 needs measured surveys: name their folder with --data or in {DATA}.")
    typer.echo(f"\nwrote {', '.join(str(path) for path in folder.written)}")


def _wanted(figures: str | None, data: Path | None) -> list[str]:
    from locbounds.papers import mcguire2009 as study
    from locbounds.papers.data import named_folder

    if figures is None:
        return [name for name in study.FIGURES if name != "fig9" or named_folder(data) is not None]
    names = [name.strip() for name in figures.split(",") if name.strip()]
    unknown = [name for name in names if name not in study.FIGURES]
    if unknown or not names:
        raise InputError(f"unknown figure {', '.join(unknown) or figures!r}", f"Known: {', '.join(study.FIGURES)}")
    return list(dict.fromkeys(names))


def _print_simple(name: str, rows: list[Any]) -> None:
    methods = list(dict.fromkeys(row.method for row in rows))
    for case in dict.fromkeys(row.case for row in rows):
        at: dict[float, dict[str, Any]] = {}
        for row in rows:
            if row.case == case:
                at.setdefault(row.sigma, {})[row.method] = row
        cells = [[f"{sigma:g}", *(_cell(line[m]) for m in methods), _tightest(line)] for sigma, line in at.items()]
        marks = [m if next(iter(at.values()))[m].valid != "refused" else f"{m} (refused)" for m in methods]
        print_table(f"Fig. {name[3:]}, {case}: position RMSE in m", ["sigma", *marks, "tightest"], cells)


def _tightest(line: dict[str, Any]) -> str:
    """The largest valid bound, and by how much it is above the next one."""
    best, other = sorted((r for r in line.values() if r.valid == "valid"), key=lambda r: -r.rmse_m)[:2]
    return f"{best.method}, {best.rmse_m / other.rmse_m - 1:.1%} above {other.method}"


def _cell(row: Any) -> str:
    if row.valid == "estimate":
        return f"{row.rmse_m:.3f} ± {row.stderr_m:.3f}"
    return f"{row.rmse_m:.3f}"


def _print_fig9(found: Any) -> None:
    from locbounds.papers import mcguire2009 as study
    from locbounds.survey.study import name_of

    methods = dict.fromkeys(row.method for s in found.values() for row in s.rows)
    rows = [("noise", *(_noise(s) for s in found.values()))]
    for method in methods:
        at = [next((row for row in s.rows if row.method == method), None) for s in found.values()]
        rows.append((name_of(method), *("" if row is None else _metres(row) for row in at)))
    print_table("Fig. 9 at each survey's own noise: position RMSE in m (± one standard error)", ["", *found], rows)
    for remark in study.REMARKS:
        typer.echo(remark)


def _noise(found: Any) -> str:
    level = found.model.noise_db
    return f"{level:.2f} dB" if level == level else f"{found.model.noise.deviation.mean():.2f} m"


def _metres(row: Any) -> str:
    if row.rmse_m < 1e-3:
        return "< 0.001"
    return f"{row.rmse_m:.3f}" + (f" ± {row.stderr_m:.3f}" if row.stderr_m > 0 else "")
