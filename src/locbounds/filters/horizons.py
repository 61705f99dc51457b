"""Filters with another horizon: predictors, and smoothers that go back over the track of a Gaussian filter."""

from typing import Any

import equinox as eqx
import numpy as np

from locbounds.axes import Array, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.filters.estimates import Estimates
from locbounds.horizon import PREDICT, SMOOTH, Horizon
from locbounds.motion import SwitchingMotion
from locbounds.precision import double_precision
from locbounds.scenario import Scenario

SINGULAR = 1e-12  # relative to the largest: eigenvalues of a predicted correlation that count as zero


class _OfFilter(eqx.Module):
    """What both share: they run a filter that estimates the state, on a motion without modes."""

    filter: eqx.AbstractVar[Any]

    def _run(
        self, scenario: Scenario, z: Array, seed: int, sight: Any
    ) -> tuple[ndarray, ndarray | None, ndarray, ndarray]:
        if isinstance(scenario.motion, SwitchingMotion):
            raise RefusedError("the motion switches", "Give a scenario whose motion has no modes")
        output = self.filter(scenario, z, seed, *(() if sight is None else (sight,)))
        mean = np.asarray(getattr(output, "mean", output), dtype=float)
        if mean.shape[1:] != (scenario.steps + 1, scenario.motion.state_size):
            raise InputError(
                f"the filter returned estimates of shape {mean.shape}",
                f"It has to estimate the state at steps 0..K: [runs, {scenario.steps + 1}, "
                f"{scenario.motion.state_size}]",
            )
        spread = getattr(output, "covariance", None)
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
        return mean, None if spread is None else np.asarray(spread), F, Q


class Predicted(_OfFilter):
    """A filter's estimates moved on by some steps: x_k from the measurements up to step k - N.

    Parameters
    ----------
    filter
        A filter of the library, or any callable ``(scenario, z, seed)`` that estimates the state at steps 0..K.
    ahead
        N, at least one step.

    Notes
    -----
    The means and covariances move on with the motion. For k < N the prior is predicted.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> ahead = Predicted(lb.ImmEkf(), 2)
    >>> ahead.name, sorted(ahead.sees)
    ('IMM-EKF, 2 steps ahead', ['ranges-2-steps-old'])
    >>> z = lb.simulate(scenario, runs=8).measurements
    >>> bool((ahead(scenario, z).mean[:, 1, :2] == [501.0, 501.0]).all())
    True
    """

    filter: Any
    ahead: int = eqx.field(static=True)

    def __check_init__(self):
        Horizon.parse(self.horizon, None)

    @property
    def horizon(self) -> Horizon:
        """Which measurements are used."""
        return Horizon(PREDICT, self.ahead)

    @property
    def id(self) -> str:
        """Id of the filter."""
        return getattr(self.filter, "id", "own")

    @property
    def name(self) -> str:
        """Name of the filter, and how many steps it predicts."""
        return _name(self.filter) + self.horizon.label

    @property
    def sees(self) -> frozenset[str]:
        """What it uses."""
        return self.horizon.sees(getattr(self.filter, "sees", frozenset({"ranges"})))

    @double_precision
    def __call__(self, scenario: Scenario, z: Array, seed: int = 0, sight: Any = None) -> Estimates:
        """Filter and predict many tracks; arguments as for the filter."""
        Horizon.parse(self.horizon, scenario.steps)
        mean, spread, F, Q = self._run(scenario, z, seed, sight)
        times, N = scenario.steps + 1, self.ahead

        def moved(first: ndarray, later: ndarray, move: Any) -> ndarray:
            rows = [first]
            for k in range(1, N):
                rows.append(move(rows[-1], k - 1))
            out = np.empty((len(later), times, *later.shape[2:]))
            for k in range(times):
                if k < N:
                    out[:, k] = rows[k]
                else:
                    out[:, k] = later[:, k - N]
                    for i in range(k - N, k):
                        out[:, k] = move(out[:, k], i)
            return out

        m = moved(np.asarray(scenario.prior.mean), mean, lambda x, k: x @ F[k].T)
        P = None
        if spread is not None:
            P = moved(np.asarray(scenario.prior.covariance), spread, lambda P, k: F[k] @ P @ F[k].T + Q[k])
        return Estimates(m, P)


