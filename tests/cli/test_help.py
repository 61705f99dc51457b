"""What a newcomer sees first: at once, and with an example each."""

import subprocess
import sys

import pytest
from typer.testing import CliRunner

from locbounds.cli.app import app
from refusals import refused

RUN = [sys.executable, "-c", "from locbounds.cli import main; main()"]
HEAVY = ("jax", "equinox", "scipy", "xarray", "matplotlib", "pydantic", "tomlkit", "numpy")
COMMANDS = [command.name or command.callback.__name__ for command in app.registered_commands if command.callback]


def test_help_names_every_command_and_imports_nothing_heavy():
    code = f"""
import sys
from locbounds.cli import main
try:
    main()
finally:
    print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code, "--help"], capture_output=True, text=True)
    assert (done.returncode, done.stderr.strip()) == (0, "[]")
    for name in COMMANDS:
        assert name in done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_teaches_by_an_example(command):
    done = CliRunner().invoke(app, [command, "--help"])
    assert done.exit_code == 0
    assert f"Example: locbounds {command}" in done.stdout


def test_version():
    done = CliRunner().invoke(app, ["--version"])
    assert done.exit_code == 0
    assert done.stdout.startswith("locbounds 0.")


@pytest.mark.parametrize(
    "arguments", [["--bogus"], ["nonsense"], ["new", "--sed", "1"], ["check"], ["check", "s.toml", "--seed", "-1"]]
)
def test_wrong_options_are_errors_with_a_remedy(arguments):
    done = CliRunner().invoke(app, arguments)
    refused(done, "remedy: see locbounds")


def test_no_arguments_show_the_help():
    assert "Usage: locbounds" in CliRunner().invoke(app, []).output


def test_help_keeps_the_names_of_sections():
    text = " ".join(CliRunner().invoke(app, ["map", "--help"], env={"COLUMNS": "200"}).stdout.split())
    assert "a section [city] that names the footprints" in text
    assert "\\" not in text
