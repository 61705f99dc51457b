"""What was possible along measured tracks, and what filters reached there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from locbounds.axes import ndarray
from locbounds.bounds import AlongTrack
from locbounds.errors import InputError
from locbounds.evaluation import estimates, position_error
from locbounds.fit.range_log import RangeLog, Track
from locbounds.horizon import Horizon
from locbounds.measurement import Range
from locbounds.result import Result
from locbounds.scenario import Link, Scenario

LABEL = "the measured tracks"
EXPLANATION = (
    "The bound is computed along each measured track, with the fitted model and the reports that really came. It says "
    "what the model permits there; it does not bound the errors on these tracks: they are single draws, and real "
    "range errors are correlated in time, which the model of independent errors leaves out (its bound is optimistic)."
)


@dataclass(frozen=True)
class AlongTracks:
    """Accuracy of one method along measured tracks.

    Attributes
    ----------
    id, name, kind : str
        Method id, name, ``"bound"`` or ``"filter"``.
    tracks : tuple of str
    time_s : tuple of array
        Seconds since each track's start, steps 0..K.
    square_m2 : tuple of array
        Per track and step: squared position error of a filter, or bound on the mean square error.
    """

    id: str
    name: str
    kind: str
    tracks: tuple[str, ...]
    time_s: tuple[ndarray, ...]
    square_m2: tuple[ndarray, ...]

    def rmse_by_track(self) -> list[float]:
        """Position RMSE of every track over its steps 1..K, in metres."""
        return [float(np.sqrt(square[1:].mean())) for square in self.square_m2]

    def rmse(self) -> tuple[float, float]:
        """Position RMSE over all tracks and steps 1..K in metres, and its standard error by a jackknife over tracks."""
        sums = np.array([square[1:].sum() for square in self.square_m2])
        counts = np.array([len(square) - 1 for square in self.square_m2])
        value = float(np.sqrt(sums.sum() / counts.sum()))
        n = len(sums)
        if n < 2 or self.kind == "bound":
            return value, 0.0 if self.kind == "bound" else float("nan")
        without = np.sqrt((sums.sum() - sums) / (counts.sum() - counts))
        return value, float(np.sqrt((n - 1) * np.var(without)))

    def quantile(self, share: float) -> float:
        """Quantile of the position error over all tracks and steps 1..K, in metres."""
        return float(np.quantile(np.sqrt(np.concatenate([square[1:] for square in self.square_m2])), share))

    def over_time(self, width_s: float) -> list[tuple[int, float, float, float]]:
        """Pooled over tracks in bins of time since the start: (bin, middle in s, RMSE in m, standard error in m)."""
        time, square = np.concatenate(self.time_s), np.concatenate(self.square_m2)
        owner = np.concatenate([np.full(len(t), i) for i, t in enumerate(self.time_s)])
        bins = (time / width_s).astype(int)
        rows = []
        for b in np.unique(bins):
            inside = bins == b
            per_track = [square[inside & (owner == i)].mean() for i in np.unique(owner[inside])]
            value = float(np.sqrt(square[inside].mean()))
            spread = np.std(per_track, ddof=1) / np.sqrt(len(per_track)) if len(per_track) > 1 else np.nan
            error = 0.0 if self.kind == "bound" else float(spread / (2 * value))
            rows.append((int(b), float((b + 0.5) * width_s), value, error))
        return rows


def on_track(scenario: Scenario, track: Track) -> Scenario:
    """The scenario on the times, reports and (where the track says so) anchors of one measured track."""
    if track.anchors_m is not None:
        links = [
            Link(a.name, Range(place), a.sight, a.noises, a.reports)
            for a, place in zip(scenario.links, track.anchors_m, strict=True)
        ]
        scenario = scenario.replace(links=links)
    return scenario.with_times(track.time_s - track.time_s[0]).with_reports(track.reports)


def _padded(track: Track, steps: int) -> Track:
    """The track with steps without any range added at its end.

    Neither a filter nor a filtering bound at step k depends on later steps, so that tracks of one length, which share
    compiled kernels, give the same numbers.
    """
    more = steps - track.steps
    time_s, place = np.asarray(track.time_s), np.asarray(track.position_m)
    tick = float(np.median(np.diff(time_s)))
    return Track(
        track.name,
        np.concatenate([time_s, time_s[-1] + tick * np.arange(1, more + 1)]),
        np.concatenate([track.ranges_m, np.full((more, track.ranges_m.shape[1]), np.nan)]),
        np.concatenate([place, np.repeat(place[-1:], more, axis=0)]),
        anchors_m=track.anchors_m,
    )


def along_tracks(
    scenario: Scenario,
    log: RangeLog,
    *,
    bounds: Sequence[Callable[..., Result]],
    filters: Sequence[Callable[..., Any]],
    horizon: Horizon | None = None,
    rtol: float | None = None,
    seed: int = 0,
    announce: Callable[[str], None] | None = None,
) -> list[AlongTracks]:
    """Compute bounds along measured tracks and run filters on their measured ranges.

    Parameters
    ----------
    scenario : Scenario
        Model: anchors, noise, sight, motion, prior. Its times and reports are replaced by each track's.
    log : RangeLog
        Tracks with true positions, none of which should have been used to fit the model.
    bounds, filters : sequences
        For example ``[lb.bcrb]`` and ``[lb.ImmEkf(), lb.ImmKf()]``.
    horizon
        Of the bounds; by default that of filters. Smoothing looks at each track by itself, up to its own end.
    rtol, seed
        Handed to the bounds and filters.
    announce
        Called with what is being done.

    Returns
    -------
    list of AlongTracks
        Bounds first; see :data:`EXPLANATION` for what the numbers mean.

    Raises
    ------
    InputError
        If the log has no true positions or other anchors than the scenario.
    """
    if not log.has_truth:
        raise InputError("the log has no true positions", "Give the truth file: errors need it")
    names = tuple(link.name for link in scenario.links)
    if names != tuple(log.anchor_names):
        raise InputError(
            f"the scenario has the anchors {', '.join(names)}, the log {', '.join(log.anchor_names)}",
            "Give the anchor file that the scenario was made with, with the same selection",
        )
    say = announce or (lambda what: None)
    squares: dict[tuple[str, str, str], list[Any]] = {}
    horizon = horizon or Horizon()
    short = min(log.tracks, key=lambda track: track.steps)
    Horizon.parse(horizon, short.steps)
    option = {} if horizon.kind == "filter" else {"horizon": horizon}
    longest = max(track.steps for track in log.tracks)
    for track in log.tracks:
        steps = track.steps
        long = track if horizon.kind == "smooth" else _padded(track, longest)
        model = on_track(scenario, long)
        truth = np.asarray(long.position_m)
        for bound in bounds:
            say(f"{track.name}: {getattr(bound, '__name__', bound)}")
            result = bound(model, rtol=rtol, seed=seed, expectation=AlongTrack(truth, label=LABEL), **option)
            squares.setdefault((result.id, result.name, "bound"), []).append(
                np.asarray(result.position_mse)[: steps + 1]
            )
        states = np.zeros((1, len(truth), scenario.motion.state_size))
        states[..., list(scenario.motion.position_index)] = truth
        for filter in filters:
            name = getattr(filter, "name", getattr(filter, "__name__", "own filter"))
            say(f"{track.name}: {name}")
            mean, _ = estimates(filter, model, long.ranges_m[None], None, seed)
            key = (getattr(filter, "id", "own"), name, "filter")
            squares.setdefault(key, []).append(position_error(model, mean, states)[0, : steps + 1] ** 2)
    time_s = tuple(track.time_s - track.time_s[0] for track in log.tracks)
    tracks = tuple(track.name for track in log.tracks)
    return [AlongTracks(*key, tracks, time_s, tuple(value)) for key, value in squares.items()]
