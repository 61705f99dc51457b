"""Prieto 2011: bounds for one distance from signal strengths and times of arrival with cut noise and bias.

J. Prieto, S. Mazuelas, A. Bahillo, P. Fernández, R. M. Lorenzo, E. J. Abril, "Posterior Cramér-Rao lower bound for
RSS/TOA-based indoor localization systems".
"""

from locbounds.papers.prieto2011.measured import compare
from locbounds.papers.prieto2011.outputs import fig3, fig3_csv
from locbounds.papers.prieto2011.setting import scenario, trajectory
from locbounds.papers.prieto2011.statements import remarks
from locbounds.papers.prieto2011.study import Study, study

__all__ = ["Study", "compare", "fig3", "fig3_csv", "remarks", "scenario", "study", "trajectory"]
