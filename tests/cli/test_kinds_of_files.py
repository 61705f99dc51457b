"""Which command takes which kind of file, and which method speaks of which."""

import json

import pytest
from typer.testing import CliRunner

import locbounds as lb
from locbounds.cli.app import app
from locbounds.errors import InputError
from locbounds.registry import METHODS
from refusals import refused

CITY = """
format = 1
[city]
buildings = "buildings.geojson"
[measure]
std_m = 5
[anchors]
A = { position_m = [0, 0] }
"""


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture(autouse=True)
def _files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "city.toml").write_text(CITY)
    assert run("new", "plan.toml", "--like", "plan").exit_code == run("new", "walk.toml").exit_code == 0


@pytest.mark.parametrize("id", [m.id for m in METHODS.values() if m.subject != "scenario" and not m.on_plan])
def test_methods_of_something_else_than_a_scenario_say_so(id):
    said = f"{id} speaks of a {METHODS[id].subject}, not of a scenario"
    refused(run("explain", id, "--scenario", "walk.toml"), said)
    refused(run("explain", id, "--scenario", "walk.toml", "--json"), said)
    with pytest.raises(InputError, match=said):
        lb.explain(id, lb.papers.fritsche2013.scenario())


@pytest.mark.parametrize("id", [m.id for m in METHODS.values() if m.subject == "plan" or m.on_plan])
def test_methods_of_plans_are_judged_on_a_plan_file(id):
    done = run("explain", id, "--scenario", "plan.toml", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.output)["verdict"] == str(METHODS[id].verdict(lb.read_plan("plan.toml").plan))


def test_methods_of_scenarios_say_that_a_plan_is_none():
    refused(run("explain", "enumer", "--scenario", "plan.toml"), "enumer speaks of a scenario, not of a plan")


@pytest.mark.parametrize(
    ("command", "kind", "taker"),
    [
        (["track", "plan.toml"], "plan", "locbounds map plan.toml"),
        (["check", "plan.toml"], "plan", "locbounds map plan.toml"),
        (["track", "city.toml"], "city", "locbounds map city.toml"),
        (["check", "city.toml"], "city", "locbounds map city.toml"),
        (["explain", "bcrb", "--scenario", "city.toml"], "city", "locbounds map city.toml"),
        (["map", "walk.toml"], "scenario", "locbounds track walk.toml"),
    ],
)
def test_a_file_of_another_kind_is_named(command, kind, taker):
    refused(run(*command), f"is a {kind} file", taker)


def test_a_stray_section_does_not_change_the_kind(tmp_path):
    walk = tmp_path / "walk.toml"
    walk.write_text(walk.read_text() + "\n[area]\nradius_m = 3\n")
    refused(run("check", "walk.toml"), "unknown key area")
