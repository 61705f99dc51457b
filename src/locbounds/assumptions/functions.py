"""What is measured, as a function of the state: whether it jumps, and whether its slope has a finite mean square.

Measurements of this library are decided by what they are; somebody's own functions are searched over draws of the
state at the steps that report (:mod:`locbounds.probes`). What such a search finds is there; what it does not find may
still be, in a part that few draws come near.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.assumptions.reach import looked_at, meets, position_laws, states
from locbounds.axes import Array, ndarray
from locbounds.measurement import BySight, is_own, pole
from locbounds.model import AdditiveChannel, DensityMotion, JumpMarkov
from locbounds.model.from_scenario import LinkFunction
from locbounds.plan_assumptions import steep_words
from locbounds.precision import double_precision, traced
from locbounds.priors import DensityPrior
from locbounds.probes import find_jump, once, steepest
from locbounds.probes.jumps import segments
from locbounds.scenario import Scenario
from locbounds.verdict import Assumption

SEGMENTS = 256


class _Function(NamedTuple):
    """A channel's function, and the measurements that it is made of (none: somebody's own)."""

    name: str
    h: Any
    modes: int
    view: ndarray
    reports: Any
    made_of: tuple[Any, ...]

    @property
    def own(self) -> bool:
        return not self.made_of or any(is_own(m) for m in self.made_of)


class Findings(NamedTuple):
    """What was found about somebody's own functions, in words, or None."""

    jump: str | None = None
    infinite: str | None = None
    nearly: str | None = None


def functions(subject: Scenario | JumpMarkov) -> list[_Function]:
    """What a scenario's links or a model's additive channels measure."""
    if isinstance(subject, Scenario):
        view = np.array(subject.motion.position_index)
        return [
            _Function(
                f"the measurement of anchor {link.name}",
                LinkFunction(link.measurement),
                len(link.noises),
                view,
                link.reports,
                _parts(link.measurement),
            )
            for link in subject.links
        ]
    everything = np.arange(subject.state_size)
    return [
        _Function(
            f"h of channel {c}",
            channel.h,
            len(channel.noises),
            everything if channel.view is None else np.array(channel.view),
            channel.reports,
            _parts(channel.h.measurement) if isinstance(channel.h, LinkFunction) else (),
        )
        for c, channel in enumerate(subject.channels)
        if isinstance(channel, AdditiveChannel)
    ]


def _parts(measurement: Any) -> tuple[Any, ...]:
    return measurement.measurements if isinstance(measurement, BySight) else (measurement,)


def discontinuous(subject: Scenario | JumpMarkov) -> str | None:
    """Which measurement jumps from one state to the next, and where, or None."""
    if traced(subject):
        return None
    for f in functions(subject):
        if any(not getattr(m, "continuous", True) for m in f.made_of):
            return f"{f.name} jumps where the line of sight is lost"
    return own_functions(subject).jump


def infinite_information(subject: Scenario | JumpMarkov) -> str | None:
    """Which measurement is so steep somewhere that the expected information is infinite, or None.

    A slope that grows like ``1/r`` has no finite mean square over a density that is positive where r vanishes, if
    that is a set of codimension one or two: for a path loss the anchor, in as many directions as the position spreads
    at some step; for a bearing in three dimensions the vertical through the anchor.
    """
    if traced(subject):
        return None
    return _at_a_pole(subject) or own_functions(subject).infinite


def nearly_infinite(subject: Scenario | JumpMarkov) -> str | None:
    """What has to be taken on trust of a function that is very steep somewhere, or None."""
    return None if traced(subject) else own_functions(subject).nearly


@double_precision
def _at_a_pole(subject: Scenario | JumpMarkov) -> str | None:
    poles = [(f, p) for f in functions(subject) for m in f.made_of if (p := pole(m)) is not None]
    laws = position_laws(subject) if poles else []
    for f, p in poles:
        part = np.arange(2) if p.vertical else np.arange(len(p.place))
        v = f.view[part]
        for mean, covariance in laws:
            for k in looked_at(f.reports, len(mean)) - 1:
                if meets(mean[k][v], covariance[k][np.ix_(v, v)], p.place[part]) in (1, 2):
                    where = "on the vertical through it" if p.vertical and len(p.place) > 2 else "at the anchor"
                    return (
                        f"{f.name} grows infinitely steep {where}: its expected information is infinite where the "
                        "mobile may come there; the model needs a radius within which it stays finite"
                    )
    return None


