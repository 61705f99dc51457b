"""What is measured at one position: a group of measurements and their noise."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.linalg import is_positive_semidefinite
from locbounds.measurement import Measurement
from locbounds.noise import Gaussian, Mixture, Noise
from locbounds.precision import float64, traced


class Observations(eqx.Module):
    """Measurements ``z = h(position) + w`` taken together, and the law of their noise ``w``.

    Parameters
    ----------
    measurements
        What is measured; a vector-valued :class:`~locbounds.Function` counts as ``size`` channels.
    covariance
        Covariance of jointly Gaussian noise, [channels, channels], in the square of the channels' units.
    noises
        Instead of a covariance: one noise per channel, independent of each other.
    names
        One per measurement, for messages; by default 1, 2, ...

    Raises
    ------
    InputError
        If there is no measurement, both or none of covariance and noises are given, or their sizes do not fit.

    Examples
    --------
    >>> import locbounds as lb
    >>> Observations([lb.Range([0, 0]), lb.Range([9, 0])], noises=[lb.Gaussian(0, 1), lb.Laplace(0, 1)]).size
    2
    """

    measurements: tuple[Measurement, ...] = eqx.field(converter=tuple)
    covariance: Float[Array, "channels channels"] | None = eqx.field(converter=float64, default=None)
    noises: tuple[Noise, ...] | None = eqx.field(
        converter=lambda noises: None if noises is None else tuple(noises), default=None
    )
    names: tuple[str, ...] = eqx.field(converter=tuple, static=True, default=())

    def __post_init__(self):
        if not self.names:
            self.names = tuple(str(i + 1) for i in range(len(self.measurements)))

    def __check_init__(self):
        if not self.measurements:
            raise InputError("a group of observations has no measurement", "Give at least one")
        if len(self.names) != len(self.measurements):
            raise InputError(
                f"{len(self.measurements)} measurements have {len(self.names)} names", "Give one name per measurement"
            )
        if (self.covariance is None) == (self.noises is None):
            raise InputError(
                "a group of observations has both a covariance and noises"
                if self.noises is not None
                else "a group of observations has no noise",
                "Give a covariance (joint Gaussian noise) or one noise per channel (independent)",
            )
        if self.noises is not None and len(self.noises) != self.size:
            raise InputError(f"{self.size} channels have {len(self.noises)} noises", "Give one noise per channel")
        if self.covariance is not None:
            check_covariance(self.covariance, self.size)

    @property
    def size(self) -> int:
        """Number of channels."""
        return sum(m.size for m in self.measurements)

    @property
    def per_channel(self) -> tuple[Measurement, ...]:
        """The measurement of every channel."""
        return tuple(m for m in self.measurements for _ in range(m.size))

    @property
    def channel_names(self) -> tuple[str, ...]:
        """A name per channel."""
        pairs = zip(self.names, self.measurements, strict=True)
        return tuple(name if m.size == 1 else f"{name}[{i}]" for name, m in pairs for i in range(m.size))

    @cached_property
    def stds(self) -> Float[Array, " channels"]:
        """Standard deviation of every channel."""
        if self.covariance is not None:
            return np.sqrt(np.diag(np.asarray(self.covariance)))
        return np.sqrt([float(noise.variance) for noise in self.noises or ()])


def check_covariance(covariance: Any, size: int) -> None:
    """Raise an InputError unless a noise covariance is positive definite and [size, size].

    >>> check_covariance(np.eye(2), 2)
    """
    if covariance.shape != (size, size):
        raise InputError(
            f"{size} channels have a noise covariance of shape {covariance.shape}", f"Give a {size} x {size} matrix"
        )
    if traced(covariance):
        return
    if not is_positive_semidefinite(covariance):
        raise InputError(
            f"the noise covariance is not positive semidefinite: {covariance.tolist()}",
            "Give a symmetric matrix without negative eigenvalues",
        )
    scale = np.sqrt(np.diag(covariance))
    if not np.all(scale > 0) or np.linalg.eigvalsh(covariance / np.outer(scale, scale))[0] < 1e-12:
        raise InputError(
            "the noise covariance is singular: some combination of measurements is free of noise",
            "Leave out redundant measurements, or give every one a noise of its own",
        )


def soft(los: Noise, nlos: Noise | None, nlos_probability: float) -> Noise | None:
    """Noise of a link that is NLOS with some probability, drawn afresh and not reported: soft information.

    Parameters
    ----------
    los, nlos
        Noise in either sight condition; None: NLOS measurements carry no information.
    nlos_probability
        0: known to be LOS; 1: known to be NLOS.

    Returns
    -------
    Noise or None
        None: the link tells nothing and is left out.

    Raises
    ------
    InputError
        If the probability is none, or an NLOS noise is missing where the sight is not known.

    Examples
    --------
    >>> import locbounds as lb
    >>> soft(lb.Gaussian(0, 1), None, 1.0) is None
    True
    """
    if not 0 <= nlos_probability <= 1:
        raise InputError(f"the probability of NLOS is {nlos_probability}", "Give a number from 0 to 1")
    if nlos_probability == 0:
        return los
    if nlos_probability == 1:
        return nlos
    if nlos is None:
        raise InputError(
            f"a link is NLOS with probability {nlos_probability}, and no NLOS noise is given",
            "Give the NLOS noise, or a known sight",
        )
    return Mixture([1 - nlos_probability, nlos_probability], [los, nlos])


def as_noises(std: Any, n: int) -> tuple[np.ndarray | None, tuple[Noise | None, ...] | None]:
    """Deviations, a covariance, a noise or noises as ``(covariance, None)`` or ``(None, noises)`` of n channels.

    >>> as_noises(2.0, 2)[0].tolist()
    [[4.0, 0.0], [0.0, 4.0]]
    """
    if isinstance(std, Noise):
        return None, (std,) * n
    if isinstance(std, Sequence) and any(isinstance(s, Noise) or s is None for s in std):
        if len(std) != n:
            raise InputError(f"{n} anchors have {len(std)} noises", "Give one noise per anchor")
        return None, tuple(s if isinstance(s, Noise) or s is None else Gaussian(0.0, s) for s in std)
    std = float64(std)
    if std.shape == (n, n) and n > 1:
        check_covariance(std, n)
        return std, None
    if std.shape not in ((), (n,)):
        raise InputError(
            f"the noise of {n} anchors has shape {std.shape}",
            f"Give one standard deviation, {n} of them, or a {n} x {n} covariance",
        )
    if not traced(std) and not (np.all(np.isfinite(std)) and np.all(std > 0)):
        raise InputError(f"the standard deviation of the noise is {std}", "Give positive numbers")
    each = std * np.ones(n)
    return np.eye(n) * each**2, None
