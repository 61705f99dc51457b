"""The recursive Weiss-Weinstein bound of a jump-Markov model with linear measurements and any noise."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.bounds.weinstein.recursion import weiss_weinstein_recursion
from locbounds.errors import InputError, RefusedError
from locbounds.horizon import PREDICT, SMOOTH, Horizon
from locbounds.model import AdditiveChannel, DensityMotion, JumpMarkov
from locbounds.noise import Mixture
from locbounds.noise.log_coefficient import log_coefficient
from locbounds.precision import double_precision
from locbounds.priors import DensityPrior
from locbounds.result import Provenance, Result
from locbounds.verdict import Status, Verdict

SIZES = (0.6, 1.2, 2.0)  # of the test shifts along each axis, relative to each other
SCALES = np.geomspace(0.03, 1.5, 12)  # common scales, in conditional deviations
FINER = 6
SINGULAR = 1e-12
LINEAR = 1e-9  # relative change of a gradient from place to place that counts as rounding
PLACES = 5


class _Coefficients:
    """Of additive channels with linear h: independent over the steps, or with a chain that the estimator is told.

    Where it is told the chain, the modes are part of the data and ``rho = E[prod_j rho_{r_j}]`` over the chain's law.
    """

    def __init__(self, model: JumpMarkov, gradients: dict[int, ndarray], told: set[int], law: dict[int, ndarray]):
        self.model, self.gradients, self.told, self.law = model, gradients, told, law
        self.tables = {}
        for c, channel in enumerate(model.channels):
            noises = channel.noises
            if channel.chain not in told and len(noises) > 1:
                noises = (Mixture(law[channel.chain][1], noises),)  # drawn afresh at every step
            self.tables[c] = [log_coefficient(noise) for noise in noises]

    def _by_mode(self, j: int, chain: int, u: ndarray) -> ndarray:
        """``log rho`` in every mode of a chain, [modes, *n]."""
        total: Any = 0.0
        for c, channel in enumerate(self.model.channels):
            reported = channel.reports is None or bool(np.asarray(channel.reports)[j - 1])
            if channel.chain == chain and reported:
                moved = u @ self.gradients[c][j - 1]
                total = total + np.stack([table(moved) for table in self.tables[c]])
        modes = len(self.model.chains[chain].start) if chain in self.told else 1
        return np.broadcast_to(total, (modes, *u.shape[:-1]))

    def single(self, j: int, u: ndarray) -> ndarray:
        if j == 0:
            return np.zeros(u.shape[:-1])
        total = np.zeros(u.shape[:-1])
        for chain in {channel.chain for channel in self.model.channels}:
            each = self._by_mode(j, chain, u)
            total = total + (_log_mean(self.law[chain][j], each) if chain in self.told else each[0])
        return total

    def excess(self, j: int, g: ndarray, h: ndarray) -> ndarray:
        total = np.zeros((len(h), len(g)))
        if j < 2:
            return total
        for chain in self.told:
            before, now = np.exp(self._by_mode(j - 1, chain, g)), np.exp(self._by_mode(j, chain, h))
            T, law = np.asarray(self.model.transitions(chain))[j - 1], self.law[chain]
            both = np.einsum("r,rm,rs,sl->lm", law[j - 1], before, T, now)
            total += np.log(both / np.einsum("l,m->lm", law[j] @ now, law[j - 1] @ before))
        return total


def _log_mean(law: ndarray, logs: ndarray) -> ndarray:
    top = logs.max(0)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return top + np.log(np.einsum("r,r...->...", law, np.exp(logs - top)))


@double_precision
def wwb_recursive(
    model: JumpMarkov, *, sizes: Sequence[float] = SIZES, horizon: str | Horizon = "filter", scale: float | None = None
) -> Result:
    """Recursive Weiss-Weinstein bound, for noises without a Fisher information too; nothing is drawn.

    Parameters
    ----------
    model
        Linear Gaussian motion without modes and with a regular Q, Gaussian prior, additive channels whose ``h`` is
        linear in the state. Where a chain's modes are drawn afresh at every step, its noise is their mixture. Where
        the chain remembers, the bound is that of estimators which are told its modes, and says so: the coefficients
        of the unknown chain are integrals over all measurements at once.
    sizes
        Lengths of the test shifts along each axis of the state, relative to each other: several points per axis.
    horizon
        ``"filter"``, or ``"predict:N"``.
    scale
        Common scale of all shifts in conditional deviations; by default the best one is searched for every step.

    Returns
    -------
    Result
        ``diagnostics["scale"]`` [steps+1]: the best scale. At the lowest one of the search the shifts tend to zero, as
        they do for smooth noises: the bound is then the Bayesian Cramér-Rao bound.

    Raises
    ------
    RefusedError
        If the model is another one, or no path is free to be moved at one step alone (singular Q).

    Notes
    -----
    :mod:`locbounds.bounds.weinstein.recursion`; every choice of shifts is valid, and the one with the largest position
    error counts.

    Examples
    --------
    A random walk seen with uniform noise, whose Fisher information is infinite:

    >>> import numpy as np, locbounds as lb
    >>> ones = np.ones((4, 1, 1))
    >>> model = lb.JumpMarkov(
    ...     times=lb.Times.uniform(step_s=1.0, steps=4),
    ...     prior=lb.GaussianPrior([0.0], [[4.0]]),
    ...     motion=lb.LinearMotion(ones, 0.25 * ones, position_index=(0,)),
    ...     channels=lb.AdditiveChannel(lambda x, mode, k: x[0], [lb.Uniform(-1.0, 1.0)]),
    ...     chains=lb.MarkovSight([1.0], [[1.0]]),
    ... )
    >>> wwb_recursive(model).position_rmse.values.round(2)
    array([2.  , 0.5 , 0.39, 0.37, 0.37])
    """
    horizon = Horizon.parse(horizon, model.steps)
    if horizon.kind == SMOOTH:
        raise RefusedError("the recursive Weiss-Weinstein bound has no smoothing form here", "Use filter or predict:N")
    F, Q, P0 = _linear_gaussian(model)
    gradients = {c: _gradient(model, c) for c in range(len(model.channels))}
    law = {c: _law(model, c) for c in range(len(model.chains))}
    remembers = {c for c in law if _remembers(np.asarray(model.transitions(c)), law[c])}
    told = {channel.chain for channel in model.channels if channel.chain in remembers}
    coefficients = _Coefficients(model, gradients, told, law)
    axes = _axes(model, F, Q, P0, gradients, coefficients)
    relative = np.asarray(sizes, dtype=float)
    if relative.ndim != 1 or not len(relative) or not np.all(relative > 0):
        raise InputError(f"the sizes are {sizes}", "Give positive numbers, for example (0.6, 1.2, 2.0)")
    index = np.array(model.position_index)

    def bound(scale: float) -> ndarray:
        shifts = (scale * relative[:, None, None] * axes[:, None]).reshape(len(axes), -1, axes.shape[-1])
        return weiss_weinstein_recursion(F, Q, P0, shifts, coefficients)

    tried = SCALES if scale is None else np.array([float(scale)])
    found = np.stack([bound(s) for s in tried])
    if scale is None:
        at = int(np.argmax(found[:, -1, index, index].sum(-1)))
        near = np.geomspace(tried[max(at - 1, 0)], tried[min(at + 1, len(tried) - 1)], FINER)
        tried, found = np.append(tried, near), np.concatenate([found, np.stack([bound(s) for s in near])])
    best = found[:, :, index, index].sum(-1).argmax(0)
    P = found[best, np.arange(model.steps + 1)]
    if horizon.kind == PREDICT:
        P = _ahead(P, F, Q, P0, horizon.ahead)
    mse = P[:, index, index].sum(-1)
    sees = frozenset({"ranges", "sight"} if told else {"ranges"})
    grounds = ("linear Gaussian motion", "linear measurements", "any noise")
    return Result(
        id="wwb-recursive",
        name="Recursive WWB" + horizon.label,
        kind="bound",
        sees=horizon.sees(sees),
        time_s=np.asarray(model.times.time_s),
        position_mse=mse,
        replicates=np.zeros((1, len(mse))),
        covariance=P,
        verdict=Verdict(Status.VALID, grounds + (("estimators told the modes",) if told else ())),
        provenance=Provenance.now(0, 0, "interior and end blocks, shifts of one state each", ("rapoport2004",)),
        diagnostics={"scale": tried[best]},
    )


def _ahead(P: ndarray, F: ndarray, Q: ndarray, P0: ndarray, ahead: int) -> ndarray:
    out = []
    for k in range(len(P)):
        S, first = (P[k - ahead], k - ahead) if k >= ahead else (P0, 0)
        for i in range(first, k):
            S = F[i] @ S @ F[i].T + Q[i]
        out.append(S)
    return np.stack(out)


def _linear_gaussian(model: JumpMarkov) -> tuple[ndarray, ndarray, ndarray]:
    if isinstance(model.motion, tuple | DensityMotion) or isinstance(model.prior, DensityPrior):
        raise RefusedError("the motion or the prior is not linear Gaussian without modes", "Use bcrb")
    intervals = model.times.intervals
    F, Q = np.asarray(model.motion.transitions(intervals)), np.asarray(model.motion.covariances(intervals))
    P0 = np.asarray(model.prior.covariance)
    for k, S in enumerate([P0, *Q]):
        values = np.linalg.eigvalsh(S / np.sqrt(np.outer(d := np.maximum(np.diag(S), 1e-300), d)))
        if not values[0] > SINGULAR:
            what = "the prior" if k == 0 else f"Q of step {k}"
            raise RefusedError(
                f"{what} is singular: no state can be moved alone without breaking the motion",
                "Give noise in every direction, or use locbounds.ranging, which moves whole paths",
            )
    return F, Q, P0


def _gradient(model: JumpMarkov, c: int) -> Float[ndarray, "steps state"]:
    """Gradient of a channel's h at every step; a RefusedError where it is not the same at all places and modes."""
    channel = model.channels[c]
    if not isinstance(channel, AdditiveChannel):
        raise RefusedError(f"channel {c} is no h(x) plus noise", "Use AdditiveChannel")
    view = np.arange(model.state_size) if channel.view is None else np.array(channel.view)
    rng = np.random.default_rng(0)
    spread = np.sqrt(np.diag(np.asarray(model.prior.covariance)))
    places = np.asarray(model.prior.mean) + spread * rng.normal(size=(PLACES, model.state_size))
    k = jnp.arange(1, model.steps + 1)
    values, slopes = [], []
    for r in range(len(channel.noises)):

        def h(x, k, r=r):
            return jnp.reshape(channel.h(x, r, k), ())

        both = jax.vmap(jax.vmap(jax.value_and_grad(h), (None, 0)), (0, None))(jnp.asarray(places[:, view]), k)
        values.append(np.asarray(both[0]))
        slopes.append(np.asarray(both[1]))
    values, slopes = np.stack(values), np.stack(slopes)  # [modes, places, steps, ...]
    scale = max(np.abs(slopes).max(), 1e-300)
    if np.abs(slopes - slopes[:1, :1]).max() > LINEAR * scale or np.abs(values - values[:1]).max() > LINEAR * (
        1 + np.abs(values).max()
    ):
        raise RefusedError(
            f"h of channel {c} is not linear in the state, or depends on the mode",
            "Put a mode's offset into its noise; for other h use bcrb",
        )
    full = np.zeros((model.steps, model.state_size))
    full[:, view] = slopes[0, 0]
    return full


