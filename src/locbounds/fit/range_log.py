"""A log of measured ranges: tracks with times, ranges, true positions, and the anchors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from locbounds.axes import Bool, Float, Int, ndarray
from locbounds.errors import InputError


def _frozen(value, dtype=float) -> ndarray:
    array = np.array(value, dtype=dtype)
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Track:
    """One walk or drive; arrays are copied and made read-only.

    Attributes
    ----------
    name : str
    time_s : array [steps+1]
        Strictly increasing, s.  Step 0 is the prior's: its ranges are not part of the track.
    ranges_m : array [steps, links]
        Ranges at steps 1..K, m; NaN where a link did not report.
    position_m : array [steps+1, space] or None
        True positions.
    sight : int array [steps, links] or None
        Labels: 0 LOS, 1 NLOS, -1 unknown.
    anchors_m : array [links, space] or None
        Positions of the anchors along this track, where they differ between tracks.
    truth_time_s, truth_m : arrays [rows] and [rows, space] or None
        The truth as it was given, at its own times, where ``position_m`` is interpolated from it.
    """

    name: str
    time_s: Float[ndarray, " times"]
    ranges_m: Float[ndarray, "steps links"]
    position_m: Float[ndarray, "times space"] | None = None
    sight: Int[ndarray, "steps links"] | None = None
    anchors_m: Float[ndarray, "links space"] | None = None
    truth_time_s: Float[ndarray, " rows"] | None = None
    truth_m: Float[ndarray, "rows space"] | None = None

    def __post_init__(self):
        for key in ("time_s", "ranges_m", "position_m", "sight", "anchors_m", "truth_time_s", "truth_m"):
            dtype = int if key == "sight" else float
            if getattr(self, key) is not None:
                object.__setattr__(self, key, _frozen(getattr(self, key), dtype))
        if len(self.time_s) != len(self.ranges_m) + 1 or len(self.time_s) < 2:
            raise InputError(
                f"track {self.name} has {len(self.time_s)} times and {len(self.ranges_m)} rows of ranges",
                "Give at least two times, and ranges for each time but the first",
            )
        if not (np.diff(self.time_s) > 0).all():
            raise InputError(f"times of track {self.name} do not increase", "Sort them and merge duplicates")

    @property
    def steps(self) -> int:
        """Number of steps K with measurements."""
        return len(self.ranges_m)

    @property
    def path(self) -> tuple[Float[ndarray, " n"], Float[ndarray, "n space"]]:
        """Times and true positions as they were given: what motion is fitted to."""
        if self.truth_time_s is not None and self.truth_m is not None:
            return self.truth_time_s, self.truth_m
        if self.position_m is None:
            raise InputError(f"track {self.name} has no true positions", "Give the truth file")
        return self.time_s, self.position_m

    @property
    def reports(self) -> Bool[ndarray, "steps links"]:
        """Which link reported at which of the steps 1..K."""
        return np.isfinite(self.ranges_m)


class ErrorSequences(NamedTuple):
    """One sequence per link and track, padded: what the noise is fitted to; see `RangeLog.errors`."""

    time_s: Float[ndarray, "sequences steps"]
    error_m: Float[ndarray, "sequences steps"]
    sight: Int[ndarray, "sequences steps"]
    track: Int[ndarray, " sequences"]
    link: Int[ndarray, " sequences"]


@dataclass(frozen=True)
class RangeLog:
    """Tracks of ranges to the same anchors, which may stand elsewhere along another track.

    Attributes
    ----------
    anchor_names : tuple of str
    anchors_m : array [links, space]
        Where a track does not say otherwise.
    tracks : tuple of Track
    notes : tuple of str
        What was left out or looked odd while reading.

    Examples
    --------
    >>> track = Track("walk", np.arange(3.0), np.array([[5.0], [np.nan]]), np.array([[0.0, 0], [3, 0], [3, 1]]))
    >>> log = RangeLog(("a",), np.array([[0.0, 0.0]]), (track,))
    >>> log.ranges, log.errors().error_m
    (1, array([[ 2., nan]]))
    """

    anchor_names: tuple[str, ...]
    anchors_m: Float[ndarray, "links space"]
    tracks: tuple[Track, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        object.__setattr__(self, "anchors_m", _frozen(self.anchors_m))
        object.__setattr__(self, "tracks", tuple(self.tracks))
        if not self.tracks:
            raise InputError("the log has no tracks", "Check the selection")

    @property
    def dim(self) -> int:
        """Number of position coordinates."""
        return self.anchors_m.shape[1]

    @property
    def ranges(self) -> int:
        """Number of ranges at steps 1..K of all tracks."""
        return int(sum(track.reports.sum() for track in self.tracks))

    @property
    def has_truth(self) -> bool:
        """Whether every track has true positions."""
        return all(track.position_m is not None for track in self.tracks)

    def anchors_of(self, track: Track) -> Float[ndarray, "links space"]:
        """Positions of the anchors along one track."""
        return self.anchors_m if track.anchors_m is None else track.anchors_m

    def errors(self) -> ErrorSequences:
        """Range minus true distance for every link along every track; missing NaN, padded with NaN times."""
        if not self.has_truth:
            raise InputError("the log has no true positions", "Give the truth file; errors are ranges minus distances")
        longest, links = max(t.steps for t in self.tracks), len(self.anchors_m)
        shape = (len(self.tracks), links, longest)
        time, error, sight = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, -1)
        for i, track in enumerate(self.tracks):
            assert track.position_m is not None
            distance = np.linalg.norm(track.position_m[1:, None] - self.anchors_of(track), axis=-1)
            time[i, :, : track.steps] = track.time_s[1:]
            error[i, :, : track.steps] = (track.ranges_m - distance).T
            if track.sight is not None:
                sight[i, :, : track.steps] = track.sight.T
        flat = (-1, longest)
        index = np.indices(shape[:2]).reshape(2, -1)
        return ErrorSequences(time.reshape(flat), error.reshape(flat), sight.reshape(flat), index[0], index[1])

    def hold_out(self, which: str | int) -> tuple[RangeLog, RangeLog]:
        """Split into tracks to fit and tracks held out.

        Parameters
        ----------
        which : str or int
            A number: the last so many tracks; or names separated by commas.  A whole number in a string is a number;
            a track whose name is a number is meant by a comma after it (``"7,"``).

        Raises
        ------
        InputError
            An unknown name, or nothing left to fit.
        """
        names = [track.name for track in self.tracks]
        if isinstance(which, int) or which.strip().isdigit():
            n = int(which)
            if not 1 <= n < len(names):
                raise InputError(
                    f"cannot hold out {n} of {len(names)} tracks", f"Give a number from 1 to {len(names) - 1}"
                )
            held = set(names[-n:])
        else:
            held = {name.strip() for name in which.split(",") if name.strip()}
            unknown = sorted(held - set(names))
            if unknown:
                raise InputError(f"no track is called {unknown[0]}", f"The tracks are {', '.join(names)}")
            if len(held) == len(names):
                raise InputError("all tracks are held out", "Leave some to fit")
        part = [[t for t in self.tracks if (t.name in held) == side] for side in (False, True)]
        return replace(self, tracks=tuple(part[0])), replace(self, tracks=tuple(part[1]))
