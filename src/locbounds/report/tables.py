"""Results as CSV text."""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from locbounds.result import Result

RMSE_COLUMNS = ("method", "kind", "step", "time_s", "position_rmse_m", "stderr_m")


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    r"""Rows as CSV; numbers keep ten significant digits.

    >>> csv_text(("a", "b"), [(1, 0.1 + 0.2)])
    'a,b\n1,0.3\n'
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([f"{cell:.10g}" if isinstance(cell, float) else cell for cell in row])
    return text.getvalue()


def rmse_rows(results: Iterable[Result]) -> list[tuple[Any, ...]]:
    """One row per method and step, in the order of :data:`RMSE_COLUMNS`.

    >>> import locbounds as lb
    >>> rmse_rows([lb.bcrb(lb.papers.fritsche2013.scenario(steps=10))])[0][:4]
    ('bcrb', 'bound', 0, 0.0)
    """
    rows = []
    for result in results:
        triples = zip(result.time_s, result.position_rmse.values, result.position_rmse_stderr.values, strict=True)
        for step, (time_s, value, error) in enumerate(triples):
            rows.append((result.id, result.kind, step, float(time_s), float(value), float(error)))
    return rows
