"""``locbounds map`` through the shell: files, tables, pictures, and plans that cannot be used."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

import locbounds as lb
from hall import HALL, PLACES
from locbounds.cli.app import app
from refusals import refused

FAST = ("--grid", "9", "--rtol", "0.05")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")


def run(text, *arguments):
    with open("hall.toml", "w") as file:
        file.write(text)
    return CliRunner().invoke(app, ["map", "hall.toml", *arguments])


def rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_files_tables_and_pictures(tmp_path):
    done = run(HALL, *FAST, "--cells", "2", "--methods", "bcrb,wwb,ezzb,mmse")
    assert done.exit_code == 0, done.output
    out = tmp_path / "hall-out"
    assert {p.name for p in out.iterdir()} == {
        ".locbounds", "map.csv", "map.nc", "methods.csv", "cells.csv", "map.png", "cells.png",
    }  # fmt: skip
    points = rows(out / "map.csv")
    assert len(points) == 9 * 5
    marked = [p for p in points if p["status"] != "ok"]
    assert [(p["x_m"], p["y_m"], p["status"]) for p in marked] == [
        ("0", "0", "no derivative"), ("40", "0", "no derivative"), ("20", "20", "no derivative"),
    ]  # fmt: skip
    assert {p["crlb_rmse_m"] for p in marked} == {""}
    good = [p for p in points if p["status"] == "ok"]
    there = np.array([[float(p["x_m"]), float(p["y_m"])] for p in good])
    bound = lb.crlb(lb.toa(PLACES, 2.0), there)
    for name, values in (("crlb_rmse_m", bound.rmse), ("crlb_cep_m", bound.cep()), ("gdop", bound.dop().gdop)):
        np.testing.assert_allclose([float(p[name]) for p in good], values, rtol=1e-9)
    methods = {r["method"]: r for r in rows(out / "methods.csv")}
    assert list(methods) == ["crlb", "bcrb", "wwb", "ezzb", "mmse"]
    assert methods["bcrb"]["verdict"] == "refused"
    assert "edge of its support" in methods["bcrb"]["why"]
    least = float(methods["mmse"]["rmse_m"]) + 4 * float(methods["mmse"]["stderr_m"])
    assert max(float(methods[id]["rmse_m"]) for id in ("wwb", "ezzb")) < least
    cells = rows(out / "cells.csv")
    assert [(c["x_low_m"], c["y_high_m"]) for c in cells] == [("0", "20"), ("20", "20")]
    for c in cells:
        assert float(c["tightest_m"]) == max(float(c["wwb_m"]), float(c["ezzb_m"]))
        assert float(c["tightest_m"]) < float(c["mmse_m"]) + 4 * float(c["mmse_stderr_m"])
        assert float(c["mmse_m"]) < float(methods["mmse"]["rmse_m"]) * 1.1  # told the cell
    left, right = (float(c["ezzb_m"]) for c in cells)
    assert left == pytest.approx(right, rel=1e-3)  # the hall is symmetric
    assert all((out / name).stat().st_size > 20_000 for name in ("map.png", "cells.png"))
    for words in ("median error (CEP)", "no bound", "refused (", "is the tightest valid bound", "3 of 45 points"):
        assert words in done.output


@pytest.mark.parametrize(("given", "wanted"), [([], [5e-3, 1e-2]), (["--rtol", "0.002"], [2e-3, 2e-3])])
def test_the_precision_asked_for_is_that_of_the_cells(monkeypatch, given, wanted):
    asked = []

    def ezzb(plan, *, rtol):
        asked.append(rtol)
        return lb.ezzb(plan, rtol=0.05)

    monkeypatch.setattr("locbounds.static.over_prior.load", lambda entry: ezzb)
    done = run(HALL, "--grid", "3", "--cells", "1", "--methods", "ezzb", *given)
    assert done.exit_code == 0, done.output
    assert asked == wanted


def test_json_and_netcdf_say_the_same(tmp_path):
    import xarray

    done = run(HALL, *FAST, "--cells", "0", "--methods", "ezzb", "--json", "--share", "0.9")
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert [m["method"] for m in said["methods"]] == ["crlb", "ezzb"]
    assert said["tightest"]["id"] == "ezzb"
    assert said["points"] == 45
    with xarray.open_dataset(tmp_path / "hall-out" / "map.nc", engine="h5netcdf") as file:
        assert file.attrs["verdict"].startswith("valid")
        assert file.crlb_q90_m.attrs["units"] == "m"
        assert int((file.status == 2).sum()) == 3
        values = file.crlb_rmse_m.values[np.isfinite(file.crlb_rmse_m.values)]
    row = next(r for r in said["crlb"] if r["quantity"] == "crlb_rmse_m")
    assert row["worst"] == pytest.approx(values.max())
    assert not (tmp_path / "hall-out" / "cells.csv").exists()


def test_a_plan_without_cramer_rao_bound_still_has_the_others(tmp_path):
    text = HALL.replace("{ std_m = 2 }", '{ family = "exponential", scale_m = 2 }')
    done = run(text, *FAST, "--cells", "0", "--methods", "wwb")
    assert done.exit_code == 0, done.output
    assert {r["method"]: r["verdict"] for r in rows(tmp_path / "hall-out" / "methods.csv")} == {
        "crlb": "refused", "wwb": "valid",
    }  # fmt: skip
    assert not (tmp_path / "hall-out" / "map.csv").exists()
    assert run(text, *FAST, "--methods", "none", "--out", "again").exit_code == 2


def test_two_anchors_have_bayesian_numbers_and_a_note(tmp_path):
    text = HALL.replace('"toa"', '"tdoa"').replace("c = { position_m = [20, 20] }\n", "")
    done = run(text, *FAST, "--cells", "0", "--methods", "wwb,ezzb,mmse")
    assert done.exit_code == 0, done.output
    assert "no Cramér-Rao bound: 1 measured number cannot determine 2 coordinates" in done.output
    found = {row["method"]: row for row in rows(tmp_path / "hall-out" / "methods.csv")}
    assert found["crlb"]["verdict"] == "refused"
    value = {id: float(found[id]["rmse_m"]) for id in ("wwb", "ezzb", "mmse")}
    assert 0 < max(value["wwb"], value["ezzb"]) < value["mmse"]
    assert not (tmp_path / "hall-out" / "map.csv").exists()


def test_mixed_units_have_no_dilution_unless_weights_are_given(tmp_path):
    text = HALL.replace("[20, 20] }", '[20, 20], measure = "aoa", los = { std_deg = 3 } }')
    done = run(text, *FAST, "--methods", "none")
    assert done.exit_code == 0, done.output
    assert "different units, and no weights are given" in done.output
    assert "gdop" not in rows(tmp_path / "hall-out" / "map.csv")[0]
    done = run(text, *FAST, "--methods", "ls", "--cells", "0")
    assert done.exit_code == 0, done.output
    why = rows(tmp_path / "hall-out" / "methods.csv")[1]["why"]
    assert why == "squares of m, rad cannot be summed without weights"
    done = run(text, *FAST, "--methods", "none", "--weights", "1,1,1500")
    assert done.exit_code == 0, done.output
    assert "gdop" in rows(tmp_path / "hall-out" / "map.csv")[0]
    done = run(text, *FAST, "--methods", "none", "--weights", "1,1")
    assert (done.exit_code, "3 channels" in done.stderr) == (2, True)


def test_three_dimensions_and_an_unknown_clock(tmp_path):
    text = HALL
    for old, new in (
        ("[area]", 'clock = "unknown"\n[area]'), ("high_m = [40, 20]", "high_m = [40, 20]\nheight_m = 1.5"),
        ("[0, 0] }", "[0, 0, 3] }"), ("[40, 0] }", "[40, 0, 5] }"),
        ("[20, 20] }", "[20, 20, 4] }\nd = { position_m = [0, 20, 6] }\ne = { position_m = [35, 15, 2] }"),
    ):  # fmt: skip
        text = text.replace(old, new)
    done = run(text, *FAST, "--methods", "ezzb")
    assert done.exit_code == 0, done.output
    assert "no numbers per cell" in done.output
    assert "the plan has no prior" in done.output
    row = rows(tmp_path / "hall-out" / "map.csv")[0]
    assert row["z_m"] == "1.5"
    assert {"gdop", "pdop", "hdop", "vdop", "tdop", "crlb_clock_m"} <= set(row)


TWO = "b = { position_m = [40, 0] }\nc = { position_m = [20, 20] }"
BOX = "low_m = [0, 0]\nhigh_m = [40, 20]"


@pytest.mark.parametrize(
    ("old", "new", "options", "words"),
    [
        (BOX, "", [], ["area is empty"]),
        (BOX, "outline_m = [[0, 0], [9, 0]]", [], ["different corners"]),
        (BOX, "outline_m = [[0, 0], [4, 4], [4, 0], [0, 4]]", [], ["crosses itself"]),
        ("c = { position_m = [20, 20] }", "c = { position_m = [20, 20], sight = 3 }", [], ["sight"]),
        ("[anchors]", "[prior]\nposition_m = [0, 0]\nposition_std_m = inf\n[anchors]", [], ["position_std_m"]),
        (
            "b = { position_m = [40, 0] }\nc = { position_m = [20, 20] }",
            "",
            ["--methods", "none"],
            ["cannot determine"],
        ),
        ("std_m", "std_db", [], ["std_db", "Did you mean std_m"]),
        (BOX, "low_m = [0, 0]\nhigh_m = [1e12, 1e12]", [], ["the area reaches", "local plane"]),
        ("", "", ["--grid", "1"], ["grid is 1"]),
        ("", "", ["--grid", "99999"], ["At most"]),
        ("", "", ["--methods", "wbw"], ["unknown method 'wbw'", "Did you mean wwb"]),
        ("", "", ["--share", "1.5"], ["1.5"]),
        ("", "", ["--cells", "999"], ["--cells is 999"]),
        ("", "", ["--rtol", "0"], ["rtol is 0"]),
        ("", "", ["--weights", "a,b"], ["--weights"]),
        (BOX, "outline_m = [[20, 0], [40, 10], [20, 20], [0, 10]]", ["--grid", "2"], ["no point of the grid"]),
    ],
)
def test_bad_plans_end_with_cause_remedy_and_no_files(tmp_path, old, new, options, words):
    done = run(HALL.replace(old, new, 1) if old else HALL, *options)
    refused(done, *words, unwritten=tmp_path / "hall-out")


def test_new_writes_a_plan_that_can_be_mapped(tmp_path):
    done = CliRunner().invoke(app, ["new", "plan.toml", "--like", "plan"])
    assert done.exit_code == 0, done.output
    assert "locbounds map plan.toml" in done.output
    done = CliRunner().invoke(app, ["map", "plan.toml", "--grid", "21", "--methods", "none"])
    assert done.exit_code == 0, done.output
    assert CliRunner().invoke(app, ["new", "plan.toml", "--like", "plan"]).exit_code == 2
    assert CliRunner().invoke(app, ["map", "none.toml"]).exit_code == 2
