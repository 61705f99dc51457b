"""From a failed validation to one clear error: key path, value, remedy, nearest known key."""

import difflib
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from locbounds.errors import InputError
from locbounds.io.schema import ScenarioFile

DEGREE_KEYS = ("lat", "lon", "lng", "latitude", "longitude")
LONGEST_VALUE = 60  # characters of a value quoted in a message


def close_key(unknown: str, known: list[str]) -> str | None:
    """The known key that was probably meant: same word with another unit, or similar letters.

    >>> close_key("std_km", ["mean_m", "std_m"]), close_key("psd", ["model", "psd_m2_s3"]), close_key("x", ["std_m"])
    ('std_m', 'psd_m2_s3', None)
    """
    folded = unknown.lower().replace("-", "_")
    same_word = [k for k in known if k == folded or k.startswith(folded + "_")]
    stem = folded.rpartition("_")[0]
    same_stem = [k for k in known if stem and k.rpartition("_")[0] == stem]
    close = difflib.get_close_matches(folded, known, n=1, cutoff=0.6)
    return next(iter(same_word + same_stem + close), None)


def is_degrees(name: str) -> bool:
    """Whether a key or column speaks of degrees."""
    parts = name.lower().split("_")
    return any(part in DEGREE_KEYS for part in parts) or parts[-1] == "deg"


DEGREES_REMEDY = "Positions are metres in a local plane: project latitude and longitude first (for example to UTM)"


def unknown_key_remedy(name: str, known: list[str], root: type[BaseModel] = ScenarioFile) -> str:
    """What to do about an unknown key or column."""
    if is_degrees(name):
        return DEGREES_REMEDY
    close = close_key(name, known)
    hint = f"Did you mean {close}? " if close else ""
    if close is None and (section := _section_of(name, root)):
        hint = f"It belongs in {section}. "
    return f"{hint}Known here: {', '.join(known)}"


def quoted(value: Any) -> str:
    """A value as the message shows it."""
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((m for m in map(_model_in, get_args(annotation)) if m), None)


def _schema_at(location: tuple, root: type[BaseModel]) -> tuple[type[BaseModel], str]:
    """The table that holds the last key of a location, and the line that teaches that key."""
    model, teaching = root, ""
    for depth, part in enumerate(location):
        field = model.model_fields.get(part) if isinstance(part, str) else None
        if field is None:
            continue  # the name of an anchor, an index, or the unknown key itself
        teaching = field.description or ""
        inner = _model_in(field.annotation)
        if inner is None or depth == len(location) - 1:
            break
        model = inner
    return model, teaching


def _section_of(name: str, root: type[BaseModel]) -> str | None:
    for section, field in root.model_fields.items():
        if section == name:
            return "the top of the file, before the first [section]"
        model = _model_in(field.annotation)
        if model and name in model.model_fields:
            return f"[{section}]"
    return None


Location = tuple[str | int, ...]  # of a key: names of tables, numbers in lists


class Wording:
    """How the keys of a file were written: as they are validated. Files that are written otherwise say so."""

    def path(self, location: Location) -> Location:
        """A location as it was written."""
        return location

    def text(self, location: Location, text: str) -> str:
        """A message about a location in the words of the file."""
        return text


AS_VALIDATED = Wording()


def _explain(error: Any, root: type[BaseModel], written: Location) -> tuple[str, str]:
    location, kind, value = error["loc"], error["type"], error["input"]
    path = ".".join(str(part) for part in written)
    model, teaching = _schema_at(location, root)
    name = next((part for part in reversed(location) if isinstance(part, str)), "")
    remedy = f"{name}: {teaching}" if teaching else ""
    if kind == "extra_forbidden":
        cause = f"unknown key {path} = {quoted(value)}"
        return cause, unknown_key_remedy(str(location[-1]), list(model.model_fields), root)
    if kind == "missing":
        return f"{path} is missing", f"Add {remedy}"
    if kind == "locbounds":
        context = error["ctx"]
        return f"{path} {context['cause']}".strip(), context["remedy"] or remedy
    if kind == "literal_error":
        return f"{path} is {quoted(value)}, but must be {error['ctx']['expected']}", remedy
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return f"{path} is {quoted(value)}, not a table", remedy or "Write it as { key = value }"
    return f"{path} is {quoted(value)}: {error['msg']}", remedy


def complain(
    error: ValidationError, source: str, root: type[BaseModel] = ScenarioFile, wording: Wording = AS_VALIDATED
) -> InputError:
    """The most telling of the errors of a validation; unknown keys come first, since they explain missing ones.

    Parameters
    ----------
    error
        From pydantic.
    source
        Name of the file, put in front of the cause.
    root
        What the whole file was validated as.
    wording
        How its keys were written, if not as they are validated.
    """
    errors = error.errors(include_url=False)
    first = min(errors, key=lambda e: e["type"] != "extra_forbidden")
    location = first["loc"]
    cause, remedy = (wording.text(location, text) for text in _explain(first, root, wording.path(location)))
    more = f" ({len(errors) - 1} more after this one)" if len(errors) > 1 else ""
    return InputError(f"{source}: {cause}{more}", remedy)
