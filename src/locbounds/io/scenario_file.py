"""Scenario files: TOML, SI units in the keys, comments that teach."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError

from locbounds.io.anchors_csv import hoisted
from locbounds.io.build import at, build
from locbounds.io.complain import complain
from locbounds.io.files import atomic_write_text
from locbounds.io.kinds import expect
from locbounds.io.schema import ScenarioFile
from locbounds.io.toml import parse_toml, read_toml
from locbounds.io.write import file_keys
from locbounds.scenario import Scenario

LINE = 120  # characters; a longer comment goes above its key
COLUMN = 46  # where comments start
PER_LINE = 12  # numbers of a long list on one line


def loads(text: str, *, folder: str | os.PathLike = ".", source: str = "scenario") -> Scenario:
    r"""A scenario from the text of a scenario file.

    Parameters
    ----------
    text
        TOML.
    folder
        Where a relative ``anchors_csv`` lies.
    source
        Name used in error messages.

    Raises
    ------
    InputError
        If the text is not TOML, a key is unknown or missing, or a value cannot be used. The error names the key,
        the value, the remedy and the nearest known key.

    Examples
    --------
    >>> from locbounds.errors import InputError
    >>> try:
    ...     loads("format = 1\n[time]\nstep_ms = 200\nsteps = 100")
    ... except InputError as error:
    ...     print(error.cause, error.remedy, sep="\n")
    scenario: unknown key time.step_ms = 200 (2 more after this one)
    Did you mean step_s? Known here: step_s, steps, times_s
    """
    return _scenario(parse_toml(text, source), Path(folder), source)


def load(path: str | os.PathLike) -> Scenario:
    """A scenario from a scenario file.

    Parameters
    ----------
    path
        The TOML file; a relative ``anchors_csv`` in it is relative to the file.

    Raises
    ------
    InputError
        If the file cannot be read, or as :func:`loads`.

    Examples
    --------
    >>> import tempfile
    >>> import locbounds as lb
    >>> path = Path(tempfile.mkdtemp()) / "scenario.toml"
    >>> lb.save(lb.papers.fritsche2013.scenario(), path)
    >>> lb.load(path).steps
    100
    """
    path = Path(path)
    return _scenario(read_toml(path, f"Make one with: locbounds new {path}"), path.parent, path.name)


def _scenario(keys: dict[str, Any], folder: Path, source: str) -> Scenario:
    expect(keys, "scenario", source)
    try:
        file = ScenarioFile.model_validate(hoisted(keys))
    except ValidationError as error:
        raise complain(error, source) from None
    with at(source):
        return build(file, folder)


TEACHING = {
    "format": "units are in the keys: m, s, m_s is m/s; a wrong unit is an unknown key",
    "time.steps": "results at steps 0..steps; step 0 is the prior",
    "time.times_s": "times of steps 0, 1, ...; step 0 is the prior",
    "motion.model": "how the mobile moves",
    "motion.psd_m2_s3": "power spectral density of the acceleration, a number or one per axis",
    "motion.diffusion_m2_s": "variance of the displacement per second, a number or one per axis",
    "motion.jerk_psd_m2_s5": "power spectral density of the jerk, a number or one per axis",
    "motion.turn_rate_rad_s": "positive to the left",
    "motion.acceleration_var_m2_s4": "variance of the acceleration during a step, a number or one per axis",
    "prior": "the mobile at step 0: Gaussian",
    "prior.position_std_m": "a number, one per axis, or a covariance in m^2",
    "prior.velocity_std_m_s": "a number, one per axis, or a covariance in (m/s)^2",
    "prior.acceleration_std_m_s2": "a number, one per axis, or a covariance in (m/s^2)^2",
    "prior.covariance": "of positions, then velocities (then accelerations), in m and m/s",
    "links": "what all links share; an anchor may override any key",
    "links.sight": "LOS/NLOS chain of each link; for uneven times dwell_s = { los = 2, nlos = 2 }",
    "links.los": "range error in LOS; mean_m is 0 if left out",
    "links.nlos": "range error in NLOS; with plus_los the excess on top of the LOS error",
    "links.outlier": "rare wide errors in LOS and NLOS alike",
    "anchors": 'one line per anchor; or, above [time]: anchors_csv = "anchors.csv"',
}


def dumps(scenario: Scenario, comments: Mapping[str, str] | None = None) -> str:
    """The text of a scenario file that reads back to exactly this scenario.

    Keys that links share are written once in ``[links]``; anchors say only where they differ.

    Parameters
    ----------
    scenario
        Made of the pieces that files know: constant velocity, Gaussian prior, ranges, two-state sight.
    comments
        Key path -> comment, for example ``{"links.los": "from 4,210 ranges"}``; they replace the teaching comments.
        A path that the file does not have (``anchors.bs1.los`` where the anchor has only a position) is written at
        the nearest key above it.

    Raises
    ------
    InputError
        If a model piece has no form in a scenario file.

    Examples
    --------
    >>> import locbounds as lb
    >>> dumps(lb.papers.fritsche2013.scenario()).splitlines()[-1]
    'bs3 = { position_m = [6000, 2000] }'
    """
    notes = dict(TEACHING)
    extra: dict[str, list[str]] = {}
    keys = file_keys(scenario)
    for path, comment in (comments or {}).items():
        extra.setdefault(_nearest(path, keys), []).append(comment)
    notes.update({path: "\n".join(lines) for path, lines in extra.items()})

    document = tomlkit.document()
    _above(document, notes.get(""))
    for name in ("format", "title"):
        _put(document, name, keys[name], notes.get(name))
    for section in ("time", "motion", "prior", "links", "anchors"):
        document.add(tomlkit.nl())
        document.add(section, _table(section, keys[section], notes))
    return tomlkit.dumps(document)


def save(scenario: Scenario, path: str | os.PathLike, comments: Mapping[str, str] | None = None) -> None:
    """Write a scenario file in one piece; see :func:`dumps`.

    Raises
    ------
    InputError
        If the file cannot be written; an old file is then untouched.

    Examples
    --------
    >>> import tempfile
    >>> import locbounds as lb
    >>> path = Path(tempfile.mkdtemp()) / "scenario.toml"
    >>> lb.save(lb.papers.fritsche2013.scenario(), path, {"links.los": "from the measurements of May"})
    >>> "# from the measurements of May" in path.read_text()
    True
    """
    atomic_write_text(path, dumps(scenario, comments))


def _nearest(path: str, keys: Mapping[str, Any]) -> str:
    """The deepest path that has a line of its own; the root's is the empty path."""
    parts: list[str] = []
    here: Any = keys
    rest = path
    while rest and isinstance(here, Mapping) and len(parts) < (3 if parts[:1] == ["anchors"] else 2):
        name = next((k for k in sorted(here, key=len, reverse=True) if rest == k or rest.startswith(f"{k}.")), None)
        if name is None:
            break
        parts, here, rest = [*parts, name], here[name], rest[len(name) + 1 :]
    return ".".join(parts if len(parts) < 3 or len(keys["anchors"][parts[1]]) > 1 else parts[:2])


