"""The table of laws that ``locbounds fit --noise`` prints, and the best law of each sight."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from locbounds.fit import LawComparison, RangeLog

HEADER = (
    "errors of",
    "law",
    "held-out",
    "behind best",
    "+-",
    "AIC",
    "KS",
    "bound",
    "numbers",
    "note",
)
SIGHTS = ("LOS", "NLOS")
EVERY = 4  # of the tracks, where none are held out, every so manyth is held out for the comparison


class Laws(dict[str, list[tuple]]):
    """Rows by the name of the sight, with the comparisons they were made from."""

    comparisons: dict[str, "list[LawComparison]"]


def compare(kept: "RangeLog", held: "RangeLog | None", noise: str, say: Callable[[str], Any]) -> Laws:
    """Fit laws to the errors of every sight, by label, or to all errors where there are no labels."""
    from locbounds.errors import InputError
    from locbounds.fit import LAWS, compare_noise_laws

    families = LAWS if noise == "auto" else tuple(name.strip() for name in noise.split(","))
    if held is None:
        names = [track.name for track in kept.tracks]
        if len(names) < 2:
            raise InputError("one track cannot be split for a comparison of laws", "Give a log of several tracks")
        kept, held = kept.hold_out(",".join(names[EVERY - 1 :: EVERY] or names[-1:]) + ",")
    fit, test = kept.errors(), held.errors()
    known = bool((fit.sight >= 0).any())
    laws = Laws()
    laws.comparisons = {}
    for name, sight in zip(SIGHTS if known else ("all",), (0, 1) if known else (None,), strict=True):
        say(f"comparing laws of {name} errors")
        parts = [e.error_m if sight is None else np.where(e.sight == sight, e.error_m, np.nan) for e in (fit, test)]
        groups = np.broadcast_to(test.track[:, None], test.error_m.shape)
        found = compare_noise_laws(*parts, groups=groups, families=families)
        laws.comparisons[name] = found
        laws[name] = [_row(name, row) for row in found]
    return laws


def _row(name: str, row: "LawComparison") -> tuple:
    def number(x: float, digits: int = 4) -> float | str:
        return round(float(x), digits) if np.isfinite(x) else ""

    fit = row.fit
    return (
        name,
        row.family,
        number(row.held_out),
        number(row.behind),
        number(row.behind_stderr),
        "" if fit is None else round(fit.aic, 1),
        number(row.ks),
        row.regularity,
        "" if fit is None else _numbers(fit.noise),
        row.note,
    )


def _numbers(noise: Any) -> str:
    from dataclasses import fields

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
            "The log has no labels: the laws are of all errors, LOS and NLOS together; scenario.toml keeps its chain."
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
