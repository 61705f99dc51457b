"""What ``locbounds fit --noise`` does: the table and the figure of laws, and the best law of each sight."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from locbounds.fit import LawComparison, RangeErrors

HEADER = (
    "errors of",
    "law",
    "held-out",
    "s.e.",
    "behind best",
    "its s.e.",
    "AIC",
    "KS",
    "bound",
    "numbers",
    "note",
)
SIGHTS = ("LOS", "NLOS")
SIGMAS = 2.0


class Laws(dict[str, list[tuple]]):
    """Rows by the name of the sight, with the comparisons they were made from."""

    comparisons: dict[str, "list[LawComparison]"]


def compare(errors: "RangeErrors", noise: str, say: Callable[[str], Any]) -> Laws:
    """Fit laws to the errors of every sight, by label, or to all errors where there are no labels."""
    from locbounds.errors import InputError
    from locbounds.fit import LAWS, compare_noise_laws

    families = LAWS if noise == "auto" else tuple(name.strip() for name in noise.split(","))
    laws = Laws()
    laws.comparisons = {}
    for name, part in errors.by_sight().items():
        fit, test = part.error_m[~part.held], part.error_m[part.held]
        if not len(fit) and not len(test):
            continue
        if not len(fit) or not len(test):
            raise InputError(
                f"{'all' if len(test) else 'no'} {name} errors are held out",
                "Hold out others: --hold-out, on both sides",
            )
        say(f"comparing laws of {len(fit):,} {name} errors on {len(test):,}")
        laws.comparisons[name] = compare_noise_laws(fit, test, groups=part.group[part.held], families=families)
        laws[name] = [_row(name, row) for row in laws.comparisons[name]]
    return laws


def write(folder: Any, errors: "RangeErrors", laws: Laws) -> list[tuple]:
    """Write noise.csv and noise.png; the rows of all tables."""
    from locbounds.report.law_plot import law_figure
    from locbounds.report.tables import csv_text

    rows = [row for table in laws.values() for row in table]
    folder.write_text("noise.csv", csv_text(HEADER, rows))
    held = {name: part.error_m[part.held] for name, part in errors.by_sight().items()}
    figure = law_figure(laws.comparisons, held)
    folder.write("noise.png", lambda path: figure.savefig(path, dpi=150))
    return rows


def print_laws(laws: Laws) -> None:
    """The tables for people."""
    import typer

    from locbounds.cli.output import print_table

    for name, table in laws.items():
        title = f"Laws of the error, {name}: mean log density (1/m) of held-out errors"
        shown = [k for k, column in enumerate(HEADER) if column not in ("errors of", "numbers")]
        print_table(title, [HEADER[k] for k in shown], [[row[k] for k in shown] for row in table])
        typer.echo(winner(name, laws.comparisons[name]) + "\n")


def winner(name: str, rows: "list[LawComparison]") -> str:
    """Which law is best, and which others the held-out errors do not tell from it, in a sentence."""
    best = rows[0]
    if best.fit is None or best.impossible:
        return f"{name}: every law calls some of the held-out errors impossible."
    near = [row.family for row in rows[1:] if row.behind <= SIGMAS * row.behind_stderr]
    also = f"; within {SIGMAS:g} standard errors of it: {', '.join(near)}" if near else ", and no other is near"
    return f"{name}: {best.family} is best ({_numbers(best.fit.noise)}){also}."


def compare_only(ranges: Path, noise: str, out: Path, *, force: bool, json: bool, **options: Any) -> None:
    """The comparison of laws for errors that are no log of tracks: no scenario comes of them."""
    import typer

    from locbounds.cli.output import output_folder, print_json, status
    from locbounds.io.range_errors import read_errors

    with output_folder(out, force=force) as folder:
        with status("reading") as say:
            errors = read_errors(ranges, **options)
            laws = compare(errors, noise, say)
        rows = write(folder, errors, laws)
    if json:
        print_json({"noise": rows, "notes": errors.notes})
        return
    print_laws(laws)
    for note in errors.notes:
        typer.echo(note)
    typer.echo(f"wrote {', '.join(str(path) for path in folder.written)}")


def _row(name: str, row: "LawComparison") -> tuple:
    def number(x: float, digits: int = 4) -> float | str:
        return round(float(x), digits) if np.isfinite(x) else ""

    fit = row.fit
    return (
        name,
        row.family,
        number(row.held_out),
        number(row.held_out_stderr),
        number(row.behind),
        number(row.behind_stderr),
        "" if fit is None else round(fit.aic, 1),
        number(row.ks),
        row.regularity,
        "" if fit is None else _numbers(fit.noise),
        row.note,
    )


def _numbers(noise: Any) -> str:
    return ", ".join(f"{f.name} {_short(getattr(noise, f.name))}" for f in fields(noise))


def _short(value: Any) -> str:
    values = np.atleast_1d(value)
    text = " ".join(f"{v:.3g}" for v in values)
    return text if values.size == 1 else f"[{text}]"


def with_best_laws(fitted: Any, laws: dict) -> tuple[Any, dict, tuple]:
    """Scenario, comments and notes of a fitted scenario: with labels the winners replace the laws of every link."""
    notes = tuple(fitted.notes)
    if not laws:
        return fitted.scenario, fitted.comments, notes
    if set(laws) != set(SIGHTS):
        more = (
            f"The labels are all {next(iter(laws))}: scenario.toml keeps its chain."
            if "all" not in laws
            else "The log has no labels: the laws are of all errors together; scenario.toml keeps its chain."
        )
        return fitted.scenario, fitted.comments, (*notes, more)
    from locbounds.scenario import Link

    best = {name: rows[0] for name, rows in laws.comparisons.items()}  # pyright: ignore[reportAttributeAccessIssue]
    if any(row.fit is None for row in best.values()):
        return fitted.scenario, fitted.comments, (*notes, "No law fits the errors: scenario.toml keeps Gaussian laws.")
    noises = tuple(best[name].fit.noise for name in SIGHTS)
    links = [Link(a.name, a.measurement, a.sight, noises, a.reports) for a in fitted.scenario.links]
    comments = {
        path: text for path, text in fitted.comments.items() if not path.endswith((".los", ".nlos", ".outlier"))
    }
    comments |= {
        f"links.{key}": f"best of {len(laws[name])} laws by held-out likelihood, {best[name].fit.errors} errors"
        for key, name in (("los", "LOS"), ("nlos", "NLOS"))
    }
    return fitted.scenario.replace(links=links), comments, notes
