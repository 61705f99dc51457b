"""From a scenario to the keys of a scenario file: the plainest keys that read back to exactly the same numbers."""

import itertools
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import jax
import numpy as np

from locbounds.errors import InputError
from locbounds.io import build
from locbounds.io.noise_families import FAMILIES, family_of
from locbounds.io.schema import (
    DERIVATIVES,
    FORMAT,
    MOTION_KEYS,
    SPREADS,
    NlosTable,
    NoiseTable,
    OutlierTable,
    PriorSection,
    SightTable,
    TimeSection,
)
from locbounds.measurement import BySight
from locbounds.motion import ConstantAcceleration, ConstantVelocity, CoordinatedTurn, RandomWalk
from locbounds.noise import ExponentiallyModifiedGaussian, Gaussian, GaussianMixture, Mixture, Noise, Sum
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight, KnownSight, MarkovSight, Sight
from locbounds.times import Times

MOST_DIGITS_OF_EXCESS = 9  # an NLOS excess is written as such only if it is a number a person may have typed


def same(a: Any, b: Any) -> bool:
    """Whether two model pieces agree leaf by leaf, exactly.

    >>> same(Gaussian(0, 1), Gaussian(0, 1)), same(Gaussian(0, 1), Gaussian(0, 2))
    (True, False)
    """
    if jax.tree.structure(a) != jax.tree.structure(b):
        return False
    pairs = zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True)
    return all(np.array_equal(x, y) for x, y in pairs)


def plain(value: Any) -> Any:
    """NumPy numbers as the shortest TOML numbers.

    >>> plain(np.array([500.0, 0.2]))
    [500, 0.2]
    """
    if np.ndim(value):
        return [plain(v) for v in value]
    value = float(value)
    return int(value) if value.is_integer() and abs(value) < 1e15 else value


def _first(candidates: Iterable[dict], rebuild: Callable[[dict], Any], target: Any) -> dict | None:
    """The first candidate that rebuilds the target exactly."""
    for candidate in candidates:
        try:
            if same(rebuild(candidate), target):
                return candidate
        except ValueError:  # not a valid way to write this one
            continue
    return None


def _cannot(what: str) -> InputError:
    return InputError(f"{what} has no form in a scenario file", "Keep this scenario in Python")


def time_keys(times: Times) -> dict:
    """Step and number of steps, or the list of times."""
    steps = times.steps
    candidates = [{"step_s": plain(t), "steps": steps} for t in (times.time_s[1], times.time_s[-1] / steps)]
    candidates.append({"times_s": plain(times.time_s)})
    found = _first(candidates, lambda keys: build.build_times(TimeSection.model_validate(keys)), times)
    assert found is not None
    return found


def motion_keys(motion: Any) -> dict:
    """Name and intensity of the motion model."""
    names = {
        ConstantVelocity: "constant-velocity",
        RandomWalk: "random-walk",
        ConstantAcceleration: "constant-acceleration",
        CoordinatedTurn: "coordinated-turn",
    }
    if type(motion) not in names:
        raise _cannot(f"the motion model {type(motion).__name__}")
    name = names[type(motion)]
    if isinstance(motion, ConstantVelocity) and motion.discrete:
        name = "constant-velocity-discrete"
    q = np.atleast_1d(motion.intensity)
    keys = {"model": name, MOTION_KEYS[name][0]: plain(q[0] if np.all(q == q[0]) else q)}
    return keys | ({"turn_rate_rad_s": plain(motion.rate_rad_s)} if isinstance(motion, CoordinatedTurn) else {})


def _spreads(covariance: Any) -> list:
    """Ways to write a covariance: one deviation, one per axis, the matrix."""
    deviations = np.sqrt(np.diag(covariance))
    return [plain(deviations[0]), plain(deviations), plain(covariance)]


def prior_keys(prior: GaussianPrior, dim: int) -> dict:
    """Means and deviations, or the whole covariance."""
    order = len(prior.mean) // dim
    blocks = [slice(i * dim, (i + 1) * dim) for i in range(order)]
    means = {name: plain(prior.mean[block]) for name, block in zip(DERIVATIVES, blocks, strict=False)}
    candidates = []
    for choice in itertools.product(*[_spreads(prior.covariance[block, block]) for block in blocks]):
        pairs = zip(means.items(), zip(SPREADS, choice, strict=False), strict=True)
        candidates.append(dict(item for pair in pairs for item in pair))
    candidates.append(means | {"covariance": plain(prior.covariance)})
    found = _first(candidates, lambda keys: build.build_prior(PriorSection.model_validate(keys)), prior)
    assert found is not None
    return found


def _by_sight(pair: Any) -> dict:
    return {"los": plain(pair[0]), "nlos": plain(pair[1])}


def sight_keys(sight: Sight, times: Times) -> dict:
    """The chain, or the known schedule in letters."""
    if isinstance(sight, KnownSight):
        return {"known": "".join("LN"[mode] for mode in sight.modes)}
    start = {"start": _by_sight(sight.start)} if len(sight.start) == 2 else {}
    if isinstance(sight, DwellSight):
        return {"dwell_s": _by_sight(sight.dwell_s), **start}
    if not isinstance(sight, MarkovSight) or len(sight.start) != 2:
        raise _cannot(f"the sight model {type(sight).__name__} with {len(sight.start)} conditions")
    stay = np.diag(sight.transition)
    candidates = [
        {"stay": plain(stay[0]), **start},
        {"stay": _by_sight(stay), **start},
        {"transition": plain(sight.transition), **start},
    ]
    found = _first(candidates, lambda keys: build.build_sight(SightTable.model_validate(keys), times), sight)
    assert found is not None
    return found


