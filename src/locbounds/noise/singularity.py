r"""Where a density is not smooth, and what that does to its Fisher information.

Near a place x0 a density of the library is ``p(x0 + t) = analytic(t) + right t_+^a + left t_-^a`` with higher
exponents left out, ``t_+ = max(t, 0)`` and ``t_- = max(-t, 0)``. The information about a shift,
``int p'^2 / p``, is finite near x0 exactly if the root of p has a square integrable derivative there
(Hájek 1972; Ibragimov and Has'minskii 1981, ch. II.1):

==========================  =================================  ==================================================
at x0                       name                               information
==========================  =================================  ==================================================
``a < 0``                   pole                               infinite: ``p'^2/p ~ t^(a-2)``
``a = 0``, left /= right    jump                               infinite: the root of p is not continuous
``p(x0) = 0``, ``a <= 1``   edge, or zero inside               infinite: ``p'^2/p ~ a^2 t^(a-2)``
``p(x0) = 0``, ``a > 1``    edge, or zero inside               finite
``p(x0) > 0``, ``a <= 1/2`` cusp                               infinite: ``p'^2 ~ t^(2a-2)``
``p(x0) > 0``, ``a > 1/2``  cusp (a < 1), kink (a = 1)         finite, but ``-E[d score]`` misses the change of p'
==========================  =================================  ==================================================

Convolution adds places and exponents, ``a + b + 1`` (in the Fourier domain the leading terms multiply), so that the
singularities of a sum of independent noises follow from those of its parts.
"""

from collections.abc import Iterable
from itertools import product
from math import cos, gamma, inf, isclose, pi, sin
from typing import NamedTuple

SAME_PLACE = 1e-12  # relative to the scale of the places: rounding of their sums
CANCELS = 1e-12

Pieces = tuple[tuple[float, float], ...]
"""Open intervals on which a density is positive."""


class Singularity(NamedTuple):
    """A place where a density is not analytic; see the module.

    Attributes
    ----------
    place
        In metres.
    exponent
        Leading exponent a of the part that is not analytic.
    left, right
        Its coefficients on both sides.
    logarithm
        Whether that part carries a factor ``log |t|``.

    Examples
    --------
    A density that starts at 2 m like ``0.5 t``:

    >>> Singularity(place=2.0, exponent=1.0, left=0.0, right=0.5).exponent
    1.0
    """

    place: float
    exponent: float
    left: float
    right: float
    logarithm: bool = False


class Finding(NamedTuple):
    """One piece of evidence about the regularity of a density.

    Attributes
    ----------
    place
        In metres.
    kind
        ``"jump"``, ``"edge"``, ``"zero"``, ``"pole"``, ``"cusp"``, ``"kink"`` or what was measured.
    exponent
        Of the density, or of its part that is not smooth.
    finite
        Whether the information is finite there; None: not known.
    text
        In words.
    """

    place: float
    kind: str
    exponent: float
    finite: bool | None
    text: str


def scaled(singularities: Iterable[Singularity], weight: float) -> tuple[Singularity, ...]:
    """Those of ``weight * p``."""
    return tuple(s._replace(left=weight * s.left, right=weight * s.right) for s in singularities)


def shifted(singularities: Iterable[Singularity], by: float) -> tuple[Singularity, ...]:
    """Those of ``p(w - by)``."""
    return tuple(s._replace(place=s.place + by) for s in singularities)


def _product(a: Singularity, b: Singularity) -> Singularity:
    """Leading singularity of the convolution of two singular parts.

    With ``g = a + b + 1`` and the Fourier transform ``Gamma(a+1) (i k)^(-a-1)`` of ``t_+^a``, the coefficients obey
    ``r exp(-i pi (g+1)/2) + l exp(i pi (g+1)/2) = sum of the parts' products``; where one of the two real equations
    degenerates while its right-hand side does not vanish, the term is ``t^g log |t|``.
    """
    g = a.exponent + b.exponent + 1
    beta = gamma(a.exponent + 1) * gamma(b.exponent + 1) / gamma(g + 1) if g > -1 else inf
    angle = pi * (a.exponent + 1) / 2, pi * (b.exponent + 1) / 2
    real = imaginary = 0.0
    for (side_a, c_a), (side_b, c_b) in product(((1, a.right), (-1, a.left)), ((1, b.right), (-1, b.left))):
        phase = side_a * angle[0] + side_b * angle[1]
        real, imaginary = real + c_a * c_b * beta * cos(phase), imaginary + c_a * c_b * beta * sin(phase)
    size = abs(real) + abs(imaginary)
    even, odd = cos(pi * (g + 1) / 2), sin(pi * (g + 1) / 2)

    def solve(value: float, factor: float) -> tuple[float, bool]:
        if abs(factor) > CANCELS:
            return value / factor, False
        return 0.0, abs(value) > 1e-9 * size

    total, log_even = solve(real, even)
    difference, log_odd = solve(imaginary, odd)
    return Singularity(
        a.place + b.place, g, 0.5 * (total - difference), 0.5 * (total + difference), log_even or log_odd
    )


