"""Running filters of a distance on draws of a model, or on one given track."""

import dataclasses
from typing import Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.evaluation import result_of_errors
from locbounds.ranging.draws import measure
from locbounds.ranging.model import DistanceModel
from locbounds.result import Result


def evaluate_distance(
    filter: Any,
    model: DistanceModel,
    *,
    runs: int = 200,
    seed: int = 0,
    track: Float[ndarray, " times"] | None = None,
    believed: DistanceModel | None = None,
    name: str | None = None,
) -> Result:
    """Root mean square error of a filter over tracks drawn from the model, or over draws of the noise along one track.

    Parameters
    ----------
    filter
        ``filter(model, z, seed) -> Estimates``.
    model
        What is drawn from.
    runs, seed
        Number of runs; the same seed gives every filter the same draws.
    track
        Distances at steps 0..K of one track for all runs.
    believed
        The model that the filter uses, where it is another one.
    name
        Name in results.

    Raises
    ------
    InputError
        If there are fewer than two runs or the track has another length.
    """
    if runs < 2 or int(runs) != runs:
        raise InputError(f"the number of runs is {runs}", "Give a whole number of at least 2")
    if track is None:
        d = model.simulate_states(runs, seed)[:, :, 0]
    else:
        if np.shape(track) != (model.steps + 1,):
            raise InputError(f"the track has shape {np.shape(track)}", f"Give {model.steps + 1} distances")
        d = np.broadcast_to(np.asarray(track, dtype=float), (runs, model.steps + 1))
    z = measure(model.sensors, d[:, 1:], seed=seed)
    found = filter(model if believed is None else believed, z, seed)
    error = np.abs(np.asarray(found.mean)[:, :, 0] - d)
    error = np.where(np.isfinite(error), error, np.inf)
    squares = np.mean(error**2, 0)[:, None, None]
    consistency = None
    if found.covariance is not None:
        variance = np.asarray(found.covariance)[:, :, 0, 0]
        consistency = error**2 / np.where(variance > 0, variance, np.nan)
    result = result_of_errors(
        error,
        np.asarray(model.times.time_s),
        squares,
        consistency,
        filter=filter,
        name=name,
        seed=seed,
        how="tracks drawn from the model" if track is None else "noise drawn along one track",
        diagnostics=dict(found.diagnostics),
    )
    if track is None:
        return result
    return dataclasses.replace(result, track="the trajectory")
