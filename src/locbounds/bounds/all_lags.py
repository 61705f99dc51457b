r"""The bound's quadratic form with the information of *all* lags, by additive functionals: no table, no window.

For any matrix V, ``E'V + V'E - V'JV`` lies below the bound ``E'J^-1 E``. V is taken from the covariance recursion of a
short window (:mod:`locbounds.bounds.recursion`): with the window's covariance S_k, its closed-loop matrix
``M_k = (I - S_k[:, p] D_k) shift_k`` and ``L_k = S_k[:, newest position]``,

    T_k = V_k' s = M_k T_{k-1} + L_k u_k s_k(r_k)

is an additive functional of the modes, u_k being the gradient of the measurement and s_k the location score of its
noise. ``X_k = V_k' J_z(k) V_k = Cov(E[T_k | track, noise])`` therefore grows by

    X_k = M_k X_{k-1} M_k' + E[xi xi' - c l' - l c' + l (I_k - Var(s_k | w_{1:k})) l'],      l = L_k u_k

with the symbols of :mod:`locbounds.bounds.score_covariance` and one vector per draw and mode,
``b(r) = M_k (E[T_{k-1} | r_{k-1} = r] - E[T_{k-1} | r_{k-1} = 0])``, in the place of the differences of all earlier
steps: ``xi = sum_r (q - p)(r) b(r)``, ``c = sum_r c(r) b(r)``.
Nothing is left out, whatever the window: it only chooses V. Work per draw and step is
constant. See docs/theory/score.md.
"""

from functools import partial, reduce
from operator import add
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Int
from locbounds.blocks import Stream, block_key
from locbounds.bounds.expectation import Expectation, Prior
from locbounds.bounds.recursion import Window, linear_model
from locbounds.bounds.score_covariance import NoiseProcess, mode_information, noise_process
from locbounds.linalg import psd_root
from locbounds.noise import Noise
from locbounds.scenario import Link, Scenario, alike
from locbounds.sight.draws import next_sight
from locbounds.simulation import draw_noise

RIDGE = 1e-10  # of the scaled window covariance, which is singular where the motion is


class Corrected(NamedTuple):
    """What one block of draws says about the bound at steps 0..K.

    Attributes
    ----------
    covariance
        ``E'V + V'E - V'JV`` with J from draws that V does not depend on: unbiased for a lower bound.
    replicates
        Deviations of the groups' position mean square error.
    windowed
        The recursion's own covariance: the inverse of the information inside the window.
    position_mse
        Inside the window and with all lags, both from the draws that made V: the two share their sampling errors.
    increments
        Information inside the window from this block's pilot alone, for V of later blocks.
    """

    covariance: Float[Array, "times state state"]
    replicates: Float[Array, "groups times"]
    windowed: Float[Array, "times state state"]
    position_mse: Float[Array, "2 times"]
    increments: Float[Array, "steps ages_space ages_space"]


class _Chains(NamedTuple):
    """What is carried for links of one structure; groups lead, those that make V (the pilot) before the others."""

    sight: Int[Array, "groups links paths"]
    law: Float[Array, "links modes"]
    p: list[Float[Array, "groups links paths"]]  # by mode
    all: Float[Array, "groups size others links paths"]  # E[T | r] - E[T | 0]
    recent: Float[Array, "pilot ages_space others links paths"]  # the same of every score in the window by itself


class _News(NamedTuple):
    """What the new measurement says about the modes before and now."""

    p: list[Float[Array, "groups links paths"]]
    change: list[Float[Array, "groups links paths"]]  # q - p at the modes that are not the first
    cross: list[Float[Array, "groups links paths"]]  # c
    gain: Float[Array, "groups links paths"]  # known-mode information minus Var(s_k | w_{1:k})
    mixing: list[list[Float[Array, "groups links paths"]]]  # backward kernel's differences, [before][now]
    jump: list[Float[Array, "groups links paths"]]  # s(r) - s(0)


def _hear(p, T, noises: tuple[Noise, ...], w, known, reported) -> _News:
    """One step of the filter of the modes, for all links and draws; modes are unrolled, so that XLA fuses them."""
    modes = range(len(noises))
    here = reported[:, None]
    log_l, s = (
        [jnp.where(here, jax.vmap(of, (0, 1), 1)(law, w), 0.0) for law in noises]
        for of in (lambda law, w: law.log_prob(w), lambda law, w: law.score(w))
    )
    joint = [[p[i] * T[:, i, j, None] for j in modes] for i in modes]  # [before][now]
    log_l = [jnp.where(_total(joint[i][j] for i in modes) > 0, log_l[j], -jnp.inf) for j in modes]  # else no say
    top = log_l[0]
    for other in log_l[1:]:
        top = jnp.maximum(top, other)
    l = [jnp.exp(log_l[j] - top) for j in modes]
    scale = 1 / _total(joint[i][j] * l[j] for i in modes for j in modes)
    joint = [[joint[i][j] * (l[j] * scale) for j in modes] for i in modes]
    now = [_total(joint[i][j] for i in modes) for j in modes]
    before = [_total(joint[i]) for i in modes]
    a = _total(now[j] * s[j] for j in modes)
    per_now = [1 / jnp.where(now[j] > 0, now[j], 1.0) for j in modes]
    others = modes[1:]
    return jax.lax.optimization_barrier(
        _News(
            now,
            [before[i] - p[i] for i in others],
            [_total(joint[i][j] * s[j] for j in modes) - a * before[i] for i in others],
            jnp.where(here, known[:, None], 0.0) - _total(now[j] * s[j] ** 2 for j in modes) + a**2,
            [[joint[i][j] * per_now[j] - joint[i][0] * per_now[0] for j in others] for i in others],
            [s[j] - s[0] for j in others],
        )
    )


