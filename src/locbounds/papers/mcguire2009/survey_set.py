"""Fig. 9: what a survey of received signal strengths tells.

The chapter's own survey (117 seats of a lecture hall, 12 access points) was not published; the same computation runs
here on measured surveys. The formula that the chapter gives for it is not a lower bound (docs/theory/survey.md), so
that it stands beside the rigorous one, marked.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from locbounds.errors import InputError
from locbounds.papers.data import data_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from locbounds.survey.study import SurveyStudy


class PublishedSurvey(NamedTuple):
    """What the chapter states on its survey."""

    points: int = 117
    access_points: int = 12
    noise_db: float = 2.1
    rmse_m: float = 2.7
    bound_m: float = 1.49


PUBLISHED_FIG9 = PublishedSurvey()
REMARKS = (
    f"The chapter: {PUBLISHED_FIG9.points} points, {PUBLISHED_FIG9.access_points} access points, "
    f"{PUBLISHED_FIG9.noise_db} dB: RMSE {PUBLISHED_FIG9.rmse_m} m, its formula {PUBLISHED_FIG9.bound_m} m. The survey "
    "was not published, so that these two numbers cannot be computed anew.",
    "The chapter's formula (31) is not a lower bound; (32) prints sigma^2 where sigma is meant, and sigma is computed.",
    "The rigorous bound and the least error hold at the surveyed points: they vanish with the noise, while the error "
    "of held-out points does not.",
)


class SurveySet(NamedTuple):
    """A measured survey of Fig. 9: its folder, how it is read and studied."""

    title: str
    folder: str
    file: str
    read: dict[str, Any]
    study: dict[str, Any]
    strongest: int | None = None


SETS = (
    SurveySet("hall, 12 access points", "wut_wifi_117", "fingerprints.csv", {}, {}, PUBLISHED_FIG9.access_points),
    SurveySet("hall, all access points", "wut_wifi_117", "fingerprints.csv", {}, {}),
    *(
        SurveySet(
            f"office, {text}",
            "wifi_rtt_grid",
            "samples.csv.gz",
            {"points": "points.csv", "select": "scene=office", "values": values},
            {"test": "split=test"},
        )
        for values, text in (("rss", "RSS"), ("range", "ranges"), ("both", "RSS and ranges"))
    ),
    SurveySet(
        "three floors, 3 m cells",
        "wifine_train",
        "fingerprints.csv.gz",
        {},
        {"test": "trajectory_id:12", "merge_m": 3.0, "levels": (0.25, 0.5, 1.0, 2.0, 3.0), "map": False},
    ),
)


def fig9(
    data: str | Path | None = None,
    *,
    sets: tuple[SurveySet, ...] = SETS,
    seed: int = 0,
    announce: Callable[[str], None] = lambda text: None,
) -> dict[str, SurveyStudy]:
    """Fig. 9 on measured surveys: a study per set that the folder has.

    Parameters
    ----------
    data
        The folder of the data sets.
    sets
        Which ones.
    seed
        Of all random numbers.
    announce
        Told what is being done.

    Raises
    ------
    InputError
        If the folder has none of the sets.
    """
    from locbounds.io.surveys import read_survey
    from locbounds.survey.study import study

    root, found = data_folder(data, [s.folder for s in sets], "Fig. 9"), {}
    for s in sets:
        path = root / s.folder
        if not path.is_dir():
            continue
        announce(f"{s.title}: reading")
        options = s.read | ({"points": path / s.read["points"]} if "points" in s.read else {})
        file = read_survey(path / s.file, **options)
        survey = file.survey
        if s.strongest is not None:
            loudest = np.argsort(-np.nansum(np.where(survey.heard, survey.value + 100, 0.0), axis=0), kind="stable")
            survey = survey.columns(np.sort(loudest[: s.strongest]))
        found[s.title] = study(
            survey, file.labels, seed=seed, announce=lambda text, s=s: announce(f"{s.title}: {text}"), **s.study
        )
    if not found:
        raise InputError(f"{root} has none of {', '.join(dict.fromkeys(s.folder for s in sets))}", "Check --data")
    return found


def fig9_csv(found: dict[str, SurveyStudy]) -> str:
    """Fig. 9 as CSV: set, method, noise, RMSE, standard error, whether it is a bound; and the chapter's two numbers."""
    from locbounds.report.tables import csv_text
    from locbounds.survey.study import CURVE_COLUMNS, ESTIMATE, NOT_A_BOUND, curve_rows

    p = PUBLISHED_FIG9
    rows = [
        ("published", "survey-printed", p.noise_db, 1.0, p.bound_m, "", NOT_A_BOUND),
        ("published", "estimator", p.noise_db, 1.0, p.rmse_m, "", ESTIMATE),
    ]
    for title, study in found.items():
        rows += [tuple("" if cell != cell else cell for cell in row) for row in curve_rows(title, study)]
    return csv_text(CURVE_COLUMNS, rows)


def fig9_figure(found: dict[str, SurveyStudy]) -> Figure:
    """Fig. 9: RMSE over noise levels, one panel per set."""
    from locbounds.report.survey_plot import curve

    return curve({title: (study.curve, study.rows) for title, study in found.items()})
