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
Nothing is left out, whatever the window: it only chooses V. Work per draw and step is constant. See
docs/theory/score.md.
"""

from functools import partial, reduce
from operator import add
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds.expectation import Expectation
from locbounds.bounds.recursion import Window, linear_model
from locbounds.bounds.streams import Draws, Kind, reports_of
from locbounds.noise import Noise
from locbounds.scenario import Scenario

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
    increments: Float[Array, "times ages_space ages_space"]


class _Chains(NamedTuple):
    """What is carried for links of one structure; groups lead, those that make V (the pilot) before the others."""

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
    return _News(
        now,
        [before[i] - p[i] for i in others],
        [_total(joint[i][j] * s[j] for j in modes) - a * before[i] for i in others],
        jnp.where(here, known[:, None], 0.0) - _total(now[j] * s[j] ** 2 for j in modes) + a**2,
        [[joint[i][j] * per_now[j] - joint[i][0] * per_now[0] for j in others] for i in others],
        [s[j] - s[0] for j in others],
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


@partial(jax.jit, static_argnames=("groups", "paths", "pilot", "window"))
def corrected_bound(
    scenario: Scenario,
    expectation: Expectation,
    seed: Array,
    block: Array,
    earlier: Float[Array, "times ages_space ages_space"],
    *,
    groups: int,
    paths: int,
    pilot: int,
    window: int,
) -> Corrected:
    """One block: ``pilot`` groups of paths make V, with those of earlier blocks, ``groups`` others the value.

    What is carried from step to step does not grow with them. Step 0 hears nothing. The draws of a step are made in
    the round before: what is carried is computed once, whereas XLA repeats what it can fuse into several kernels.
    """
    model = linear_model(scenario)
    n_state, index = len(model.P0), np.array(model.position)
    S_window = Window(model, window)
    size, space = S_window.size, len(index)
    every = pilot + groups
    draws = Draws(scenario, expectation, seed, block, every, paths)
    kinds = draws.kinds

    def first_chains(kind: Kind) -> _Chains:
        start = kind.process.start
        links, modes = start.shape
        return _Chains(
            start,
            [jnp.broadcast_to(start[:, r, None], (every, links, paths)) for r in range(modes)],
            jnp.zeros((every, size, modes - 1, links, paths)),
            jnp.zeros((pilot, window * space, modes - 1, links, paths)),
        )

    def step(carry, inputs):
        S, missing_pilot, missing, chains, x, drawn = carry
        (F, Q, reports, before_D), coming = inputs
        transitions = [chain[coming.k - 1] for chain in all_transitions]
        coming = coming._replace(transitions=[chain[coming.k] for chain in all_transitions])

        heard, own = [], jnp.zeros((window * space, window * space))
        for kind, chain, (_, w, u), T, reported in zip(kinds, chains, drawn, transitions, reports, strict=True):
            law = jnp.einsum("li,lij->lj", chain.law, T)
            news = _hear(chain.p, T, kind.process.noises, w, jnp.sum(law * kind.information, -1), reported)
            of_pilot = jax.tree.map(lambda x: x[:pilot], news)
            recent = jnp.concatenate([jnp.zeros_like(chain.recent[:, :space]), chain.recent[:, :-space]], 1)
            l = jnp.concatenate([u[:pilot], jnp.zeros((pilot, (window - 1) * space, *u.shape[2:]))], 1)
            own += _growth(recent, l, of_pilot).sum(0) / (pilot * paths)
            heard.append((_Chains(law, news.p, chain.all, _mix(recent, l, of_pilot)), news, u))

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
        best = A[:, index]
        spread = jnp.einsum("ai,gab,bi->g", best, missing - mean, best)
        bare = S[:n_state, :n_state]
        of_pilot = jnp.trace(_value(S, missing_pilot, A)[np.ix_(index, index)])
        x, drawn = draws.next(x, drawn, coming)
        return (S, missing_pilot, missing, chains, x, drawn), (_value(S, mean, A), spread, bare, of_pilot, own)

    first = (
        S_window.first(),
        jnp.zeros((size, size)),
        jnp.zeros((groups, size, size)),
        [first_chains(kind) for kind in kinds],
        *draws.first(),
    )
    steps = draws.steps()
    nothing = jnp.eye(n_state)[None], jnp.zeros((1, n_state, n_state))
    now = (
        jnp.concatenate([nothing[0], model.F]),
        jnp.concatenate([nothing[1], model.Q]),
        [jnp.concatenate([jnp.zeros_like(reports[:1]), reports]) for reports in map(reports_of, kinds)],
        earlier,
    )
    all_transitions = [  # the largest of the model's numbers: kept once
        jnp.concatenate([jnp.broadcast_to(jnp.eye(T.shape[-1]), T[:1].shape), T, T[-1:]]) for T in steps.transitions
    ]
    steps = steps._replace(transitions=())
    coming = jax.tree.map(lambda a: jnp.concatenate([a, a[-1:]]), steps)  # nobody hears what is drawn after the last
    coming = coming._replace(k=jnp.arange(1, scenario.steps + 2))
    _, (value, spread, bare, of_pilot, own) = jax.lax.scan(step, first, (now, coming))
    inside = bare[:, index, index].sum(-1)
    return Corrected(value, spread.T, bare, jnp.stack([inside, of_pilot]), own)


def _value(S, missing, A) -> Float[Array, "state state"]:
    """``E'V + V'E - V'JV`` for the columns A of the window's V."""
    both = S[: A.shape[1]] @ A
    return both + both.T - A.T @ (S - missing) @ A


def _best_combination(S, missing, n_state: int) -> Float[Array, "size state"]:
    """A for which V A gives the largest value when ``V'JV = S - missing``: ``(S - missing)^-1 S e``.

    Any other A is as valid, so that the ridge, which keeps a singular S harmless, costs nothing but a little height.
    """
    scale = jnp.sqrt(jnp.diag(S))
    scale = jnp.where(scale > 0, scale, 1.0)
    N = (S - missing) / (scale[:, None] * scale) + RIDGE * jnp.eye(len(S))
    step = jnp.linalg.solve(N, missing[:, :n_state] / scale[:, None]) / scale[:, None]
    return jnp.eye(len(S), n_state) + step