def _total(terms):
    return reduce(add, terms)


def _growth(
    older: Float[Array, "groups size others links paths"], l: Float[Array, "groups size links paths"], news: _News
) -> Float[Array, "groups size size"]:
    """Group sums of ``xi xi' - c l' - l c' + l gain l'``: two matrix products per group."""

    def rows(x):
        return x.reshape(*x.shape[:2], -1)

    def over(modes):
        return sum(mode[:, None] * older[:, :, i] for i, mode in enumerate(modes))

    xi = rows(over(news.change))
    half = rows(0.5 * news.gain[:, None] * l - over(news.cross))
    one_side = half @ jnp.swapaxes(rows(l), 1, 2)
    return xi @ jnp.swapaxes(xi, 1, 2) + one_side + jnp.swapaxes(one_side, 1, 2)


def _mix(older, l, news: _News):
    """``E[T_k | r_k = j] - E[T_k | r_k = 0]`` from those of the step before."""
    others = range(older.shape[2])
    each = [
        sum(news.mixing[i][j][:, None] * older[:, :, i] for i in others) + news.jump[j][:, None] * l for j in others
    ]
    return jnp.stack(each, 2)


def _times(M: Float[Array, "a b"], x: Float[Array, "groups b *n"]) -> Float[Array, "groups a *n"]:
    product = jnp.broadcast_to(M, (len(x), *M.shape)) @ x.reshape(*x.shape[:2], -1)
    return product.reshape(len(x), len(M), *x.shape[2:])


def _constants(links: list[Link], scenario: Scenario) -> tuple[NoiseProcess, Array]:
    """Noise processes and known-mode informations of links of one structure, with a leading axis of links."""
    each = [noise_process(scenario, link) for link in links]
    processes = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(x) for x in leaves]), *each)
    return processes, jnp.stack([mode_information(process) for process in each])


