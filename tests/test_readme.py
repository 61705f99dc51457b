"""The README: its example runs and prints what it says, its table and commands are those of the program."""

import math
import re
import shlex

import pytest

from datasets import PROJECT
from locbounds.registry import METHODS

README = (PROJECT / "README.md").read_text()
NUMBER = re.compile(r"\d+\.\d+")
WITH_ERROR = re.compile(r"(\d+\.\d+) \+- (\d+\.\d+)")
WITH_INTERVAL = re.compile(r"(\d+\.\d+) \[(\d+\.\d+), (\d+\.\d+)\]")  # 95 %
SIGMAS = 5.0  # a README need not be edited whenever the order of the draws changes


def block(language):
    return re.search(rf"^```{language}\n(.*?)^```", README, re.S | re.M)[1]  # type: ignore[index]


def estimates(text):
    """Every number that stands with its uncertainty, and its standard error."""
    pairs = [(float(value), float(error)) for value, error in WITH_ERROR.findall(text)]
    return pairs + [(float(x), (float(high) - float(low)) / 3.92) for x, low, high in WITH_INTERVAL.findall(text)]


def test_the_example_prints_what_the_readme_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(block("python"), "README.md", "exec"), {})
    printed, said = capsys.readouterr().out, block("text")
    assert NUMBER.sub("#", printed) == NUMBER.sub("#", said)
    values, promised = estimates(printed), estimates(said)
    assert len(values) == 3
    for (value, error), (other, its_error) in zip(values, promised, strict=True):
        assert abs(value - other) <= SIGMAS * math.hypot(error, its_error)
        assert error == pytest.approx(its_error, rel=0.5)
    (bound, _), (filter, _), (efficiency, _) = values
    assert bound < filter
    assert efficiency < 1
    assert (tmp_path / "tracking.png").stat().st_size > 10_000


def test_the_example_is_ten_lines_long():
    assert len(block("python").splitlines()) <= 10


def test_every_method_is_named():
    assert [id for id in METHODS if f"`{id}`" not in README] == []


def test_the_table_says_what_the_bounds_assume():
    words = {"los-ranges": "LOS ranges"}
    for m in METHODS.values():
        if m.kind == "bound":
            row = next(line for line in README.splitlines() if line.startswith("|") and f"| `{m.id}` |" in line)
            sees = {words.get(what, what) for what in m.sees}
            assert set(row.strip("| ").split(" | ")[-1].split(", ")) == sees


def test_commands_and_options_exist():
    import typer

    from locbounds.cli.app import app

    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    lines = [line.partition("#")[0] for line in README.splitlines() if line.startswith("locbounds ")]
    assert len(lines) >= 7
    for call in (part for line in lines for part in line.split("&&")):
        program, name, *words = shlex.split(call)
        known = {option for parameter in commands[name].params for option in parameter.opts}
        assert program == "locbounds"
        assert {word for word in words if word.startswith("--")} <= known


def test_pictures_and_files_exist():
    targets = re.findall(r"\]\(([^)#:]+)\)", README) + re.findall(r"`(docs/[^`]+)`", README)
    assert targets
    assert [target for target in targets if not (PROJECT / target).exists()] == []
