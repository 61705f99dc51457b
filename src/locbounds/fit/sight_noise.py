"""LOS/NLOS noise and the dwell times of the sight, from the errors of real ranges, by maximum likelihood.

The model is a two-state hidden Markov chain in *continuous time* with an outlier component
(`locbounds.fit.switching`): irregular steps, gaps and missing ranges need no special treatment.

The exact likelihood is maximised directly (L-BFGS on its exact derivative) rather than by EM: in continuous time the
M-step of the rates has no closed form, while the derivative of the forward recursion serves labelled, partly labelled
and unlabelled ranges alike, and its parts per track give standard errors that hold when the errors within a track are
correlated.  For equally spaced, complete data without outliers the maximum is that of a Gaussian hidden Markov model.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.fit import maximum
from locbounds.fit.maximum import Maximum, Problem, Sequences, Units
from locbounds.precision import double_precision

MIN_RANGES = 50
"""Fewest ranges that nine parameters are fitted to."""

OUTLIER_WIDTH = 5.0
"""Default of ``outlier_width``: what "outlier" means here."""

OUTLIER_BULK = 0.95
"""Share of the errors, those nearest to the median, whose reach ``outlier_width`` multiplies."""


@dataclass(frozen=True)
class SightNoiseFit:
    """A fitted two-sight noise model.

    Attributes
    ----------
    los_mean_m, los_std_m, nlos_mean_m, nlos_std_m : float
        Mean and deviation of the range error in each sight, m.
    los_dwell_s, nlos_dwell_s : float
        Mean time in a sight before it changes, s.
    start_nlos : float
        Pr(NLOS) at the first time: the stationary share unless fitted freely.
    outlier_share, outlier_mean_m, outlier_std_m : float
        The wide component common to both sights; share 0 and NaN if there is none.
    stderr : dict
        Standard error of each number above and of ``nlos_share``, valid also when errors within a group (track) depend
        on each other and when the model is wrong; NaN for a number at a limit, and with one group.
    stderr_model : dict
        The same from the observed information, valid if the model is true: the ratio tells how far it is from that.
    log_likelihood : float
        At the maximum; densities in 1/m.
    ranges, sequences, groups : int
        What was fitted to.
    theta : array [10]
        The parameters in the order of `locbounds.fit.switching.NAMES`.
    notes : tuple of str
        What the reader has to know: parameters at a limit, an ambiguous order of the sights.
    """

    los_mean_m: float
    los_std_m: float
    nlos_mean_m: float
    nlos_std_m: float
    los_dwell_s: float
    nlos_dwell_s: float
    start_nlos: float
    outlier_share: float
    outlier_mean_m: float
    outlier_std_m: float
    stderr: dict[str, float] = field(repr=False)
    stderr_model: dict[str, float] = field(repr=False)
    log_likelihood: float
    ranges: int
    sequences: int
    groups: int
    theta: Float[ndarray, "10"] = field(repr=False)
    stationary: bool
    notes: tuple[str, ...] = ()

    @property
    def nlos_share(self) -> float:
        """Long-run share of time in NLOS."""
        return self.nlos_dwell_s / (self.los_dwell_s + self.nlos_dwell_s)

    @property
    def dwell_s(self) -> tuple[float, float]:
        """Mean dwell times (LOS, NLOS), s."""
        return self.los_dwell_s, self.nlos_dwell_s

    @property
    def start(self) -> tuple[float, float]:
        """Law of the sight at the first time (LOS, NLOS)."""
        return 1.0 - self.start_nlos, self.start_nlos

    @property
    def outliers(self) -> bool:
        """Whether there is an outlier component."""
        return self.outlier_share > 0.0

    def law(self, sight: int) -> tuple[ndarray, ndarray, ndarray]:
        """Weights, means (m) and deviations (m) of the Gaussian components in one sight (0 = LOS, 1 = NLOS)."""
        mean, std = ((self.los_mean_m, self.los_std_m), (self.nlos_mean_m, self.nlos_std_m))[sight]
        if not self.outliers:
            return np.ones(1), np.array([mean]), np.array([std])
        eps = self.outlier_share
        return np.array([1 - eps, eps]), np.array([mean, self.outlier_mean_m]), np.array([std, self.outlier_std_m])

    def __str__(self) -> str:
        out = f"{self.outlier_share:.2%} outliers" if self.outliers else "no outliers"
        return (
            f"LOS {self.los_mean_m:.3g} +- {self.los_std_m:.3g} m for {self.los_dwell_s:.3g} s, "
            f"NLOS {self.nlos_mean_m:.3g} +- {self.nlos_std_m:.3g} m for {self.nlos_dwell_s:.3g} s, {out} "
            f"({self.ranges} ranges, {self.groups} groups)"
        )


@double_precision
def fit_sight_noise(
    time_s,
    error_m,
    *,
    labels=None,
    groups=None,
    outliers: bool = True,
    outlier_width: float = OUTLIER_WIDTH,
    outlier_law: tuple[float, float] | None = None,
    stationary: bool = True,
    initial: SightNoiseFit | None = None,
) -> SightNoiseFit:
    """Fit LOS and NLOS noise and the dwell times of the sight by maximum likelihood.

    Parameters
    ----------
    time_s : array [sequences, steps]
        Times, s, increasing along a sequence; NaN at the end is padding.  A sequence is one link along one track.
    error_m : array [sequences, steps]
        Range minus true distance, m; NaN is a missing range.
    labels : int array [sequences, steps], optional
        Known sight: 0 LOS, 1 NLOS, -1 unknown.  Any share of the ranges may be labelled.
    groups : array [sequences], optional
        The track of each sequence: standard errors take all of one group as dependent.  Default: each its own.
    outliers : bool
        Whether both sights carry the same wide outlier component.
    outlier_width : float
        The outlier's deviation is at least this many times the distance from the median within which 95 % of the
        errors lie: this defines what an outlier is.  Without a limit the maximum spends the component on the heavy
        tail of the NLOS error, which lasts in time and is no outlier.
    outlier_law : (mean_m, std_m), optional
        Fixed outlier mean and deviation, for links with few outliers of their own; only the share is fitted then.
    stationary : bool
        The first sight of a sequence has the chain's stationary law (default), or a law of its own that is fitted.
    initial : SightNoiseFit, optional
        Start from there instead of trying several starts.

    Returns
    -------
    SightNoiseFit
        Without labels, LOS is the sight with the smaller mean.

    Raises
    ------
    InputError
        Fewer than `MIN_RANGES` ranges, errors all equal, or labels that name only one sight.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> sight = np.tile(np.arange(200) // 20 % 2, (4, 1))
    >>> error = np.where(sight == 0, rng.normal(0, 0.1, sight.shape), rng.normal(2, 0.5, sight.shape))
    >>> time = np.tile(np.arange(200) * 0.5, (4, 1))
    >>> fit = fit_sight_noise(time, error, outliers=False)
    >>> round(fit.los_std_m, 1), round(fit.nlos_mean_m, 1), round(fit.nlos_dwell_s)
    (0.1, 2.0, 11)
    """
    t, e = np.atleast_2d(np.asarray(time_s, float)), np.atleast_2d(np.asarray(error_m, float))
    e = np.where(np.isfinite(t), e, np.nan)
    known = np.full(e.shape, -1) if labels is None else np.atleast_2d(np.asarray(labels, int))
    known = np.where(np.isfinite(e), known, -1)
    group = np.arange(len(e)) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
    heard = np.isfinite(e).any(1)
    t, e, known, group = t[heard], e[heard], known[heard], group[heard]
    _check(e, known)

    own = maximum.units(t, e)
    data = Sequences(t / own.tick, (e - own.middle) / own.scale, known)
    bulk = np.quantile(np.abs(data.e[np.isfinite(data.e)]), OUTLIER_BULK)
    problem = _problem(outliers, outlier_width * bulk, outlier_law is None, stationary)
    gain, offset = maximum.to_si(own)
    fixed = np.zeros(10)
    if outlier_law is not None:
        fixed[[maximum.WIDE_MEAN, maximum.WIDE_STD]] = outlier_law[0], np.log(outlier_law[1])
        fixed = (fixed - offset) / gain
    if initial is None:
        theta = _best_start(problem, data, fixed)
    else:
        theta = np.where(problem.free, (initial.theta - offset) / gain, fixed)
    top = maximum.maximise(problem, theta, data, iterations=500)

    if outliers and np.isfinite(e).sum() / (1 + np.exp(-top.theta[maximum.SHARE])) < 0.5:
        # Not half an outlier: its mean and deviation mean nothing; fit without.
        return fit_sight_noise(t, e, labels=known, groups=group, outliers=False, stationary=stationary)
    if (known < 0).all() and top.theta[0] > top.theta[2]:
        swap = [2, 3, 0, 1, 5, 4, 6, 7, 8, 9]
        sign = np.where(np.arange(10) == maximum.START, -1, 1)
        top = Maximum(top.theta[swap] * sign, top.value, top.score[:, swap] * sign)
    return _result(problem, top, data, own, group)


def _check(e, known) -> None:
    n = int(np.isfinite(e).sum())
    if n < MIN_RANGES:
        raise InputError(
            f"there {'is 1 range' if n == 1 else f'are {n} ranges'} with a known true distance",
            f"A fit of two sights needs at least {MIN_RANGES}, from several tracks",
        )
    for sight, name in enumerate(("LOS", "NLOS")):
        if (known >= 0).any() and (known[np.isfinite(e)] >= 0).all() and not (known == sight).any():
            raise InputError(
                f"no range is labelled {name}: its noise cannot be estimated",
                f"Give {name} ranges, leave the labels out, or write that noise into the scenario by hand",
            )


def _problem(outliers: bool, least_wide: float, free_law: bool, stationary: bool) -> Problem:
    if not least_wide >= 1:
        raise InputError("outlier_width is below one robust deviation of the errors", "Give a larger number, such as 5")
    free = np.ones(10, bool)
    free[maximum.SHARE] = outliers
    free[[maximum.WIDE_MEAN, maximum.WIDE_STD]] = outliers and free_law
    free[maximum.START] = not stationary
    lower = maximum.LOWER.copy()
    lower[maximum.WIDE_STD] = np.log(least_wide)
    return Problem(free, lower, stationary, outliers)


def _best_start(problem: Problem, data: Sequences, fixed) -> Float[ndarray, "10"]:
    few = np.unique(np.linspace(0, len(data.e) - 1, maximum.FEW).astype(int))
    part = Sequences(*(d[few] for d in data)) if len(data.e) > 2 * maximum.FEW else data
    tries = maximum.starts(data, float(problem.lower[maximum.WIDE_STD]))
    tries = [np.where(problem.free, start, fixed) for start in tries]
    if len(tries) == 1:
        return tries[0]
    return max((maximum.maximise(problem, start, part, iterations=60) for start in tries), key=lambda m: m.value).theta


def _natural(theta, problem: Problem, own: Units) -> dict[str, float]:
    """The numbers of a fit from parameters in the errors' own units."""
    gain, offset = maximum.to_si(own)
    x = gain * theta + offset
    nlos = 1 / (1 + np.exp(x[5] - x[4]))
    return {
        "los_mean_m": x[0],
        "los_std_m": np.exp(x[1]),
        "nlos_mean_m": x[2],
        "nlos_std_m": np.exp(x[3]),
        "los_dwell_s": np.exp(-x[4]),
        "nlos_dwell_s": np.exp(-x[5]),
        "start_nlos": nlos if problem.stationary else 1 / (1 + np.exp(-x[9])),
        "outlier_share": 1 / (1 + np.exp(-x[6])) if problem.outliers else 0.0,
        "outlier_mean_m": x[7] if problem.outliers else np.nan,
        "outlier_std_m": np.exp(x[8]) if problem.outliers else np.nan,
        "nlos_share": nlos,
    }


def _result(problem: Problem, top: Maximum, data: Sequences, own: Units, group) -> SightNoiseFit:
    inner = problem.free & (top.theta > problem.lower + 1e-6) & (top.theta < maximum.UPPER - 1e-6)
    numbers = _natural(top.theta, problem, own)
    step = 1e-6 * np.eye(10)
    up, down = ([_natural(top.theta + s * d, problem, own) for d in step] for s in (1, -1))
    jac = np.array([[(u[k] - d[k]) / 2e-6 for u, d in zip(up, down, strict=True)] for k in numbers])

    def deviations(covariance) -> dict[str, float]:
        used = np.nan_to_num(jac, nan=0.0)
        variance = np.diag(used @ covariance @ used.T)
        variance = np.where(variance >= 0, variance, np.nan)  # a likelihood that is flat, or no maximum, there
        fixed = ~(used[:, inner] != 0).any(1)
        return {k: float("nan") if f else float(np.sqrt(v)) for k, f, v in zip(numbers, fixed, variance, strict=True)}

    model, robust = maximum.covariances(problem, top, inner, data, group)
    gain, offset = maximum.to_si(own)
    n = int(np.isfinite(data.e).sum())
    stderr = deviations(robust)
    for sight in _told_apart_once(data, group):
        stderr |= dict.fromkeys((f"{sight}_mean_m", f"{sight}_std_m"), float("nan"))
    return SightNoiseFit(
        **{k: float(v) for k, v in numbers.items() if k != "nlos_share"},
        stderr=stderr,
        stderr_model=deviations(model),
        log_likelihood=top.value - n * float(np.log(own.scale)),
        ranges=n,
        sequences=len(data.e),
        groups=len(np.unique(group)),
        theta=gain * top.theta + offset,
        stationary=problem.stationary,
        notes=_notes(problem, top.theta, numbers, own, labelled=bool((data.label >= 0).any())),
    )


def _told_apart_once(data: Sequences, group) -> list[str]:
    """Which sight was labelled in one group only, where all is labelled: no spread over groups tells its s.e."""
    there = np.isfinite(data.e)
    if (data.label[there] < 0).any():
        return []
    counts = [len(np.unique(group[(there & (data.label == sight)).any(1)])) for sight in (0, 1)]
    return [name for name, n in zip(("los", "nlos"), counts, strict=True) if n < 2]


def _notes(problem: Problem, theta, x: dict[str, float], own: Units, *, labelled: bool):
    notes = []
    if not labelled and x["los_std_m"] > x["nlos_std_m"]:
        notes.append(
            "The sight with the smaller mean error, taken as LOS, is the one with the larger deviation: "
            "check with labels which is which."
        )
    if not labelled and x["nlos_mean_m"] - x["los_mean_m"] < max(x["los_std_m"], x["nlos_std_m"]):
        notes.append("The two sights overlap: their means are closer than the wider deviation.")
    for i, name in ((4, "LOS"), (5, "NLOS")):
        if theta[i] > maximum.UPPER[i] - 1e-3:
            notes.append(f"{name} ends within one interval ({own.tick:.3g} s): its dwell time is not resolved.")
        if theta[i] < problem.lower[i] + 1e-3:
            notes.append(f"{name} was never seen to end: its dwell time has no upper limit in this log.")
    for i, name in ((1, "LOS"), (3, "NLOS")):
        if theta[i] < problem.lower[i] + 1e-3:
            notes.append(f"The {name} deviation fell to its limit: the log repeats the same errors.")
    wide = maximum.WIDE_STD
    if problem.free[wide] and theta[wide] < problem.lower[wide] + 1e-3:
        notes.append(
            f"The outlier deviation is at its lower limit, {x['outlier_std_m']:.3g} m: the errors have a longer tail "
            f"than two Gaussians, and {x['outlier_share']:.2%} of the ranges are taken as outliers."
        )
    return tuple(notes)