def _noise_table(noise: Noise) -> dict:
    if isinstance(noise, GaussianMixture):
        return {"weights": plain(noise.weights), "means_m": plain(noise.means), "stds_m": plain(noise.stds)}
    if isinstance(noise, Sum):
        return {"sum": [_noise_table(noise.first), _noise_table(noise.second)]}
    if isinstance(noise, Mixture):
        shares = zip(plain(noise.weights), noise.parts, strict=True)
        return {"mixture": [{"share": share, **_noise_table(part)} for share, part in shares]}
    family = family_of(noise)
    if family is None:
        raise _cannot(f"the noise {type(noise).__name__}")
    table = {} if family == "gaussian" else {"family": family}
    for name, argument in FAMILIES[family].keys.items():
        value = getattr(noise, argument)
        left_out = name in FAMILIES[family].optional and (value == 0 or not np.isfinite(value))
        if not left_out or (value == 0 and name in ("low_m", "high_m")):
            table[name] = plain(value)
    return table if family != "gaussian" else dict(sorted(table.items()))


def _as_excess(los: Noise, nlos: Noise) -> dict | None:
    if isinstance(nlos, Sum):
        return {"plus_los": True, **_noise_table(nlos.second)}
    if isinstance(los, Gaussian) and isinstance(nlos, ExponentiallyModifiedGaussian):
        start = {"start_m": plain(nlos.center - los.mean)} if nlos.center != los.mean else {}
        return {"plus_los": True, "family": "exponential", "scale_m": plain(nlos.scale), **start}
    if not isinstance(los, Gaussian) or not isinstance(nlos, Gaussian) or nlos.std <= los.std:
        return None
    mean, std = nlos.mean - los.mean, np.sqrt(nlos.std**2 - los.std**2)
    short = [float(f"{x:.{MOST_DIGITS_OF_EXCESS}g}") for x in (mean, std)]
    return {"plus_los": True, "mean_m": plain(short[0]), "std_m": plain(short[1])}


def _without_outlier(los: Noise, nlos: Noise) -> tuple[Noise, Noise, dict] | None:
    """Split off a last component that both conditions share."""
    if not (isinstance(los, GaussianMixture) and isinstance(nlos, GaussianMixture)):
        return None
    if not len(los.weights) == len(nlos.weights) == 2 or not same(los.weights, nlos.weights):
        return None
    if los.means[1] != nlos.means[1] or los.stds[1] != nlos.stds[1]:
        return None
    outlier = {"share": plain(los.weights[1]), "mean_m": plain(los.means[1]), "std_m": plain(los.stds[1])}
    return Gaussian(los.means[0], los.stds[0]), Gaussian(nlos.means[0], nlos.stds[0]), outlier


def noise_keys(los: Noise, nlos: Noise) -> dict:
    """Noise of both sight conditions: excess over LOS and a shared outlier component where that is what it is."""
    candidates = []
    for base_los, base_nlos, outlier in filter(None, (_without_outlier(los, nlos), (los, nlos, None))):
        rest = {"outlier": outlier} if outlier else {}
        for table in filter(None, (_as_excess(base_los, base_nlos), _noise_table(base_nlos))):
            candidates.append({"los": _noise_table(base_los), "nlos": table, **rest})

    def rebuild(keys: dict) -> tuple[Noise, Noise]:
        outlier = OutlierTable.model_validate(keys["outlier"]) if "outlier" in keys else None
        return build.build_noises(
            NoiseTable.model_validate(keys["los"]), NlosTable.model_validate(keys["nlos"]), outlier
        )

    found = _first(candidates, rebuild, (los, nlos))
    assert found is not None
    return found


def link_keys(link: Link, times: Times) -> dict:
    """All keys of one link except its position."""
    if len(link.noises) != 2:
        raise _cannot(f"anchor {link.name} with {len(link.noises)} sight conditions")
    if isinstance(link.measurement, BySight):
        raise _cannot(f"the measurement of anchor {link.name}, which depends on the sight,")
    if link.chain is not None:
        raise _cannot(f"the chain {link.chain} that anchor {link.name} shares")
    keys = {"measure": "range", "sight": sight_keys(link.sight, times), **noise_keys(*link.noises)}
    if link.reports is not None:
        keys["missing_steps"] = (np.flatnonzero(~np.asarray(link.reports, dtype=bool)) + 1).tolist()
    return keys


def shared_keys(tables: list[dict]) -> dict:
    """What goes into [links]: the most common value of each key that all links have, if it saves a repetition."""
    shared = {}
    for name in tables[0]:
        if all(name in table for table in tables):
            counts = Counter(repr(table[name]) for table in tables)
            value, count = counts.most_common(1)[0]
            if count > 1 or len(tables) == 1:
                shared[name] = next(table[name] for table in tables if repr(table[name]) == value)
    return shared


def file_keys(scenario: Scenario) -> dict[str, Any]:
    """Everything a scenario file says, as nested dictionaries in the file's order.

    Raises
    ------
    InputError
        If a model piece has no form in a scenario file.
    """
    tables = [link_keys(link, scenario.times) for link in scenario.links]
    shared = shared_keys(tables)
    anchors = {}
    for link, table in zip(scenario.links, tables, strict=True):
        own = {name: value for name, value in table.items() if name not in shared or shared[name] != value}
        anchors[link.name] = {"position_m": plain(link.measurement.anchor), **own}
    return {
        "format": FORMAT,
        "title": scenario.title,
        "time": time_keys(scenario.times),
        "motion": motion_keys(scenario.motion),
        "prior": prior_keys(scenario.prior, scenario.dim),
        "links": shared,
        "anchors": anchors,
    }
