"""The trackers of Chen 2010: time for 400 runs of 1600 steps, against the same algorithms as per-run Python loops.

And whether 100 particles are enough: the RMSE with 100 and with 2,000 particles on the same runs.
"""

import sys
import time
from pathlib import Path

import numpy as np

import locbounds as lb
from locbounds.evaluation import evaluate_on
from locbounds.filters.lowering import lower
from locbounds.papers import chen2010
from locbounds.papers.chen2010.study import PARTICLES, overall, paired
from locbounds.precision import double_precision
from locbounds.simulation import Draws

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
RUNS = 400
LOOP_STEPS = 40  # of one run; a Python loop costs the same at every step
MANY, MANY_RUNS = 2_000, 100  # paired over runs, 100 of them tell a difference of a per cent


def loops(model, z) -> dict[str, float]:
    """Seconds per step of the textbook's loops."""
    import textbook_trackers as textbook  # pyright: ignore[reportMissingImports]

    rng = np.random.default_rng(0)
    work = {
        "EKF banks": lambda: textbook.ekf_banks(model, z),
        "RBPF": lambda: textbook.rbpf(model, z, PARTICLES, rng),
        "oracle": lambda: textbook.decentralised_ekf(model, z, np.zeros(z.shape, int), printed=False),
    }
    seconds = {}
    for name, run in work.items():
        start = time.perf_counter()
        run()
        seconds[name] = (time.perf_counter() - start) / len(z)
    return seconds


def main() -> None:
    truth = chen2010.scenario().with_known_sight(chen2010.schedule())
    scenario = chen2010.scenario()
    draws = lb.simulate(truth, runs=RUNS, seed=0)
    short = chen2010.scenario(steps=LOOP_STEPS)
    by_loop = loops(double_precision(lower)(short), draws.measurements[0, :LOOP_STEPS])
    filters = {
        "IMM-KF": lb.ImmKf(weighted=False, covariance=False),
        "EKF banks": lb.EkfBanks(covariance=False),
        "RBPF": lb.Rbpf(PARTICLES, covariance=False),
        "oracle": lb.OracleEkf(covariance=False),
    }
    total = 0.0
    for name, filter in filters.items():
        start = time.perf_counter()
        evaluate_on(filter, scenario, draws)
        cold = time.perf_counter() - start
        start = time.perf_counter()
        evaluate_on(filter, scenario, draws)
        warm = time.perf_counter() - start
        total += cold
        text = f"  {name}: {cold:.1f} s with compilation, {warm:.1f} s again"
        if name in by_loop:
            loop = by_loop[name] * RUNS * scenario.steps
            text += f"; Python loop {loop:,.0f} s, ratio {loop / warm:,.0f}"
        print(text, flush=True)
    print(f"all four, {RUNS} runs x {scenario.steps} steps: {total:.1f} s (limit 180 s)")

    some = Draws(*(a[:MANY_RUNS] for a in draws))
    few = evaluate_on(filters["RBPF"], scenario, some)
    start = time.perf_counter()
    many = evaluate_on(lb.Rbpf(MANY, covariance=False), scenario, some, seed=1)
    seconds = time.perf_counter() - start
    difference, error = paired(many, few)
    level = overall(many)[0]
    print(
        f"RBPF, {PARTICLES} particles against {MANY:,} ({seconds:.0f} s): RMSE {level:.2f} m, difference "
        f"{difference:.3f} +- {error:.3f} m, {difference / level:.2%} (limit 1 %)"
    )
