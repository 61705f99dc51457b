"""Fig. 3 and the tables of the study."""

from typing import TYPE_CHECKING

from locbounds.papers.prieto2011.study import (
    CONDITIONAL,
    EKF,
    ESTIMATOR,
    INVALID,
    PAPER_EKF,
    PARTICLES,
    PRINTED,
    RANDOM,
    REGULAR,
    WEINSTEIN,
    Curve,
    Study,
)
from locbounds.report.tables import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIG3_COLUMNS = ("case", "method", "time_s", "rmse_m", "stderr_m", "valid")
DRIFT_COLUMNS = ("case", "draws", "information", "spread", "rmse_m", "growth_per_decade")
SETTING_COLUMNS = ("case", "bias", "derivatives", "rmse_m")
STYLES = {PRINTED: ("C3", ":"), REGULAR: ("C0", "-"), WEINSTEIN: ("C2", "-"), EKF: ("C1", "--")} | {
    PAPER_EKF: ("C5", "--"),
    PARTICLES: ("k", "--"),
}
TITLES = {"rss": "signal strength", "toa": "time of arrival", "fusion": "both"}


def fig3_csv(found: Study) -> str:
    """``fig3.csv``: root mean square errors and bounds accumulated from the first second on, once per second."""
    rows = [
        (c.case, c.method, float(k), float(value), float(error), c.valid)
        for c in found.curves
        for k, (value, error) in enumerate(zip(c.rmse_m, c.stderr_m, strict=True), start=1)
    ]
    return csv_text(FIG3_COLUMNS, rows)


def drift_csv(found: Study) -> str:
    """``as-printed.csv``: the Monte Carlo information of the cut densities over the number of draws."""
    return csv_text(DRIFT_COLUMNS, found.drifts)


def settings_csv(found: Study) -> str:
    """``settings.csv``: what the readings of bias and prior change."""
    return csv_text(SETTING_COLUMNS, found.settings)


def _style(curve: Curve) -> dict:
    for start, (colour, line) in STYLES.items():
        if curve.method == start or (start == PRINTED and curve.method.startswith(start)):
            return {"color": colour, "ls": line, "lw": 1.8 if line == "-" else 1.3}
    return {"color": "0.5", "ls": "--", "lw": 1.3}


def fig3(found: Study) -> "Figure":
    """Fig. 3: along the trajectory, by what is measured; and times of arrival over random tracks."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 7.4), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True)
    marks = {CONDITIONAL: " (conditional)", INVALID: " (not a bound)", ESTIMATOR: ""}
    cases = [*TITLES, RANDOM]
    for ax, case in zip(panels.flat, cases, strict=True):
        for c in (c for c in found.curves if c.case == case):
            t = range(1, len(c.rmse_m) + 1)
            ax.plot(t, c.rmse_m, label=c.method + marks.get(c.valid, ""), **_style(c))
            if c.stderr_m.any():
                low, high = c.rmse_m - 2 * c.stderr_m, c.rmse_m + 2 * c.stderr_m
                ax.fill_between(t, low, high, color=_style(c)["color"], alpha=0.15, lw=0)
        ax.set_title(
            f"{TITLES[case]}, one trajectory" if case in TITLES else "time of arrival, random tracks",
            loc="left",
            fontsize=11,
        )
        ax.set_ylim(0, None)
        ax.grid(alpha=0.3)
        ax.legend(frameon=False, fontsize=8)
    for ax in panels[1]:
        ax.set_xlabel("time in s")
    for ax in panels[:, 0]:
        ax.set_ylabel("accumulated range RMSE in m")
    return figure