@partial(jax.jit, static_argnames=("groups", "paths", "pilot", "window"))
def corrected_bound(
    scenario: Scenario,
    expectation: Expectation,
    seed: Array,
    block: Array,
    earlier: Float[Array, "steps ages_space ages_space"],
    *,
    groups: int,
    paths: int,
    pilot: int,
    window: int,
) -> Corrected:
    """One block: ``pilot`` groups of paths make V, with those of earlier blocks, ``groups`` others the value.

    Every step's draws have a key of their own, so that what is computed for a step does not depend on how many come
    after it. What is carried from step to step does not grow with them.
    """
    model = linear_model(scenario)
    n_state, index = len(model.P0), np.array(model.position)
    S_window = Window(model, window)
    size, space = S_window.size, len(index)
    every = pilot + groups
    n = every * paths
    tracks, noise = (block_key(seed, stream, block) for stream in (Stream.TRACKS, Stream.SIGHT_AND_NOISE))
    kinds = alike(scenario.links)
    constants = [_constants([scenario.links[m] for m in members], scenario) for members, _ in kinds]
    streamed = isinstance(expectation, Prior)
    roots = psd_root(scenario.process_noise)
    given = None if streamed else jnp.moveaxis(expectation.positions(scenario, tracks, n), 0, 1)

    def first_chains(process: NoiseProcess, number: int) -> _Chains:
        links, modes = process.start.shape
        keys = jax.vmap(partial(jax.random.fold_in, jax.random.fold_in(noise, 0)))(number + jnp.arange(links))

        def draw(law, key):
            return next_sight(law[None], jnp.zeros((every, paths), int), jax.random.uniform(key, (every, paths)))

        return _Chains(
            jax.vmap(draw, 0, 1)(process.start, keys),
            process.start,
            [jnp.broadcast_to(process.start[:, r, None], (every, links, paths)) for r in range(modes)],
            jnp.zeros((every, size, modes - 1, links, paths)),
            jnp.zeros((pilot, window * space, modes - 1, links, paths)),
        )

    offsets = np.cumsum([0, *(len(members) for members, _ in kinds)])
    root0 = psd_root(model.P0)
    x0 = scenario.prior.mean + jax.random.normal(jax.random.fold_in(tracks, 0), (n, n_state)) @ root0

    def step(carry, inputs):
        S, missing_pilot, missing, x, chains = carry
        k, F, Q, root, pieces, given, before_D = inputs
        if streamed:
            x = x @ F.T + jax.random.normal(jax.random.fold_in(tracks, k), x.shape) @ root
            position = scenario.motion.position(x)
        else:
            position = jnp.broadcast_to(given, (n, space))

        heard, own = [], jnp.zeros((window * space, window * space))
        for chain, (process, info), (T, reported), (_, like), first in zip(
            chains, constants, pieces, kinds, offsets, strict=False
        ):
            links = len(T)
            keys = jax.vmap(partial(jax.random.fold_in, jax.random.fold_in(noise, k)))(first + jnp.arange(links))

            def draw(key, T, sight, noises):
                change, disturb = jax.random.split(key)
                sight = next_sight(T, sight, jax.random.uniform(change, sight.shape))
                return sight, draw_noise(disturb, noises, sight)

            def gradients(link):
                return jnp.moveaxis(jax.vmap(jax.grad(link.measurement))(position).reshape(every, paths, space), 2, 1)

            drawn = jax.vmap(draw, (0, 0, 1, 0), 1)(keys, T, chain.sight, process.noises)
            (sight, w), u = jax.lax.optimization_barrier((drawn, jax.vmap(gradients, 0, 2)(like)))  # compute once
            law = jnp.einsum("li,lij->lj", chain.law, T)
            news = _hear(chain.p, T, process.noises, w, jnp.sum(law * info, -1), reported)
            of_pilot = jax.tree.map(lambda x: x[:pilot], news)
            recent = jnp.concatenate([jnp.zeros_like(chain.recent[:, :space]), chain.recent[:, :-space]], 1)
            l = jnp.zeros((pilot, window * space, links, paths)).at[:, :space].set(u[:pilot])
            own += _growth(recent, l, of_pilot).sum(0) / (pilot * paths)
            recent = _mix(recent, l, of_pilot)
            heard.append((_Chains(sight, law, news.p, chain.all, recent), news, u))

        D = (block * before_D + own) / (block + 1)
        S = S_window.update(S_window.predict(S, F, Q), D)
        P = S[:, S_window.observed]
        M = (jnp.eye(size).at[:, S_window.observed].add(-P @ D)) @ S_window.shift(F)
        growth, chains = jnp.zeros((every, size, size)), []
        for chain, news, u in heard:
            older, l = _times(M, chain.all), _times(P[:, :space], u)
            growth += _growth(older, l, news) / paths
            chains.append(chain._replace(all=_mix(older, l, news)))
        missing_pilot = M @ missing_pilot @ M.T + P @ own @ P.T - growth[:pilot].mean(0)
        missing = M @ missing @ M.T + P @ D @ P.T - growth[pilot:]

        A = _best_combination(S, missing_pilot, n_state)
        mean = missing.mean(0)
        value = S[:n_state] @ A
        value = value + value.T - A.T @ (S - mean) @ A
        best = A[:, index]
        spread = jnp.einsum("ai,gab,bi->g", best, missing - mean, best)
        of_pilot = S[:n_state] @ A
        of_pilot = jnp.trace((of_pilot + of_pilot.T - A.T @ (S - missing_pilot) @ A)[np.ix_(index, index)])
        bare = S[:n_state, :n_state]
        return (S, missing_pilot, missing, x, chains), (value, spread, bare, of_pilot, own)

    zero = jnp.zeros((size, size))
    first = (
        S_window.first(),
        zero,
        jnp.zeros((groups, size, size)),
        x0 if streamed else None,
        [first_chains(process, int(m)) for (process, _), m in zip(constants, offsets, strict=False)],
    )
    pieces = [(jnp.swapaxes(p.transitions, 0, 1), jnp.swapaxes(p.reports, 0, 1)) for p, _ in constants]
    inputs = jnp.arange(1, scenario.steps + 1), model.F, model.Q, roots, pieces, given, earlier
    _, (value, spread, bare, of_pilot, own) = jax.lax.scan(step, first, inputs)
    P0 = model.P0[None]
    at_zero = jnp.sum(jnp.diag(model.P0)[index])[None]
    windowed = jnp.concatenate([P0, bare])
    return Corrected(
        jnp.concatenate([P0, value]),
        jnp.concatenate([jnp.zeros((groups, 1)), spread.T], axis=1),
        windowed,
        jnp.stack([windowed[:, index, index].sum(-1), jnp.concatenate([at_zero, of_pilot])]),
        own,
    )


def _best_combination(S, missing, n_state: int) -> Float[Array, "size state"]:
    """A for which V A gives the largest value when ``V'JV = S - missing``: ``(S - missing)^-1 S e``.

    Any other A is as valid, so that the ridge, which keeps a singular S harmless, costs nothing but a little height.
    """
    scale = jnp.sqrt(jnp.diag(S))
    scale = jnp.where(scale > 0, scale, 1.0)
    N = (S - missing) / (scale[:, None] * scale) + RIDGE * jnp.eye(len(S))
    step = jnp.linalg.solve(N, missing[:, :n_state] / scale[:, None]) / scale[:, None]
    return jnp.eye(len(S), n_state) + step
