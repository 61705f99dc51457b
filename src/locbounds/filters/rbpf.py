"""Rao-Blackwellised particle filter: particles for the sight of all links, an EKF for the state of each particle."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array
from locbounds.blocks import Stream, block_key, check_seed
from locbounds.errors import InputError
from locbounds.filters.estimates import Estimates
from locbounds.filters.lowering import Model, check_measurements, estimates, lower, transition_pattern
from locbounds.filters.over_tracks import over_tracks
from locbounds.filters.range_update import (
    IMPOSSIBLE,
    LARGEST_EXPONENT,
    Correction,
    correct,
    corrected,
    direction,
    no_correction,
)
from locbounds.filters.resampling import systematic
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

RESAMPLE_BELOW = 0.5  # of the particles


def rbpf(
    model: Model, z: Array, run: Array, seed: Array, *, kinds: Pattern, particles: int, covariance: bool
) -> tuple[Array, Array | None, Array]:
    """Particles over the sight sequences, each with the Gaussian of an EKF that is told its sequence.

    A step of every particle, whose sight of link l was i_l and whose EKF predicts N(x, P):

    1. link after link, with what the links before have added (all ranges linearised at x): the sight j is drawn with
       probability ``q_j ~ T_ij N(z; h(x) + m_j, S_j)``, the optimal proposal, and the weight is multiplied by
       ``sum_j T_ij N(z; h(x) + m_j, S_j)``, which does not depend on the draw;
    2. the EKF is updated by the drawn sights;
    3. the estimate is the mean of the weighted Gaussians;
    4. systematic resampling where the effective sample size ``1 / sum w^2`` is below half of the particles.

    Weights are kept as logarithms.

    Parameters
    ----------
    model
        The scenario.
    z
        Ranges [steps, links, tracks], NaN = missing: the sight is drawn from the chain.
    run
        Number of each track, [1, 1, tracks]: its random numbers depend on nothing else.
    seed
        Seed of the random numbers, [1, 1, tracks], the same for all.
    kinds, covariance
        As in :func:`locbounds.filters.imm_ekf.imm_ekf`.
    particles
        Their number N; the cost is linear in it, and in links.

    Returns
    -------
    mean [steps, state, tracks], covariance [steps, state, state, tracks] or None, effective sample size
    [steps, tracks] before resampling.
    """
    links, modes, _ = model.means.shape
    dim, n, tracks = model.anchors.shape[1], len(model.m0), z.shape[-1]
    shape = particles, tracks
    # [links, components, modes, 1, 1]
    noises = tuple(
        jnp.moveaxis(jnp.asarray(a), -1, 1)[..., None, None] for a in (model.weights, model.means, model.variances)
    )
    keys = jax.vmap(lambda s, r: block_key(s, Stream.FILTER, r))(seed[0, 0], run[0, 0])

    def uniforms(k: Array) -> tuple[Array, Array]:
        """In (0, 1): [links, particles, tracks] and [tracks]."""
        bits = jax.vmap(lambda key: jax.random.bits(jax.random.fold_in(key, k), (links * particles + 1,), jnp.uint32))
        u = (bits(keys).T + 0.5) * 2.0**-32
        return u[:-1].reshape(links, *shape), u[-1]

    def pick(weights: Array, u: Array) -> Array:
        """Index of the first weight whose cumulative sum exceeds a share of their total."""
        total = jnp.cumsum(weights, axis=0)
        return jnp.sum(total[:-1] <= u * total[-1], axis=0)

    def at(index: Array, values: Array) -> Array:
        return sum(jnp.where(index == j, values[j], 0.0) for j in range(modes))  # pyright: ignore[reportReturnType]

    def step(carry: Any, piece: Any) -> Any:
        x, P, sight, log_w = carry
        F, Q, transitions, z, k = piece
        u_sight, u_resample = uniforms(k)
        x, P = apply(F, kinds, x), congruence(F, kinds, P)
        P = {(i, j): P[i, j] + Q[i, j] for i, j in P}
        x, P = materialise((x, P))
        P_pp = {pair: P[pair] for pair in upper(dim)}

        def link(so_far: Any, piece: Any) -> Any:
            y, K, log_w = so_far
            sight, T, z, anchor, noise, uniform = piece
            h, u = direction(x[:dim], anchor)
            t = times(P_pp, u)
            a = [u_i - k_i for u_i, k_i in zip(u, times(K, t), strict=True)]
            innovation, v = materialise((z - h - dot(t, y), dot(t, a)))
            along = jnp.broadcast_to(v, (modes, *shape))
            one = jnp.ones_like(along)
            of_mode = correct(no_correction(along, 1), {(0, 0): along}, (0.0 * one, [one]), innovation, noise)
            c = jnp.stack([at(sight, T[:, j]) for j in range(modes)])
            least = jnp.min(jnp.where(c > IMPOSSIBLE, of_mode.energy, jnp.inf), axis=0)
            excess = jnp.maximum(of_mode.energy - least, -LARGEST_EXPONENT)
            q = materialise(c * jnp.sqrt(of_mode.scale) * jnp.exp(-0.5 * excess))
            sight = pick(q, uniform)
            e, s = at(sight, of_mode.y[0]), at(sight, of_mode.K[0, 0])
            y = [y_i + a_i * e for y_i, a_i in zip(y, a, strict=True)]
            K = {(i, j): K[i, j] + a[i] * a[j] * s for i, j in K}
            log_w = log_w + jnp.log(jnp.sum(q, axis=0)) - 0.5 * least
            return materialise((y, K, log_w)), sight

        nothing = no_correction(x[0], dim)
        pieces = sight, transitions, z, jnp.asarray(model.anchors), noises, u_sight
        (y, K, log_w), sight = jax.lax.scan(link, (nothing.y, nothing.K, log_w), pieces)
        x, P = materialise(corrected(x, P, Correction(y, K, nothing.energy, nothing.scale)))

        log_w = log_w - jnp.max(log_w, axis=0)
        w = jnp.exp(log_w)
        w = materialise(w / jnp.sum(w, axis=0))
        mean = [jnp.sum(w * a, axis=0) for a in x]
        spread = None
        if covariance:
            d = [a - m for a, m in zip(x, mean, strict=True)]
            spread = dense({(i, j): jnp.sum(w * (P[i, j] + d[i] * d[j]), axis=0) for i, j in P})
        effective = 1.0 / jnp.sum(w * w, axis=0)

        few = effective < RESAMPLE_BELOW * particles
        state = [*x, *P.values(), *(sight[l] for l in range(links)), log_w]

        def resample(state: list[Array]) -> list[Array]:
            index = jnp.where(few, systematic(w, u_resample), jnp.arange(particles)[:, None])
            flat = index * tracks + jnp.arange(tracks)
            *kept, log_w = (jnp.take(a.reshape(-1), flat, mode="clip") for a in state)
            return [*kept, jnp.where(few, 0.0, log_w)]

        state = jax.lax.cond(jnp.any(few), resample, lambda state: state, state)
        x, pairs = state[:n], upper(n)
        P = dict(zip(pairs, state[n : n + len(pairs)], strict=True))
        sight, log_w = jnp.stack(state[n + len(pairs) : -1]), state[-1]
        return (x, P, sight, log_w), (jnp.stack(mean), spread, effective)

    P_0 = symmetric(jnp.asarray(model.P0))
    start = jnp.broadcast_to(jnp.asarray(model.start).T[:, :, None, None], (modes, links, *shape))
    first = (
        [jnp.broadcast_to(model.m0[i], shape) for i in range(n)],
        {pair: jnp.broadcast_to(P_0[pair], shape) for pair in upper(n)},
        pick(start, uniforms(jnp.asarray(0))[0]),
        jnp.zeros(shape),
    )
    transitions = jnp.moveaxis(jnp.asarray(model.transitions), 0, 1)
    return jax.lax.scan(step, first, (model.F, model.Q, transitions, z, 1 + jnp.arange(len(z))))[1]


class Rbpf(eqx.Module):
    """Rao-Blackwellised particle filter: particles for the sight of all links, an EKF for the state of each particle.

    With many particles it converges to the mixture of the EKFs of all sight sequences, for linear measurements to the
    exact posterior. Its cost is linear in particles and in links.

    Parameters
    ----------
    particles
        Their number, at least 2; Chen 2010 uses 100.
    covariance
        Whether the estimates carry covariances.

    Raises
    ------
    InputError
        If there are fewer than two particles.

    Notes
    -----
    Chen 2010 compares with an "improved" filter of this kind and only cites it; what was chosen here: the sight of each
    link is drawn from its optimal proposal, given the range (that is the improvement), weights are logarithms, and
    systematic resampling happens where the effective sample size falls below half of the particles.

    ``diagnostics["effective"]`` [runs, steps+1] is the effective sample size before resampling, as a share of the
    particles.

    References
    ----------
    Chen, Wu, "Mobile localization with NLOS mitigation using improved Rao-Blackwellized particle filtering algorithm",
    IEEE ISCE 2009.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> found = Rbpf(20)(scenario, lb.simulate(scenario, runs=2, seed=0).measurements)
    >>> found.mean.shape, bool(found.diagnostics["effective"].min() > 0)
    ((2, 4, 4), True)
    """

    particles: int = eqx.field(static=True, default=100)
    covariance: bool = eqx.field(static=True, default=True, kw_only=True)

    id: ClassVar[str] = "rbpf"
    name: ClassVar[str] = "RBPF"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges"})

    def __check_init__(self):
        number = self.particles
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 2:
            raise InputError(f"the number of particles is {number!r}", "Give a whole number of at least 2, e.g. 100")

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
            Seed of the particles; those of a track depend on it and on the track's place among the runs only.

        Raises
        ------
        InputError
            If shapes do not match, a range is infinite, or the seed is none.
        """
        z = check_measurements(scenario, z)
        model = lower(scenario)
        run = np.arange(len(z), dtype=np.uint32)[:, None, None]
        mean, covariance, effective = over_tracks(
            rbpf,
            model,
            (z, run, np.full_like(run, check_seed(seed))),
            (model.m0, model.P0, np.full((), float(self.particles))),
            hypotheses=self.particles,
            kinds=transition_pattern(model),
            particles=int(self.particles),
            covariance=self.covariance,
        )
        return estimates(scenario, mean, covariance, effective=effective / self.particles)
