"""What goes to stdout and stderr."""

import json

import numpy as np

from locbounds.cli.output import count_progress, precision_progress, print_json, print_table


def test_json_is_plain_and_valid(capsys):
    print_json({"a": np.float64(1.5), "b": np.arange(2), "c": [float("nan"), float("inf")], "d": "é"})
    assert json.loads(capsys.readouterr().out) == {"a": 1.5, "b": [0, 1], "c": [None, None], "d": "é"}


def test_tables_are_not_folded_in_a_pipe(capsys):
    print_table("T", ("name", "value"), [["x" * 100, 1.25], ["y", 2.0]])
    out = capsys.readouterr().out
    assert f"{'x' * 100}   1.25" in out
    assert "name" in out


def test_progress_is_silent_without_a_terminal(capsys):
    with precision_progress("BCRB") as report, count_progress("IMM-EKF") as count:
        report(100, 0.01, 0.001)
        count(5, 10)
    assert capsys.readouterr() == ("", "")


def test_progress_shows_the_precision_reached(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "120")
    with precision_progress("BCRB") as report:
        report(4096, 0.004, 0.002)
    with count_progress("IMM-EKF") as count:
        count(500, 1000)
    shown, out = capsys.readouterr().err, capsys.readouterr().out
    assert out == ""
    assert "BCRB" in shown
    assert "0.40%" in shown
    assert "4,096 draws" in shown
    assert "500 of 1,000" in shown
