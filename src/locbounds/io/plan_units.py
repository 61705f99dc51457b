"""Units of the noise in plan files: metres, decibels, radians or degrees, in tables that all have the keys of metres.

Keys are renamed before the file is validated and values converted after it, so that errors tell what is written.
"""

import math
import re
from collections.abc import Iterator
from typing import Any

from locbounds.errors import InputError
from locbounds.io.complain import Location, Wording, quoted
from locbounds.io.schema import NlosTable, OutlierTable, Section

UNITS = {"toa": ("m",), "tdoa": ("m",), "rss": ("db",), "aoa": ("rad", "deg")}
NOISES = ("los", "nlos", "outlier")
WORDS = {"m": "metres", "db": "dB", "rad": "radians", "deg": "degrees"}
FACTORS = {"deg": math.pi / 180}
KEYS = {name for table in (NlosTable, OutlierTable) for name in table.model_fields if name.endswith("_m")}


class Written(Wording):
    """The keys of a plan file with the names that validation knows, and how they were written.

    Parameters
    ----------
    keys
        Of the whole file.

    Raises
    ------
    InputError
        If a noise has another unit than what it is the noise of, or a key twice in two units.

    Examples
    --------
    >>> file = Written({"links": {"measure": "aoa", "los": {"std_deg": -3}}})
    >>> file.keys["links"]["los"], file.path(("links", "los", "std_m"))
    ({'std_m': -3}, ('links', 'los', 'std_deg'))
    >>> file.text(("links", "los", "std_m"), "std_m: standard deviation in metres")
    'std_deg: standard deviation in degrees'
    """

    def __init__(self, keys: dict[str, Any]):
        self._names: dict[Location, str] = {}
        self._units: dict[Location, str] = {}
        self.keys = dict(keys)
        links, anchors = keys.get("links"), keys.get("anchors")
        shared = links.get("measure") if isinstance(links, dict) else None
        if isinstance(links, dict):
            self.keys["links"] = self._link(links, shared, ("links",))
        if isinstance(anchors, dict):
            self.keys["anchors"] = {
                name: self._link(a, a.get("measure", shared), ("anchors", name)) if isinstance(a, dict) else a
                for name, a in anchors.items()
            }

    def _link(self, table: dict[str, Any], measure: Any, path: Location) -> dict[str, Any]:
        if not isinstance(measure, str) or measure not in UNITS:
            return table
        usual = UNITS[measure][0]
        return {k: self._noise(v, measure, usual, (*path, k)) if k in NOISES else v for k, v in table.items()}

    def _noise(self, value: Any, measure: str, unit: str, path: Location) -> Any:
        if isinstance(value, list):
            return [self._noise(v, measure, unit, (*path, k)) for k, v in enumerate(value)]
        if not isinstance(value, dict):
            return value
        self._units[path] = unit = next((u for _, u in map(_parts, value) if u in UNITS[measure]), unit)
        out = {}
        for name, inner in value.items():
            stem, own = _parts(name)
            if not own:
                out[name] = self._noise(inner, measure, unit, (*path, name))
                continue
            if own not in UNITS[measure]:
                known = " or ".join(f"{stem}_{u}" for u in UNITS[measure])
                raise InputError(
                    f"unknown key {_dotted((*path, name))} = {quoted(inner)}",
                    f'Did you mean {known}? The errors of "{measure}" are in {WORDS[UNITS[measure][0]]}',
                )
            if f"{stem}_m" in out:
                raise InputError(
                    f"{_dotted(path)} has {self._names[*path, f'{stem}_m']} and {name}", "Keep one of them"
                )
            self._names[*path, f"{stem}_m"] = name
            out[f"{stem}_m"] = inner
        return out

    def path(self, location: Location) -> Location:
        """A location in the validated keys, as it was written."""
        return (*location[:-1], self._names.get(location, location[-1])) if location else location

    def text(self, location: Location, text: str) -> str:
        """A message about a location, in the unit of its noise table."""
        unit = next((self._units[p] for p in _upwards(location) if p in self._units), "m")
        if unit == "m":
            return text
        for name in KEYS:
            text = re.sub(rf"\b{name}\b", f"{name[:-1]}{unit}", text)
        return text.replace("in metres", f"in {WORDS[unit]}")

    def in_si(self, file: Any, path: Location = ()) -> Any:
        """The validated file with degrees in radians."""
        if isinstance(file, Section):
            values = {name: self.in_si(getattr(file, name), (*path, name)) for name in file.model_fields_set}
            return file.model_copy(update=values)
        if isinstance(file, dict):
            return type(file)((k, self.in_si(v, (*path, k))) for k, v in file.items())
        if path in self._names:
            factor = FACTORS.get(_parts(self._names[path])[1])
            return file if factor is None else _times(file, factor)
        if isinstance(file, tuple | list):
            return type(file)(self.in_si(v, (*path, k)) for k, v in enumerate(file))
        return file


def _parts(name: str) -> tuple[str, str]:
    """Stem and unit of a key; no unit where it ends in none.

    >>> _parts("std_deg"), _parts("degrees")
    (('std', 'deg'), ('degrees', ''))
    """
    stem, _, unit = name.rpartition("_")
    return (stem, unit) if stem and unit in WORDS else (name, "")


def _times(value: Any, factor: float) -> Any:
    return tuple(v * factor for v in value) if isinstance(value, tuple) else value * factor


def _upwards(path: Location) -> Iterator[Location]:
    for n in range(len(path), 0, -1):
        yield path[:n]


def _dotted(path: Location) -> str:
    return ".".join(map(str, path))
