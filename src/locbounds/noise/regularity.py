"""Whether a Cramér-Rao bound exists for a noise."""

from typing import NamedTuple

from locbounds.noise.singularity import Finding, Pieces, Singularity, findings

NO_BOUND = (
    "the information about a shift is infinite, so that the Cramér-Rao bound is zero and a Monte Carlo value only "
    "grows with the number of draws; Weiss-Weinstein and Ziv-Zakai bounds, which compare shifted copies, apply"
)


class Regularity(NamedTuple):
    """Whether the location family of a density has a finite Fisher information, and why.

    Attributes
    ----------
    finite
        True: regular; False: irregular; None: undecided.
    reason
        One sentence.
    findings
        The evidence: places, exponents and what follows from them.
    """

    finite: bool | None
    reason: str
    findings: tuple[Finding, ...] = ()

    @property
    def status(self) -> str:
        """``"regular"``, ``"irregular"`` or ``"undecided"``."""
        return {True: "regular", False: "irregular", None: "undecided"}[self.finite]

    def __str__(self) -> str:
        lines = [f"{self.status}: {self.reason}", *(f"- {f.text}" for f in self.findings if f.text not in self.reason)]
        if self.finite is False:
            lines.append(f"consequence: {NO_BOUND}")
        if self.finite is None:
            lines.append("consequence: a Cramér-Rao number may be quoted only after the density has been declared")
        return "\n".join(lines)


def declared(singularities: tuple[Singularity, ...], pieces: Pieces, name: str) -> Regularity:
    """The verdict on a density whose singularities are all known.

    Examples
    --------
    >>> declared((Singularity(0.0, 1.0, 0.0, 1.0),), ((0.0, float("inf")),), "a ramp").reason
    'the density vanishes linearly at 0 m, an edge of its support (finite only above t^1)'
    """
    found = findings(singularities, pieces)
    bad = [f for f in found if f.finite is False]
    if bad:
        more = f"; and {len(bad) - 1} more such place{'s' if len(bad) > 2 else ''}" if len(bad) > 1 else ""
        return Regularity(False, bad[0].text + more, found)
    if not found:
        return Regularity(True, f"{name}: smooth on the whole line", found)
    return Regularity(True, f"{name}: {'; '.join(f.text for f in found)}", found)
