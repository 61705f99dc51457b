"""From the parts' increments to a linear model and increments that the covariance recursion takes.

Two cases. *The motion has no modes and is linear Gaussian*: its information is exact, the parts add the measurements'.
*Otherwise* the whole score is estimated, and what is added is measured against a reference motion (and prior) without
modes, which is subtracted from it: the sum is the same for any reference.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds.general.parts import Part, parts
from locbounds.bounds.general.switching_motion import Reference, switching_steps
from locbounds.bounds.recursion import LinearModel
from locbounds.errors import RefusedError
from locbounds.model import DensityMotion, JumpMarkov
from locbounds.priors import DensityPrior


class Tables(NamedTuple):
    """Group means of one block, or of several.

    Attributes
    ----------
    prior
        Information of a prior given by its density; zeros for a Gaussian one.
    scores
        Sums over the steps of each part's newest scores, a check of densities against samplers.
    """

    increments: Float[Array, "groups steps ages components ages components"]
    prior: Float[Array, "groups state state"]
    scores: tuple[Array, ...]


class Frame(NamedTuple):
    """What does not change from block to block.

    Attributes
    ----------
    whole
        Whether the whole score is estimated.
    parts
        The parts of the model.
    exact
        Known-mode information beyond the reference's that needs no draws, of every part, [steps, m, m].
    components
        State components that increments are about.
    """

    whole: bool
    parts: list[Part]
    exact: list[Any]
    reference: Reference | None
    components: tuple[int, ...]

    def ages(self, window: int) -> int:
        """Ages of the state in a table."""
        return window + int(self.whole)


def frame(model: JumpMarkov) -> Frame:
    """Which case a model belongs to.

    Raises
    ------
    RefusedError
        If the state reveals the mode.
    """
    whole = model.switching or isinstance(model.motion, DensityMotion) or isinstance(model.prior, DensityPrior)
    linear, reference, exact = (None, None, None)
    if isinstance(model.motion, tuple):
        linear, reference, exact = switching_steps(model)
    elif not isinstance(model.motion, DensityMotion):
        intervals = model.times.intervals
        reference = Reference(model.motion.transitions(intervals), model.motion.covariances(intervals))
    pieces = parts(model, whole, linear)
    sizes = [len(p.components) * (1 + p.lag) for p in pieces]
    known = [
        exact if p.motion is linear and linear is not None else np.zeros((model.steps, m, m))
        for p, m in zip(pieces, sizes, strict=True)
    ]
    everything = tuple(range(model.state_size))
    components = everything if whole else tuple(sorted({i for p in pieces for i in p.components}))
    return Frame(whole, pieces, known, reference, components)


def placed(table: Array, part: Part, frame: Frame, window: int) -> Array:
    """A part's increments among all components and ages."""
    at = np.searchsorted(frame.components, part.components)
    extra = frame.ages(window) - window - part.lag
    if extra == 0 and len(at) == len(frame.components):
        return table
    rows = table.shape[:2]
    out = jnp.zeros((*rows, *(frame.ages(window), len(frame.components)) * 2))
    ages = np.arange(window + part.lag)
    grid = np.ix_(np.arange(rows[0]), np.arange(rows[1]), ages, at, ages, at)
    return out.at[grid].add(table)


def linear_model(model: JumpMarkov, frame: Frame, first: Tables) -> LinearModel:
    """Motion and prior that the increments are measured against."""
    if isinstance(model.prior, DensityPrior):
        P0 = _inverse(np.asarray(first.prior.mean(0)), "the prior's log-density")
    else:
        P0 = np.asarray(model.prior.covariance)
    reference = frame.reference
    if reference is None:  # a transition density: the Gaussian step with the same information
        n = model.state_size
        newest = np.asarray(first.increments.mean(0)[:, :2, :, :2, :]).reshape(-1, 2 * n, 2 * n)
        Q = np.stack([_inverse(J[:n, :n], f"the motion's log-density at step {k}") for k, J in enumerate(newest, 1)])
        reference = Reference(-Q @ newest[:, :n, n:], Q)
    F, Q = jnp.asarray(reference.F), jnp.asarray(reference.Q)
    return LinearModel(F, Q, jnp.asarray(P0), frame.components, model.position_index)


def beyond_reference(
    model: JumpMarkov, frame: Frame, linear: LinearModel, tables: Tables
) -> Float[Array, "groups steps ages components ages components"]:
    """The increments less what the linear model has of them."""
    increments = jnp.asarray(tables.increments)
    if frame.reference is None:
        n = model.state_size
        step = jnp.concatenate([jnp.broadcast_to(jnp.eye(n), linear.F.shape), -jnp.asarray(linear.F)], -1)
        own = jnp.einsum("kia,kij,kjb->kab", step, jnp.linalg.inv(linear.Q), step)
        increments = increments.at[:, :, :2, :, :2, :].add(-own.reshape(-1, 2, n, 2, n))
    if isinstance(model.prior, DensityPrior):
        increments = jnp.asarray(increments).at[:, 0, 1, :, 1, :].add(tables.prior - jnp.linalg.inv(linear.P0))
    return increments


def _inverse(information: np.ndarray, what: str) -> np.ndarray:
    values = np.linalg.eigvalsh(information) if np.all(np.isfinite(information)) else np.zeros(1)
    if not values.min() > 1e-12 * values.max():
        raise RefusedError(
            f"{what} has no finite, positive information about the state: eigenvalues {values}",
            "Check that it is smooth, depends on every component, and is finite on the sampler's draws",
        )
    return np.linalg.inv(information)