def _table(path: str, values: Mapping[str, Any], notes: Mapping[str, str]):
    table = tomlkit.table()
    _above(table, notes.get(path))
    nested = path == "anchors" and any(len(value) > 1 for value in values.values())
    for name, value in values.items():
        here = f"{path}.{name}"
        if nested:
            table.add(name, _table(here, value, notes))
        else:
            _put(table, name, value, notes.get(here))
    return table


def _above(table: Any, comment: str | None) -> None:
    for line in (comment or "").splitlines():
        table.add(tomlkit.comment(line))


def _put(table: Any, name: str, value: Any, comment: str | None) -> None:
    text = _text(value)
    item = tomlkit.value(text)
    if comment:
        width = len(tomlkit.key(name).as_string()) + len(" = ") + len(text)
        if "\n" in comment or max(width + 1, COLUMN) + len(f"# {comment}") > LINE:
            _above(table, comment)
        else:
            item.comment(comment)
            item.trivia.comment_ws = " " * max(COLUMN - width, 1)
    table.add(name, item)


def _text(value: Any) -> str:
    """A value as a person writes it: spaces inside braces, long lists over several lines."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {_text(inner)}" for name, inner in value.items()) + " }"
    if isinstance(value, list):
        cells = [_text(v) for v in value]
        if len(cells) <= PER_LINE:
            return f"[{', '.join(cells)}]"
        lines = [", ".join(cells[i : i + PER_LINE]) for i in range(0, len(cells), PER_LINE)]
        return "[\n    " + ",\n    ".join(lines) + ",\n]"
    return tomlkit.item(value).as_string()
