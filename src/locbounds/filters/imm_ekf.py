"""IMM-EKF over the joint sight conditions of all links."""

import functools
import itertools
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array
from locbounds.errors import InputError
from locbounds.filters.estimates import Estimates
from locbounds.filters.lowering import Model, check_measurements, estimates, lower, transition_pattern
from locbounds.filters.over_tracks import over_tracks
from locbounds.filters.range_update import (
    correct,
    correct_in_plane,
    corrected,
    direction,
    no_correction,
    relative_weights,
)
from locbounds.filters.tracks_last import (
    Pattern,
    apply,
    congruence,
    dense,
    materialise,
    upper,
)
from locbounds.precision import double_precision
from locbounds.scenario import Scenario

MAX_JOINT_MODES = 256
TINY = 1e-290  # a mode less likely than this has no mean


def imm_ekf(model: Model, z: Array, *, kinds: Pattern, covariance: bool) -> tuple[Array, Array | None]:
    """Interacting multiple model filter over all combinations of the links' modes.

    For joint modes i, j with probabilities mu_i, means x_i and covariances P_i (Bar-Shalom, Li, Kirubarajan 2001,
    section 11.6.6), each step does

    1. mixing: ``c_j = sum_i T_ij mu_i``; mode j starts from the mean and covariance of ``sum_i T_ij mu_i N(x_i, P_i)``;
    2. prediction by F and Q;
    3. per mode, the EKF update by all ranges, linearised at the mode's own predicted mean, with the noise of the mode;
    4. ``mu_j ~ c_j x likelihood_j``; the estimate is the mean and covariance of the mixture.

    Mixing is linear in the probabilities and the first two moments about any common point, here the predicted estimate:
    one product of T^T (extended by a row of ones, which gives the estimate) with each moment of all tracks.

    Parameters
    ----------
    model
        The scenario.
    z
        Ranges [steps, links, tracks], NaN = missing: likelihood one, and the chain goes on.
    kinds
        Which entries of F are zero or one at every step.
    covariance
        Whether to return it.

    Returns
    -------
    mean [steps, state, tracks], covariance [steps, state, state, tracks] or None.
    """
    links, modes, components = model.means.shape
    dim, n, tracks = model.anchors.shape[1], len(model.m0), z.shape[-1]
    joint = np.array(list(itertools.product(range(modes), repeat=links)))  # [joint modes, links], in the order of kron
    rows = len(joint)
    law = model.weights, model.means, model.variances
    noises = [[jnp.asarray(a)[link][joint[:, link]].T[..., None] for a in law] for link in range(links)]

    def mix(moments: Any, transitions: Array) -> Any:
        """Moments of every mode after a transition, and in one more row the sums over all modes."""
        T = functools.reduce(jnp.kron, [transitions[a] for a in range(links)])
        matrix = jnp.concatenate([T.T, jnp.ones((1, rows))])
        return materialise(jax.tree.map(lambda moment: matrix @ moment, moments))

    def step(carry: Any, piece: Any) -> Any:
        m, centre, (c, S1, S2), c_total = carry
        F, Q, transitions, z = piece
        possible = c[:rows] > TINY * c_total
        inverse = materialise(jnp.where(possible, 1.0 / jnp.where(possible, c[:rows], 1.0), 0.0))
        d = materialise([s[:rows] * inverse for s in S1])
        x = apply(F, kinds, [a + b for a, b in zip(centre, d, strict=True)])
        P = congruence(F, kinds, {(i, j): S2[i, j][:rows] * inverse - d[i] * d[j] for i, j in S2})
        P = {(i, j): P[i, j] + Q[i, j] for i, j in P}
        z, x, P, centre = materialise(([z[a] for a in range(links)], x, P, apply(F, kinds, m)))

        position, P_pp = x[:dim], {pair: P[pair] for pair in upper(dim)}
        predictions = [direction(position, model.anchors[link]) for link in range(links)]
        if dim == 2 and components == 1:
            correction = correct_in_plane(P_pp, predictions, z, noises)
        else:
            correction = no_correction(x[0], dim)
            for link in range(links):  # unrolled: there are few, and XLA fuses across them
                correction = correct(correction, P_pp, predictions[link], z[link], noises[link])
        mu = relative_weights(c[:rows] / c_total, correction)
        x, P = corrected(x, P, correction)
        d = materialise([a - b for a, b in zip(x, centre, strict=True)])
        moments = mu, [mu * a for a in d], {(i, j): mu * (P[i, j] + d[i] * d[j]) for i, j in P}
        c, S1, S2 = mix(materialise(moments), transitions)

        c_total = c[rows]
        e = [s[rows] / c_total for s in S1]
        m = [a + b for a, b in zip(centre, e, strict=True)]
        spread = dense({(i, j): S2[i, j][rows] / c_total - e[i] * e[j] for i, j in P}) if covariance else None
        return (m, centre, (c, S1, S2), c_total), (jnp.stack(m), spread)

    one = jnp.ones((rows, tracks))
    start = [jnp.asarray(model.start)[link][joint[:, link]] for link in range(links)]
    mu = functools.reduce(jnp.multiply, start)[:, None] * one
    m = [jnp.broadcast_to(model.m0[i], tracks) for i in range(n)]
    moments = mu, [0.0 * one] * n, {(i, j): mu * model.P0[i, j] for i, j in upper(n)}
    T = jnp.moveaxis(jnp.asarray(model.transitions), 0, 1)
    first = m, m, mix(moments, T[0]), jnp.ones(tracks)
    pieces = model.F, model.Q, jnp.concatenate([T[1:], T[-1:]]), z  # the transition that follows the step
    return jax.lax.scan(step, first, pieces)[1]


class ImmEkf(eqx.Module):
    """IMM-EKF: interacting multiple model filter over the joint sight conditions of all links, with EKF updates.

    Its cost grows with modes^links; use :class:`FactorisedImmEkf` for many links.

    Parameters
    ----------
    covariance
        Whether the estimates carry covariances.

    References
    ----------
    Fritsche, Hammes, Klein, Zoubir, ICASSP 2009 [fritsche2013, 5]; Bar-Shalom, Li, Kirubarajan, "Estimation with
    Applications to Tracking and Navigation", 2001, section 11.6.6.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> ImmEkf()(scenario, lb.simulate(scenario, runs=2, seed=0).measurements).covariance.shape
    (2, 4, 4, 4)
    """

    covariance: bool = eqx.field(static=True, default=True, kw_only=True)

    id: ClassVar[str] = "imm-ekf"
    name: ClassVar[str] = "IMM-EKF"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges"})

    @double_precision
    def __call__(self, scenario: Scenario, z: Array, seed: int = 0) -> Estimates:
        """Filter many tracks.

        Parameters
        ----------
        scenario
            The model.
        z
            Ranges in metres, [runs, steps, links], NaN = missing.
        seed
            Not used: the filter draws nothing.

        Raises
        ------
        InputError
            If shapes do not match, a range is infinite, or there are more than 256 joint modes.
        """
        z = check_measurements(scenario, z)
        model = lower(scenario)
        links, modes, _ = model.means.shape
        if modes**links > MAX_JOINT_MODES:
            raise InputError(
                f"{links} links have {modes}^{links} joint sight conditions, the joint filter takes {MAX_JOINT_MODES}",
                "Use the filter imm-ekf-factorised (FactorisedImmEkf), whose cost is linear in the links",
            )
        results = over_tracks(
            imm_ekf,
            model,
            (z,),
            (model.m0, model.P0),
            hypotheses=modes**links,
            kinds=transition_pattern(model),
            covariance=self.covariance,
        )
        return estimates(scenario, *results)
