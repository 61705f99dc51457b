"""Chen 2010: the bound for known sight conditions and three trackers.

L. Chen, L. Wu, R. Piché, "Posterior Cramér-Rao lower bound for mobile tracking in mixed LOS/NLOS conditions", EUSIPCO.
"""

from locbounds.papers.chen2010.outputs import fig1, fig1_csv, fig2, fig2_csv, quantiles_csv, segments_csv, settings_csv
from locbounds.papers.chen2010.setting import (
    ANCHORS_M,
    MATCHED_STAY,
    PUBLISHED_BOUND_M,
    SCHEDULE,
    STAY,
    least_steady_bound,
    scenario,
    schedule,
)
from locbounds.papers.chen2010.statements import statements
from locbounds.papers.chen2010.study import RUNS, Study, study

__all__ = [
    "ANCHORS_M",
    "MATCHED_STAY",
    "PUBLISHED_BOUND_M",
    "RUNS",
    "SCHEDULE",
    "STAY",
    "Study",
    "fig1",
    "fig1_csv",
    "fig2",
    "fig2_csv",
    "least_steady_bound",
    "quantiles_csv",
    "scenario",
    "schedule",
    "segments_csv",
    "settings_csv",
    "statements",
    "study",
]
