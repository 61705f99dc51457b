"""Accuracy requirements: "100 m @ 67 %" against measured or simulated errors, with the confidence of the sample."""

import re
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError

E911 = "100 m @ 67 %, 300 m @ 95 %"
"""US rule for network-based location of emergency calls (FCC 1996, as cited by Chen 2010, reference 12)."""
CONFIDENCE = 0.95
REMEDY = f'Write limits and shares like "{E911}", or e911'


class Requirement(NamedTuple):
    """An error that a share of all position estimates must not exceed.

    Attributes
    ----------
    limit_m
        The error in metres.
    share
        Between 0 and 1.
    """

    limit_m: float
    share: float

    def __str__(self) -> str:
        return f"{self.limit_m:g} m @ {100 * self.share:g} %"


class Decision(StrEnum):
    """What the errors say about a requirement."""

    PASS = "pass"
    FAIL = "fail"
    UNDECIDED = "undecided"


class Compliance(NamedTuple):
    """One requirement and what the errors say about it.

    Attributes
    ----------
    requirement
        What was asked for.
    share, low, high
        Share of the errors within the limit, and its 95 % confidence interval.
    decision
        Pass if the whole interval reaches the requirement, fail if none of it does, else undecided.
    """

    requirement: Requirement
    share: float
    low: float
    high: float
    decision: Decision

    def __str__(self) -> str:
        return (
            f"{self.requirement}: {self.decision} ({100 * self.share:.4g} % within, "
            f"95 % interval {100 * self.low:.4g} to {100 * self.high:.4g} %)"
        )


def parse(text: str) -> tuple[Requirement, ...]:
    """Requirements from text.

    Parameters
    ----------
    text
        Comma separated limits and shares, or ``e911`` for :data:`E911`.

    Raises
    ------
    InputError
        If it cannot be read, a limit is not positive or a share not between 0 and 100 %.

    Examples
    --------
    >>> parse("100 m @ 67 %, 0.5 km @ 95 %")
    (Requirement(limit_m=100.0, share=0.67), Requirement(limit_m=500.0, share=0.95))
    """
    if text.strip().lower() == "e911":
        text = E911
    found = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(m|km|cm)\s*@\s*([0-9.eE+-]+)\s*%\s*", part)
        try:
            limit, share = (float(match[1]), float(match[3])) if match else (np.nan, np.nan)
        except ValueError:
            match = None
        if match is None:
            raise InputError(f'cannot read the requirement "{part.strip()}"', REMEDY)
        limit *= {"m": 1.0, "km": 1e3, "cm": 1e-2}[match[2]]
        if not (0 < limit < np.inf and 0 < share < 100):
            raise InputError(
                f'the requirement "{part.strip()}" can never be decided',
                "Give a positive length and a share between 0 and 100 %",
            )
        found.append(Requirement(limit, share / 100))
    return tuple(found)


def comply(
    requirements: str | Sequence[Requirement], errors: Float[Array, "runs times"] | Sequence[Float[Array, " times"]]
) -> tuple[Compliance, ...]:
    """Whether position errors satisfy requirements, as far as the sample can tell.

    Parameters
    ----------
    requirements
        Text or what :func:`parse` made of it.
    errors
        Position errors in metres, one row (of any length) per independent run or track. Errors within a run are
        dependent; NaN counts as beyond any limit.

    Returns
    -------
    tuple of Compliance
        One per requirement, in order.

    Raises
    ------
    InputError
        If there are no errors, or the requirement cannot be read.

    Notes
    -----
    The interval is that of Clopper and Pearson for the effective number of independent errors,
    ``n = p (1 - p) / se^2`` with the standard error over runs, reduced for the few runs it is estimated from (Korn and
    Graubard 1998). Where every run has the same share, n is the number of runs.

    Examples
    --------
    >>> import numpy as np
    >>> errors = np.random.default_rng(0).rayleigh(50.0, (400, 10))
    >>> [str(c.decision) for c in comply("100 m @ 67 %, 100 m @ 86.5 %, 100 m @ 95 %", errors)]
    ['pass', 'undecided', 'fail']
    """
    wanted = parse(requirements) if isinstance(requirements, str) else requirements
    rows = [np.asarray(row, dtype=float).ravel() for row in errors]
    rows = [row for row in rows if row.size]
    if not rows:
        raise InputError("there are no errors to judge a requirement by", "Give the errors of at least one run")
    return tuple(_decide(requirement, rows) for requirement in wanted)


def _decide(requirement: Requirement, rows: list[np.ndarray]) -> Compliance:
    inside = np.array([np.sum(row <= requirement.limit_m) for row in rows], dtype=float)
    counts = np.array([row.size for row in rows], dtype=float)
    share = float(inside.sum() / counts.sum())
    low, high = _interval(share, _effective(inside, counts, share))
    decision = Decision.PASS if low >= requirement.share else Decision.FAIL
    if low < requirement.share <= high:
        decision = Decision.UNDECIDED
    return Compliance(requirement, share, low, high, decision)


def _effective(inside: np.ndarray, counts: np.ndarray, share: float) -> float:
    """How many independent errors would say as much about the share."""
    from scipy.stats import t

    runs = len(inside)
    residual = inside - share * counts
    variance = runs / max(runs - 1, 1) * np.sum(residual**2) / counts.sum() ** 2
    if runs < 2 or variance <= 0:
        return float(runs)
    upper = 0.5 + CONFIDENCE / 2
    few = (t.ppf(upper, max(counts.sum() - 1, 1)) / t.ppf(upper, runs - 1)) ** 2
    return float(min(share * (1 - share) / variance * few, counts.sum()))


def _interval(share: float, n: float) -> tuple[float, float]:
    from scipy.stats import beta

    tail = (1 - CONFIDENCE) / 2
    k = share * n
    low = float(beta.ppf(tail, k, n - k + 1)) if share > 0 else 0.0
    high = float(beta.ppf(1 - tail, k + 1, n - k)) if share < 1 else 1.0
    return low, high
