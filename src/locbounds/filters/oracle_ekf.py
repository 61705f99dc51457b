"""Extended Kalman filter that is told the sight of every link."""

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
from locbounds.filters.range_update import correct, corrected, direction, no_correction
from locbounds.filters.tracks_last import (
    Pattern,
    apply,
    congruence,
    dense,
    materialise,
    symmetric,
    upper,
)
from locbounds.precision import double_precision, traced
from locbounds.scenario import Scenario


def oracle_ekf(
    model: Model, z: Array, sight: Array, *, kinds: Pattern, covariance: bool, printed_gain: bool = False
) -> tuple[Array, Array | None]:
    """EKF with the noise of the true sight: all ranges of a step linearised at its predicted mean.

    Parameters
    ----------
    model
        The scenario; its chains are not used.
    z
        Ranges [steps, links, tracks], NaN = missing.
    sight
        True sight [steps, links, tracks].
    kinds, covariance
        As in :func:`locbounds.filters.imm_ekf.imm_ekf`.
    printed_gain
        See :class:`OracleEkf`.
    """
    modes = model.means.shape[1]
    dim, n, tracks = model.anchors.shape[1], len(model.m0), z.shape[-1]
    # [links, modes, components, 1]
    noises = tuple(jnp.asarray(a)[..., None] for a in (model.weights, model.means, model.variances))

    def step(carry: Any, piece: Any) -> Any:
        x, P = carry
        F, Q, z, sight = piece
        x, P = apply(F, kinds, x), congruence(F, kinds, P)
        P = {(i, j): P[i, j] + Q[i, j] for i, j in P}
        x, P = materialise((x, P))
        P_pp = {pair: P[pair] for pair in upper(dim)}

        def link(correction: Any, piece: Any) -> Any:
            z, sight, anchor, noise = piece
            noise = [jnp.sum(jnp.stack([(sight == j) * a[j] for j in range(modes)]), axis=0) for a in noise]
            seen = direction(x[:dim], anchor)
            alone = correct(no_correction(x[0], dim), P_pp, seen, z, noise).y if printed_gain else None
            return correct(correction, P_pp, seen, z, noise), alone

        pieces = z, sight, jnp.asarray(model.anchors), noises
        correction, alone = jax.lax.scan(link, no_correction(x[0], dim), pieces)
        if printed_gain:
            correction = correction._replace(y=[jnp.sum(y, axis=0) for y in alone])
        x, P = materialise(corrected(x, P, correction))
        return (x, P), (jnp.stack(x), dense(P) if covariance else None)

    P_0 = symmetric(jnp.asarray(model.P0))
    first = (
        [jnp.broadcast_to(model.m0[i], tracks) for i in range(n)],
        {pair: jnp.broadcast_to(P_0[pair], tracks) for pair in P_0},
    )
    return jax.lax.scan(step, first, (model.F, model.Q, z, sight))[1]


class OracleEkf(eqx.Module):
    """Extended Kalman filter that is told the sight of every link at every step: how much knowing the sight is worth.

    Parameters
    ----------
    covariance
        Whether the estimates carry covariances.
    printed_gain
        The decentralised EKF of Chen 2010, eqs. (22)-(26), sums one correction per link. With the gain of the fused
        covariance (26), ``K_i = P H_i^T / R_i``, it is this filter. As printed, (24)-(25) take the covariance that
        link i alone would leave, so that every link's correction acts on the whole prior uncertainty: together they
        overshoot. True: as printed. The covariance is (26) in both.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> draws = lb.simulate(scenario, runs=2, seed=0)
    >>> OracleEkf()(scenario, draws.measurements, 0, draws.sight).mean.shape
    (2, 4, 4)
    """

    covariance: bool = eqx.field(static=True, default=True, kw_only=True)
    printed_gain: bool = eqx.field(static=True, default=False, kw_only=True)

    id: ClassVar[str] = "oracle-ekf"
    name: ClassVar[str] = "Oracle EKF"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges", "sight"})

    @double_precision
    def __call__(self, scenario: Scenario, z: Array, seed: int = 0, sight: Array | None = None) -> Estimates:
        """Filter many tracks.

        Parameters
        ----------
        scenario
            The model.
        z
            Ranges in metres, [runs, steps, links], NaN = missing.
        seed
            Not used: the filter draws nothing.
        sight
            True sight, [runs, steps, links], 0 = LOS, 1 = NLOS.

        Raises
        ------
        InputError
            If shapes do not match, a range is infinite, or the sight is missing or not one of the scenario's.
        """
        if sight is None:
            raise InputError(
                f"{self.id} was not told the sight of the links, which it needs",
                "Give sight [runs, steps, links] (simulated tracks have it), or use a filter that sees the ranges only",
            )
        z = check_measurements(scenario, z)
        model = lower(scenario)
        modes = model.means.shape[1]
        if not traced(sight):
            sight = np.asarray(sight)
            if sight.shape != z.shape or not np.isin(sight, np.arange(modes)).all():
                raise InputError(
                    f"the sight has shape {sight.shape} and values {np.unique(sight)[:5]}",
                    f"Give one of 0..{modes - 1} for each range, shape {z.shape}",
                )
        results = over_tracks(
            oracle_ekf,
            model,
            (z, sight),
            (model.m0, model.P0),
            hypotheses=2,
            kinds=transition_pattern(model),
            covariance=self.covariance,
            printed_gain=self.printed_gain,
        )
        return estimates(scenario, *results)
