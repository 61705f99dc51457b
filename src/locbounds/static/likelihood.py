"""Log-likelihoods of drawn measurements over many places: what posterior quadrature and maximum likelihood need."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.noise.log_coefficient import rough_variance
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.static.plan_laws import means

BINS = 2**16  # of a table of the density of an angle on the circle
TABLE, MOST = 2**14, 2**21  # differences at which the log-density of another noise is tabulated
NARROW = 0.3  # rad: below it both ways round the circle never meet
SMALL = 25.0  # log-likelihoods so far below the best one do not count


class Likelihood(NamedTuple):
    """Measurement law of a plan, split into a Gaussian part and single channels.

    Attributes
    ----------
    plan : Plan
    linear : array [channels] of bool
        Gaussian channels that are not periodic: jointly whitened.
    whitener : array [rank, linear channels]
        W with ``W^T W`` their precision; of the rank of it (an unknown clock removes one).
    noises : tuple
        ``(channel, noise, periodic)`` of the others.
    tables : tuple
        Log-densities of these: ``(low, 1 / step, values)``, or the function itself.
    """

    plan: Plan
    linear: ndarray
    whitener: Float[ndarray, "rank channels"]
    noises: tuple[Any, ...]
    tables: tuple[Any, ...]

    def features(self, points: Float[ndarray, "n space"]) -> tuple[ndarray, ndarray]:
        """Whitened means [n, rank] of the Gaussian part, and means [n, others] of the other channels."""
        m = means(self.plan, points)
        return m[:, self.linear] @ self.whitener.T, m[:, ~self.linear]

    def draw(self, points: Float[ndarray, "n space"], uniforms: Float[ndarray, "n dims"]) -> tuple[ndarray, ndarray]:
        """Measurements at places, in the form of :meth:`features`; one uniform number per rank and other channel."""
        from scipy.special import ndtri

        white, other = self.features(points)
        rank = white.shape[1]
        noise = [quantile(n, uniforms[:, rank + k]) for k, (_, n, _) in enumerate(self.noises)]
        return white + ndtri(uniforms[:, :rank]), other + (np.stack(noise, -1) if noise else 0.0)

    @property
    def dims(self) -> int:
        """How many uniform numbers a draw takes."""
        return len(self.whitener) + len(self.noises)

    @property
    def angles(self) -> ndarray | None:
        """Deviations of the other channels if all are narrow angles with Gaussian noise, else None."""
        from locbounds.noise import Gaussian

        if not all(
            round_ and type(noise) is Gaussian and float(noise.std) < NARROW for _, noise, round_ in self.noises
        ):
            return None
        return np.array([float(noise.std) for _, noise, _ in self.noises])

    def each(self, z: tuple[ndarray, ndarray], at: tuple[ndarray, ndarray]) -> Float[ndarray, " n"]:
        """Log-likelihood of the n-th draw at the n-th place, up to a constant."""
        total = -0.5 * np.square(z[0] - at[0]).sum(1)
        for k, table in enumerate(self.tables):
            total = total + look_up(table, self.noises[k][2], z[1][:, k] - at[1][:, k])
        return total

    def squares(self, z: tuple[ndarray, ndarray], at: tuple[ndarray, ndarray]) -> Float[ndarray, "*n"]:
        """Sum of squared differences in the channels' units, angles on the circle; broadcasts."""
        back = np.linalg.pinv(self.whitener) if len(self.whitener) else np.zeros((0, 0))
        total = np.square((z[0] - at[0]) @ back.T).sum(-1)
        for k, (_, _, periodic) in enumerate(self.noises):
            gap = z[1][..., k] - at[1][..., k]
            total = total + np.square(gap - 2 * np.pi * np.round(gap / (2 * np.pi)) if periodic else gap)
        return total

    def log(self, z: tuple[ndarray, ndarray], at: tuple[ndarray, ndarray]) -> Float[ndarray, "draws n"]:
        """Log-likelihood of draws at places, up to a constant per draw."""
        white, other = at
        total = z[0] @ white.T - 0.5 * np.square(white).sum(1)
        for k, table in enumerate(self.tables):
            total += look_up(table, self.noises[k][2], z[1][:, k, None] - other[:, k])
        return total


def quantile(noise: Any, u: ndarray) -> ndarray:
    """Inverse distribution function of a noise."""
    from locbounds.noise import Gaussian

    if type(noise) is Gaussian:
        from scipy.special import ndtri

        return float(noise.mean) + float(noise.std) * ndtri(u)
    return np.asarray(double_precision(noise.quantile)(u))


def look_up(table: Any, periodic: bool, difference: ndarray) -> ndarray:
    """The nearest entry of a table (on the circle for angles); minus infinity where the density vanishes."""
    if callable(table):
        return np.asarray(table(difference))
    low, per_step, values = table
    index = np.rint((difference - low) * per_step).astype(np.int64)
    if periodic:
        return values[index % BINS]
    outside = (index < 0) | (index >= len(values))
    return np.where(outside, -np.inf, values[np.clip(index, 0, len(values) - 1)])


def likelihood(plan: Plan) -> Likelihood:
    """The measurement law of a plan."""
    from locbounds.noise import Gaussian

    periodic = np.asarray(plan.periodic)
    gaussian = np.asarray(plan.gaussian)
    linear = gaussian & ~periodic
    precision = (
        np.asarray(plan.precision)[np.ix_(linear[gaussian], linear[gaussian])] if linear.any() else np.zeros((0, 0))
    )
    values, vectors = np.linalg.eigh(precision)
    keep = values > 1e-12 * max(values.max(initial=0.0), 1e-300)
    whitener = (vectors[:, keep] * np.sqrt(values[keep])).T
    laws = []
    for group in plan.groups:
        laws += [Gaussian(0.0, s) for s in group.stds] if group.noises is None else list(group.noises)
    others = tuple((c, laws[c], bool(periodic[c])) for c in np.flatnonzero(~linear))
    return Likelihood(plan, linear, whitener, others, tuple(_table(noise, round_) for _, noise, round_ in others))


def _table(noise: Any, periodic: bool) -> Any:
    if periodic:
        w = -np.pi + 2 * np.pi * np.arange(BINS) / BINS
        turns = 2 * np.pi * np.arange(-12, 13)
        total = np.full(BINS, -np.inf)
        for turn in turns:
            total = np.logaddexp(total, np.asarray(double_precision(noise.log_prob)(w + turn)))
        return -np.pi, BINS / (2 * np.pi), total
    places = np.asarray(double_precision(lambda: noise.landmarks())())
    low, high = float(places[0]), float(places[-1])
    # fine where the density is: spacing a hundredth of the deviation at most, and all of the span
    fine = 100 * (high - low) / double_precision(rough_variance)(noise) ** 0.5
    if not fine <= MOST:
        return double_precision(jax.jit(lambda w: noise.log_prob(w)))  # heavy tails
    count = int(max(TABLE, fine))
    w = np.linspace(low, high, count)
    return low, (count - 1) / (high - low), np.asarray(double_precision(noise.log_prob)(w))
