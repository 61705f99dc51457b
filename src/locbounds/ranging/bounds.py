"""Bounds for one distance over time: by quadrature where there is an information, Weiss-Weinstein for any noise."""

import equinox as eqx
import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.bounds.backward import bound_recursion
from locbounds.bounds.recursion import GivenIncrements, LinearModel
from locbounds.bounds.weinstein import path_bounds
from locbounds.errors import InputError, RefusedError
from locbounds.horizon import Horizon
from locbounds.noise.log_coefficient import log_coefficient, rough_variance
from locbounds.precision import double_precision
from locbounds.ranging.model import DistanceModel
from locbounds.ranging.sensors import refuse_zero
from locbounds.registry import RANGES, method
from locbounds.result import Provenance, Result
from locbounds.verdict import Status, Verdict

READINGS = ("initial", "every step")


def slopes(model: DistanceModel, track: Float[ndarray, " times"] | None) -> Float[ndarray, "sensors steps"]:
    """Derivatives of what the sensors measure at steps 1..K.

    Raises
    ------
    RefusedError
        If a strength is measured and no track is given: the expected information of a signal strength, E[1/d^2], is
        infinite for a distance with a density at zero.
    InputError
        If the track has another length.
    """
    curved = [type(s).__name__ for s in model.sensors if not s.linear]
    if track is None:
        if curved:
            raise RefusedError(
                f"{curved[0]}: its expected information, proportional to E[1/d^2], is infinite for a Gaussian distance",
                "Give a track, and the bound is conditional on it",
            )
        d = np.ones(model.steps)
    else:
        d = np.asarray(track, dtype=float)
        if d.shape != (model.steps + 1,):
            raise InputError(f"the track has shape {d.shape}", f"Give {model.steps + 1} distances, at steps 0..K")
        d = d[1:]
        refuse_zero(model.sensors, d)
    return np.stack([np.asarray(s.slope(d)) for s in model.sensors])


def information(model: DistanceModel, track: Float[ndarray, " times"] | None = None) -> Float[ndarray, " steps"]:
    """Information of every step's samples about the distance, 1/m^2, by one-dimensional quadrature.

    Raises
    ------
    RefusedError
        If some noise has no finite Fisher information, and as :func:`slopes`.
    """
    steep = slopes(model, track)
    for sensor in model.sensors:
        regularity = sensor.error.regularity()
        if regularity.finite is False:
            raise RefusedError(
                f"{type(sensor).__name__}: no finite Fisher information: {regularity.reason}",
                "Use distance_wwb, or noise that is not cut",
            )
    each = np.array([float(sensor.information()) for sensor in model.sensors])
    return np.einsum("m,mk->k", each, steep**2)


def distance_bcrb(
    model: DistanceModel,
    *,
    track: Float[ndarray, " times"] | None = None,
    given: Float[ndarray, " steps"] | None = None,
    derivatives: str = "initial",
    horizon: str | Horizon = "filter",
) -> Result:
    """Posterior Cramér-Rao bound of a distance; nothing is drawn.

    Parameters
    ----------
    model
        The model.
    track
        Distances at steps 0..K: the number is then conditional on them, and no bound on errors there.
    given
        Information of steps 1..K, 1/m^2, in place of :func:`information` (for numbers as printed elsewhere). Nothing is
        asked of the noise then, and the verdict says that the bound is as good as this information.
    derivatives
        What is known of d', d'', ...: ``"initial"``, their prior at step 0, or ``"every step"``: their prior taken as a
        further measurement at each step, which counts one fact K times and is over-confident.
    horizon
        ``"filter"``, ``"predict:N"`` or ``"smooth"``.

    Returns
    -------
    Result
        ``position_mse`` is that of the distance.

    Raises
    ------
    RefusedError, InputError
        As for :func:`information`; if the reading is none; if the given information has another shape, is negative or
        not finite.

    Notes
    -----
    Prieto et al. 2011, eq. (10), in covariance form, since Q has rank one.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.ranging import DistanceModel, TimeOfArrival, distance_bcrb
    >>> toa = TimeOfArrival(lb.Gaussian(0.0, 3.5), lb.Uniform(0.0, 3.0), samples=10)
    >>> model = DistanceModel(lb.Times.uniform(step_s=1.0, steps=85), [10, 0, 0], [2, 0.5, 0.75], 1.0, [toa])
    >>> print(distance_bcrb(model))
    BCRB: position RMSE 3.242 m, mean over steps 0..85; valid (Gaussian prior and motion; smooth noise)
    """
    if derivatives not in READINGS:
        raise InputError(f"derivatives is {derivatives!r}", f"Give {' or '.join(READINGS)}")
    horizon = Horizon.parse(horizon, model.steps)
    J = information(model, track) if given is None else _checked(given, model.steps)
    extra = None
    if derivatives == "every step":
        if not np.all(model.std[1:] > 0):
            raise InputError("a derivative has no prior deviation", "Give positive ones to measure it every step")
        extra = np.zeros((model.steps + 1, model.size, model.size))
        extra[1:, range(1, model.size), range(1, model.size)] = model.std[1:] ** -2.0
    P = np.asarray(_recursion(model, J, extra, horizon))
    entry = method("bcrb")
    conditions = [
        text
        for text, said in (
            ("conditional on the trajectory", track is not None),
            ("the information as given", given is not None),
            ("the derivatives measured anew at every step, which counts one prior many times", extra is not None),
        )
        if said
    ]
    regularities = [] if given is not None else [(type(s).__name__, s.error.regularity()) for s in model.sensors]
    doubts = [f"{name}: {regularity.reason}" for name, regularity in regularities if regularity.finite is None]
    if doubts:
        verdict = Verdict(Status.UNDECIDED, (*doubts, *conditions))
    else:
        verdict = Verdict(Status.CONDITIONAL, tuple(conditions)) if conditions else Verdict(Status.VALID, entry.grounds)
    return _result(entry.id, entry.name + horizon.label, model, P, verdict, horizon, track, "quadrature")


