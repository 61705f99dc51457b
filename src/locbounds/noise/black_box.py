r"""Whether a density about which nothing is declared has a finite Fisher information.

Sampling cannot prove smoothness, so three answers are possible. The log-density is looked at on a grid of the
region where it is within 60 of its maximum; intervals over which its slope changes far more than in their
neighbourhood are halved down to the spacing of doubles. What is left is a place, and its surroundings over many
decades of the distance t say what it is:

* a change that does not shrink with t is a jump: irregular;
* at an end of the support, or where the density falls to zero inside it, the local exponent
  ``a = d log p / d log t`` is measured over decades. Where it is the same over the last decades, it is the exponent:
  irregular for ``a <= 1``, regular for ``a > 1``. Where it still drifts, the verdict is undecided:
  ``p = t log(1/t)^-2`` is regular, ``p = t log(1/t)`` is not, and both have exponents that creep towards 1;
* where the density is positive, the exponent b of its change, ``|p(x0 + t) - p(x0)| ~ t^b``, is measured: a kink
  (b = 1) or a cusp (1/2 < b < 1) is regular, ``b <= 1/2`` irregular, and a change steep beyond resolution undecided.

A growing mean of squared scores over nested samples is evidence as well: where nothing was found at any place although
that mean keeps growing, the verdict is undecided.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.noise.regularity import Regularity
from locbounds.noise.singularity import Finding
from locbounds.precision import double_precision

GRID = 4096  # places looked at first
SUSPECTS = 24  # most rough places that are examined
DECADES = np.arange(1, 13)  # distances 10^-k of the width of the law
STABLE = 0.005  # an exponent is taken as measured where the last decades agree within this
NEAR_ONE = 0.05  # and is compared with a critical exponent where it is no closer than this, unless it agrees with it
EXACT = 2e-3  # agreement with a critical exponent
LogDensity = Callable[[ndarray], ndarray]


class Local(NamedTuple):
    """What was measured at one place, on one side."""

    exponent: float
    spread: float


def examine(noise: Any) -> Regularity:
    """The verdict on a noise that declares no singularities.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from locbounds.noise import FromLogDensity
    >>> ramp = FromLogDensity(lambda w: jnp.log(2 * w), support=(0.0, 1.0))
    >>> examine(ramp).status
    'irregular'
    """
    log_p = double_precision(jax.jit(lambda w: noise.log_prob(w)))

    def padded(w: ndarray) -> ndarray:  # one compiled shape
        w = np.asarray(w, dtype=float).ravel()
        rows = np.concatenate([w, np.full(-len(w) % GRID, w[-1])]).reshape(-1, GRID)
        return np.concatenate([np.asarray(log_p(row)) for row in rows])[: len(w)]

    pieces = noise.support()
    places = np.asarray(double_precision(noise.landmarks)())
    return examine_density(padded, pieces[0][0], pieces[-1][1], places, _width(padded, places))


def _width(log_p: LogDensity, places: ndarray) -> float:
    """Twice the interquartile range, roughly."""
    w = _subdivided(places, 10)
    middle = 0.5 * (w[1:] + w[:-1])
    values = log_p(middle)
    below = np.cumsum(np.diff(w) * np.exp(values - np.max(values)))
    low, high = np.interp([0.25, 0.75], below / below[-1], middle)
    return 2 * float(high - low)


def examine_density(
    log_p: LogDensity, low: float, high: float, landmarks: Float[ndarray, " k"], width: float
) -> Regularity:
    """The verdict on a log-density given as a function.

    Parameters
    ----------
    log_p
        Vectorised; may be minus infinity.
    low, high
        Ends of the support, infinite where there are none.
    landmarks
        Ordered places with practically all mass between the first and the last, dense where the mass is.
    width
        Scale of the law in metres, such as twice its interquartile range.
    """
    inside = landmarks[(landmarks > low) & (landmarks < high)]
    values = log_p(inside)
    if not np.all(np.isfinite(values) | (values == -np.inf)):
        return Regularity(None, "the log-density is not a number somewhere inside its support")
    core = inside[values > values.max() - 60]
    found: list[Finding] = []
    for end, side in ((low, 1.0), (high, -1.0)):
        if np.isfinite(end):
            found.append(_edge(log_p, end, side, width))
    for place in _suspects(log_p, core):
        if min(abs(place - low), abs(place - high)) > 1e-6 * width:
            finding = _interior(log_p, place, width)
            if finding is not None:
                found.append(finding)
    return _verdict(found, log_p, core)


def _verdict(found: list[Finding], log_p: LogDensity, core: ndarray) -> Regularity:
    places = tuple(found)
    bad = [f for f in found if f.finite is False]
    if bad:
        return Regularity(False, f"{bad[0].text} (measured)", places)
    unsure = [f for f in found if f.finite is None]
    if unsure:
        return Regularity(None, unsure[0].text, places)
    growth = _growth(log_p, core)
    if growth > 0.1:
        text = (
            f"the mean squared slope of the log-density grows by {growth:.0%} when the grid is refined sixteenfold, "
            "although no single place explains it"
        )
        return Regularity(None, text, (*places, Finding(float("nan"), "growth", float("nan"), None, text)))
    text = "; ".join(f.text for f in found) or "no jump, zero, kink or steep place found"
    return Regularity(True, f"examined as a black box: {text}", places)


def _growth(log_p: LogDensity, core: ndarray) -> float:
    """Relative growth of the mean squared slope from a grid to one sixteen times finer."""

    def mean(n: int) -> float:
        w = _subdivided(core, n)
        values = log_p(w)
        ok = np.isfinite(values[1:]) & np.isfinite(values[:-1])
        step = np.diff(w)[ok]
        p = step * np.exp(0.5 * (values[1:] + values[:-1])[ok] - values.max())
        return float((p * (np.diff(values)[ok] / step) ** 2).sum() / p.sum())

    coarse, fine = mean(32), mean(512)
    return fine / coarse - 1 if coarse > 0 else 0.0


def _subdivided(places: ndarray, n: int) -> ndarray:
    """Every interval in n equal parts."""
    parts = places[:-1, None] + np.diff(places)[:, None] * np.arange(n) / n
    return np.unique(np.append(parts.ravel(), places[-1]))


def _suspects(log_p: LogDensity, core: Float[ndarray, " k"]) -> list[float]:
    """Places inside at which the log-density changes abruptly, found by halving the roughest intervals."""
    w = _subdivided(core, 40)
    values = log_p(w)
    peak = values.max()
    change = np.abs(np.diff(np.where(np.isfinite(values), values, peak - 800)))
    relevant = np.maximum(values[1:], values[:-1]) > peak - 40
    bend = np.zeros(len(w))
    slopes = np.diff(np.where(np.isfinite(values), values, peak - 800)) / np.diff(w)
    bend[1:-1] = np.abs(np.diff(slopes)) * np.maximum(np.diff(w)[1:], np.diff(w)[:-1])
    typical = np.median(change[relevant]) + 1e-12
    near = np.maximum(bend[1:], bend[:-1])
    around = np.array([np.median(near[max(0, i - 40) : i + 41]) for i in range(0, len(near), 20)])
    local = np.repeat(around, 20)[: len(near)]
    rough = relevant & (near > 8 * local + 1e-9 * (1 + typical))
    index = np.flatnonzero(rough)
    if not index.size:
        return []
    groups = np.split(index, np.flatnonzero(np.diff(index) > 2) + 1)
    groups.sort(key=lambda g: -near[g].max())
    return [
        _home_in(log_p, float(w[max(g[0] - 1, 0)]), float(w[min(g[-1] + 2, len(w) - 1)]), peak)
        for g in groups[:SUSPECTS]
    ]


def _home_in(log_p: LogDensity, low: float, high: float, peak: float) -> float:
    """Where within [low, high] the log-density bends or jumps most, to the spacing of doubles."""
    for _ in range(40):
        w = np.linspace(low, high, 33)
        values = log_p(w)
        values = np.where(np.isfinite(values), values, peak - 800)
        slopes = np.diff(values)
        bends = np.abs(np.diff(slopes))
        lowest = np.argmin(values)
        deep = values[lowest] < np.median(values) - 2 and 0 < lowest < 32
        i = lowest if deep else int(np.argmax(bends)) + 1
        step = w[1] - w[0]
        if step < 4 * np.spacing(max(abs(low), abs(high), 1e-300)) or bends.max() == 0:
            return float(w[i])
        low, high = w[max(i - 2, 0)], w[min(i + 2, 32)]
    return 0.5 * (low + high)


def _distances(place: float, width: float) -> ndarray:
    smallest = 1e3 * np.spacing(max(abs(place), width * 1e-16))
    t = width * 10.0 ** -np.arange(1.0, 13.0, 0.5)
    return t[t > smallest]


def _exponents(t: ndarray, log_values: ndarray) -> ndarray:
    return np.diff(log_values) / np.diff(np.log(t))


def _measured(t: ndarray, log_values: ndarray) -> Local:
    """Limit of the local exponent as t falls, and how much it still drifts."""
    if not np.all(np.isfinite(log_values[-6:])):
        return Local(float("nan"), np.inf)
    last = _exponents(t[-6:], log_values[-6:])
    if len(last) < 4:
        return Local(float("nan"), np.inf)
    return Local(float(last[-1]), float(np.ptp(last)))


def _edge(log_p: LogDensity, end: float, side: float, width: float) -> Finding:
    t = _distances(end, width)
    values = log_p(end + side * t)
    there = np.isfinite(values)
    where = f"at {end:.6g} m, an end of its support"
    fast = np.log(t[-1] / t[0]) * 5  # what t^5 falls by
    if not there[-1] or values[-1] < values[0] - 200 or values[-1] - values[0] < fast:
        return Finding(end, "edge", np.inf, True, f"the density vanishes faster than t^5 {where}")
    a, spread = _measured(t, values)
    if not spread < STABLE:
        if np.all(_exponents(t[-6:], values[-6:]) > 2):
            return Finding(end, "edge", a, True, f"the density vanishes like t^{a:.3g} or faster {where}")
        text = f"the exponent of the density drifts (last {a:.3g}, by {spread:.2g} over two decades) {where}"
        return Finding(end, "edge", a, None, text)
    if abs(a) < EXACT:
        return Finding(end, "jump", 0.0, False, f"the density jumps {where}")
    if a < 0:
        return Finding(end, "pole", a, False, f"the density is unbounded (t^{a:.3g}) {where}")
    if abs(a - 1) < EXACT and spread < EXACT:
        return Finding(end, "edge", 1.0, False, f"the density vanishes linearly {where}")
    if abs(a - 1) < NEAR_ONE:
        return Finding(end, "edge", a, None, f"the exponent {a:.3g} of the density is too close to 1 {where}")
    return Finding(end, "edge", a, a > 1, f"the density vanishes like t^{a:.3g} {where}")


def _interior(log_p: LogDensity, place: float, width: float) -> Finding | None:
    t = _distances(place, width)
    t = t[t < 0.03 * width]
    right, left = log_p(place + t), log_p(place - t)
    at = float(log_p(np.array([place]))[0])
    where = f"at {place:.6g} m"
    gap = np.abs(right - left)
    if np.isinf(right[-1]) != np.isinf(left[-1]):
        solid, side = (left, -1.0) if np.isinf(right[-1]) else (right, 1.0)
        del solid
        return _edge(log_p, place, side, width)._replace(place=place)
    if np.isinf(right[-1]):
        return Finding(place, "gap", np.nan, None, f"the density is zero around {where[3:]}, inside its support")
    sides = [_measured(t, values) for values in (left, right)]
    if all(a.spread < STABLE and a.exponent > EXACT for a in sides):
        a = min(side.exponent for side in sides)
        if abs(a - 1) < NEAR_ONE:
            sure = abs(a - 1) < EXACT
            return Finding(place, "zero", a, False if sure else None, f"the density vanishes like t^{a:.3g} {where}")
        return Finding(place, "zero", a, a > 1, f"the density vanishes like t^{a:.3g} {where}, inside its support")
    if all(a.spread < STABLE and a.exponent < -EXACT for a in sides):
        return Finding(place, "pole", sides[0].exponent, False, f"the density is unbounded {where}")
    if gap[-1] > 1e-3 and gap[-1] > 0.9 * gap[len(gap) // 2]:
        return _jump_or_steep(log_p, place, gap[-1], width, where)
    if gap[-1] > 1e-3:
        return Finding(place, "steep", np.nan, None, f"the density changes steeply {where}, beyond resolution")
    change = np.maximum(np.abs(right - at), np.abs(left - at))
    usable = change > 1e-11
    if usable.sum() < 6:
        return None
    b, spread = _measured(t[usable], np.log(change[usable]))
    if b > 1.5:
        return None
    if not spread < 2 * STABLE:
        return Finding(place, "kink", b, None, f"the exponent of a change of the density drifts (last {b:.3g}) {where}")
    if abs(b - 0.5) < NEAR_ONE:
        return Finding(
            place, "cusp", b, None if b > 0.5 - EXACT and abs(b - 0.5) > EXACT else False, f"a cusp t^{b:.3g} {where}"
        )
    if b < 0.5:
        return Finding(place, "cusp", b, False, f"a cusp t^{b:.3g} {where}")
    slopes = (right - at) / t, (at - left) / t
    k = np.flatnonzero(usable)[-1]
    if b > 0.95 and abs(slopes[0][k] - slopes[1][k]) < 0.02 * max(abs(slopes[0][k]), abs(slopes[1][k])):
        return None
    name = "kink" if b > 0.95 else f"cusp t^{b:.3g}"
    return Finding(place, name, b, True, f"a {name} {where}: finite there, but only as E[score^2], not as -E[d score]")


def _jump_or_steep(log_p: LogDensity, place: float, gap: float, width: float, where: str) -> Finding:
    """A jump changes from one double to the next; a steep place takes several."""
    ulp = np.spacing(max(abs(place), width * 1e-16))
    values = log_p(place + ulp * np.arange(-64, 65))
    one = np.abs(np.diff(values)).max()
    if one > 0.9 * gap:
        return Finding(place, "jump", 0.0, False, f"the density jumps {where} (by {np.expm1(gap):.2g} of its value)")
    return Finding(place, "steep", np.nan, None, f"the density changes steeply {where}: no jump, but beyond resolution")
