"""Small jump-Markov models that several tests share, and what they are compared with."""

import jax
import jax.numpy as jnp
import numpy as np

import locbounds as lb
from scenarios import sequence_probabilities, sequences

STEPS = 4
START = np.array([0.2, 0.8])
CHAIN = np.array([[0.9, 0.1], [0.35, 0.65]])


def linear(f, q, steps=STEPS):
    """One scalar motion that is the same at every step."""
    ones = np.ones((steps, 1, 1))
    return lb.LinearMotion(f * ones, q * ones, position_index=(0,))


def bent(x, mode, k):
    """A measurement that depends on the mode and is not linear."""
    return x[0] + 0.1 * x[0] ** 2 if mode == 0 else 1.5 * x[0] - 1.0


NOISES = (lb.Gaussian(0.0, 0.7), lb.Gaussian(1.0, 1.5))


def switching(*, steps=STEPS, f=(0.9, 0.5), q=(0.4, 1.5), h=bent, noises=NOISES, start=START, chain=CHAIN, prior=None):
    """A scalar state whose motion and measurement follow one asymmetric chain away from its long-run law."""
    return lb.JumpMarkov(
        times=lb.Times.uniform(step_s=1.0, steps=steps),
        prior=lb.GaussianPrior([0.5], [[0.8]]) if prior is None else prior,
        motion=[linear(f_r, q_r, steps) for f_r, q_r in zip(f, q, strict=True)],
        channels=lb.AdditiveChannel(h, noises),
        chains=lb.MarkovSight(start, chain),
    )


def gaussian(z, mean, std):
    return -0.5 * ((z - mean) / std) ** 2 - jnp.log(std)


def log_step(x, before, z, r, *, f=(0.9, 0.5), q=(0.4, 1.5), h=bent, noises=NOISES):
    """``log p(z | x, r) p(x | before, r)`` of :func:`switching`, written again; the same up to a constant."""
    f, q = np.array(f)[r], np.sqrt(np.array(q))[r]
    mean, std = float(noises[r].mean), float(noises[r].std)
    return gaussian(x, f * before, q) + gaussian(z - h(x[None], r, 0), mean, std)


def log_sum(log_step, start, chain, steps):
    """``log sum_r Pr(r_{1:k}) prod_n exp(log_step(n, r_n))``, an explicit sum over all mode sequences; n = 0..k-1."""
    modes = len(start)
    each = jnp.stack([jnp.stack([log_step(n, r) for r in range(modes)]) for n in range(steps)])
    p = sequence_probabilities(start, np.broadcast_to(chain, (steps, modes, modes)))
    picked = each[np.arange(steps), sequences(steps, modes)].sum(1)
    return jax.scipy.special.logsumexp(picked, b=p)


def information(log_density, x, z, batch=512):
    """Mean and 32 group means of ``s s^T``, s the gradient of a log-density with respect to its first argument."""
    with jax.enable_x64(True):
        score = jax.jit(lambda x, z: jax.lax.map(lambda a: jax.grad(log_density)(*a), (x, z), batch_size=batch))
        s = np.asarray(score(jnp.asarray(x), jax.tree.map(jnp.asarray, z))).reshape(32, -1, np.size(x[0]))
    groups = np.einsum("gna,gnb->gab", s, s) / s.shape[1]
    return groups.mean(0), groups


def inverse_with_error(J, groups, corner):
    """A corner of the inverse's trace and its standard error, by a delete-one jackknife over the groups."""

    def value(J):
        return np.trace(np.linalg.inv(J)[np.ix_(corner, corner)])

    n = len(groups)
    left_out = np.array([value(J + (groups.mean(0) - g) / (n - 1)) for g in groups])
    return value(J), np.sqrt((n - 1) / n * np.sum(np.square(left_out - left_out.mean())))
