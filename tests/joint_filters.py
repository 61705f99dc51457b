"""Estimators for models that the library's filters do not know: an IMM over joint modes, and a particle filter.

Both see the measurements only; many tracks at once.
"""

import itertools
from functools import reduce

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.linalg import psd_root


def imm(model, z):
    """IMM of EKFs over all chains' joint modes, with Gaussians of the noises' moments; means [runs, steps, state].

    NumPy; links of a scenario turned into a JumpMarkov, measurements z [runs, steps, channels] with NaN where there is
    none.
    """
    intervals, steps, runs = model.times.intervals, model.steps, len(z)
    joint = list(itertools.product(*(range(len(chain.start)) for chain in model.chains)))
    motions = model.motion if isinstance(model.motion, tuple) else (model.motion,)
    which = [r[model.motion_chain] if len(motions) > 1 else 0 for r in joint]
    with jax.enable_x64(True):
        F = np.stack([np.asarray(m.transitions(intervals)) for m in motions], 1)[:, which]
        Q = np.stack([np.asarray(m.covariances(intervals)) for m in motions], 1)[:, which]
        chains = [np.asarray(chain.transitions(intervals)) for chain in model.chains]
    p = np.tile(reduce(np.kron, [np.asarray(chain.start) for chain in model.chains]), (runs, 1))
    x = np.tile(model.prior.mean, (runs, len(joint), 1))
    P = np.tile(model.prior.covariance, (runs, len(joint), 1, 1))
    place, out = list(model.position_index), []
    anchors, means, variances = (
        [np.array([of(channel, r[channel.chain]) for r in joint]) for channel in model.channels]
        for of in (
            lambda channel, r: channel.h.measurement.under(r).anchor,
            lambda channel, r: float(channel.noises[r].mean),
            lambda channel, r: float(channel.noises[r].variance),
        )
    )
    for k in range(steps):
        T = reduce(np.kron, [chain[k] for chain in chains])
        c = np.maximum(p @ T, 1e-300)
        w = np.swapaxes(p[:, :, None] * T / c[:, None], 1, 2)  # [runs, now, before]
        centre = np.einsum("ri,ria->ra", p, x)[:, None]
        x, d = w @ x, x - centre
        second = P + d[..., :, None] * d[..., None, :]
        d = x - centre
        P = (w @ second.reshape(runs, len(joint), -1)).reshape(P.shape) - d[..., :, None] * d[..., None, :]
        x, P = np.einsum("jab,rjb->rja", F[k], x), F[k] @ P @ np.swapaxes(F[k], 1, 2) + Q[k]
        offsets = [x[..., place] - anchor for anchor in anchors]
        start, log_l = x, np.log(c)
        for m, offset in enumerate(offsets):
            distance = np.linalg.norm(offset, axis=-1)
            gradient = offset / distance[..., None]
            PH = np.einsum("rjab,rjb->rja", P[..., place], gradient)
            S = np.einsum("rja,rja->rj", PH[..., place], gradient) + variances[m]
            moved = np.einsum("rja,rja->rj", (x - start)[..., place], gradient)
            nu = z[:, k, m, None] - distance - moved - means[m]
            there = np.isfinite(nu)
            nu, gain = np.where(there, nu, 0.0), np.where(there[..., None], PH / S[..., None], 0.0)
            x = x + gain * nu[..., None]
            P = P - gain[..., :, None] * PH[..., None, :]
            log_l = log_l + np.where(there, -0.5 * (nu**2 / S + np.log(S)), 0.0)
        p = np.exp(log_l - log_l.max(1, keepdims=True))
        p = p / p.sum(1, keepdims=True)
        out.append(np.einsum("ri,ria->ra", p, x))
    return np.stack(out, 1)


@eqx.filter_jit
def _particles(model, z, seed, count):
    runs, steps = z.shape[:2]
    F = model.motion.transitions(model.times.intervals)
    roots = psd_root(model.motion.covariances(model.times.intervals))
    transitions = [model.transitions(c) for c in range(len(model.chains))]
    first, later = jax.random.split(jax.random.key(seed))
    x = jax.random.normal(first, (runs, count, model.state_size)) @ psd_root(jnp.asarray(model.prior.covariance))
    modes = [jnp.broadcast_to(jnp.asarray(chain.start), (runs, count, len(chain.start))) for chain in model.chains]

    def step(carry, inputs):
        x, modes = carry
        F, root, Ts, z, k, key = inputs
        move, pick = jax.random.split(key)
        x = x @ F.T + jax.random.normal(move, x.shape) @ root
        log_w, filtered = 0.0, []
        for c, (p, T) in enumerate(zip(modes, Ts, strict=True)):
            log_l = jnp.zeros(p.shape)
            for m, channel in enumerate(model.channels):
                if channel.chain == c:
                    seen = jnp.nan_to_num(z[:, m, None])
                    values = []
                    for r, noise in enumerate(channel.noises):
                        h = jax.vmap(jax.vmap(lambda x, r=r, h=channel.h: h(x, r, k)))
                        values.append(noise.log_prob(seen - h(channel.seen(x))))
                    log_l = log_l + jnp.where(jnp.isfinite(z[:, m])[:, None, None], jnp.stack(values, -1), 0.0)
            joint = (p @ T) * jnp.exp(log_l - log_l.max(-1, keepdims=True))
            log_w = log_w + log_l.max(-1) + jnp.log(joint.sum(-1))
            filtered.append(joint / joint.sum(-1, keepdims=True))
        w = jax.nn.softmax(log_w, axis=1)
        mean = jnp.einsum("rn,rna->ra", w, x)
        at = (jnp.arange(count) + jax.random.uniform(pick, (runs, 1))) / count
        index = jnp.minimum(jax.vmap(jnp.searchsorted)(jnp.cumsum(w, 1), at), count - 1)[..., None]
        return (jnp.take_along_axis(x, index, 1), [jnp.take_along_axis(p, index, 1) for p in filtered]), mean

    inputs = F, roots, transitions, jnp.moveaxis(z, 1, 0), jnp.arange(1, steps + 1), jax.random.split(later, steps)
    return jnp.moveaxis(jax.lax.scan(step, (x + model.prior.mean, modes), inputs)[1], 0, 1)


def particles(model, z, *, seed=0, count=128):
    """Bootstrap particle filter for a motion without modes; means [runs, steps, state].

    The state is drawn; every particle carries the exact law of each chain's mode along its path. Resampled at every
    step.
    """
    with jax.enable_x64(True):
        return np.asarray(_particles(model, jnp.asarray(z), np.uint32(seed), count))
