"""The layers of the design, as pyproject.toml states them."""

import grimp
from importlinter.cli import lint_imports

from datasets import PROJECT


def test_arrows_point_one_way(tmp_path, capsys):
    status = lint_imports(str(PROJECT / "pyproject.toml"), no_cache=True, no_logo=True)
    assert status == 0, capsys.readouterr().out


def test_nobody_goes_round_the_layers_through_the_package_itself():
    graph = grimp.build_graph("locbounds", cache_dir=None)
    assert graph.find_modules_that_directly_import("locbounds") == set()


def test_no_empty_rooms():
    rooms = [path.parent for path in (PROJECT / "src" / "locbounds").rglob("__init__.py")]
    code = {room: "".join(path.read_text() for path in room.glob("*.py")).strip() for room in rooms}
    assert [str(room) for room in rooms if not code[room]] == []