def _checked(given: Float[ndarray, " steps"], steps: int) -> Float[ndarray, " steps"]:
    J = np.asarray(given, dtype=float)
    if J.shape != (steps,):
        raise InputError(f"the information has shape {J.shape}", f"Give {steps} numbers, at steps 1..K")
    if not np.all(np.isfinite(J) & (J >= 0)):
        raise InputError("the information is negative or not finite at some step", "Give numbers of at least zero")
    return J


@double_precision
def _recursion(model: DistanceModel, J: ndarray, extra: ndarray | None, horizon: Horizon):
    motion = model.motion
    linear = LinearModel(motion.F, motion.Q, model.prior.covariance, (0,), (0,))
    return _solve(linear, J.reshape(-1, 1, 1, 1, 1), extra, horizon)


@eqx.filter_jit
def _solve(linear, increments, extra, horizon):
    return bound_recursion(linear, GivenIncrements(increments), horizon, extra)[0]


def distance_wwb(
    model: DistanceModel, *, track: Float[ndarray, " times"] | None = None, horizon: str | Horizon = "filter"
) -> Result:
    """Weiss-Weinstein bound of a distance, for any noise; nothing is drawn.

    Parameters
    ----------
    model
        The model. Samples that share a bias need Gaussian noise of their own.
    track
        Distances at steps 0..K: signal strengths are then taken as linear around them, and the number is conditional.
    horizon
        ``"filter"``, ``"predict:N"`` or ``"smooth"``.

    Returns
    -------
    Result
        ``covariance`` holds the bound for the distance alone, [steps+1, 1, 1].

    Raises
    ------
    RefusedError, InputError
        As for :func:`slopes`; if no law stands for an epoch.

    Notes
    -----
    Test functions shift the whole path (:mod:`locbounds.bounds.weinstein.path`), so that Q may have rank one.

    Examples
    --------
    Cut noise and bias, whose Fisher information is infinite:

    >>> import locbounds as lb
    >>> from locbounds.ranging import DistanceModel, TimeOfArrival, distance_wwb
    >>> toa = TimeOfArrival(lb.TruncatedGaussian(0.0, 3.5, -7.0, 7.0), lb.Uniform(0.0, 3.0), samples=10)
    >>> model = DistanceModel(lb.Times.uniform(step_s=1.0, steps=3), [10, 0, 0], [2, 0.5, 0.75], 1.0, [toa])
    >>> print(distance_wwb(model))
    Recursive WWB: position RMSE 2.024 m, mean over steps 0..3; valid (any noise)
    """
    steep = slopes(model, track)
    laws = [sensor.epoch_noise() for sensor in model.sensors]
    tables = [log_coefficient(noise) for noise, _ in laws]
    counts = [count for _, count in laws]
    rough = np.array([c / rough_variance(noise) for noise, c in laws])

    def log_rho(moved: ndarray) -> ndarray:
        total = np.zeros(moved.shape[1:])
        for m, (table, count) in enumerate(zip(tables, counts, strict=True)):
            total = total + count * table(moved[m :: len(laws)]).sum(0)
        return total

    horizon = Horizon.parse(horizon, model.steps)
    X = model.whitened()[:, :1]  # the distance is all that is measured, and all that is asked for
    P = path_bounds(X, steep[..., None], rough, log_rho, np.array([0]), horizon)
    entry = method("wwb-recursive")
    verdict = Verdict(Status.VALID, entry.grounds)
    if track is not None:
        verdict = Verdict(Status.CONDITIONAL, ("conditional on the trajectory",))
    name = entry.name + horizon.label
    return _result(entry.id, name, model, P, verdict, horizon, track, "test functions that shift whole paths")


def _result(id, name, model, P, verdict, horizon, track, how) -> Result:
    mse = P[:, 0, 0]
    return Result(
        id=id,
        name=name,
        kind="bound",
        sees=horizon.sees(RANGES),
        time_s=np.asarray(model.times.time_s),
        position_mse=mse,
        replicates=np.zeros((1, len(mse))),
        covariance=P,
        verdict=verdict,
        provenance=Provenance.now(0, 0, how, method(id).references),
        track="" if track is None else "the trajectory",
    )
