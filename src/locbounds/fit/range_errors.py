"""Range errors to compare laws on: which are LOS, which belong together, which are held out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.axes import Bool, Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.fit.range_log import RangeLog

EVERY = 4
"""Where nothing is said about it, every so manyth group (or error) is held out."""


class RangeErrors(NamedTuple):
    """Errors without an order in time.

    Attributes
    ----------
    error_m
        Measured minus true range, m; NaN where there is none.
    sight
        0 LOS, 1 NLOS, -1 not known.
    group
        Number of the track or place: errors of one depend on each other.
    held
        Whether it is held out of the fit.
    notes
        What a reader of the comparison has to know.

    Examples
    --------
    >>> e = RangeErrors(np.array([0.1, np.nan, 2.0]), np.array([0, 0, 1]), np.array([0, 0, 1]), np.zeros(3, bool))
    >>> [part.error_m.tolist() for part in e.by_sight().values()]
    [[0.1], [2.0]]
    """

    error_m: Float[ndarray, " errors"]
    sight: Int[ndarray, " errors"]
    group: Int[ndarray, " errors"]
    held: Bool[ndarray, " errors"]
    notes: tuple[str, ...] = ()

    def by_sight(self) -> dict[str, RangeErrors]:
        """Those there are, labelled LOS and labelled NLOS, or all of them where nothing is labelled."""
        there = np.isfinite(self.error_m)
        labelled = bool((self.sight >= 0).any())
        parts = {"LOS": self.sight == 0, "NLOS": self.sight == 1} if labelled else {"all": there}
        return {name: self._cut(there & part) for name, part in parts.items()}

    def _cut(self, keep: Bool[ndarray, " errors"]) -> RangeErrors:
        return RangeErrors(self.error_m[keep], self.sight[keep], self.group[keep], self.held[keep])


def errors_of_log(kept: RangeLog, held: RangeLog | None) -> RangeErrors:
    """The errors of a log; if no tracks are held out, some are here.

    Raises
    ------
    InputError
        If there is only one track.
    """
    if held is None:
        names = [track.name for track in kept.tracks]
        if len(names) < 2:
            raise InputError("one track cannot be split for a comparison of laws", "Give a log of several tracks")
        kept, held = kept.hold_out(",".join(names[EVERY - 1 :: EVERY] or names[-1:]) + ",")
    parts = []
    for out, log in enumerate((kept, held)):
        e = log.errors()
        track = np.broadcast_to(e.track[:, None] + out * len(kept.tracks), e.error_m.shape)
        parts.append([x.ravel() for x in (e.error_m, e.sight, track, np.full(e.error_m.shape, bool(out)))])
    error, sight, track, out = (np.concatenate(x) for x in zip(*parts, strict=True))
    return RangeErrors(error, sight, track, out)
