"""From the validated keys of a scenario file to the scenario."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import reduce
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from locbounds.axes import LOS, NLOS, ndarray
from locbounds.errors import InputError
from locbounds.io import noise_families
from locbounds.io.anchors_csv import anchor_positions
from locbounds.io.complain import quoted, unknown_key_remedy
from locbounds.io.schema import (
    MOTION_KEYS,
    SPREADS,
    AnchorTable,
    LinksSection,
    MotionSection,
    NlosTable,
    NoiseTable,
    OutlierTable,
    PriorSection,
    ScenarioFile,
    Section,
    SightTable,
    TimeSection,
)
from locbounds.measurement import Range
from locbounds.motion import ConstantAcceleration, ConstantVelocity, CoordinatedTurn, Motion, RandomWalk
from locbounds.noise import Gaussian, GaussianMixture, Mixture, Noise
from locbounds.noise.sums import add
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight, KnownSight, MarkovSight, Sight
from locbounds.sight.markov import EQUAL_STEPS
from locbounds.times import Times

S = TypeVar("S", bound=Section)
LETTERS = {"L": LOS, "N": NLOS}
WORDS = {"los": LOS, "nlos": NLOS}


@contextmanager
def at(path: str) -> Iterator[None]:
    """Put a key's path in front of the errors of the model pieces."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error.cause}", error.remedy) from error


def build_times(time: TimeSection) -> Times:
    """Times of the steps."""
    with at("time"):
        if time.times_s is not None:
            return Times(time.times_s)
        assert time.step_s is not None
        assert time.steps is not None
        return Times.uniform(step_s=time.step_s, steps=time.steps)


def build_motion(motion: MotionSection, dim: int) -> Motion:
    """Motion model in as many dimensions as the prior."""
    name = MOTION_KEYS[motion.model][0]
    intensity = getattr(motion, name)
    turns = motion.model == "coordinated-turn"
    if isinstance(intensity, tuple) and (turns or len(intensity) != dim):
        raise InputError(
            f"motion.{name} has {len(intensity)} numbers, prior.position_m {dim} coordinates",
            "Give one number" if turns else "Give one number, or one per coordinate",
        )
    with at("motion"):
        if motion.model == "random-walk":
            return RandomWalk(intensity, dim)
        if motion.model == "constant-acceleration":
            return ConstantAcceleration(intensity, dim)
        if turns:
            return CoordinatedTurn(motion.turn_rate_rad_s, intensity, dim)
        return ConstantVelocity(intensity, dim, discrete=motion.model == "constant-velocity-discrete")


def covariance_of(spread: Any, dim: int) -> ndarray:
    """The covariance matrix that a deviation, one per axis, or the matrix itself says.

    >>> covariance_of(3.0, 2).tolist()
    [[9.0, 0.0], [0.0, 9.0]]
    """
    if np.ndim(spread) == 2:
        return np.asarray(spread)
    return np.diag(np.broadcast_to(np.asarray(spread), dim) ** 2)


def build_prior(prior: PriorSection) -> GaussianPrior:
    """Prior of position, velocity and acceleration, as many as there are."""
    n, means = len(prior.position_m), prior.means
    covariance = np.zeros((len(means) * n, len(means) * n))
    if prior.covariance is not None:
        covariance[:] = prior.covariance
    else:
        for i, name in enumerate(SPREADS[: len(means)]):
            block = slice(i * n, (i + 1) * n)
            covariance[block, block] = covariance_of(getattr(prior, name), n)
            with at(f"prior.{name}"):
                GaussianPrior(np.zeros(n), covariance[block, block])
    with at("prior"):
        return GaussianPrior([x for name in means for x in getattr(prior, name)], covariance)


def build_schedule(known, times: Times) -> list[int]:
    """Modes of steps 1..K from letters, or from a list of periods."""
    remedy = SightTable.model_fields["known"].description or ""
    if isinstance(known, str):
        if not known or set(known) - set(LETTERS):
            raise InputError(f"the schedule is {quoted(known)}", f"Use the letters L and N only; {remedy}")
        return [LETTERS[letter] for letter in known]
    if not isinstance(known, list) or not known or not all(isinstance(period, dict) for period in known):
        raise InputError(f"the schedule is {quoted(known)}", remedy)
    modes = np.full(times.steps, -1)
    begin = -np.inf
    for period in known:
        for name in set(period) - {"until_s", "sight"}:
            raise InputError(f"unknown key {name} in {period}", unknown_key_remedy(name, ["until_s", "sight"]))
        until, sight = period.get("until_s", np.inf), period.get("sight")
        if sight not in WORDS or isinstance(until, bool | str) or not until > begin:
            raise InputError(f"the period {period} after {begin:g} s is not valid", f"Give growing times; {remedy}")
        modes[(times.time_s[1:] > begin) & (times.time_s[1:] <= until)] = WORDS[sight]
        begin = until
    if (modes < 0).any():
        raise InputError(
            f"the schedule ends at {begin:g} s, the scenario at {times.time_s[-1]:g} s",
            'End with a period without until_s, for example { sight = "los" }',
        )
    return modes.tolist()


