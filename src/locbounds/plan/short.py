"""Plans in one call."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.measurement import Bearing, Elevation, Function, Measurement, PathLoss, Range, RangeDifference
from locbounds.noise import Gaussian, Noise
from locbounds.plan.observations import Observations, as_noises
from locbounds.plan.plan import Plan
from locbounds.precision import float64

Deviation = Any  # a standard deviation, one per anchor, a covariance, a noise, or one noise per anchor (None: left out)


def toa(
    anchors: Any, std_m: Deviation, *, clock_std_m: float | None = None, names: Sequence[str] = (), **plan: Any
) -> Plan:
    """Plan with times of arrival (ranges) to anchors.

    Parameters
    ----------
    anchors
        Positions [anchors, space] in metres.
    std_m
        Standard deviation of the noise in metres, one per anchor, a covariance [anchors, anchors], a noise, or one
        noise per anchor; None among them leaves that anchor out.
    clock_std_m
        Standard deviation of the mobile's unknown clock offset in metres; ``inf`` if nothing is known of it.
    names
        Names of the anchors.
    **plan
        ``prior``, ``title`` of :class:`~locbounds.Plan`.

    Examples
    --------
    >>> toa([[0, 0], [100, 0], [0, 100]], 5.0).size
    3
    """
    return _plan(Range, anchors, std_m, names, clock_std_m=clock_std_m, **plan)


def tdoa(anchors: Any, std_m: Deviation, *, reference: int = 0, names: Sequence[str] = (), **plan: Any) -> Plan:
    """Plan with differences of times of arrival to a reference anchor: ``z = F z_toa``, covariance ``F C F^T``.

    Parameters
    ----------
    anchors
        Positions [anchors, space] in metres.
    std_m
        Standard deviation of every *time of arrival* in metres, one per anchor, or their covariance C.
    reference
        Index of the reference anchor; it does not change any bound.
    names
        Names of the anchors.
    **plan
        ``prior``, ``title`` of :class:`~locbounds.Plan`.

    Raises
    ------
    InputError
        If the noises are not Gaussian: use ``toa`` with an unknown clock, which carries the same information.

    Examples
    --------
    >>> tdoa([[0, 0], [100, 0], [0, 100]], 1.0).groups[0].covariance.tolist()
    [[2.0, 1.0], [1.0, 2.0]]
    """
    places = _positions(anchors)
    covariance, noises = as_noises(std_m, len(places))
    if noises is not None:
        keep = [i for i, noise in enumerate(noises) if noise is not None]
        if not all(type(noises[i]) is Gaussian for i in keep):
            raise InputError(
                "time differences of arrival with noise that is not Gaussian",
                "Use lb.toa(anchors, noises, clock_std_m=numpy.inf), which measures the same",
            )
        if reference in range(len(places)) and reference not in keep:
            raise InputError("the reference anchor is left out", "Choose another reference")
        covariance = np.diag([float(noises[i].variance) for i in keep])  # pyright: ignore[reportOptionalMemberAccess]
        names = [names[i] for i in keep] if names else names
        places, reference = places[keep], keep.index(reference) if reference in keep else reference
    assert covariance is not None
    n = len(places)
    if n < 2:
        raise InputError(f"time differences of arrival of {n} anchor", "Give at least two anchors")
    if reference not in range(n):
        raise InputError(f"the reference anchor is number {reference} of {n}", f"Give a number from 0 to {n - 1}")
    others = [i for i in range(n) if i != reference]
    F = np.eye(n)[others]
    F[:, reference] = -1.0
    names = list(names) or [str(i + 1) for i in range(n)]
    group = Observations(
        [RangeDifference(places[i], places[reference]) for i in others],
        F @ covariance @ F.T,
        names=[f"{names[i]}-{names[reference]}" for i in others],
        station_stds=np.sqrt(np.diag(covariance)),
    )
    return Plan([group], **plan)


def rss(
    anchors: Any,
    std_db: Deviation,
    *,
    exponent: Any = 3.0,
    near_field_m: float | None = None,
    names: Sequence[str] = (),
    **plan: Any,
) -> Plan:
    """Plan with received signal strengths (path losses) of anchors.

    Parameters
    ----------
    anchors
        Positions [anchors, space] in metres.
    std_db
        Standard deviation of the noise in dB, or any other form that ``toa`` takes.
    exponent
        Path loss exponent, or one per anchor.
    near_field_m
        Radius below which the path loss no longer depends on distance.
    names
        Names of the anchors.
    **plan
        ``prior``, ``title`` of :class:`~locbounds.Plan`.

    Examples
    --------
    >>> rss([[0, 0], [100, 0], [0, 100]], 4.0, exponent=2.5).units
    ('dB', 'dB', 'dB')
    """
    places = _positions(anchors)
    if np.shape(exponent) not in ((), (len(places),)):
        raise InputError(
            f"{len(places)} anchors have path loss exponents of shape {np.shape(exponent)}", "Give one, or one each"
        )
    exponents = iter(np.broadcast_to(exponent, len(places)).astype(float))
    return _plan(lambda p: PathLoss(p, next(exponents), near_field_m), places, std_db, names, **plan)


def aoa(anchors: Any, std_rad: Deviation, *, names: Sequence[str] = (), **plan: Any) -> Plan:
    """Plan with angles of arrival at anchors: bearings; in 3-D azimuths, then elevations, with noise of the same kind.

    Parameters
    ----------
    anchors
        Positions [anchors, space] in metres.
    std_rad
        Standard deviation of the noise in radians, or any other form that ``toa`` takes.
    names
        Names of the anchors.
    **plan
        ``prior``, ``title`` of :class:`~locbounds.Plan`.

    Examples
    --------
    >>> aoa([[0, 0], [100, 0]], 0.05).size, aoa([[0, 0, 3], [100, 0, 3]], 0.05).size
    (2, 4)
    """
    places = _positions(anchors)
    azimuths = _plan(Bearing, places, std_rad, names, **plan)
    if places.shape[1] == 2:
        return azimuths
    return azimuths + _plan(Elevation, places, std_rad, [f"{n} elevation" for n in names], **plan)


def observe(
    h: Callable[..., Any] | Measurement,
    covariance: Float[Array, "channels channels"] | float | Sequence[Noise],
    *,
    dim: int = 2,
    unit: str = "",
    **plan: Any,
) -> Plan:
    """Plan with any measurement ``z = h(position) + w``.

    Parameters
    ----------
    h
        ``h(position [space])``, a number or a vector; made of ``jax.numpy``.
    covariance
        Of Gaussian noise, [channels, channels] (a number: the variance of one channel), or one noise per channel.
    dim
        Number of coordinates of a position.
    unit
        ``"m"``, ``"dB"``, ``"rad"`` or ``""``.
    **plan
        ``prior``, ``title`` of :class:`~locbounds.Plan`.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> plan = observe(lambda p: jnp.array([p[0] ** 2, p[0] * p[1]]), np.diag([1.0, 4.0]))
    >>> plan.information(np.array([[1.0, 2.0]]))
    array([[[5.  , 0.5 ], [0.5 , 0.25]]])
    """
    if isinstance(covariance, Noise):
        covariance = [covariance]
    noises = None
    if isinstance(covariance, Sequence) and covariance and isinstance(covariance[0], Noise):
        noises, matrix = covariance, None
        size = len(noises)
    else:
        matrix = np.atleast_2d(float64(covariance))
        size = len(matrix)
    measurement = h if isinstance(h, Measurement) else Function(h, size, unit, dim)
    return Plan([Observations([measurement], matrix, noises)], **plan)  # pyright: ignore[reportArgumentType]


def _positions(anchors: Any) -> Any:
    places = float64(anchors)
    if places.ndim != 2 or places.shape[1] not in (2, 3) or len(places) == 0:
        raise InputError(
            f"the anchors' positions have shape {places.shape}", "Give [[x, y], ...] or [[x, y, z], ...] in metres"
        )
    return places


def _plan(make: Callable[[Any], Measurement], anchors: Any, std: Deviation, names: Sequence[str], **plan: Any) -> Plan:
    places = _positions(anchors)
    if names and len(names) != len(places):
        raise InputError(f"{len(places)} anchors have {len(names)} names", "Give one name per anchor")
    covariance, noises = as_noises(std, len(places))
    measurements = [make(p) for p in places]
    names = list(names) or [str(i + 1) for i in range(len(places))]
    if noises is not None:
        keep = [i for i, noise in enumerate(noises) if noise is not None]
        if not keep:
            raise InputError("every anchor is left out", "Give at least one a noise")
        measurements, names = [measurements[i] for i in keep], [names[i] for i in keep]
        noises = [noises[i] for i in keep]
    return Plan([Observations(measurements, covariance, noises, names)], **plan)  # pyright: ignore[reportArgumentType]
