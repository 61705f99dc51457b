"""Linear motions that switch: transition densities, also where all modes move the state inside one subspace.

With a singular Q the step has a density on the subspace that the noise reaches; N are the directions that it does
not reach. If ``N' F(r)`` is the same in all modes, the state outside the subspace follows a known linear map, and
inside it the step has the Gaussian density with the pseudo-inverse of Q(r): the parameters are x_0 and the noises in
the subspace, of which all states are linear functions. Otherwise the state itself reveals the mode.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import RefusedError
from locbounds.model import JumpMarkov

RANK = 1e-12  # eigenvalues below this, in units of the largest deviations, count as zero
SAME_SUBSPACE = 1e-9  # relative: maps and subspaces closer than this are the same


class Steps(NamedTuple):
    """Gaussian transition densities by step and mode.

    Attributes
    ----------
    F, P
        Transition matrices and (pseudo-)inverses of Q.
    log_scale
        Minus half the logarithm of Q's (pseudo-)determinant.
    """

    F: Float[Array, "*steps modes state state"]
    P: Float[Array, "*steps modes state state"]
    log_scale: Float[Array, "*steps modes"]


class Reference(NamedTuple):
    """A motion without modes that the information is measured against."""

    F: Float[Array, "steps state state"]
    Q: Float[Array, "steps state state"]


def step_score(motion: Steps, r: int, x: Array, before: Array) -> tuple[Scalar, Float[Array, " twice_state"]]:
    """Log-density of a step in one mode and its gradient with respect to (x_k, x_{k-1})."""

    def log_density(x, before):
        v = x - motion.F[r] @ before
        return motion.log_scale[r] - 0.5 * v @ motion.P[r] @ v

    value, gradient = jax.value_and_grad(log_density, (0, 1))(x, before)
    return value, jnp.concatenate(gradient)


def switching_steps(model: JumpMarkov) -> tuple[Steps, Reference, Float[Array, "steps m m"]]:
    """Transition densities, a reference motion, and what the known-mode information exceeds the reference's by.

    The reference has the mean of the modes' information: ``Q^-1 = sum_r Pr(r) Q(r)^-1`` and
    ``F = Q sum_r Pr(r) Q(r)^-1 F(r)``, so that the excess concerns x_{k-1} alone; any other would do.

    Raises
    ------
    RefusedError
        If the noises of the modes reach different subspaces, or the modes move the state outside of it differently.
    """
    motions = model.motion
    assert isinstance(motions, tuple)
    intervals = model.times.intervals
    F = np.stack([np.asarray(m.transitions(intervals)) for m in motions], 1)
    Q = np.stack([np.asarray(m.covariances(intervals)) for m in motions], 1)
    unit = np.sqrt(np.einsum("krii->kri", Q).max(1))  # positions and velocities differ by orders of magnitude
    unit = np.where(unit > 0, unit, 1.0)
    scaled = Q / unit[:, None, :, None] / unit[:, None, None, :]
    values, vectors = np.linalg.eigh(scaled)
    kept = values > RANK * Q.shape[-1]
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    P = np.einsum("krai,kri,krbi->krab", vectors, inverse, vectors)
    inside = np.einsum("krai,kri,krbi->krab", vectors, kept, vectors)
    outside = np.eye(Q.shape[-1]) - inside
    scale = np.abs(F / unit[:, None, :, None]).max()
    for k in range(len(F)):
        if np.abs(inside[k] - inside[k, :1]).max() > SAME_SUBSPACE:
            raise RefusedError(
                f"at step {k + 1} the motion noises of the modes reach different subspaces: the state reveals the mode",
                "Give every mode process noise in the same directions, for example a small intensity instead of zero",
            )
        if np.abs(outside[k, 0] @ ((F[k] - F[k, :1]) / unit[k, :, None])).max() > SAME_SUBSPACE * scale:
            raise RefusedError(
                f"at step {k + 1} the modes move the state differently where there is no noise: the state reveals the "
                "mode",
                "Add process noise in these directions, for example continuous instead of discrete white acceleration",
            )
    law = _law(model)
    scales = unit[:, :, None] * unit[:, None, :]
    reference_Q = np.linalg.pinv(np.einsum("kr,krab->kab", law, P), rcond=RANK, hermitian=True) * scales
    P = P / scales[:, None]
    change = np.einsum("kr,krab,krbc->kac", law, P, F - F[:, :1])
    reference_F = F[:, 0] + reference_Q @ change
    excess = np.einsum("kr,krba,krbc,krcd->kad", law, F - reference_F[:, None], P, F - reference_F[:, None])
    n = Q.shape[-1]
    exact = np.zeros((len(F), 2 * n, 2 * n))
    exact[:, n:, n:] = excess
    log_scale = -0.5 * np.sum(np.log(np.where(kept, values, 1.0)), -1)
    return Steps(F, P, log_scale), Reference(reference_F, reference_Q), exact


def _law(model: JumpMarkov) -> np.ndarray:
    """Law of the motion's mode at steps 1..K."""
    law, rows = np.asarray(model.chains[model.motion_chain].start), []
    for T in np.asarray(model.transitions(model.motion_chain)):
        law = law @ T
        rows.append(law)
    return np.array(rows)
