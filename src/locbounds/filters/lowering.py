"""From a scenario to the arrays that filter kernels work on, and back."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError, RefusedError
from locbounds.filters.estimates import Estimates
from locbounds.filters.tracks_last import Pattern, pattern
from locbounds.precision import traced
from locbounds.scenario import Scenario, beyond_separation


class Model(NamedTuple):
    """A scenario as arrays, the state's position coordinates first.

    Attributes
    ----------
    F, Q
        [steps, state, state].
    m0, P0
        [state], [state, state].
    anchors
        [links, space].
    weights, means, variances
        Gaussian mixture of the noise, [links, modes, components]; a noise with fewer components than another has
        components of weight zero.
    start
        [links, modes].
    transitions
        [links, steps, modes, modes], ``transitions[l, k, i, j] = Pr(next = j | now = i)``.
    """

    F: Float[Array, "steps state state"]
    Q: Float[Array, "steps state state"]
    m0: Float[Array, " state"]
    P0: Float[Array, "state state"]
    anchors: Float[Array, "links space"]
    weights: Float[Array, "links modes components"]
    means: Float[Array, "links modes components"]
    variances: Float[Array, "links modes components"]
    start: Float[Array, "links modes"]
    transitions: Float[Array, "links steps modes modes"]


def state_order(scenario: Scenario) -> list[int]:
    """Indices of the state components, positions first."""
    position = list(scenario.motion.position_index)
    return position + [i for i in range(scenario.motion.state_size) if i not in position]


def lower(scenario: Scenario) -> Model:
    """The arrays of a scenario.

    Raises
    ------
    InputError
        If links differ in their number of sight conditions.
    RefusedError
        If the motion switches, a measurement depends on the sight, or links share a chain.
    """
    why = beyond_separation(scenario)
    if why is not None:
        raise RefusedError(
            f"{why}, which the library's filters do not know", "Evaluate a filter of your own, any callable"
        )
    modes = {len(link.noises) for link in scenario.links}
    if len(modes) > 1:
        raise InputError(
            f"links have different numbers of sight conditions: {sorted(modes)}",
            "Give every link the same number; a condition may have probability zero",
        )
    index = np.array(state_order(scenario))
    mixtures = [[noise.components() for noise in link.noises] for link in scenario.links]
    size = max(len(weights) for row in mixtures for weights, _, _ in row)
    intervals = scenario.times.intervals
    motion = scenario.transition, scenario.process_noise
    chains = [(link.sight.start, link.sight.transitions(intervals)) for link in scenario.links]
    # NumPy compiles none of these small steps; inside a transformation the pieces may be tracers
    xp = jnp if traced(scenario, mixtures, motion, chains) else np

    def padded(values: Array, filling: float) -> Array:
        return xp.concatenate([xp.asarray(values), xp.full(size - len(values), filling)])

    def table(which: int, filling: float) -> Array:
        return xp.stack([xp.stack([padded(mixture[which], filling) for mixture in row]) for row in mixtures])

    F, Q = (xp.asarray(a)[:, index][:, :, index] for a in motion)
    return Model(
        F=F,
        Q=Q,
        m0=scenario.prior.mean[index],
        P0=scenario.prior.covariance[index][:, index],
        anchors=scenario.anchors,
        weights=table(0, 0.0),
        means=table(1, 0.0),
        variances=table(2, 1.0),
        start=xp.stack([xp.asarray(start) for start, _ in chains]),
        transitions=xp.stack([xp.asarray(transitions) for _, transitions in chains]),
    )


def check_measurements(scenario: Scenario, z: Any) -> Array:
    """The ranges as an array, or an InputError that says what is wrong with them."""
    z = z if traced(z) else np.asarray(z, dtype=np.float64)
    expected = (scenario.steps, len(scenario.links))
    if z.ndim != 3 or z.shape[1:] != expected or not len(z):
        raise InputError(
            f"measurements have shape {z.shape}",
            f"Give [runs, {expected[0]} steps, {expected[1]} links], NaN = missing",
        )
    if not traced(z) and np.isinf(z).any():
        raise InputError("measurements hold infinite ranges", "Give NaN where a link did not report")
    return z


def estimates(scenario: Scenario, mean: Array, covariance: Array | None, **diagnostics: Array) -> Estimates:
    """Results of a kernel, [runs, steps+1, state] and [runs, steps+1, state, state], in the scenario's state order."""
    order = state_order(scenario)
    if order != sorted(order):
        back = np.argsort(order)
        mean = mean[..., back]
        covariance = None if covariance is None else covariance[..., back[:, None], back[None, :]]
    return Estimates(mean, covariance, diagnostics)


def transition_pattern(model: Model) -> Pattern:
    """Which entries of F are always zero or one."""
    return pattern(model.F)