def build_sight(sight: SightTable, times: Times) -> Sight:
    """Chain of sight conditions, checked against the times."""
    if sight.known is not None:
        chain = KnownSight(build_schedule(sight.known, times))
    elif sight.dwell_s is not None:
        chain = DwellSight(sight.start, sight.dwell_s)
    elif sight.stay is not None:
        chain = MarkovSight.stay(sight.stay, sight.start)
    else:
        chain = MarkovSight(sight.start, sight.transition)
    if isinstance(chain, KnownSight) and len(chain.modes) != times.steps:
        raise InputError(f"the schedule has {len(chain.modes)} letters for {times.steps} steps", "Give one per step")
    if isinstance(chain, MarkovSight) and np.ptp(times.intervals) > EQUAL_STEPS * np.max(times.intervals):
        chain.transitions(times.intervals)  # raises: a chain per step needs equal steps
    return chain


def build_noise(table: NoiseTable) -> Noise:
    """The law that one noise table describes; that of the mean where it is one of several samples."""
    law = _one_sample(table)
    if table.samples is None:
        return law
    assert isinstance(law, Gaussian)
    return Gaussian(law.mean, law.std / np.sqrt(table.samples))


def _one_sample(table: NoiseTable) -> Noise:
    if table.sum is not None:
        return reduce(add, map(build_noise, table.sum))
    if table.mixture is not None:
        return Mixture([part.share for part in table.mixture], [build_noise(part) for part in table.mixture])
    if table.weights is not None:
        return GaussianMixture(table.weights, table.means_m, table.stds_m)
    return noise_families.build(table.family or "gaussian", table.laws())


def build_noises(los: NoiseTable, nlos: NlosTable, outlier: OutlierTable | None) -> tuple[Noise, Noise]:
    """Noises of LOS and NLOS; an excess on top of LOS is the sum of two independent errors."""
    laws = build_noise(los), build_noise(nlos)
    if nlos.plus_los:
        laws = laws[0], add(laws[0], laws[1])
    return _with_outliers(laws[0], outlier), _with_outliers(laws[1], outlier)


def _with_outliers(noise: Noise, outlier: OutlierTable | None) -> Noise:
    if outlier is None or outlier.share == 0:
        return noise
    if isinstance(noise, Gaussian | GaussianMixture):
        simple = isinstance(noise, Gaussian)
        w, m, s = (1.0, noise.mean, noise.std) if simple else (noise.weights, noise.means, noise.stds)
        w = np.append((1 - outlier.share) * np.asarray(w), outlier.share)
        return GaussianMixture(w, np.append(m, outlier.mean_m), np.append(s, outlier.std_m))
    return Mixture([1 - outlier.share, outlier.share], [noise, Gaussian(outlier.mean_m, outlier.std_m)])


def _missing(steps: tuple[int, ...] | None, count: int) -> ndarray | None:
    if steps is None:
        return None
    reports = np.ones(count, dtype=bool)
    if steps and max(steps) > count:
        raise InputError(f"step {max(steps)} is after the last step {count}", "Give steps from 1 to time.steps")
    reports[np.array(steps, dtype=int) - 1] = False
    return reports


def build_link(name: str, position: tuple[float, ...], table: LinksSection, times: Times) -> Link:
    """One link from the shared keys with the anchor's own on top."""
    for key in ("sight", "los", "nlos"):
        if getattr(table, key) is None:
            raise InputError(
                f"anchors.{name} has no {key}, and neither has [links]",
                f"Add {key} to [links]: {LinksSection.model_fields[key].description}",
            )
    assert table.los is not None
    assert table.nlos is not None
    assert table.sight is not None
    with at(f"anchors.{name}"):
        measurement = Range(position)
        reports = _missing(table.missing_steps, times.steps)
        noises = build_noises(table.los, table.nlos, table.outlier)
    with at(f"sight of anchor {name}"):
        sight = build_sight(table.sight, times)
    return Link(name, measurement, sight, noises, reports)


def merged(shared: Section, own: Section | None, kind: type[S]) -> S:
    """The shared keys, each replaced as a whole where the anchor gives its own, as a section of this kind."""
    given = {k: getattr(section, k) for section in (shared, own) if section for k in section.model_fields_set}
    return kind.model_construct(**given)


def build(file: ScenarioFile, folder: Path) -> Scenario:
    """The scenario of a validated file; ``folder`` is where a relative ``anchors_csv`` lies."""
    positions = anchor_positions(file.anchors, file.anchors_csv, folder)
    dim = len(file.prior.position_m)
    for name, position in positions.items():
        if len(position) != dim:
            raise InputError(
                f"anchors.{name}.position_m has {len(position)} coordinates, prior.position_m {dim}",
                "Use the same number of coordinates everywhere",
            )
    times = build_times(file.time)
    links = [
        build_link(n, p, merged(file.links, file.anchors.get(n), AnchorTable), times) for n, p in positions.items()
    ]
    return Scenario(file.title, times, build_motion(file.motion, dim), build_prior(file.prior), links)
