"""Nothing is ever left half-written, and results never mix with foreign files."""

import pytest

from locbounds.errors import InputError
from locbounds.io.files import MARKER, OutputFolder, atomic_path, atomic_write_text, refuse_existing


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def half_written(path, error):
    with atomic_path(path) as temporary:
        temporary.write_text("half")
        raise error


def interrupted_after_a_file(folder):
    with OutputFolder(folder) as out:
        out.write_text("a.csv", "x")
        raise KeyboardInterrupt


def test_an_interrupted_write_leaves_the_old_file(tmp_path):
    atomic_write_text(tmp_path / "a.csv", "old")
    for error in (ValueError, KeyboardInterrupt):
        with pytest.raises(error):
            half_written(tmp_path / "a.csv", error)
    assert (tmp_path / "a.csv").read_text() == "old"
    assert names(tmp_path) == ["a.csv"]


def test_a_new_folder_is_marked_and_used_again(tmp_path):
    for text in ("first", "second"):
        with OutputFolder(tmp_path / "deep" / "x-out") as out:
            out.write_text("a.csv", text)
    assert names(tmp_path / "deep" / "x-out") == [MARKER, "a.csv"]
    assert (tmp_path / "deep" / "x-out" / "a.csv").read_text() == "second"


def test_a_foreign_folder_is_refused_without_force(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="not from locbounds"), OutputFolder(tmp_path):
        pass
    assert names(tmp_path) == ["thesis.tex"]
    with OutputFolder(tmp_path, force=True) as out:
        out.write_text("a.csv", "x")
    assert names(tmp_path) == [MARKER, "a.csv", "thesis.tex"]


def test_an_empty_folder_is_taken(tmp_path):
    with OutputFolder(tmp_path) as out:
        out.write_text("a.csv", "x")
    assert [p.name for p in out.written] == ["a.csv"]


def test_a_failure_before_the_first_file_leaves_nothing(tmp_path):
    with pytest.raises(ValueError, match="no"), OutputFolder(tmp_path / "a" / "b"):
        raise ValueError("no")
    assert names(tmp_path) == []


def test_a_failure_later_keeps_what_was_computed(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        interrupted_after_a_file(tmp_path / "x")
    assert names(tmp_path / "x") == [MARKER, "a.csv"]


@pytest.mark.parametrize("place", ["file/below", "file", "/proc/x-out"])
def test_a_folder_that_cannot_be_written(tmp_path, place):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"cannot write|is a file"), OutputFolder(tmp_path / place):
        pass


def test_an_existing_file_is_not_replaced_unasked(tmp_path):
    refuse_existing(tmp_path / "a", force=False)
    (tmp_path / "a").write_text("x")
    with pytest.raises(InputError, match="exists"):
        refuse_existing(tmp_path / "a", force=False)
    refuse_existing(tmp_path / "a", force=True)
    with pytest.raises(InputError, match="is a folder"):
        refuse_existing(tmp_path, force=True)
