"""A scenario: what is located, from what, with which prior knowledge."""

import dataclasses
import hashlib
import re
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.errors import InputError
from locbounds.measurement import Anchored, BySight
from locbounds.motion import Motion, SwitchingMotion
from locbounds.noise import Noise
from locbounds.precision import traced
from locbounds.priors import GaussianPrior
from locbounds.sight import KnownSight, Sight
from locbounds.stacks import stacks
from locbounds.times import Times


def _equal(a: Sight, b: Sight) -> bool:
    """Whether two chains are the same, leaf by leaf; traced ones are taken to be."""
    (leaves_a, tree_a), (leaves_b, tree_b) = jax.tree.flatten(a), jax.tree.flatten(b)
    same = zip(leaves_a, leaves_b, strict=False)
    return tree_a == tree_b and (traced(a, b) or all(np.array_equal(x, y) for x, y in same))


class Link(eqx.Module):
    """The radio link between the mobile and one anchor.

    Parameters
    ----------
    name
        Name of the anchor.
    measurement
        What is measured: ``h(position)``, or one such measurement per sight condition (:class:`BySight`).
    sight
        The chain of sight conditions.
    noises
        One noise per sight condition, (LOS, NLOS), or more.
    reports
        Which of the steps 1..K have a measurement, [steps]; None means all.
    chain
        Name of the chain. Links with the same chain name switch together; None: a chain of its own.

    Examples
    --------
    >>> import locbounds as lb
    >>> Link("bs1", lb.Range([0, 0]), lb.MarkovSight.stay(0.9), (lb.Gaussian(0, 150), lb.Gaussian(513, 436))).name
    'bs1'
    """

    name: str = eqx.field(static=True)
    measurement: Anchored | BySight
    sight: Sight
    noises: tuple[Noise, ...]
    reports: Bool[Array, " steps"] | None = None
    chain: str | None = eqx.field(static=True, default=None)

    def replace(self, **changes) -> "Link":
        """A copy with some fields changed."""
        return dataclasses.replace(self, **changes)


def alike(links: tuple[Link, ...]) -> list[tuple[np.ndarray, Link]]:
    """Links of the same structure as one link whose numbers have a leading axis, and which of the links these are.

    What is the same for every link is then traced and compiled once for all of them, by ``jax.vmap``.

    >>> import locbounds as lb
    >>> [(index, link),] = alike(lb.papers.fritsche2013.scenario().links)
    >>> index.tolist(), link.measurement.anchor.shape
    ([0, 1, 2], (3, 2))
    """
    return stacks(Link("", a.measurement, a.sight, a.noises, a.reports) for a in links)


