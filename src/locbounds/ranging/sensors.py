"""What is measured of one distance: signal strength or time of arrival, several samples per epoch."""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError, RefusedError
from locbounds.noise import Epoch, Noise
from locbounds.precision import double_precision, float64

SPEED_OF_LIGHT_M_S = 299_792_458.0  # exact, SI
CLOCK_HZ = 44e6  # of the IEEE 802.11 round-trip-time counters in Prieto et al. (2011) and their references


class Sensor(eqx.Module):
    """Samples ``z = mean(d) + noise + bias`` of a distance d, ``samples`` of them per epoch.

    Attributes
    ----------
    noise
        Noise of every sample, in the sensor's unit.
    bias
        Law of the bias; None: there is none.
    samples
        M, at least one.
    common
        One bias for all samples of an epoch, or one for each.
    """

    noise: eqx.AbstractVar[Noise]
    bias: eqx.AbstractVar[Noise | None]
    samples: eqx.AbstractVar[int]
    common: eqx.AbstractVar[bool]

    def _check_samples(self) -> None:
        if isinstance(self.samples, bool) or not isinstance(self.samples, int) or self.samples < 1:
            raise InputError(f"an epoch has {self.samples!r} samples", "Give a whole number of at least one")

    @abstractmethod
    def mean(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Noise-free value at a distance; not a number where there is none."""

    @abstractmethod
    def slope(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Derivative of the mean."""

    @abstractmethod
    def inverse(self, value: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """The distance that has this noise-free value."""

    @property
    def linear(self) -> bool:
        """Whether the slope is the same at all distances."""
        return False

    @property
    def error(self) -> Noise:
        """Law of one sample's error, noise plus bias."""
        return self.noise if self.bias is None else self.noise + self.bias

    @property
    def shares(self) -> bool:
        """Whether samples of one epoch are dependent."""
        return self.common and self.bias is not None and self.samples > 1

    def epoch_noise(self) -> tuple[Noise, int]:
        """A law and how many independent samples of it tell as much as the epoch.

        Raises
        ------
        RefusedError
            If samples share a bias and their own noise is not Gaussian: then no single law stands for the epoch.
        """
        if not self.shares:
            return self.error, self.samples
        assert self.bias is not None
        return Epoch(self.noise, self.bias, self.samples, common=True).as_noise(), 1

    def information(self) -> Scalar:
        """Fisher information of an epoch about a shift of its samples, by quadrature; infinite where there is none."""
        noise, samples = self.epoch_noise()
        return samples * float(double_precision(lambda: noise.information())())

    def mean_and_variance(self) -> tuple[float, float]:
        """Of the mean of an epoch's errors: what a moment-matched Kalman filter takes."""
        average, own = float(self.noise.mean), float(self.noise.variance) / self.samples
        if self.bias is None:
            return average, own
        shared = 1 if self.common else self.samples
        return average + float(self.bias.mean), own + float(self.bias.variance) / shared


class TimeOfArrival(Sensor):
    """Time of arrival in clock cycles, ``z = offset + cycles_per_m d + noise + bias``.

    Parameters
    ----------
    noise, bias, samples, common
        In cycles; see :class:`Sensor`.
    cycles_per_m
        By default those of a round trip, ``2 * 44e6 / c``: the clock of IEEE 802.11.
    offset
        In cycles; known.

    Examples
    --------
    >>> import locbounds as lb
    >>> sensor = TimeOfArrival(lb.Gaussian(0.0, 3.5), samples=10)
    >>> round(float(sensor.information()) * sensor.cycles_per_m**2, 4)  # per square metre
    0.0703
    """

    noise: Noise
    bias: Noise | None = None
    samples: int = eqx.field(static=True, default=1, kw_only=True)
    common: bool = eqx.field(static=True, default=False, kw_only=True)
    cycles_per_m: float = eqx.field(static=True, default=2 * CLOCK_HZ / SPEED_OF_LIGHT_M_S, kw_only=True)
    offset: float = eqx.field(static=True, default=0.0, kw_only=True)

    def __check_init__(self):
        self._check_samples()
        if not (np.isfinite(self.cycles_per_m) and self.cycles_per_m > 0 and np.isfinite(self.offset)):
            raise InputError(
                f"the clock has {self.cycles_per_m} cycles per metre and an offset of {self.offset}",
                "Give a positive number of cycles per metre and a finite offset",
            )

    @property
    def linear(self) -> bool:
        return True

    def mean(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return self.offset + self.cycles_per_m * d

    def slope(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return self.cycles_per_m + 0.0 * d

    def inverse(self, value: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return (value - self.offset) / self.cycles_per_m


class Strength(Sensor):
    """Received signal strength in dB, ``z = level - 10 exponent log10(d / 1 m) + noise + bias``.

    Parameters
    ----------
    noise, bias, samples, common
        In dB; see :class:`Sensor`.
    exponent
        Path loss exponent beta.
    level
        Strength at one metre, in dB; known.

    Raises
    ------
    InputError
        If the exponent is not positive.

    Examples
    --------
    >>> import numpy as np, locbounds as lb
    >>> sensor = Strength(lb.Gaussian(0.0, 1.6), exponent=2.5)
    >>> sensor.mean(np.array([10.0, 100.0]))
    array([-25., -50.])
    """

    noise: Noise
    bias: Noise | None = None
    samples: int = eqx.field(static=True, default=1, kw_only=True)
    common: bool = eqx.field(static=True, default=False, kw_only=True)
    exponent: Scalar = eqx.field(converter=float64, default=2.5, kw_only=True)
    level: Scalar = eqx.field(converter=float64, default=0.0, kw_only=True)

    def __check_init__(self):
        self._check_samples()
        if not (np.isfinite(self.exponent) and self.exponent > 0):
            raise InputError(f"the path loss exponent is {self.exponent}", "Give a positive number, for example 2.5")

    def mean(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        xp = np if isinstance(d, np.ndarray | float) else jnp
        known = d > 0
        return xp.where(known, self.level - 10 * self.exponent * xp.log10(xp.where(known, d, 1.0)), xp.nan)

    def slope(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return -10 * self.exponent / np.log(10) / d

    def inverse(self, value: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return 10.0 ** ((self.level - value) / (10 * self.exponent))


def refuse_zero(sensors: tuple[Sensor, ...], d: Float[Array, " n"]) -> None:
    """Raise a RefusedError where a strength is asked for at a distance that has none."""
    for sensor in sensors:
        if not sensor.linear and not np.all(np.asarray(d) > 0):
            raise RefusedError(
                f"a signal strength has no value at a distance of {float(np.min(np.asarray(d))):.3g} m",
                "Keep the distance above zero",
            )
