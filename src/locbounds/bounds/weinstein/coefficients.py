"""Bhattacharyya coefficients of the measurements of a jump-Markov model with linear channels."""

from collections import Counter
from typing import Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.model import JumpMarkov
from locbounds.noise import Mixture
from locbounds.noise.log_coefficient import log_coefficient


class ModelCoefficients:
    """Independent over the steps, or with chains whose modes the estimator is told.

    Where it is told the modes r, they are part of the data and ``rho = E[prod_j rho_{r_j}]`` over the chain's law.
    Where the modes of a single channel are drawn afresh at every step, its noise is their mixture; channels that share
    a chain depend on each other, so that one may tell the mode of the other.

    Parameters
    ----------
    model
        Additive channels, linear in the state.
    slopes
        Their gradients, [channels, steps, state].
    """

    def __init__(self, model: JumpMarkov, slopes: Float[ndarray, "channels steps state"]):
        self.model, self.slopes = model, slopes
        self.used = sorted({channel.chain for channel in model.channels})
        self.law = {c: _law(model, c) for c in self.used}
        self.transitions = {c: np.asarray(model.transitions(c)) for c in self.used}
        channels_of = Counter(channel.chain for channel in model.channels)
        self.told = {
            c
            for c in self.used
            if _remembers(self.transitions[c], self.law[c]) or (channels_of[c] > 1 and self.law[c].shape[1] > 1)
        }
        self.tables = []
        for channel in model.channels:
            noises: Any = channel.noises  # type: ignore[attr-defined]
            if channel.chain not in self.told and len(noises) > 1:
                noises = (Mixture(self.law[channel.chain][1], noises),)
            self.tables.append([log_coefficient(noise) for noise in noises])

    def _by_mode(self, chain: int, moved: Float[ndarray, "channels *n"]) -> Float[ndarray, "modes *n"]:
        """``log rho`` of one step in every mode of a chain, from the shifts of what all channels measure."""
        total: Any = np.zeros(moved.shape[1:])
        for c, channel in enumerate(self.model.channels):
            if channel.chain == chain:
                total = total + np.stack([table(moved[c]) for table in self.tables[c]])
        modes = len(self.law[chain][0]) if chain in self.told else 1
        return np.broadcast_to(total, (modes, *moved.shape[1:]))

    def _moved(self, j: int, u: Float[ndarray, "*n state"]) -> Float[ndarray, "channels *n"]:
        return np.stack([u @ slope for slope in self.slopes[:, j - 1]])

    def single(self, j: int, u: Float[ndarray, "*n state"]) -> Float[ndarray, "*n"]:
        """``log rho_j(u)``: x_j alone moved by u."""
        total = np.zeros(u.shape[:-1])
        if j == 0:
            return total
        for chain in self.used:
            each = self._by_mode(chain, self._moved(j, u))
            total = total + (_log_mean(self.law[chain][j], each) if chain in self.told else each[0])
        return total

    def excess(self, j: int, g: Float[ndarray, "m state"], h: Float[ndarray, "l state"]) -> Float[ndarray, "l m"]:
        """``log kappa_j(g, h)``: x_{j-1} moved by g and x_j by h, relative to each of them alone."""
        total = np.zeros((len(h), len(g)))
        if j < 2:
            return total
        for c in self.told:
            before = np.exp(self._by_mode(c, self._moved(j - 1, g)))
            now = np.exp(self._by_mode(c, self._moved(j, h)))
            law = self.law[c]
            both = np.einsum("r,rm,rs,sl->lm", law[j - 1], before, self.transitions[c][j - 1], now)
            with np.errstate(divide="ignore", invalid="ignore"):  # of shifts that are too long to be used
                total += np.log(both / np.einsum("l,m->lm", law[j] @ now, law[j - 1] @ before))
        return total

    def path(self, moved: Float[ndarray, "rows *n"]) -> Float[ndarray, "*n"]:
        """``log rho`` of steps 1..j, from the shifts of what every channel measures at step 1, then at step 2, ..."""
        moved = moved.reshape(-1, len(self.tables), *moved.shape[1:])
        total = np.zeros(moved.shape[2:])
        for c in self.used:
            if c not in self.told:
                total = total + sum(self._by_mode(c, step)[0] for step in moved)
                continue
            weight = _log(self.law[c][0]).reshape(-1, *(1 for _ in total.shape))
            for T, step in zip(self.transitions[c], moved, strict=False):
                forward = np.stack([_log_mean(T[:, r], weight) for r in range(len(T))])
                weight = forward + self._by_mode(c, step)
            total = total + _log_mean(np.ones(len(weight)), weight)
        return total


def _log(p: ndarray) -> ndarray:
    with np.errstate(divide="ignore"):
        return np.log(p)


def _log_mean(weights: Float[ndarray, " modes"], logs: Float[ndarray, "modes *n"]) -> Float[ndarray, "*n"]:
    """``log sum_r w_r exp(l_r)``."""
    top = logs.max(0)
    top = np.where(np.isfinite(top), top, 0.0)
    return top + _log(np.einsum("r,r...->...", weights, np.exp(logs - top)))


def _law(model: JumpMarkov, c: int) -> Float[ndarray, "times modes"]:
    """Law of a chain's mode at steps 0..K."""
    law = [np.asarray(model.chains[c].start)]
    for T in np.asarray(model.transitions(c)):
        law.append(law[-1] @ T)
    return np.stack(law)


def _remembers(T: Float[ndarray, "steps modes modes"], law: Float[ndarray, "times modes"]) -> bool:
    return law.shape[1] > 1 and not (np.allclose(T, T[:, :1], atol=1e-12) and np.allclose(law[1:], law[1], atol=1e-12))
