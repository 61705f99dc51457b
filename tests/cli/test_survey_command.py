"""``survey`` and ``paper mcguire2009`` through the shell."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from datasets import folder, need
from locbounds.cli.app import app
from refusals import refused


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def survey(path="s.csv", change=lambda lines: lines):
    rng = np.random.default_rng(0)
    lines = ["point_id,x_m,y_m,ap1,ap2,ap3"]
    for k in range(24):
        x, y = k % 6, k // 6
        for _ in range(3):
            heard = -40 - 4 * np.hypot(x - np.array([0, 6, 3]), y - np.array([0, 0, 4])) + 2 * rng.normal(size=3)
            lines.append(f"{k},{x},{y}," + ",".join(f"{v:.0f}" for v in heard))
    with open(path, "w") as file:
        file.write("\n".join(change(lines)) + "\n")
    return path


def test_files_tables_and_columns(tmp_path):
    done = run("survey", survey(), "--no-map")
    assert done.exit_code == 0, done.output
    out = tmp_path / "s-out"
    assert {p.name for p in out.iterdir()} >= {"survey.csv", "access_points.csv", "map.png", "fig9.csv", "fig9.png"}
    rows = list(csv.DictReader((out / "survey.csv").read_text().splitlines()))
    assert list(rows[0]) == ["method", "noise_db", "rmse_m", "stderr_m", "valid"]
    value = {row["method"]: float(row["rmse_m"]) for row in rows}
    assert value["survey"] < value["mmse"] < value["knn"]
    assert all((out / name).stat().st_size > 10_000 for name in ("map.png", "fig9.png"))
    for words in ("rigorous bound", "not a bound", "valid under: a device at one of the surveyed points", "Lost to"):
        assert words in done.output
    again = json.loads(run("survey", "s.csv", "--no-map", "--json").stdout)
    assert {row["method"]: row["rmse_m"] for row in again["rows"]} == pytest.approx(value)


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (lambda lines: lines[:4], [], ["one point"]),
        (
            lambda lines: [lines[0], *(line.replace(",-", ",x", 1) for line in lines[1:])],
            [],
            ["line 2", "not a number"],
        ),
        (lambda lines: [",".join(line.split(",")[:1] + line.split(",")[3:]) for line in lines], [], ["no column x_m"]),
        (lambda lines: [lines[0], *(",".join(line.split(",")[:3]) + ",,," for line in lines[1:])], [], ["is heard"]),
        (
            lambda lines: [lines[0], *(",".join(line.split(",")[:3]) + ",-50,-50,-50" for line in lines[1:])],
            [],
            ["one value"],
        ),
        (lambda lines: lines[:1] + lines[1::3], [], ["no point has two samples", "--noise", "--merge"]),
        (lambda lines: lines, ["--noise", "loud"], ["loud"]),
        (lambda lines: lines, ["--noise", "0"], ["noise level is 0"]),
        (lambda lines: lines, ["--test", "split=test"], ["no column split"]),
        (lambda lines: lines, ["--test", "far.csv"], ["nearest survey point", "coordinates"]),
        (lambda lines: lines, ["--column", "xx=east"], ["KEY=COLUMN", "Did you mean x"]),
        (lambda lines: lines, ["--silence", "gold"], ["gold"]),
        (lambda lines: lines, ["--neighbours", "0"], ["--neighbours"]),
    ],
)
def test_bad_surveys_end_with_cause_remedy_and_no_files(tmp_path, change, options, words):
    survey("far.csv", lambda lines: [lines[0], "99,500,0,-50,-50,-50"])
    done = run("survey", survey(change=change), *options, "--no-map")
    refused(done, *words, unwritten=tmp_path / "s-out")


def test_the_paper_needs_its_data(monkeypatch, tmp_path):
    monkeypatch.delenv("LOCBOUNDS_DATA", raising=False)
    out = tmp_path / "mcguire2009-out"
    fig9 = ("paper", "mcguire2009", "--figures", "fig9")
    refused(run(*fig9), "Fig. 9 needs measured data", "wut_wifi_117", "--data", unwritten=out)
    refused(run(*fig9, "--data", tmp_path), "wut_wifi_117", unwritten=out)
    refused(run(*fig9, "--data", tmp_path / "none"), "there is no folder", "LOCBOUNDS_DATA", unwritten=out)


@pytest.mark.slow
def test_fig9_on_all_surveys(tmp_path):
    for name in ("wut_wifi_117", "wifi_rtt_grid", "wifine_train"):
        need(name)
    done = run("paper", "mcguire2009", "--figures", "fig9", "--data", folder())
    assert done.exit_code == 0, done.output
    rows = list(csv.DictReader((tmp_path / "mcguire2009-out" / "fig9.csv").read_text().splitlines()))
    sets = {row["set"] for row in rows} - {"published"}
    assert len(sets) == 6
    for name in sets:
        at = {}
        for row in rows:
            if row["set"] == name:
                at.setdefault(row["noise_factor"], {})[row["method"]] = float(row["rmse_m"]), float(row["stderr_m"])
        for found in at.values():
            if "mmse" in found:
                assert found["survey"][0] <= found["mmse"][0] + 4 * found["mmse"][1]
