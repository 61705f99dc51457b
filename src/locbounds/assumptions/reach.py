"""Where the state of a model comes to: its Gaussian laws where it has some, and draws."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Int, ndarray
from locbounds.model import DensityMotion, JumpMarkov
from locbounds.motion import SwitchingMotion
from locbounds.paths import moving_states
from locbounds.priors import GaussianPrior
from locbounds.scenario import Scenario
from locbounds.sight.draws import draw_sight
from locbounds.simulation import draw_states

DRAWS, FEWEST = 512, 32  # per step
NUMBERS = 2**21  # kept at most, where there are many steps
STEPS = 16  # at which functions are looked at
RANK = 1e-12  # relative variance below which a law does not spread in a direction
ROUNDING = 1e-9


def position_laws(subject: Scenario | JumpMarkov) -> list[tuple[ndarray, ndarray]]:
    """Means [steps, state] and covariances [steps, state, state] of the state at steps 1..K, while one mode lasts.

    One pair per mode of the motion; none where prior or motion is a density.
    """
    motion, prior = subject.motion, subject.prior
    if isinstance(motion, DensityMotion) or not isinstance(prior, GaussianPrior):
        return []
    motions = motion.motions if isinstance(motion, SwitchingMotion) else motion
    intervals, laws = subject.times.intervals, []
    for one in motions if isinstance(motions, tuple) else (motions,):
        F, Q = np.asarray(one.transitions(intervals)), np.asarray(one.covariances(intervals))
        m, P = np.asarray(prior.mean), np.asarray(prior.covariance)
        means, covariances = [], []
        for F_k, Q_k in zip(F, Q, strict=True):
            m, P = F_k @ m, F_k @ P @ F_k.T + Q_k
            means.append(m)
            covariances.append(P)
        laws.append((np.stack(means), np.stack(covariances)))
    return laws


def meets(mean: Float[Array, " n"], covariance: Float[Array, "n n"], place: Float[Array, " n"]) -> int:
    """In how many directions a Gaussian law spreads if it comes to a place, otherwise 0.

    >>> flat = np.diag([4.0, 4.0, 0.0])
    >>> meets(np.zeros(3), flat, np.array([1.0, 0.0, 0.0])), meets(np.zeros(3), flat, np.array([1.0, 0.0, 2.0]))
    (2, 0)
    """
    values, vectors = np.linalg.eigh(covariance)
    spread = vectors[:, values > RANK * max(values[-1], np.finfo(float).tiny)]
    d = place - mean
    left = d - spread @ (spread.T @ d)
    return spread.shape[1] if np.linalg.norm(left) <= ROUNDING * (1 + np.linalg.norm(d)) else 0


def looked_at(reports: Any, steps: int) -> Int[ndarray, " looked_at"]:
    """Some of the steps 1..K that have reports, the first and the last among them.

    >>> looked_at(None, 3).tolist(), looked_at(np.array([False, True, True]), 3).tolist()
    ([1, 2, 3], [2, 3])
    """
    there = np.arange(1, steps + 1)[slice(None) if reports is None else np.asarray(reports, dtype=bool)]
    return there[np.unique(np.linspace(0, len(there) - 1, STEPS).round().astype(int))] if len(there) else there


def states(subject: Scenario | JumpMarkov) -> Float[ndarray, "times n state"]:
    """Draws of the state at steps 0..K."""
    size = subject.motion.state_size if isinstance(subject, Scenario) else subject.state_size
    n = int(np.clip(NUMBERS // ((subject.steps + 1) * size), FEWEST, DRAWS))
    if isinstance(subject, Scenario):
        few = eqx.tree_at(lambda s: s.links, subject.anonymous(), subject.anonymous().links[:1])
        return np.moveaxis(np.asarray(_of_scenario(few, n)), 0, 1)
    start, chain = subject.chains[subject.motion_chain].start, subject.transitions(subject.motion_chain)
    few = eqx.tree_at(lambda m: (m.channels, m.chains), subject, ((), subject.chains[: subject.motion_chain + 1]))
    return np.asarray(_of_model(few, jnp.asarray(start), chain, n))


@eqx.filter_jit
def _of_scenario(scenario: Scenario, n: int) -> Array:
    return draw_states(jax.random.key(0), scenario, n)


@eqx.filter_jit
def _of_model(model: JumpMarkov, start: Array, chain: Array, n: int) -> Array:
    one, two = jax.random.split(jax.random.key(0))
    return moving_states(one, model, draw_sight(two, start, chain, n), n)
