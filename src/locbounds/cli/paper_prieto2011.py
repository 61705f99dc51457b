"""``locbounds paper prieto2011``: files and screen."""

from pathlib import Path
from typing import Any

import typer

from locbounds.cli.output import print_json, print_table, status


def prieto2011(folder: Any, *, samples: int | None, runs: int | None, data: Path | None, seed: int, json: bool) -> None:
    """Run the study, write its files into the folder, print what was found."""
    from locbounds.papers.prieto2011 import densities, outputs
    from locbounds.papers.prieto2011.statements import remarks
    from locbounds.papers.prieto2011.study import study
    from locbounds.report.tables import csv_text

    survey, missing = _survey(data)
    with status("prieto2011: starting") as say:
        found = study(samples=samples, runs=runs, seed=seed, announce=lambda text: say(f"prieto2011: {text}"))
    for name, figure, unit, title in (
        ("fig1", densities.FIG1, "dB", "Signal strength: density of the error"),
        ("fig2", densities.FIG2, "cycles", "Time of arrival: density of the error"),
    ):
        folder.write_text(f"{name}.csv", densities.csv_of(figure))
        picture = densities.draw(figure, unit, title)
        folder.write(f"{name}.png", lambda path, picture=picture: picture.savefig(path, dpi=150))
    folder.write_text("fig3.csv", outputs.fig3_csv(found))
    folder.write_text("as-printed.csv", outputs.drift_csv(found))
    folder.write_text("settings.csv", outputs.settings_csv(found))
    figure = outputs.fig3(found)
    folder.write("fig3.png", lambda path: figure.savefig(path, dpi=150))
    measured = []
    if survey is not None:
        from locbounds.papers.prieto2011 import measured as real

        with status("prieto2011: measured distances"):
            measured = real.compare(survey, seed=seed)
        folder.write_text("measured.csv", csv_text(real.COLUMNS, measured))
    said = remarks(found)
    if json:
        print_json(
            {
                "fig3": [
                    {
                        "case": c.case,
                        "method": c.method,
                        "rmse_m": c.rmse_m[-1],
                        "stderr_m": c.stderr_m[-1],
                        "valid": c.valid,
                    }
                    for c in found.curves
                ],
                "as_printed": [d._asdict() for d in found.drifts],
                "settings": [s._asdict() for s in found.settings],
                "measured": [row._asdict() for row in measured],
                "remarks": said,
            }
        )
        return
    _print(found, said, measured, missing)
    typer.echo(f"\nwrote {', '.join(str(path) for path in folder.written)}")


def _survey(data: Path | None) -> tuple[Path | None, str]:
    """The folder of measured distances, or why there is none."""
    from locbounds.errors import InputError
    from locbounds.papers.data import DATA, named_folder
    from locbounds.papers.prieto2011.measured import FOLDER

    named = named_folder(data)
    if named is None:
        return None, f"measured distances skipped: name the folder that holds {FOLDER} with --data or in {DATA}"
    folder = named / FOLDER
    if folder.is_dir():
        return folder, ""
    if data is not None:
        raise InputError(f"there is no folder {folder}", "Check --data")
    return None, f"measured distances skipped: there is no {folder}"


def _print(found: Any, said: list[str], measured: list[Any], missing: str) -> None:
    from locbounds.papers.prieto2011 import measured as real

    seconds = len(found.curves[0].rmse_m)
    print_table(
        f"Fig. 3: range RMSE in m accumulated over {seconds} s (± one standard error, over {found.runs} runs)",
        ["case", "method", "RMSE", "valid"],
        [
            [c.case, c.method, f"{c.rmse_m[-1]:.3f}" + (f" ± {e:.3f}" if (e := c.stderr_m[-1]) > 0 else ""), c.valid]
            for c in found.curves
        ],
    )
    print_table(
        "What the readings change: bound in m, noise not cut",
        ["case", "bias", "prior of the derivatives", "RMSE"],
        [[s.case, s.bias, s.derivatives, f"{s.rmse_m:.2f}"] for s in found.settings],
    )
    if measured:
        print_table(
            "Measured distances (test points): RMSE in m ± one standard error over points",
            ["scene", "measured", "method", "RMSE", "fitted"],
            [
                [
                    r.scene,
                    r.measured,
                    r.method,
                    f"{r.rmse_m:.3f}" + (f" ± {r.stderr_m:.3f}" if r.stderr_m > 0 else ""),
                    r.note,
                ]
                for r in measured
            ],
        )
        for why in real.WHY:
            typer.echo(f"- {why}")
        typer.echo()
    else:
        typer.echo(missing + "\n")
    for remark in said:
        typer.echo(f"- {remark}")