def of_sum(a: Iterable[Singularity], b: Iterable[Singularity]) -> tuple[Singularity, ...]:
    """Singularities of the sum of two independent noises.

    >>> step = Singularity(0.0, 0.0, 0.0, 1.0)
    >>> of_sum([step], [step])
    (Singularity(place=0.0, exponent=1.0, left=0.0, right=1.0, logarithm=False),)
    """
    found = []
    for x, y in product(a, b):
        s = _product(x, y)
        # up to a power of t, which is analytic: nothing on the side where both parts are zero
        if x.left == y.left == 0:
            s = s._replace(left=0.0, right=_moved(s.exponent, s.left, s.right))
        elif x.right == y.right == 0:
            s = s._replace(left=_moved(s.exponent, s.right, s.left), right=0.0)
        found.append(s)
    return tuple(found)


def _moved(exponent: float, gone: float, kept: float) -> float:
    """The coefficient that is left on one side when a power of t takes away that on the other."""
    if exponent != round(exponent):
        return kept
    return kept - gone if round(exponent) % 2 == 0 else kept + gone


def sum_pieces(a: Pieces, b: Pieces) -> Pieces:
    """Where the sum of two independent noises has positive density."""
    return union_pieces(((x + u, y + v) for (x, y), (u, v) in product(a, b)))


def union_pieces(pieces: Iterable[tuple[float, float]]) -> Pieces:
    """Open intervals that overlap, merged; those that only touch stay apart.

    >>> union_pieces([(0.0, 1.0), (0.5, 2.0), (2.0, 3.0)])
    ((0.0, 2.0), (2.0, 3.0))
    """
    merged: list[tuple[float, float]] = []
    for low, high in sorted(pieces):
        if merged and low < merged[-1][1]:
            merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
        else:
            merged.append((low, high))
    return tuple(merged)


def _analytic(exponent: float, left: float, right: float) -> bool:
    """Whether the two sides make one power of t."""
    if exponent != round(exponent) or exponent < 0:
        return False
    mirrored = left if round(exponent) % 2 == 0 else -left
    return isclose(mirrored, right, rel_tol=CANCELS)


def _groups(singularities: Iterable[Singularity]) -> list[list[Singularity]]:
    groups: list[list[Singularity]] = []
    ordered = sorted(singularities, key=lambda s: s.place)
    scale = max((abs(s.place) for s in ordered), default=0.0)
    for s in ordered:
        if groups and s.place - groups[-1][-1].place <= SAME_PLACE * scale:
            groups[-1].append(s)
        else:
            groups.append([s])
    return groups


def findings(singularities: Iterable[Singularity], pieces: Pieces) -> tuple[Finding, ...]:
    """What every place does to the information; parts of one place are added before they are judged."""
    found = (_at_one_place(group, pieces) for group in _groups(singularities))
    return tuple(f for f in found if f is not None)


def _at_one_place(group: list[Singularity], pieces: Pieces) -> Finding | None:
    place = group[0].place
    room = SAME_PLACE * max(abs(place), 1e-300)
    positive = any(low + room < place < high - room for low, high in pieces)
    for exponent in sorted({s.exponent for s in group}):
        parts = [s for s in group if isclose(s.exponent, exponent, abs_tol=1e-9)]
        left, right = sum(s.left for s in parts), sum(s.right for s in parts)
        if not any(s.logarithm for s in parts) and _analytic(exponent, left, right):
            positive = positive or exponent == 0
            continue
        return judge(
            place, exponent, left, right, positive=positive, pieces=pieces, logarithm=any(s.logarithm for s in parts)
        )
    return None


def judge(
    place: float,
    exponent: float,
    left: float,
    right: float,
    *,
    positive: bool,
    pieces: Pieces,
    logarithm: bool = False,
) -> Finding:
    """The table of the module, for one place."""
    where = f"at {place:.6g} m"
    if exponent < 0 or (exponent == 0 and logarithm):
        text = f"the density is unbounded {where} (t^{exponent:.4g})"
        return Finding(place, "pole", exponent, False, text)
    if exponent == 0:
        return Finding(place, "jump", 0.0, False, f"the density jumps {where}")
    if positive:
        if exponent <= 0.5:
            text = f"the density has a cusp of exponent {exponent:.4g} {where} (finite only above 1/2)"
            return Finding(place, "cusp", exponent, False, text)
        kind = "kink" if exponent >= 1 else "cusp"
        smooth = exponent > 1
        text = f"{'a change of curvature' if smooth else 'a ' + kind} {where}, exponent {exponent:.4g}"
        if not smooth:
            text += ": finite there, but only as E[score^2], not as -E[d score]"
        return Finding(place, kind, exponent, True, text)
    ends = {end for piece in (pieces[0][0], pieces[-1][1]) for end in (piece,)}
    edge = any(isclose(place, end, rel_tol=SAME_PLACE) for end in ends)
    kind, name = ("edge", "edge of its support") if edge else ("zero", "zero inside its support")
    way = {1.0: "vanishes linearly"}.get(exponent, f"vanishes like t^{exponent:.4g}")
    text = f"the density {way} {where}, an {name}" if edge else f"the density {way} {where}, a {name}"
    return Finding(place, kind, exponent, exponent > 1, text + ("" if exponent > 1 else " (finite only above t^1)"))
