"""What every command does with input that it cannot use."""

from pathlib import Path
from typing import Any


def refused(done: Any, *words: str, unwritten: Path | None = None) -> None:
    """Exit code 2, cause and remedy with these words on stderr, nothing on stdout, no traceback, nothing written."""
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert "\nremedy: " in done.stderr
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr
    assert unwritten is None or not unwritten.exists()
