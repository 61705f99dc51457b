"""EKF banks with data fusion: one bank of EKFs per link, fused in information form."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array
from locbounds.filters.estimates import Estimates
from locbounds.filters.lowering import Model, check_measurements, estimates, lower, transition_pattern
from locbounds.filters.over_tracks import over_tracks
from locbounds.filters.range_update import Correction, correct, corrected, direction, no_correction, relative_weights
from locbounds.filters.tracks_last import (
    Pattern,
    apply,
    congruence,
    dense,
    dot,
    materialise,
    symmetric,
    times,
    upper,
)
from locbounds.precision import double_precision
from locbounds.scenario import Scenario


def ekf_banks(model: Model, z: Array, *, kinds: Pattern, covariance: bool) -> tuple[Array, Array | None, Array]:
    r"""One bank of EKFs per link, each from the fused prediction, and Bayesian fusion of what they learnt.

    With the prediction N(x, P) of all links, the direction u of link i and ``v = u^T P u``, the EKF of mode j has the
    innovation variance ``1/s_j`` and the mean ``x + P u e_j``, ``e_j = s_j (z - h(x) - m_j)``. The bank's posterior,
    the mixture of its modes with probabilities ``mu_j ~ c_j N(z; h(x) + m_j, 1/s_j)``, ``c = mu T``, has the moments

        x_i = x + P u e,     P_i = P - kappa P u u^T P,     e = sum mu_j e_j,     kappa = sum mu_j (s_j - (e_j - e)^2).

    What the link has added to the prediction is the scalar information ``lambda = kappa / (1 - kappa v)`` along u,
    ``P_i^-1 = P^-1 + lambda u u^T``, and ``P_i^-1 (x_i - x) = u e (1 + lambda v)``. The prediction is common to all
    banks and is counted once:

        P+^-1 = P^-1 + sum_i lambda_i u_i u_i^T,     x+ = x + P+ sum_i u_i e_i (1 + lambda_i v_i).

    Where the modes disagree about the position the mixture is wider than the prediction and lambda negative; it is
    clipped at zero (the link then moves the mean, and adds no certainty), and such updates are counted.

    Parameters
    ----------
    model
        The scenario.
    z
        Ranges [steps, links, tracks], NaN = missing: nothing is added, and the chain goes on.
    kinds, covariance
        As in :func:`locbounds.filters.imm_ekf.imm_ekf`.

    Returns
    -------
    mean [steps, state, tracks], covariance [steps, state, state, tracks] or None, clipped links [steps, tracks].
    """
    modes = model.means.shape[1]
    dim, n, tracks = model.anchors.shape[1], len(model.m0), z.shape[-1]
    # [links, components, modes, 1]
    noises = tuple(
        jnp.moveaxis(jnp.asarray(a), -1, 1)[..., None] for a in (model.weights, model.means, model.variances)
    )

    def over_modes(values: Array) -> Array:
        return sum(values[j] for j in range(modes))  # pyright: ignore[reportReturnType]

    def step(carry: Any, piece: Any) -> Any:
        x, P, mu = carry
        F, Q, transitions, z = piece
        x, P = apply(F, kinds, x), congruence(F, kinds, P)
        P = {(i, j): P[i, j] + Q[i, j] for i, j in P}
        x, P = materialise((x, P))
        P_pp = {pair: P[pair] for pair in upper(dim)}

        def link(fused: Any, piece: Any) -> Any:
            K, b = fused
            mu, T, z, anchor, noise = piece
            h, u = direction(x[:dim], anchor)
            v = dot(u, times(P_pp, u))
            c = jnp.stack([sum(T[i, j] * mu[i] for i in range(modes)) for j in range(modes)])
            along = jnp.broadcast_to(v, c.shape)  # the bank, one row per mode, in the coordinate along u
            bank = correct(no_correction(along, 1), {(0, 0): along}, (h, [jnp.ones_like(along)]), z, noise)
            mu = relative_weights(c, bank)
            mu = materialise(mu / over_modes(mu))
            e = over_modes(mu * bank.y[0])
            kappa = over_modes(mu * (bank.K[0, 0] - (bank.y[0] - e) ** 2))
            clipped = kappa < 0
            information = jnp.where(clipped, 0.0, kappa / (1.0 - kappa * v))
            t = times(P_pp, u)
            a = [u_i - k_i for u_i, k_i in zip(u, times(K, t), strict=True)]
            s = information / (1.0 + information * dot(t, a))
            K = {(i, j): K[i, j] + a[i] * a[j] * s for i, j in K}
            b = [b_i + u_i * e * (1.0 + information * v) for b_i, u_i in zip(b, u, strict=True)]
            return materialise((K, b)), (mu, clipped)

        nothing = no_correction(x[0], dim)
        pieces = mu, transitions, z, jnp.asarray(model.anchors), noises
        (K, b), (mu, clipped) = jax.lax.scan(link, (nothing.K, nothing.y), pieces)
        y = [b_i - k_i for b_i, k_i in zip(b, times(K, times(P_pp, b)), strict=True)]
        x, P = materialise(corrected(x, P, Correction(y, K, nothing.energy, nothing.scale)))
        return (x, P, mu), (jnp.stack(x), dense(P) if covariance else None, jnp.sum(clipped * 1.0, axis=0))

    P_0 = symmetric(jnp.asarray(model.P0))
    first = (
        [jnp.broadcast_to(model.m0[i], tracks) for i in range(n)],
        {pair: jnp.broadcast_to(P_0[pair], tracks) for pair in P_0},
        jnp.broadcast_to(jnp.asarray(model.start)[..., None], (*model.start.shape, tracks)),
    )
    transitions = jnp.moveaxis(jnp.asarray(model.transitions), 0, 1)
    return jax.lax.scan(step, first, (model.F, model.Q, transitions, z))[1]


class EkfBanks(eqx.Module):
    """EKF banks with data fusion: per link one EKF for each sight condition, fused over links by their information.

    Its cost is linear in links.

    Parameters
    ----------
    covariance
        Whether the estimates carry covariances.

    Notes
    -----
    Chen 2010 compares with this filter and only cites it; what was chosen here: both EKFs of a bank start from the
    fused prediction (feedback), the probabilities of the modes are carried per link, and the scalar information that a
    link adds is clipped at zero. ``diagnostics["clipped"]`` [runs] is the share of updates where that happened.

    References
    ----------
    Chen, Wu, "Mobile positioning in mixed LOS/NLOS conditions using modified EKF banks and data fusion method", IEICE
    Trans. Commun., 2009.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> found = EkfBanks()(scenario, lb.simulate(scenario, runs=2, seed=0).measurements)
    >>> found.covariance.shape, found.diagnostics["clipped"].shape
    ((2, 4, 4, 4), (2,))
    """

    covariance: bool = eqx.field(static=True, default=True, kw_only=True)

    id: ClassVar[str] = "ekf-banks"
    name: ClassVar[str] = "EKF banks"
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
            If shapes do not match or a range is infinite.
        """
        z = check_measurements(scenario, z)
        model = lower(scenario)
        mean, covariance, clipped = over_tracks(
            ekf_banks,
            model,
            (z,),
            (model.m0, model.P0, np.zeros(())),
            hypotheses=4 * model.means.shape[1],
            kinds=transition_pattern(model),
            covariance=self.covariance,
        )
        updates = (~jnp.isnan(z)).sum(axis=(1, 2))
        return estimates(scenario, mean, covariance, clipped=clipped.sum(axis=1) / jnp.maximum(updates, 1))