class Smoothed(_OfFilter):
    """A Gaussian filter followed by a Rauch-Tung-Striebel pass backwards: x_k from all measurements of the record.

    Parameters
    ----------
    filter
        A filter that returns means and covariances at steps 0..K. For a Kalman filter on a linear model the result is
        optimal; after a filter that merges modes, such as :class:`ImmEkf`, it is as approximate as that merging.

    Notes
    -----
    With the filter's ``m_k, P_k`` and ``S = F P_k F' + Q``, ``G = P_k F' S^-1``: ``m_k + G (m^s_{k+1} - F m_k)`` and
    ``P_k + G (P^s_{k+1} - S) G'`` (Rauch, Tung, Striebel 1965); a pseudo-inverse where S is singular.

    Examples
    --------
    No filtering bound speaks of it, as it uses later ranges:

    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> smoother = Smoothed(lb.ImmEkf())
    >>> smoother.name, sorted(smoother.sees)
    ('IMM-EKF, smoothing', ['future-ranges', 'ranges'])
    >>> draws = lb.simulate(scenario, runs=8)
    >>> smoother(scenario, draws.measurements).mean.shape
    (8, 4, 4)
    """

    filter: Any

    @property
    def id(self) -> str:
        """Id of the filter."""
        return getattr(self.filter, "id", "own")

    @property
    def name(self) -> str:
        """Name of the filter, and that it smooths."""
        return _name(self.filter) + Horizon(SMOOTH).label

    @property
    def sees(self) -> frozenset[str]:
        """What it uses."""
        return Horizon(SMOOTH).sees(getattr(self.filter, "sees", frozenset({"ranges"})))

    @double_precision
    def __call__(self, scenario: Scenario, z: Array, seed: int = 0, sight: Any = None) -> Estimates:
        """Filter and smooth many tracks; arguments as for the filter."""
        m, P, F, Q = self._run(scenario, z, seed, sight)
        if P is None:
            raise RefusedError(f"{_name(self.filter)} returns no covariances", "Smooth a filter that does")
        m, P = m.copy(), P.copy()
        for k in range(scenario.steps - 1, -1, -1):
            x, S = m[:, k] @ F[k].T, F[k] @ P[:, k] @ F[k].T + Q[k]
            G = P[:, k] @ F[k].T @ _inverse(np.asarray(S))
            m[:, k] += np.einsum("rab,rb->ra", G, m[:, k + 1] - x)
            P[:, k] += G @ (P[:, k + 1] - S) @ np.swapaxes(G, 1, 2)
        return Estimates(m, P)


def with_horizon(filter: Any, horizon: Horizon) -> Any:
    """A filter as the horizon wants it; one that smooths already is left as it is."""
    if horizon.kind == PREDICT:
        return Predicted(filter, horizon.ahead)
    smooths = any(what.startswith("future") for what in getattr(filter, "sees", ()))
    return Smoothed(filter) if horizon.kind == SMOOTH and not smooths else filter


def _name(filter: Any) -> str:
    return getattr(filter, "name", None) or getattr(filter, "__name__", "own filter")


def _inverse(S: ndarray) -> ndarray:
    """Inverses of covariances, pseudo-inverses of singular ones, in units of the deviations."""
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", S), np.finfo(float).tiny))
    pair = scale[..., :, None] * scale[..., None, :]
    broken = ~np.isfinite(S).all((1, 2), keepdims=True)
    return np.linalg.pinv(np.where(broken, 0.0, S / pair), rcond=SINGULAR, hermitian=True) / pair