class Scenario(eqx.Module):
    """Everything a bound or a filter needs to know; immutable, a JAX pytree with NumPy float64 leaves.

    Parameters
    ----------
    title
        One line that names it.
    times
        Times of steps 0..K.
    motion
        Motion model of the mobile.
    prior
        Law of the state at step 0.
    links
        The links to the anchors. Their noises are independent of each other, and so are their chains, unless links
        (and a switching motion) name one chain in common.

    Raises
    ------
    InputError
        If pieces do not fit: dimensions, numbers of modes, names, steps.

    Examples
    --------
    >>> import locbounds as lb
    >>> link = Link("bs1", lb.Range([0, 0]), lb.MarkovSight.stay(0.9), (lb.Gaussian(0, 150), lb.Gaussian(513, 436)))
    >>> prior = lb.GaussianPrior([500, 500, 5, 5], np.diag([2500.0, 2500.0, 4.0, 4.0]))
    >>> Scenario("one anchor", lb.Times.uniform(step_s=0.2, steps=100), lb.ConstantVelocity(0.5), prior, [link]).steps
    100
    """

    title: str = eqx.field(static=True)
    times: Times
    motion: Motion
    prior: GaussianPrior
    links: tuple[Link, ...] = eqx.field(converter=tuple)

    def __check_init__(self):
        if not self.links:
            raise InputError("the scenario has no anchors", "Give at least one")
        names = [link.name for link in self.links]
        if len(set(names)) < len(names):
            raise InputError(f"anchor names repeat: {names}", "Give every anchor its own name")
        if len(self.prior.mean) != self.motion.state_size:
            raise InputError(
                f"the prior has {len(self.prior.mean)} components, the motion model {self.motion.state_size}",
                f"Give one prior number per state component: {', '.join(self.motion.state_names)}",
            )
        for link in self.links:
            if len(link.measurement.anchor) != self.dim:
                raise InputError(
                    f"anchor {link.name} has {len(link.measurement.anchor)} coordinates, the motion model {self.dim}",
                    "Use the same number of dimensions everywhere",
                )
            if len(link.noises) != len(link.sight.start):
                raise InputError(
                    f"anchor {link.name} has {len(link.noises)} noises for {len(link.sight.start)} sight conditions",
                    "Give one noise per sight condition",
                )
            of = link.measurement
            if isinstance(of, BySight) and len(of.measurements) != len(link.noises):
                raise InputError(
                    f"anchor {link.name} has {len(of.measurements)} measurements, {len(link.noises)} sight conditions",
                    "Give one measurement per sight condition",
                )
            if link.reports is not None and np.shape(link.reports) != (self.steps,):
                raise InputError(
                    f"anchor {link.name} says for {np.shape(link.reports)[0]} steps whether it reported, "
                    f"the scenario has {self.steps}",
                    "Give one truth value per step 1..K",
                )
        named = [(link.chain, link.sight, link.name) for link in self.links]
        if isinstance(self.motion, SwitchingMotion):
            named.append((self.motion.chain, self.motion.sight, "motion"))
        for i, (chain, sight, name) in enumerate(named):
            for other, other_sight, other_name in named[:i]:
                if chain is not None and chain == other and not _equal(sight, other_sight):
                    raise InputError(
                        f"{other_name} and {name} name the same chain {chain}, but their sights differ",
                        "Give both the same sight, or chains of their own",
                    )

    @property
    def steps(self) -> int:
        """Number of measurement steps K; results have K + 1 rows, step 0 being the prior."""
        return self.times.steps

    @property
    def dim(self) -> int:
        """Number of position coordinates."""
        return self.motion.dim

    @property
    def anchors(self) -> Float[Array, "links space"]:
        """Anchor positions in metres."""
        stack = np.stack if not any(isinstance(a.measurement.anchor, jax.Array) for a in self.links) else jnp.stack
        return stack([link.measurement.anchor for link in self.links])

    @property
    def reports(self) -> Bool[Array, "steps links"]:
        """Which link reported at which of the steps 1..K."""
        everywhere = np.ones(self.steps, dtype=bool)
        return np.stack([everywhere if link.reports is None else link.reports for link in self.links], axis=1)

    @property
    def transition(self) -> Float[Array, "steps state state"]:
        """F of every step."""
        return self.motion.transitions(self.times.intervals)

    @property
    def process_noise(self) -> Float[Array, "steps state state"]:
        """Q of every step."""
        return self.motion.covariances(self.times.intervals)

    def replace(self, **changes) -> "Scenario":
        """A copy with some fields changed; all checks run again."""
        fields = {name: getattr(self, name) for name in ("title", "times", "motion", "prior", "links")}
        return Scenario(**(fields | changes))

    def anonymous(self) -> "Scenario":
        """The same scenario without title and names: kernels compiled for one serve all of the same shape.

        >>> import locbounds as lb
        >>> lb.papers.fritsche2013.scenario().anonymous().links[2].name
        '2'
        """
        return self.replace(title="", links=[a.replace(name=str(m)) for m, a in enumerate(self.links)])

    def fingerprint(self) -> str:
        """A short text that is the same for scenarios whose numbers are the same to nine digits, whatever their names.

        Empty while JAX traces the scenario.

        >>> import locbounds as lb
        >>> a, b, c = (lb.papers.fritsche2013.scenario(stay=stay) for stay in (0.9, 0.9, 0.6))
        >>> a.fingerprint() == b.replace(title="other").fingerprint(), a.fingerprint() == c.fingerprint()
        (True, False)
        """
        if traced(self):
            return ""
        chains: list[str] = [a.chain for a in self.links if a.chain is not None]
        if isinstance(self.motion, SwitchingMotion):
            chains.append(self.motion.chain or "")
        links = [
            a.replace(
                name="",
                chain=None if chains.count(a.chain or "") < 2 else str(chains.index(a.chain or "")),
                reports=np.ones(self.steps, dtype=bool) if a.reports is None else np.asarray(a.reports, dtype=bool),
            )
            for a in self.links
        ]
        leaves, structure = jax.tree.flatten((self.times, self.motion, self.prior, links))
        found = hashlib.blake2b(re.sub(r" at 0x[0-9a-f]+", "", str(structure)).encode(), digest_size=12)
        for leaf in leaves:
            values = np.asarray(leaf)
            if values.dtype.kind == "f":
                mantissa, exponent = np.frexp(values.astype(np.float64))
                values = np.ldexp(np.round(mantissa * 2.0**30), exponent) + 0.0
            values = values if values.dtype.kind == "b" else values.astype(np.float64)
            found.update(f"{values.shape}{values.dtype}".encode() + values.tobytes())
        return found.hexdigest()

    def with_times(self, time_s: Float[Array, " times"]) -> "Scenario":
        """The same scenario at other times; which steps had reports is forgotten."""
        return self.replace(times=Times(time_s), links=[a.replace(reports=None) for a in self.links])

    def with_reports(self, reports: Bool[Array, "steps links"]) -> "Scenario":
        """The same scenario with a mask of the measurements that exist."""
        reports = np.asarray(reports, dtype=bool)
        return self.replace(links=[a.replace(reports=reports[:, m]) for m, a in enumerate(self.links)])

    def with_known_sight(self, modes: Any) -> "Scenario":
        """The same scenario with a known sight schedule.

        Parameters
        ----------
        modes
            0 = LOS, 1 = NLOS at steps 1..K: [steps, links], [steps] for all links alike, or a dict with one list per
            anchor name.

        Raises
        ------
        InputError
            If the schedule has another length than the scenario or other anchors.
        """
        names = [link.name for link in self.links]
        if isinstance(modes, dict):
            unknown, missing = [n for n in modes if n not in names], [n for n in names if n not in modes]
            if unknown or missing:
                wrong = f"unknown anchors {unknown}" if unknown else f"nothing for the anchors {missing}"
                raise InputError(f"the sight schedule has {wrong}", f"Give one list for each of {', '.join(names)}")
            lengths = {n: len(modes[n]) for n in names}
            if set(lengths.values()) != {self.steps}:
                raise InputError(
                    f"the sight schedules have {lengths} steps, the scenario {self.steps}",
                    "Give one sight per step 1..K",
                )
            modes = np.stack([np.asarray(modes[n]) for n in names], axis=1)
        modes = np.asarray(modes)
        if modes.shape not in ((self.steps,), (self.steps, len(names))):
            raise InputError(
                f"the sight schedule has shape {modes.shape}",
                f"Give one sight per step 1..K: [{self.steps}], or [{self.steps}, {len(names)}], a column per anchor",
            )
        modes = np.broadcast_to(modes[:, None] if modes.ndim == 1 else modes, (len(modes), len(names)))
        links = [a.replace(sight=KnownSight(modes[:, m], len(a.noises)), chain=None) for m, a in enumerate(self.links)]
        return self.replace(links=links)


def beyond_separation(scenario: Scenario) -> str | None:
    """Why noise and geometry of a scenario do not separate link by link, or None where they do.

    Examples
    --------
    >>> import locbounds as lb
    >>> beyond_separation(lb.papers.fritsche2013.scenario()) is None
    True
    """
    if isinstance(scenario.motion, SwitchingMotion):
        return "the motion switches"
    by_sight = [link.name for link in scenario.links if isinstance(link.measurement, BySight)]
    if by_sight:
        return f"what anchor {', '.join(by_sight)} measures depends on the sight"
    chains = [link.chain for link in scenario.links if link.chain is not None]
    shared = [link.name for link in scenario.links if link.chain is not None and chains.count(link.chain) > 1]
    if shared:
        return f"anchors {', '.join(shared)} share a chain"
    return None
