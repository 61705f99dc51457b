"""Checked values of scenario files: numbers with their sign, vectors, matrices, one value per sight condition.

Each checker takes what the TOML parser gives and returns plain floats and tuples, or raises a
:class:`pydantic_core.PydanticCustomError` whose context carries the remedy.
"""

import math
from typing import Annotated, Any

from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

ROUNDING = 1e-9  # probabilities typed in decimal, or computed, sum to one within this
SIGHT_KEYS = ("los", "nlos")


def fail(cause: str, remedy: str = "") -> PydanticCustomError:
    """An error about one value; the cause continues the sentence that the key's path begins."""
    return PydanticCustomError("locbounds", "{cause}", {"cause": cause, "remedy": remedy})


def number(value: Any) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise fail(f"is {value!r}, not a number", "Write a number without quotes; the unit is part of the key")
    if not math.isfinite(value):
        raise fail(f"is {value}", "Give a finite number")
    return float(value)


def positive(value: Any) -> float:
    """A number above zero."""
    if number(value) <= 0:
        raise fail(f"is {value!r}, but must be positive")
    return float(value)


def not_negative(value: Any) -> float:
    """A number of at least zero."""
    if number(value) < 0:
        raise fail(f"is {value!r}, but must not be negative")
    return float(value)


def probability(value: Any) -> float:
    """A number from 0 to 1."""
    if not 0 <= number(value) <= 1 + ROUNDING:
        raise fail(f"is {value!r}, but must lie between 0 and 1")
    return float(value)


def whole(value: Any) -> int:
    """A whole number of at least one."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise fail(f"is {value!r}, not a whole number")
    if value < 1:
        raise fail(f"is {value}, but must be at least 1")
    return value


def words(value: Any) -> str:
    """Text."""
    if not isinstance(value, str):
        raise fail(f"is {value!r}, not text", "Write it in quotes")
    return value


def vector(value: Any, each=number) -> tuple[float, ...]:
    """A list of numbers."""
    if not isinstance(value, list):
        raise fail(f"is {value!r}, not a list of numbers", "Write it in square brackets, for example [500, 500]")
    return tuple(each(v) for v in value)


def point(value: Any) -> tuple[float, ...]:
    """Two or three coordinates."""
    if len(vector(value)) not in (2, 3):
        raise fail(f"has {len(value)} coordinates", "Give 2 or 3, for example [500, 500]")
    return vector(value)


def matrix(value: Any) -> tuple[tuple[float, ...], ...]:
    """A square matrix."""
    if not isinstance(value, list) or not all(isinstance(row, list) and len(row) == len(value) for row in value):
        raise fail(f"is {value!r}, not a square matrix", "Write it row by row, for example [[1, 0], [0, 1]]")
    return tuple(vector(row) for row in value)


def spread(value: Any) -> float | tuple:
    """A standard deviation, one per axis, or a covariance matrix."""
    if isinstance(value, list) and value and isinstance(value[0], list):
        return matrix(value)
    try:
        return vector(value, positive) if isinstance(value, list) else positive(value)
    except PydanticCustomError as error:
        if value == 0 or (isinstance(value, list) and 0 in value):
            raise fail(
                f"is {value!r}, but must be positive", "A start known exactly is a covariance of zeros"
            ) from error
        raise


def per_axis(value: Any) -> float | tuple[float, ...]:
    """A number that is not negative, or one per axis."""
    return vector(value, not_negative) if isinstance(value, list) else not_negative(value)


def by_sight(value: Any, each=number) -> tuple[float, float]:
    """One value per sight condition, ``{ los = .., nlos = .. }``, as (LOS, NLOS)."""
    if not isinstance(value, dict) or set(value) != set(SIGHT_KEYS):
        raise fail(f"is {value!r}", "Write one value per sight condition: { los = .., nlos = .. }")
    return each(value["los"]), each(value["nlos"])


def law(value: Any) -> tuple[float, float]:
    """Probabilities of LOS and NLOS that sum to one."""
    pair = by_sight(value, probability)
    if abs(sum(pair) - 1) > ROUNDING:
        raise fail(f"is {value!r}, which sums to {sum(pair):.6g}", "The probabilities of LOS and NLOS must sum to one")
    return pair


def stay(value: Any) -> float | tuple[float, float]:
    """A probability for both sight conditions, or one for each."""
    return by_sight(value, probability) if isinstance(value, dict) else probability(value)


def chain(value: Any) -> tuple[tuple[float, ...], ...]:
    """A 2 x 2 matrix of probabilities whose rows sum to one."""
    rows = matrix(value)
    if len(rows) != 2:
        raise fail(f"has {len(rows)} rows", "Give a 2 x 2 matrix: row i holds Pr(next = j | now = i), j = LOS, NLOS")
    for i, row in enumerate(rows):
        if min(row) < 0 or abs(sum(row) - 1) > ROUNDING:
            raise fail(
                f"has row {i + 1} = {list(row)}, which sums to {sum(row):.6g}",
                "Every row holds Pr(next = LOS), Pr(next = NLOS) given the sight now: not negative, summing to one",
            )
    return rows


Number = Annotated[float, BeforeValidator(number)]
Positive = Annotated[float, BeforeValidator(positive)]
Probability = Annotated[float, BeforeValidator(probability)]
Whole = Annotated[int, BeforeValidator(whole)]
Text = Annotated[str, BeforeValidator(words)]
Numbers = Annotated[tuple[float, ...], BeforeValidator(vector)]
Positives = Annotated[tuple[float, ...], BeforeValidator(lambda v: vector(v, positive))]
Point = Annotated[tuple[float, ...], BeforeValidator(point)]
Matrix = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(matrix)]
PerAxis = Annotated[Any, BeforeValidator(per_axis)]
Spread = Annotated[Any, BeforeValidator(spread)]
Stay = Annotated[Any, BeforeValidator(stay)]
Law = Annotated[tuple[float, float], BeforeValidator(law)]
Dwell = Annotated[tuple[float, float], BeforeValidator(lambda v: by_sight(v, positive))]
Chain = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(chain)]
