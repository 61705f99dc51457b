"""Small scenarios that several tests share: few shapes, because compiling costs more than computing."""

import itertools

import jax.numpy as jnp
import numpy as np

import locbounds as lb

STEPS = 12


class Linear(lb.Range):
    """A measurement that is linear in the position, ``h(p) = anchor . p``: then the bound is a Kalman covariance."""

    def __call__(self, position):
        return jnp.sum(self.anchor * position, axis=-1)


def mask(steps, links, seed=5, share=0.7):
    """Which link reported when; every step keeps at least the chance of having none."""
    return np.random.default_rng(seed).random((steps, links)) < share


def asymmetric(*, steps=STEPS, reports=None, stay=((0.9, 0.6), (0.7, 0.95)), start=((0.1, 0.9), (0.7, 0.3))):
    """Two ranges with different asymmetric chains, starts away from stationarity and different noises.

    The prior is wide against the noise, so that the bound is made by the ranges.
    """
    noises = (
        (lb.Gaussian(0.0, 3.0), lb.Gaussian(8.0, 7.0)),
        (lb.Gaussian(1.0, 2.0), lb.Gaussian(5.0, 4.0)),
    )
    anchors = ((-60.0, -20.0), (30.0, 90.0))
    reports = np.ones((steps, 2), bool) if reports is None else reports
    links = [
        lb.Link(f"a{m}", lb.Range(anchors[m]), lb.MarkovSight.stay(stay[m], start[m]), noises[m], reports[:, m])
        for m in range(2)
    ]
    return lb.Scenario(
        "two ranges", lb.Times.uniform(step_s=0.5, steps=steps), lb.ConstantVelocity(0.4), prior(), links
    )


def prior(std_m=(8.0, 10.0), std_m_s=(1.0, 2.0)):
    covariance = np.diag(np.square([*std_m, *std_m_s]))
    covariance[0, 1] = covariance[1, 0] = 0.3 * std_m[0] * std_m[1]
    return lb.GaussianPrior([5.0, 10.0, 1.0, -1.0], covariance)


def noise_of(scenario, **changes):
    """The scenario with fields of every link replaced: ``noises`` or ``sight``, one for all links."""
    links = [
        lb.Link(a.name, a.measurement, changes.get("sight", a.sight), changes.get("noises", a.noises), a.reports)
        for a in scenario.links
    ]
    return scenario.replace(links=links)


def sequences(steps, modes=2):
    """All mode sequences r_1..r_K, [modes^K, steps]."""
    return np.array(list(itertools.product(range(modes), repeat=steps)))


def sequence_probabilities(start, transitions):
    """Probability of every sequence of :func:`sequences`, the chain starting at step 0; by the chain rule."""
    transitions = np.asarray(transitions)
    first = np.asarray(start) @ transitions[0]
    r = sequences(len(transitions), len(first))
    p = first[r[:, 0]]
    for k in range(1, len(transitions)):
        p = p * transitions[k][r[:, k - 1], r[:, k]]
    return p


def kalman(F, Q, P0, rows):
    """Covariances of the textbook Kalman filter at steps 0..K; ``rows[k]`` lists (h, variance) of step k + 1."""
    P, out = P0, [P0]
    for F_k, Q_k, row in zip(F, Q, rows, strict=True):
        P = F_k @ P @ F_k.T + Q_k
        for h, r in row:
            gain = P @ h / (h @ P @ h + r)
            P = P - np.outer(gain, h @ P)
        out.append(P)
    return np.array(out)


def one_link(*, steps=5, stay=0.8, std=3.0, anchor=-60.0, intensity=0.4, prior_std=8.0):
    """One range over few steps, every parameter open to a JAX tracer."""
    covariance = np.diag([1.0, 1.0, 0.0, 0.0]) * prior_std**2 + np.diag([0.0, 0.0, 1.0, 2.0])
    noises = (lb.Gaussian(0.0, std), lb.Gaussian(8.0, 7.0))
    link = lb.Link("a0", lb.Range([anchor, -20.0]), lb.MarkovSight.stay(stay), noises)
    prior = lb.GaussianPrior([5.0, 10.0, 1.0, -1.0], covariance)
    return lb.Scenario(
        "one range", lb.Times.uniform(step_s=0.5, steps=steps), lb.ConstantVelocity(intensity), prior, [link]
    )
