"""Range errors drawn from the model by an independent route: exponential dwell times, not transition matrices."""

import numpy as np

TRUE = {
    "los_mean_m": 0.4,
    "los_std_m": 0.3,
    "nlos_mean_m": 2.5,
    "nlos_std_m": 1.0,
    "los_dwell_s": 6.0,
    "nlos_dwell_s": 3.0,
    "outlier_share": 0.02,
    "outlier_mean_m": 10.0,
    "outlier_std_m": 40.0,
}


def errors(seed, *, sequences=24, steps=400, irregular=True, missing=0.1, outliers=True, free_start=None, scale=1.0):
    """Times, errors and sights [sequences, steps] of the model `TRUE`."""
    rng = np.random.default_rng(seed)
    gaps = rng.choice([0.2, 0.4, 1.5], p=[0.7, 0.25, 0.05], size=(sequences, steps))
    if not irregular:
        gaps[:] = 0.5
    time = np.cumsum(gaps, 1)
    sight = np.empty(time.shape, int)
    dwell = np.array([TRUE["los_dwell_s"], TRUE["nlos_dwell_s"]])
    for i in range(sequences):
        nlos = dwell[1] / dwell.sum() if free_start is None else free_start
        now, clock, first = 0.0, [], int(rng.random() < nlos)
        while now < time[i, -1] - time[i, 0]:
            now += rng.exponential(dwell[(first + len(clock)) % 2])
            clock.append(now)
        sight[i] = (first + np.searchsorted(clock, time[i] - time[i, 0], side="right")) % 2
    mean = np.array([TRUE["los_mean_m"], TRUE["nlos_mean_m"]])[sight]
    std = np.array([TRUE["los_std_m"], TRUE["nlos_std_m"]])[sight]
    error = mean + std * rng.normal(size=time.shape)
    if outliers:
        wide = rng.random(time.shape) < TRUE["outlier_share"]
        error = np.where(wide, rng.normal(TRUE["outlier_mean_m"], TRUE["outlier_std_m"], time.shape), error)
    error[rng.random(time.shape) < missing] = np.nan
    return time, scale * error, sight
