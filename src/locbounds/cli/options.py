"""Options that commands share."""

from pathlib import Path
from typing import Annotated, Any

import typer

ScenarioArgument = Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="Scenario file.", show_default=False)]
OutOption = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for results; by default ./NAME-out.")
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of all random numbers.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print tables as JSON.")]
ForceOption = Annotated[bool, typer.Option("--force", help="Write into a folder, or over a file, that is not ours.")]
RequirementOption = Annotated[
    str,
    typer.Option(
        "--requirement",
        metavar="TEXT",
        help="What to judge the filters' errors by, like '5 m @ 90 %'; e911: 100 m @ 67 %, 300 m @ 95 %; or none.",
    ),
]


def requirements(text: str) -> tuple[Any, ...]:
    """What ``--requirement`` asks for; nothing for ``none``.

    >>> requirements("none")
    ()
    """
    from locbounds.requirement import parse

    return () if text.strip().lower() == "none" else parse(text)


def default_out(name: str | Path, out: Path | None) -> Path:
    """The folder for results: the one asked for, or ``./NAME-out``.

    >>> default_out(Path("plans/city.toml"), None).name
    'city-out'
    """
    return out if out is not None else Path(f"{Path(name).stem}-out")
