"""Writing files so that nothing is ever left half-written, and folders that never mix with foreign files."""

import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from locbounds.errors import InputError

MARKER = ".locbounds"
MARKER_TEXT = "Written by locbounds: the next run with the same --out replaces what it finds here.\n"


@contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """A path to write to instead of ``path``; it takes its place when the block ends without an error.

    The temporary file lies beside the final one and keeps its suffix. After an error, or Ctrl-C, the old file is
    untouched.

    Raises
    ------
    InputError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "a.txt"
    >>> with atomic_path(path) as temporary:
    ...     _ = temporary.write_text("whole")
    >>> path.read_text(), [p.name for p in path.parent.iterdir()]
    ('whole', ['a.txt'])
    """
    path = Path(path)
    temporary = path.with_name(f".{secrets.token_hex(4)}-{path.name}")
    try:
        with _readable_errors(path):
            yield temporary
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True) if path.parent.is_dir() else None


@contextmanager
def _readable_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if isinstance(error, InputError):
            raise
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot write {path}: {reason}", "Choose a place that can be written to") from error


def atomic_write_text(path: str | os.PathLike, text: str) -> None:
    """Write a text file in one piece.

    Raises
    ------
    InputError
        If the file cannot be written; an old file is then untouched.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def refuse_existing(path: str | os.PathLike, *, force: bool) -> None:
    """Raise an InputError if a file exists and may not be replaced."""
    if Path(path).is_dir():
        raise InputError(f"{path} is a folder", "Name a file")
    if Path(path).exists() and not force:
        raise InputError(f"{path} exists", "Choose another name, or replace it with --force")


class OutputFolder:
    r"""A folder of results, used as a context.

    A new or empty folder is taken and marked. A folder marked by an earlier run is used again, file by file. Any
    other folder is foreign and refused unless ``force``. If the block fails before a file is written, a folder made
    here is removed again.

    Parameters
    ----------
    path
        The folder; parents are made.
    force
        Write into a foreign folder too.

    Attributes
    ----------
    written
        Files finished so far.
    partial
        Set it before writing what an interrupted command had computed: the files are then called ``partial-NAME``.

    Raises
    ------
    InputError
        If the folder is foreign or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with OutputFolder(Path(tempfile.mkdtemp()) / "demo-out") as out:
    ...     out.write_text("a.csv", "x\n")
    >>> [path.name for path in out.written]
    ['a.csv']
    """

    def __init__(self, path: str | os.PathLike, *, force: bool = False):
        self.path = Path(path)
        self.force = force
        self.written: list[Path] = []
        self.partial = False
        self._made: list[Path] = []

    def __enter__(self) -> "OutputFolder":
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"{self.path} is a file, not a folder", "Choose another folder with --out")
        if self._foreign() and not self.force:
            raise InputError(
                f"the folder {self.path} holds files that are not from locbounds",
                "Choose another folder with --out, or write into it with --force",
            )
        self._made = [p for p in (self.path, *self.path.parents) if not p.exists()]
        with _readable_errors(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
        try:
            atomic_write_text(self.path / MARKER, MARKER_TEXT)
        except InputError:
            self._remove_empty()
            raise
        return self

    def __exit__(self, kind, error, trace) -> None:
        if kind is not None and not self.written:
            self._remove_empty()

    def _foreign(self) -> bool:
        with _readable_errors(self.path):
            return self.path.is_dir() and any(self.path.iterdir()) and not (self.path / MARKER).exists()

    def _remove_empty(self) -> None:
        for folder in self._made:
            if {p.name for p in folder.iterdir()} <= {MARKER}:
                shutil.rmtree(folder)

    def write_text(self, name: str, text: str) -> None:
        """Write one text file."""
        self.write(name, lambda path: path.write_text(text, encoding="utf-8"))

    def write(self, name: str, save: Callable[[Path], object]) -> None:
        """Write one file with a function of the path, for example ``figure.savefig`` or ``dataset.to_netcdf``."""
        with self.writing(name) as temporary:
            save(temporary)

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        """A path to write one file to, in as many pieces as it takes; it gets its name when the block has ended.

        While :attr:`partial` is set, the name is ``partial-NAME``; the whole file later removes it.
        """
        target = self.path / (f"partial-{name}" if self.partial else name)
        with atomic_path(target) as temporary:
            yield temporary
        self.written.append(target)
        if not self.partial:
            (self.path / f"partial-{name}").unlink(missing_ok=True)
