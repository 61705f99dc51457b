"""Extended Kalman filter of a distance, with noise of matched moments."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.filters import Estimates
from locbounds.ranging.model import DistanceModel

NEAREST_M = 0.1  # a strength is linearised at no smaller distance


class DistanceEkf:
    """Extended Kalman filter; an epoch's samples enter as their mean, with the moments of its error.

    Notes
    -----
    Prieto et al. 2011, section IV, with the true moments of cut noises and biases in place of those of uncut ones.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.ranging import DistanceEkf, DistanceModel, TimeOfArrival, evaluate_distance
    >>> toa = TimeOfArrival(lb.Gaussian(0.0, 3.5), samples=10)
    >>> model = DistanceModel(lb.Times.uniform(step_s=1.0, steps=4), [10, 0, 0], [2, 0.5, 0.75], 1.0, [toa])
    >>> evaluate_distance(DistanceEkf(), model, runs=50).kind
    'filter'
    """

    id: ClassVar[str] = "distance-ekf"
    name: ClassVar[str] = "EKF"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges"})

    def __call__(
        self, model: DistanceModel, z: Sequence[Float[ndarray, "runs steps samples"]], seed: int = 0
    ) -> Estimates:
        """Filter many runs; ``z`` as from :func:`~locbounds.ranging.measure`."""
        runs, n = len(z[0]), model.size
        moments = [sensor.mean_and_variance() for sensor in model.sensors]
        x = np.broadcast_to(np.asarray(model.mean), (runs, n)).copy()
        P = np.broadcast_to(np.diag(np.asarray(model.std) ** 2), (runs, n, n)).copy()
        F, Q = np.asarray(model.motion.F), np.asarray(model.motion.Q)
        means, spreads = [x.copy()], [P.copy()]
        for k in range(model.steps):
            x, P = x @ F[k].T, F[k] @ P @ F[k].T + Q[k]
            for sensor, (mean, variance), samples in zip(model.sensors, moments, z, strict=True):
                d = x[:, 0] if sensor.linear else np.maximum(x[:, 0], NEAREST_M)
                h = np.asarray(sensor.slope(d))
                residual = samples[:, k].mean(-1) - mean - np.asarray(sensor.mean(d)) - h * (x[:, 0] - d)
                gain = P[:, :, 0] * (h / (h**2 * P[:, 0, 0] + variance))[:, None]
                x = x + gain * residual[:, None]
                P = P - gain[:, :, None] * h[:, None, None] * P[:, :1]
                P = 0.5 * (P + np.swapaxes(P, 1, 2))
            means.append(x.copy())
            spreads.append(P.copy())
        return Estimates(np.stack(means, 1), np.stack(spreads, 1))
