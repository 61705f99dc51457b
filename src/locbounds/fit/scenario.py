"""From a log to a scenario that bounds and filters can use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from locbounds.errors import InputError
from locbounds.fit.motion import MotionFit, fit_psd, prior_from_tracks
from locbounds.fit.quality import FitQuality, fit_quality
from locbounds.fit.range_log import RangeLog, Track
from locbounds.fit.sight_noise import MIN_RANGES, SightNoiseFit, fit_sight_noise
from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian, GaussianMixture, Noise
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight
from locbounds.times import Times


@dataclass(frozen=True)
class FittedScenario:
    """A scenario from a log, and where each number came from.

    Attributes
    ----------
    scenario : Scenario
        In the times and reports of one typical track.
    comments : dict
        Key of the scenario file, dotted (``motion.psd_m2_s3``, ``links.los``, ``anchors.3.nlos``), to a line of text.
    noise : dict
        Anchor name to its `SightNoiseFit`; the same object for every anchor if pooled.
    motion : MotionFit or None
        None if the intensity was given.
    quality : FitQuality
        Of the tracks that were fitted.
    layout : str
        Name of the track whose times and reports the scenario has.
    notes : tuple of str
    """

    scenario: Scenario
    comments: dict[str, str]
    noise: dict[str, SightNoiseFit] = field(repr=False)
    motion: MotionFit | None
    quality: FitQuality = field(repr=False)
    layout: str
    notes: tuple[str, ...] = ()


def fit_scenario(
    log: RangeLog,
    *,
    held_out: RangeLog | None = None,
    per_anchor: bool = False,
    outliers: bool = True,
    psd_m2_s3: float | None = None,
    truth_std_m: float | None = None,
    prior: str | GaussianPrior = "area",
    title: str = "Fitted to a log of ranges",
) -> FittedScenario:
    """Fit noise, sight, motion and prior to a log.

    Parameters
    ----------
    log : RangeLog
        The tracks to fit, with true positions; see `locbounds.io.logs.read_log` and `RangeLog.hold_out`.
    held_out : RangeLog, optional
        The scenario takes times and reports of the track of median length among these (default: among ``log``).
    per_anchor : bool
        Noise and dwell times for every anchor instead of pooled; the outlier's mean and deviation stay pooled.
        Anchors with fewer than `MIN_RANGES` ranges keep the pooled values.
    outliers : bool
        Whether both sights carry an outlier component.
    psd_m2_s3 : float, optional
        Acceleration intensity, if the truth cannot tell it.
    truth_std_m : float, optional
        Deviation of the true positions, m; estimated if not given.
    prior : {"area", "start"} or GaussianPrior
        See `prior_from_tracks`.
    title : str

    Returns
    -------
    FittedScenario

    Raises
    ------
    InputError
        Naming whatever cannot be estimated from this log.

    Examples
    --------
    A log that was simulated, of two anchors whose NLOS ranges are 3 m too long:

    >>> import locbounds as lb
    >>> noises = (lb.Gaussian(0.0, 0.3), lb.Gaussian(3.0, 1.0))
    >>> sight = lb.DwellSight(None, [5.0, 5.0])
    >>> links = [lb.Link(name, lb.Range(place), sight, noises) for name, place in (("a", [0, 0]), ("b", [30, 0]))]
    >>> prior = lb.GaussianPrior([10, 20, 1, 0], np.diag([1.0, 1.0, 0.1, 0.1]))
    >>> truth = lb.Scenario("walk", lb.Times.uniform(step_s=0.5, steps=100), lb.ConstantVelocity(0.1), prior, links)
    >>> draws = lb.simulate(truth, runs=4, seed=0)
    >>> tracks = [
    ...     Track(f"walk {i}", truth.times.time_s, z, x[:, :2])
    ...     for i, (z, x) in enumerate(zip(draws.measurements, draws.states, strict=True))
    ... ]
    >>> log = RangeLog(("a", "b"), truth.anchors, tuple(tracks))
    >>> fitted = fit_scenario(log, outliers=False, psd_m2_s3=0.1)
    >>> los, nlos = fitted.scenario.links[0].noises
    >>> abs(float(los.mean)) < 0.1, abs(float(nlos.mean) - 3) < 0.4
    (True, True)
    """
    if not log.has_truth:
        raise InputError(
            "without true positions links.los, links.nlos, motion.psd_m2_s3 and prior cannot be estimated",
            "Give the truth file (--truth), or write the scenario by hand",
        )
    noise, pooled, notes = _noise(log, per_anchor, outliers)
    times, places = zip(*(t.path for t in log.tracks), strict=True)
    motion = None if psd_m2_s3 is not None else fit_psd(times, places, truth_std_m=truth_std_m)
    comments = _noise_comments(pooled, noise, per_anchor)
    if motion is None:
        intensity = float(psd_m2_s3 or 0.0)
        comments["motion.psd_m2_s3"] = "given"
    else:
        intensity = float(_digits(motion.psd_m2_s3))
        spread = "" if np.isnan(motion.stderr) else f", s.e. {motion.stderr:.2g}"
        comments["motion.psd_m2_s3"] = (
            f"maximum likelihood, true positions of {_count(motion.tracks, 'track')}, {motion.steps:,} steps{spread}; "
            f"error of the truth {'given' if truth_std_m is not None else 'estimated'} as {motion.truth_std_m:.2g} m"
        )
        notes += list(motion.notes)
    start = prior
    if isinstance(start, str):
        mean, covariance = prior_from_tracks(times, places, where=start)
        start = GaussianPrior(_digits(mean), _digits(covariance, 8))  # a covariance needs digits to stay positive
        where = "where the tracks were, each moment alike" if prior == "area" else "where the tracks start"
        comments["prior"] = f"mean and covariance over {_count(len(log.tracks), 'track')}: {where}"
    else:
        comments["prior"] = "given"

    typical = _typical((held_out or log).tracks)
    comments["time"] = f"times and reports of track {typical.name} ({'held out' if held_out else 'fitted'})"
    own = typical.anchors_m is not None
    comments["anchors"] = f"positions from the anchor file{f', those of track {typical.name}' if own else ''}"
    links = [
        Link(name, Range(place), *_laws(noise[name]), typical.reports[:, m])
        for m, (name, place) in enumerate(zip(log.anchor_names, log.anchors_of(typical), strict=True))
    ]
    scenario = Scenario(
        title=title,
        times=Times(typical.time_s - typical.time_s[0]),
        motion=ConstantVelocity(intensity, dim=log.dim),
        prior=start,
        links=links,
    )
    quality = fit_quality(log, noise)
    notes.append(quality.statement)
    return FittedScenario(scenario, comments, noise, motion, quality, typical.name, (*log.notes, *notes))


def _noise(log: RangeLog, per_anchor: bool, outliers: bool):
    errors = log.errors()
    labels = errors.sight if (errors.sight >= 0).any() else None
    pooled = fit_sight_noise(errors.time_s, errors.error_m, labels=labels, groups=errors.track, outliers=outliers)
    noise, notes = dict.fromkeys(log.anchor_names, pooled), list(pooled.notes)
    if not per_anchor:
        return noise, pooled, notes
    law = (pooled.outlier_mean_m, pooled.outlier_std_m) if pooled.outliers else None
    for m, name in enumerate(log.anchor_names):
        rows = errors.link == m
        if np.isfinite(errors.error_m[rows]).sum() < MIN_RANGES:
            notes.append(f"Anchor {name} has fewer than {MIN_RANGES} ranges: it keeps the pooled noise.")
            continue
        own = None if labels is None else labels[rows]
        if own is not None and len(np.unique(own[np.isfinite(errors.error_m[rows])])) < 2:
            notes.append(f"Anchor {name} is labelled with one sight only: it keeps the pooled noise.")
            continue
        noise[name] = fit_sight_noise(
            errors.time_s[rows],
            errors.error_m[rows],
            labels=own,
            groups=errors.track[rows],
            outliers=pooled.outliers,
            outlier_law=law,
        )
        notes += [f"Anchor {name}: {note}" for note in noise[name].notes]
    return noise, pooled, notes


def _laws(fit: SightNoiseFit) -> tuple[DwellSight, tuple[Noise, Noise]]:
    def law(sight: int) -> Noise:
        weights, means, stds = fit.law(sight)
        means, stds = _digits(means), _digits(stds)
        if len(weights) == 1:
            return Gaussian(means[0], stds[0])
        eps = float(_digits(weights[1]))
        return GaussianMixture(np.array([1 - eps, eps]), means, stds)

    nlos = round(fit.start_nlos, 4)
    return DwellSight(np.array([round(1 - nlos, 4), nlos]), _digits(np.array(fit.dwell_s))), (law(0), law(1))


def _digits(x, digits: int = 4):
    """Rounded to significant digits, well below any standard error, so that a scenario file stays readable."""
    size = np.floor(np.log10(np.maximum(np.abs(x), 1e-300)))
    scale = 10.0 ** (digits - 1 - size)
    return np.round(np.asarray(x) * scale) / scale


def _count(n: int, what: str) -> str:
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def _noise_comments(pooled: SightNoiseFit, noise: Mapping[str, SightNoiseFit], per_anchor: bool) -> dict[str, str]:
    def lines(prefix: str, fit: SightNoiseFit) -> dict[str, str]:
        def error(*names: str, unit: str = "") -> str:
            values = [fit.stderr[name] for name in names]
            if not np.isfinite(values).any():
                return "no s.e. from one track" if fit.groups < 2 else "no s.e. from one such track or at a limit"
            return "s.e. " + ", ".join(f"{value:.2g}" if np.isfinite(value) else "none" for value in values) + unit

        source = f"maximum likelihood, {_count(fit.groups, 'track')}, {_count(fit.ranges, 'range')}"
        found = {
            f"{prefix}.los": f"{source}, {error('los_mean_m', 'los_std_m', unit=' m (mean, deviation)')}",
            f"{prefix}.nlos": f"{source}, {error('nlos_mean_m', 'nlos_std_m', unit=' m (mean, deviation)')}",
            f"{prefix}.sight": f"{source}, {error('los_dwell_s', 'nlos_dwell_s', unit=' s')}; start: long-run shares",
        }
        if fit.outliers:
            found[f"{prefix}.outlier"] = (
                f"{source}, share {fit.outlier_share:.4f}, {error('outlier_share')}; common to LOS and NLOS"
            )
        return found

    comments = lines("links", pooled)
    if per_anchor:
        for name, fit in noise.items():
            if fit is not pooled:
                comments |= lines(f"anchors.{name}", fit)
    return comments


def _typical(tracks: tuple[Track, ...]) -> Track:
    """The track of median length (the lower one of two)."""
    return sorted(tracks, key=lambda track: track.steps)[(len(tracks) - 1) // 2]
