"""Which measurements an estimator of x_k may use: up to step k, up to some steps before, or all of the record."""

from typing import NamedTuple

from locbounds.errors import InputError

FILTER, PREDICT, SMOOTH = "filter", "predict", "smooth"
KNOWN = "filter, predict:N (N steps ahead) or smooth"


class Horizon(NamedTuple):
    """A parsed horizon.

    Attributes
    ----------
    kind
        ``"filter"``: x_k from z_1..z_k; ``"predict"``: from z_1..z_{k-N}; ``"smooth"``: from z_1..z_K.
    ahead
        N, the number of steps that are predicted; 0 for the others.
    """

    kind: str = FILTER
    ahead: int = 0

    @property
    def label(self) -> str:
        """What is added to a method's name.

        >>> [Horizon.parse(text, 9).label for text in ("filter", "predict:1", "smooth")]
        ['', ', 1 step ahead', ', smoothing']
        """
        if self.kind == PREDICT:
            return f", {self.ahead} step{'s' if self.ahead > 1 else ''} ahead"
        return ", smoothing" if self.kind == SMOOTH else ""

    def last(self, k: int, steps: int) -> int:
        """The last step whose measurements an estimator of x_k may use, of a record with so many steps.

        >>> [Horizon.parse(text, 9).last(4, 9) for text in ("filter", "predict:3", "predict:6", "smooth")]
        [4, 1, 0, 9]
        """
        return steps if self.kind == SMOOTH else max(k - self.ahead, 0)

    def sees(self, filtering: frozenset[str]) -> frozenset[str]:
        """What may be seen with this horizon, given what a filter may see.

        >>> sorted(Horizon.parse("smooth", 9).sees(frozenset({"ranges", "sight"})))
        ['future-ranges', 'ranges', 'sight']
        >>> sorted(Horizon.parse("predict:3", 9).sees(frozenset({"ranges"})))
        ['ranges-3-steps-old']
        """
        if self.kind == SMOOTH:
            future = {f"future-{what}" for what in filtering if what.endswith("ranges")}
            return filtering | future
        if self.kind == PREDICT:
            return frozenset(f"{what}-{self.ahead}-steps-old" if "ranges" in what else what for what in filtering)
        return filtering

    @classmethod
    def parse(cls, text: "str | Horizon", steps: int | None) -> "Horizon":
        """The horizon that a text names.

        Parameters
        ----------
        text
            ``"filter"``, ``"predict:N"`` or ``"smooth"``.
        steps
            Number of steps of the record; None: not known yet.

        Raises
        ------
        InputError
            If it names none, or predicts beyond the record.

        Examples
        --------
        >>> Horizon.parse("predict:3", steps=10)
        Horizon(kind='predict', ahead=3)
        """
        if isinstance(text, Horizon):
            found = text
        else:
            kind, _, number = str(text).partition(":")
            if kind not in (FILTER, PREDICT, SMOOTH) or bool(number) != (kind == PREDICT):
                raise InputError(f"the horizon is {text!r}", f"Give {KNOWN}")
            if kind == PREDICT and not number.isdigit():
                raise InputError(f"the horizon is {text!r}", "Give a whole number of steps, for example predict:3")
            found = cls(kind, int(number) if number else 0)
        if found.kind == PREDICT and found.ahead < 1:
            raise InputError(f"the horizon predicts {found.ahead} steps ahead", "Give at least one, or use filter")
        if steps is not None and found.ahead > steps:
            raise InputError(
                f"the horizon predicts {found.ahead} steps ahead, the record has {steps}",
                f"Give at most predict:{steps}, or a scenario with more steps",
            )
        return found
