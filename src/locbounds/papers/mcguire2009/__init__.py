"""McGuire and Plataniotis, "Accuracy bounds for wireless localization methods" (book chapter, 2009).

Figs. 3 to 6: bounds and least error of a simple static scenario. Figs. 7 and 8: terminals in the streets of a dense
city (:mod:`~locbounds.papers.mcguire2009.streets`). Fig. 9: what a survey of signal strengths tells.
"""

from locbounds.papers.mcguire2009.simple import (
    CASES,
    FIGURE_OF,
    Case,
    Row,
    case_rows,
    figure_csv,
    simple_figure,
    simple_study,
)
from locbounds.papers.mcguire2009.statements import Statement, on_maximum_likelihood, statements
from locbounds.papers.mcguire2009.streets import fig7_figure, fig8, fig8_figure, street_statements
from locbounds.papers.mcguire2009.survey_set import (
    PUBLISHED_FIG9,
    REMARKS,
    SETS,
    PublishedSurvey,
    SurveySet,
    fig9,
    fig9_csv,
    fig9_figure,
)

FIGURES = ("fig3", "fig4", "fig5", "fig6", "fig7", "fig8", "fig9")

__all__ = [
    "CASES",
    "FIGURES",
    "FIGURE_OF",
    "PUBLISHED_FIG9",
    "REMARKS",
    "SETS",
    "Case",
    "PublishedSurvey",
    "Row",
    "Statement",
    "SurveySet",
    "case_rows",
    "fig7_figure",
    "fig8",
    "fig8_figure",
    "fig9",
    "fig9_csv",
    "fig9_figure",
    "figure_csv",
    "on_maximum_likelihood",
    "simple_figure",
    "simple_study",
    "statements",
    "street_statements",
]
