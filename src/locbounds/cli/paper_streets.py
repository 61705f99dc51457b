"""Figs. 7 and 8 of ``locbounds paper mcguire2009``."""

from collections.abc import Callable
from typing import Any


def streets(folder: Any, *, seed: int, say: Callable[[str], None]) -> tuple[list[Any], list[str]]:
    """Write fig7.png, fig8.csv and fig8.png; the rows of Fig. 8, and what becomes of the chapter's statements."""
    from locbounds.papers import mcguire2009_streets as study

    figure = study.fig7_figure()
    folder.write("fig7.png", lambda path: figure.savefig(path, dpi=150))
    rows = study.fig8(seed=seed, announce=say)
    folder.write_text("fig8.csv", study.fig8_csv(rows))
    curves = study.fig8_figure(rows)
    folder.write("fig8.png", lambda path: curves.savefig(path, dpi=150))
    return rows, study.remarks(rows)
