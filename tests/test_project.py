"""The project around the code: pins, what an import does, what the public docstrings hold."""

import inspect
import re
import subprocess
import sys
import tomllib
from itertools import chain

import pytest

import datasets
from datasets import PROJECT

PYPROJECT = tomllib.loads((PROJECT / "pyproject.toml").read_text())


def test_pins_are_plain_versions_without_any_address():
    pins = (PROJECT / "constraints.txt").read_text().splitlines()
    assert [pin for pin in pins if not re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.!+_-]+", pin)] == []


def test_every_requirement_is_pinned():
    def normal(name):
        return re.sub(r"[-_.]+", "-", name).lower()

    pinned = {normal(pin.partition("==")[0]) for pin in (PROJECT / "constraints.txt").read_text().split()}
    wanted = [*PYPROJECT["project"]["dependencies"], *chain.from_iterable(PYPROJECT["dependency-groups"].values())]
    names = (re.match(r"[A-Za-z0-9._-]+", requirement) for requirement in wanted)
    assert {normal(name[0]) for name in names if name} <= pinned


def test_version_is_that_of_pyproject():
    import locbounds

    assert locbounds.__version__ == PYPROJECT["project"]["version"]


def test_import_is_light_and_leaves_the_users_precision_alone():
    heavy = ["jax", "equinox", "scipy", "xarray", "matplotlib", "pydantic", "rich"]
    light = f"import sys, locbounds; print([name for name in {heavy} if name in sys.modules])"
    precision = "import locbounds, jax, jax.numpy as jnp; print(jax.config.jax_enable_x64, jnp.ones(1).dtype)"
    assert python(light) == "[]"
    assert python(precision) == "False float32"


def test_every_public_name_is_there_in_a_fresh_process():
    program = "import locbounds as lb; print([n for n in lb.__all__ if getattr(lb, n) is None])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == ("[]", "")


def test_every_public_docstring_has_an_example():
    import locbounds

    public = {name: getattr(locbounds, name) for name in getattr(locbounds, "__all__", ()) if name[0] != "_"}
    errors = (BaseException,)  # documented by their base class
    callables = {
        name: thing
        for name, thing in public.items()
        if callable(thing) and not (inspect.isclass(thing) and issubclass(thing, errors))
    }
    assert [name for name, thing in callables.items() if ">>>" not in (inspect.getdoc(thing) or "")] == []


def test_shape_annotations_are_checked_in_the_tests():
    assert any(type(finder).__module__.startswith("jaxtyping") for finder in sys.meta_path)


def test_missing_data_is_a_failure_where_the_setting_promises_them(tmp_path, monkeypatch):
    monkeypatch.setenv("LOCBOUNDS_DATA", str(tmp_path))
    (tmp_path / "here").mkdir()
    assert datasets.need("here") == tmp_path / "here"
    with pytest.raises(pytest.fail.Exception, match=r"absent.*LOCBOUNDS_DATA"):
        datasets.need("absent")


def test_missing_data_is_a_skip_with_a_remedy_without_the_setting(monkeypatch):
    monkeypatch.delenv("LOCBOUNDS_DATA", raising=False)
    with pytest.raises(pytest.skip.Exception, match="set LOCBOUNDS_DATA"):
        datasets.need("absent")


def python(code):
    """The output of a fresh interpreter, without this process's import hook."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()
