"""Fingerprints: what was heard where, as it was measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from locbounds.axes import Bool, Float, Int, ndarray
from locbounds.errors import InputError

RSS, RANGE = "dB", "m"
LEAST_TOGETHER = 10  # values that two columns must share before they can be called one access point


def _frozen(value, dtype=float) -> ndarray:
    array = np.array(value, dtype=dtype)
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Fingerprints:
    """Samples of a survey; arrays are copied and made read-only.

    Attributes
    ----------
    names : tuple of str
        One per column: an access point's RSS, or its range.
    units : tuple of str
        ``"dB"`` (RSS in dBm) or ``"m"`` (a range) per column.
    position_m : array [points, space]
        Where the points are; no two are equal.
    point : int array [samples]
        The point of every sample.
    value : array [samples, columns]
        dBm or m; NaN where the access point was not heard.
    group : tuple of str
        One per sample: its walk, or an empty string.
    notes : tuple of str
        What was merged, left out or looked odd.

    Raises
    ------
    InputError
        If there is one point only, or nothing was heard.

    Examples
    --------
    >>> heard = [[-40.0, -60], [-41, np.nan], [-50, -52]]
    >>> survey = Fingerprints.at(np.array([[0.0, 0], [0, 0], [3, 0]]), np.array(heard), names=("a", "b"))
    >>> survey.points, survey.samples, survey.point.tolist()
    (2, 3, [0, 0, 1])
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    position_m: Float[ndarray, "points space"]
    point: Int[ndarray, " samples"]
    value: Float[ndarray, "samples columns"]
    group: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        for key, dtype in (("position_m", float), ("point", int), ("value", float)):
            object.__setattr__(self, key, _frozen(getattr(self, key), dtype))
        if len(self.names) != self.value.shape[1] or len(self.units) != len(self.names):
            raise InputError(f"{len(self.names)} names for {self.value.shape[1]} columns", "Give one name per column")

    @classmethod
    def at(
        cls,
        position_m: Float[ndarray, "samples space"],
        value: Float[ndarray, "samples columns"],
        *,
        names: tuple[str, ...] | None = None,
        units: tuple[str, ...] | None = None,
        group: tuple[str, ...] | None = None,
        notes: tuple[str, ...] = (),
    ) -> Fingerprints:
        """From one position per sample; samples at equal positions are samples of one point."""
        places, point = np.unique(np.asarray(position_m, float), axis=0, return_inverse=True)
        names = names or tuple(f"ap{k + 1:03d}" for k in range(value.shape[1]))
        units = units or (RSS,) * len(names)
        return cls(names, units, places, point.reshape(-1), value, group or ("",) * len(value), notes)

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self.position_m)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.value)

    @property
    def heard(self) -> Bool[ndarray, "samples columns"]:
        """Which sample heard which access point."""
        return np.isfinite(self.value)

    def checked(self) -> Fingerprints:
        """Without columns that say nothing; an InputError if too little is left for a survey."""
        heard = self.heard
        silent = np.asarray(~heard.any(axis=0))
        if silent.all():
            raise InputError("no access point is heard anywhere", "Check the columns, and the code for not heard")
        spread = np.where(heard, self.value, np.nan)
        low, high = (f(np.where(heard, spread, fill), axis=0) for f, fill in ((np.min, np.inf), (np.max, -np.inf)))
        constant = ~silent & (low == high) & heard.all(axis=0)
        if self.points < 2:
            raise InputError("the survey has one point", "A survey needs at least two points at different positions")
        if (silent | constant).all():
            raise InputError("every access point has one value everywhere", "Such fingerprints tell nothing: measure")
        notes = list(self.notes)
        for which, what in ((silent, "never heard"), (constant, "with one value everywhere")):
            if which.any():
                found = [name for name, it in zip(self.names, which.tolist(), strict=True) if it]
                notes.append(f"Left out, {what}: {_list(found)}.")
        return replace(self.columns(~(silent | constant)), notes=tuple(notes))

    def columns(self, keep: ndarray) -> Fingerprints:
        """Only these columns (a mask, or indices)."""
        index = np.arange(len(self.names))[keep]
        names, units = (tuple(what[k] for k in index) for what in (self.names, self.units))
        return replace(self, names=names, units=units, value=self.value[:, index])

    def rows(self, keep: ndarray) -> Fingerprints:
        """Only these samples (a mask, or indices), and the points that they belong to."""
        index = np.arange(self.samples)[keep]
        kept, point = np.unique(self.point[index], return_inverse=True)
        group = tuple(self.group[k] for k in index)
        return replace(
            self, position_m=self.position_m[kept], point=point.reshape(-1), value=self.value[index], group=group
        )

    def merged(self, cell_m: float | int) -> Fingerprints:
        """Samples within one cell of a grid become samples of one point, at their mean position.

        Parameters
        ----------
        cell_m
            Side of the cells, m.
        """
        if not cell_m > 0:
            raise InputError(f"the cells have a side of {cell_m:g} m", "Give a positive number of metres")
        cell = np.floor((self.position_m - self.position_m.min(axis=0)) / cell_m).astype(int)
        _, new = np.unique(cell, axis=0, return_inverse=True)
        point = new.reshape(-1)[self.point]
        count = np.bincount(point)
        places = np.stack([np.bincount(point, x) / count for x in self.position_m[self.point].T], axis=1)
        note = f"{self.points:,} positions merged into {len(places):,} cells of {cell_m:g} m."
        return replace(self, position_m=places, point=point, notes=(*self.notes, note))

    def without_twins(self, deviation: Float[ndarray, " columns"]) -> Fingerprints:
        """One column for every access point that sends under several addresses.

        Two addresses are one access point if they are heard together (at least ten times, and in more than half of
        the samples that hear either) and their difference varies less than half as much as independent noise would
        make it vary. The column heard more often stays, filled from the other.

        Parameters
        ----------
        deviation
            [columns] deviation of the noise; zero asks for equal differences.
        """
        heard, value = self.heard, self.value.copy()
        order = np.argsort(-heard.sum(axis=0), kind="stable").tolist()
        keep: list[int] = []
        twins: dict[int, list[str]] = {}
        for k in order:
            first = next((j for j in keep if self._same(heard, j, k, deviation)), None)
            if first is None:
                keep.append(k)
                continue
            twins.setdefault(first, []).append(self.names[k])
            both = heard[:, first] & heard[:, k]
            shift = np.median(self.value[both, first] - self.value[both, k])
            value[:, first] = np.where(np.isfinite(value[:, first]), value[:, first], self.value[:, k] + shift)
        if not twins:
            return self
        found = [f"{self.names[k]} ({', '.join(v)})" for k, v in sorted(twins.items())]
        note = f"{len(order)} addresses belong to {len(keep)} access points; merged: {_list(found)}."
        return replace(replace(self, value=value).columns(np.sort(keep)), notes=(*self.notes, note))

    def _same(self, heard: ndarray, i: int, j: int, deviation: ndarray) -> bool:
        both = heard[:, i] & heard[:, j]
        together = int(both.sum())
        if self.units[i] != self.units[j] or together < LEAST_TOGETHER:
            return False
        if 2 * together <= int((heard[:, i] | heard[:, j]).sum()):
            return False
        difference = self.value[both, i] - self.value[both, j]
        return bool(np.var(difference) <= (deviation[i] ** 2 + deviation[j] ** 2) / 2)


def _list(names: list[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
