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


def last(found: Study, case: str, method: str) -> tuple[float, float]:
    """A curve's value over the whole record, and its standard error."""
    curve = next(c for c in found.curves if c.case == case and c.method.startswith(method))
    return float(curve.rmse_m[-1]), float(curve.stderr_m[-1])


def remarks(found: Study) -> list[str]:
    """What the numbers say about the paper's statements."""
    matched = "; ".join(f"{case} {_gain(found, case, EKF)}" for case in (*TITLES, RANDOM))
    printed = "; ".join(f"{case} {_gain(found, case, PAPER_EKF)}" for case in TITLES)
    wide = {(s.case, s.bias, s.derivatives): s.rmse_m for s in found.settings}
    one, many = wide["rss", "one per second", "initial"], wide["rss", "one per sample", "initial"]
    every, once = wide["fusion", "one per sample", "every step"], wide["fusion", "one per sample", "initial"]
    drift = {case: [d for d in found.drifts if d.case == case] for case in dict.fromkeys(d.case for d in found.drifts)}
    grown = "; ".join(
        f"{case} {d[0].information:.4f} ± {d[0].spread:.4f} at N = {d[0].draws} and {d[-1].information:.4f} ± "
        f"{d[-1].spread:.4f} at N = {d[-1].draws}, expected growth {d[0].growth:.5f} per factor of ten"
        for case, d in drift.items()
    )
    random = {m: last(found, RANDOM, m)[0] for m in (REGULAR, WEINSTEIN, EKF, PARTICLES)}
    alone, fused = (last(found, case, PARTICLES)[0] for case in ("rss", "fusion"))
    return [
        '"This expression has no closed-form solution and its result has to be obtained by Monte Carlo": does not '
        "hold. Both densities vanish linearly at their ends, the Fisher information is infinite and the exact bound 0; "
        f"a Monte Carlo value depends on its draws (one evaluation: {grown}). Without the cut it is one integral.",
        f"The noise that is not cut is another model with more variance. Its bound, {random[REGULAR]:.2f} m for times "
        f"of arrival over random tracks, lies above what filters reach on the cut noise ({random[PARTICLES]:.2f} m) "
        f"and bounds nothing there; Weiss-Weinstein does, {random[WEINSTEIN]:.2f} m.",
        '"The accumulated PCRLB in each position" of the trajectory: holds as a conditional number only. The '
        "trajectory is far smoother than the model's, and starts where the prior says, so that filters may lie below "
        "numbers that bound the error over random tracks. With signal strengths a bound over random tracks does not "
        "exist, because E[1/d^2] is infinite.",
        '"The error introduced by the EKF": small. In root mean square an accurate particle filter gains on an EKF '
        f"with matched moments {matched}, and on the one as printed {printed}: that the EKF is far from optimal is not "
        "supported.",
        f'"The improvement ... by means of the RSS and TOA data fusion": holds; particle filter {alone:.2f} m from '
        f"signal strengths alone, {fused:.2f} m with both.",
        f"Ten biases per second are optimistic: with one per second the signal-strength bound goes from {many:.2f} "
        f"to {one:.2f} m. Taking the prior of the derivatives as a measurement of every second counts one fact many "
        f"times ({once:.2f} to {every:.2f} m, fusion): over-confident.",
        f"Steps at which no particle explained the samples: {found.stranded}, counted and recovered.",
    ]


def _gain(found: Study, case: str, method: str) -> str:
    gain, error = found.gains[case, method]
    return f"{100 * gain:.1f} ± {100 * error:.1f} %"