@once
def own_functions(subject: Scenario | JumpMarkov) -> Findings:
    """What a search finds about the functions that are somebody's own."""
    return _searched(subject)


@double_precision
def _searched(subject: Scenario | JumpMarkov) -> Findings:
    own = [f for f in functions(subject) if f.own]
    if not own:
        return Findings()
    surely_positive = not (isinstance(subject.motion, DensityMotion) or isinstance(subject.prior, DensityPrior))
    x = states(subject)
    found = Findings()
    for f in own:
        k = looked_at(f.reports, subject.steps)
        if not len(k):
            continue
        one = _search(f, x[k][..., f.view], k, surely_positive)
        found = Findings(*(a or b for a, b in zip(found, one, strict=True)))
    return found


def _search(f: _Function, x: ndarray, k: ndarray, surely_positive: bool) -> Findings:
    """x: draws [steps, n, view] at the steps k."""
    half = x.shape[1] // 2
    law = np.resize(np.arange(len(k)), SEGMENTS)
    row = np.arange(SEGMENTS) // len(k) % half
    low, high = segments(x[law, row], x[law, half + row])
    first = np.asarray(_values(f.h, f.modes, low, k[law]))
    modes = [r for r in range(f.modes) if not any(np.array_equal(first[r], first[q]) for q in range(r))]
    jump = infinite = nearly = None
    periodic = any(getattr(m, "periodic", False) for m in f.made_of)
    anchors = [np.asarray(m.anchor) for m in f.made_of if hasattr(m, "anchor")]
    anchors = [a for a in anchors if a.shape == x.shape[-1:]]
    for r in modes:

        def values(points: ndarray, r: int = r) -> ndarray:
            flat = points.reshape(-1, points.shape[-1])
            every = np.repeat(k[law], points.shape[1])
            return np.asarray(_values(f.h, f.modes, flat, every)[r]).reshape(points.shape[:2])

        there = find_jump(values, low, high, periodic=periodic)
        if there is not None:
            jump = jump or f"{f.name} jumps by {there[1]:.3g} at ({_numbers(there[0])})"
        steep = steepest(
            lambda p, law, r=r: np.asarray(_slopes(f.h, f.modes, p, k[law])[r]),
            x,
            candidates=np.array(anchors) if anchors else None,
        )
        if steep is None:
            continue
        if steep.infinite and surely_positive:
            infinite = infinite or f"{f.name} grows infinitely steep: {steep_words('h', steep)}"
        else:
            nearly = nearly or f"{f.name}: {steep_words('h', steep._replace(infinite=None))}"
    return Findings(jump, infinite, nearly)


def _numbers(place: ndarray) -> str:
    return ", ".join(f"{v:.4g}" for v in np.round(place, 9) + 0.0)


@eqx.filter_jit
def _values(h: Any, modes: int, x: Array, k: Array) -> Array:
    """[modes, n]."""
    return jnp.stack([jax.vmap(lambda x, k, r=r: _number(h(x, r, k)))(x, k) for r in range(modes)])


@eqx.filter_jit
def _slopes(h: Any, modes: int, x: Array, k: Array) -> Array:
    """[modes, n, view]."""
    return jnp.stack([jax.vmap(jax.grad(lambda x, k, r=r: _number(h(x, r, k))))(x, k) for r in range(modes)])


def _number(value: Any) -> Array:
    return jnp.reshape(jnp.asarray(value, dtype=float), ())


CONTINUOUS_FUNCTIONS = Assumption("what is measured is continuous in the state", discontinuous)
FINITE_GEOMETRY = Assumption(
    "what is measured has a slope of finite mean square", infinite_information, trusted=nearly_infinite
)
