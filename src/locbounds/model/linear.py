"""What makes a jump-Markov model linear: its matrices, the gradients of its channels, and why it is not linear."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.model.channels import AdditiveChannel
from locbounds.model.density_motion import DensityMotion
from locbounds.model.jump_markov import JumpMarkov
from locbounds.precision import double_precision
from locbounds.priors import DensityPrior

SINGULAR = 1e-12  # smallest eigenvalue of a correlation matrix that is not called singular
LINEAR = 1e-9  # relative change of a gradient from place to place that counts as rounding
PLACES = 24
FAR = (1.0, 3.0)  # deviations of the state that places spread over


@double_precision
def matrices(model: JumpMarkov) -> tuple[ndarray, ndarray, ndarray]:
    """F [steps, state, state], Q of the same shape and P0 [state, state] of a linear Gaussian motion without modes."""
    motion: Any = model.motion
    prior: Any = model.prior
    intervals = model.times.intervals
    return (
        np.asarray(motion.transitions(intervals)),
        np.asarray(motion.covariances(intervals)),
        np.asarray(prior.covariance),
    )


def no_linear_motion(model: JumpMarkov) -> str | None:
    """Why motion and prior are not linear Gaussian without modes, or None."""
    if isinstance(model.motion, DensityMotion) or isinstance(model.prior, DensityPrior):
        return "the motion or the prior is a density, not linear Gaussian"
    return "the motion has modes" if isinstance(model.motion, tuple) else None


def singular_motion(model: JumpMarkov) -> str | None:
    """Which of P0, Q_1, .., Q_K leaves some direction without noise, or None."""
    if no_linear_motion(model) is not None:
        return None
    _, Q, P0 = matrices(model)
    for k, S in enumerate([P0, *Q]):
        deviations = np.sqrt(np.maximum(np.diag(S), np.finfo(float).tiny))
        if not np.linalg.eigvalsh(S / np.outer(deviations, deviations))[0] > SINGULAR:
            what = "the prior" if k == 0 else f"Q of step {k}"
            return f"{what} is singular: no state can be moved alone without breaking the motion"
    return None


def no_linear_channel(model: JumpMarkov) -> str | None:
    """Which channel is no ``g'x + const + noise``, the same g and constant in all modes, or None."""
    if no_linear_motion(model) is not None:
        return None
    for c, channel in enumerate(model.channels):
        if not isinstance(channel, AdditiveChannel):
            return f"channel {c} is no h(x) plus noise"
        values, slopes, places = _at_places(model, c)
        steep = max(np.abs(slopes).max(), np.finfo(float).tiny)
        if not np.abs(slopes - slopes[:1, :1]).max() <= LINEAR * steep:
            return f"h of channel {c} is not linear in the state"
        predicted = values[:, :1] + np.einsum("rkv,pv->rpk", slopes[:, 0], places - places[0])
        if not np.abs(values - predicted).max() <= LINEAR * (1 + np.abs(values).max()):
            return f"h of channel {c} is not linear in the state: its values differ by other than slope times way"
        if np.abs(values - values[:1]).max() > LINEAR * (1 + np.abs(values).max()):
            return f"h of channel {c} depends on the mode"
    return None


def gradients(model: JumpMarkov) -> Float[ndarray, "channels steps state"]:
    """Gradients of the channels of a linear model; zero at steps that are not reported."""
    full = np.zeros((len(model.channels), model.steps, model.state_size))
    for c, channel in enumerate(model.channels):
        full[c][:, _view(model, channel)] = _at_places(model, c)[1][0, 0]
        if channel.reports is not None:
            full[c] *= np.asarray(channel.reports)[:, None]
    return full


def _view(model: JumpMarkov, channel: Any) -> ndarray:
    return np.arange(model.state_size) if channel.view is None else np.array(channel.view)


@double_precision
def _at_places(model: JumpMarkov, c: int) -> tuple[ndarray, ndarray, ndarray]:
    """Values [modes, places, steps], gradients [modes, places, steps, view] and places [places, view] of a channel.

    The places spread over all that the state comes to.
    """
    channel: Any = model.channels[c]
    prior: Any = model.prior
    F, Q, P = matrices(model)
    mean = start = np.asarray(prior.mean)
    spread = np.sqrt(np.diag(P))
    for F_k, Q_k in zip(F, Q, strict=True):
        mean, P = F_k @ mean, F_k @ P @ F_k.T + Q_k
        spread = np.maximum(spread, np.abs(mean - start) + np.sqrt(np.diag(P)))
    draws = np.random.default_rng(0).normal(size=(PLACES, model.state_size)) * np.resize(FAR, PLACES)[:, None]
    places = (start + (1 + spread) * draws)[:, _view(model, channel)]
    k = jnp.arange(1, model.steps + 1)
    values, slopes = [], []
    for mode in range(len(channel.noises)):

        def h(x, k, mode=mode):
            return jnp.reshape(channel.h(x, mode, k), ())

        both = jax.vmap(jax.vmap(jax.value_and_grad(h), (None, 0)), (0, None))
        value, slope = both(jnp.asarray(places), k)
        values.append(np.asarray(value))
        slopes.append(np.asarray(slope))
    return np.stack(values), np.stack(slopes), places
