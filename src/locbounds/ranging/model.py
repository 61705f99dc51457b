"""One distance over time: its derivatives as the state, driven by a random highest derivative."""

import math

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Float, ndarray
from locbounds.errors import InputError
from locbounds.motion import LinearMotion
from locbounds.motion.linear import whitened
from locbounds.precision import float64
from locbounds.priors import GaussianPrior
from locbounds.ranging.sensors import Sensor
from locbounds.times import Times


class DistanceModel(eqx.Module):
    """A distance and its first derivatives [d, d', d'', ...], measured by sensors at steps 1..K.

    Between steps the derivative after the last one in the state is constant and random, Gaussian with mean zero,
    independent from step to step: a Taylor expansion, whose noise has rank one (Prieto et al. 2011, eq. 1).

    Parameters
    ----------
    times
        Times of steps 0..K.
    mean, std
        Means and standard deviations of [d, d', ...] at step 0, independent, in m, m/s, ...
    driving_std
        Standard deviation of the next derivative, for three components m/s^3; zero: there is none.
    sensors
        What is measured.

    Raises
    ------
    InputError
        If shapes differ or numbers make no sense.

    Examples
    --------
    >>> import numpy as np, locbounds as lb
    >>> from locbounds.ranging import DistanceModel, TimeOfArrival
    >>> toa = TimeOfArrival(lb.Gaussian(0.0, 3.5), samples=10)
    >>> model = DistanceModel(lb.Times.uniform(step_s=1.0, steps=85), [10, 0, 0], [2, 0.5, 0.75], 1.0, [toa])
    >>> int(np.linalg.matrix_rank(model.motion.covariances(model.times.intervals)[0]))
    1
    """

    times: Times
    mean: Float[Array, " state"] = eqx.field(converter=float64)
    std: Float[Array, " state"] = eqx.field(converter=float64)
    driving_std: Float[Array, ""] = eqx.field(converter=float64)
    sensors: tuple[Sensor, ...] = eqx.field(converter=tuple)

    def __check_init__(self):
        if self.mean.ndim != 1 or self.mean.shape != self.std.shape or not len(self.mean):
            raise InputError(
                f"the prior's means have shape {self.mean.shape}, its deviations {self.std.shape}",
                "Give one number each for the distance and its derivatives",
            )
        if not (np.all(np.isfinite(self.mean)) and np.all(np.isfinite(self.std)) and np.all(self.std >= 0)):
            raise InputError("the prior's numbers are not finite, or a deviation is negative", "Correct them")
        if not (np.isfinite(self.driving_std) and self.driving_std >= 0):
            raise InputError(f"the driving deviation is {self.driving_std}", "Give zero or a positive number")
        if not self.sensors:
            raise InputError("nothing is measured", "Give at least one sensor")

    @property
    def size(self) -> int:
        """Number of state components."""
        return len(self.mean)

    @property
    def steps(self) -> int:
        """Number of steps K."""
        return self.times.steps

    @property
    def inputs(self) -> Float[ndarray, "steps state"]:
        """Columns G with ``Q = G G'``: what one standard deviation of the driving derivative does."""
        dt, n = np.asarray(self.times.intervals), self.size
        return float(self.driving_std) * np.stack([dt ** (n - i) / math.factorial(n - i) for i in range(n)], -1)

    @property
    def motion(self) -> LinearMotion:
        """Taylor expansion, noise of rank one."""
        dt, n = np.asarray(self.times.intervals), self.size
        F = np.zeros((len(dt), n, n))
        for i in range(n):
            for j in range(i, n):
                F[:, i, j] = dt ** (j - i) / math.factorial(j - i)
        Q = np.einsum("ka,kb->kab", self.inputs, self.inputs)
        names = tuple("d" + "'" * i for i in range(n))
        return LinearMotion(F, Q, position_index=(0,), state_names=names)

    @property
    def prior(self) -> GaussianPrior:
        """Law of the state at step 0."""
        return GaussianPrior(self.mean, np.diag(self.std**2))

    def whitened(self) -> Float[ndarray, "times state theta"]:
        """How independent standard normal numbers (those of x_0, then one per step) make the states at steps 0..K."""
        return whitened(np.asarray(self.motion.F), np.diag(self.std), self.inputs[:, :, None])

    def simulate_states(self, runs: int, seed: int = 0) -> Float[ndarray, "runs times state"]:
        """Draw states at steps 0..K."""
        X = self.whitened()
        mean = [np.asarray(self.mean)]
        for F in np.asarray(self.motion.F):
            mean.append(F @ mean[-1])
        theta = np.random.default_rng([seed, 0]).normal(size=(runs, X.shape[-1]))
        return np.stack(mean) + np.einsum("kat,rt->rka", X, theta)
