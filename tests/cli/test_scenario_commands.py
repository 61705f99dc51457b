"""``new``, ``check`` and ``explain`` through the shell: what they write, and what they say when they cannot."""

import json

import equinox as eqx
import pytest
from typer.testing import CliRunner

from locbounds.cli.app import app
from locbounds.io.scenario_file import load
from locbounds.papers import fritsche2013
from refusals import refused


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")
    monkeypatch.delenv("LOCBOUNDS_DEBUG", raising=False)


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_new_writes_the_papers_scenario(tmp_path):
    assert run("new", "s.toml", "--like", "fritsche2013").exit_code == 0
    assert eqx.tree_equal(load("s.toml"), fritsche2013.scenario())
    assert "locbounds check s.toml" in (tmp_path / "s.toml").read_text()
    refused(run("new", "s.toml"), "s.toml exists", "--force")
    assert run("new", "s.toml", "--force").exit_code == 0


def test_new_names_the_nearest_paper(tmp_path):
    refused(run("new", "s.toml", "--like", "fritsch"), "unknown paper 'fritsch'", "Did you mean fritsche2013?")
    refused(run("new", "s.toml", "--like", "plna"), "unknown paper 'plna'", "Did you mean plan?")
    assert files(tmp_path) == []


def test_figures_are_for_one_paper(tmp_path):
    refused(run("paper", "chen2010", "--figures", "fig1"), "--figures is for mcguire2009, this is chen2010")
    assert files(tmp_path) == []


def test_new_into_a_folder_that_does_not_exist(tmp_path):
    refused(run("new", "nowhere/s.toml"), "cannot write nowhere/s.toml")
    assert files(tmp_path) == []


def test_check_says_what_was_understood_and_draws_it(tmp_path):
    run("new", "s.toml")
    done = run("check", "s.toml")
    assert done.exit_code == 0, done.output
    for text in ("100 steps of 0.2 s", "(-3000, -2000)", "kept with 0.9 a step", "bcrb", "valid", "none found"):
        assert text in done.stdout
    assert (tmp_path / "s-out" / "scenario.png").read_bytes().startswith(b"\x89PNG")
    assert run("check", "s.toml").exit_code == 0  # its own folder is used again


def test_check_as_json():
    run("new", "s.toml")
    seen = json.loads(run("check", "s.toml", "--json").stdout)
    assert [link["anchor"] for link in seen["links"]] == ["bs1", "bs2", "bs3"]
    assert {b["id"]: b["status"] for b in seen["bounds"]}["known-sight"] == "refused"
    assert seen["dangers"] == []


def change(path, *pairs):
    text = path.read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)


def test_check_reports_what_is_legal_but_dangerous(tmp_path):
    run("new", "s.toml")
    change(tmp_path / "s.toml", ("stay = 0.9", "stay = 0.9999"))
    done = run("check", "s.toml")
    assert done.exit_code == 0
    assert "nearly deterministic" in done.stdout


def test_check_in_three_dimensions(tmp_path):
    run("new", "s.toml")
    flat = ("[500, 500]", "[5, 5]", "[-3000, -2000]", "[3000, 5000]", "[6000, 2000]")
    change(tmp_path / "s.toml", *((place, place.replace("]", ", 20]")) for place in flat))
    done = run("check", "s.toml")
    assert done.exit_code == 0, done.output
    assert "in 3-D" in done.stdout


BAD_FILES = [
    ("std_m = 150", "std = 150", "unknown key links.los.std", "Did you mean std_m?"),
    ("std_m = 150", "std_m = 0", "must be positive", "metres"),
    ("step_s", "step_ms", "unknown key time.step_ms", "Did you mean step_s?"),
    ("steps = 100 ", "steps = 0 ", "time.steps is 0", "steps:"),
    ("stay = 0.9", "transition = [[0.9, 0.2], [0.1, 0.9]]", "sums to 1.1", "summing to one"),
    ("position_std_m = 50 ", "position_std_m = [[1, 2], [2, 1]] ", "not positive semidefinite", "symmetric"),
    ("position_m = [-3000, -2000]", "lat = 48.1, lon = 11.5", "unknown key anchors.bs1.lat", "metres"),
    ("[time]", "[time", "not valid TOML", "line"),
    ("[anchors]", 'anchors_csv = "none.csv"\n[anchors]', "cannot read the anchors", "CSV"),
]


@pytest.mark.parametrize(("old", "new", "cause", "remedy"), BAD_FILES, ids=[bad[1] for bad in BAD_FILES])
def test_check_refuses_bad_files_and_writes_nothing(tmp_path, old, new, cause, remedy):
    run("new", "s.toml")
    change(tmp_path / "s.toml", (old, new))
    refused(run("check", "s.toml", "--json"), "error: s.toml", cause, remedy)
    assert files(tmp_path) == ["s.toml"]


def test_check_without_a_file(tmp_path):
    refused(run("check", "s.toml"), "cannot read s.toml: no such file", "locbounds new s.toml")
    refused(run("check", tmp_path), "cannot read")


def test_a_foreign_folder_is_refused(tmp_path):
    run("new", "s.toml")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "main.tex").write_text("precious")
    refused(run("check", "s.toml", "--out", "thesis"), "not from locbounds", "--force")
    refused(run("check", "s.toml", "--out", "s.toml"), "is a file")
    refused(run("check", "s.toml", "--out", "s.toml/below"), "cannot write")
    assert files(tmp_path) == ["s.toml", "thesis/main.tex"]
    assert run("check", "s.toml", "--out", "thesis", "--force").exit_code == 0


def test_ctrl_c_keeps_what_is_finished_and_leaves_nothing_half_written(tmp_path, monkeypatch):
    run("new", "s.toml")

    def interrupted(path):
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda self, path, **options: interrupted(path))
    done = run("check", "s.toml")
    assert done.exit_code == 130
    assert done.stderr.startswith("error: interrupted")
    assert files(tmp_path) == ["s.toml"]


def test_a_defect_is_short_unless_debug_is_asked_for(monkeypatch):
    run("new", "s.toml")

    def broken(*_, **__):
        raise ZeroDivisionError("three words here")

    monkeypatch.setattr("locbounds.report.understood.understood", broken)
    short = run("check", "s.toml")
    assert short.exit_code == 1
    assert short.stderr.startswith("error: unexpected: ZeroDivisionError: three words here\nremedy: ")
    assert "Traceback" not in short.stderr
    long = run("--debug", "check", "s.toml")
    assert long.exit_code == 1
    assert "Traceback" in long.stderr


def test_explain():
    everything = run("explain")
    assert everything.exit_code == 0
    for id in ("bcrb", "enumer", "imm-ekf"):
        assert id in everything.stdout
    one = run("explain", "bcrb")
    for text in ("BCRB (bcrb), a bound", "sees     ranges", "careful", "fritsche2013"):
        assert text in one.stdout
    assert json.loads(run("explain", "bcrb", "--json").stdout)["kind"] == "bound"
    refused(run("explain", "bcbr"), "unknown method 'bcbr'", "Did you mean bcrb?")