def _law(model: JumpMarkov, c: int) -> ndarray:
    """Law of a chain's mode at steps 0..K."""
    law = [np.asarray(model.chains[c].start)]
    for T in np.asarray(model.transitions(c)):
        law.append(law[-1] @ T)
    return np.stack(law)


def _remembers(T: ndarray, law: ndarray) -> bool:
    return law.shape[1] > 1 and not (np.allclose(T, T[:, :1], atol=1e-12) and np.allclose(law[1:], law[1], atol=1e-12))


def _axes(model, F, Q, P0, gradients, coefficients) -> Float[ndarray, "times state state"]:
    """Test directions of every state: columns of a root of its covariance given all others, roughly."""
    inverse = [np.linalg.inv(P0), *np.linalg.inv(Q)]
    out = []
    for k in range(model.steps + 1):
        J = inverse[k] + (F[k].T @ inverse[k + 1] @ F[k] if k < model.steps else 0.0)
        if k:
            for c, channel in enumerate(model.channels):
                reported = channel.reports is None or bool(np.asarray(channel.reports)[k - 1])
                g = gradients[c][k - 1]
                J = J + reported * np.outer(g, g) / min(float(n.variance) for n in channel.noises)
        out.append(np.linalg.cholesky(np.linalg.inv(J)).T)
    return np.stack(out)
