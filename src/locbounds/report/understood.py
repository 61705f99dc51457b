"""A scenario in words and numbers: what was understood, what is dangerous, which bounds apply."""

from typing import Any

import numpy as np

from locbounds.axes import LOS, NLOS
from locbounds.motion import ConstantAcceleration, CoordinatedTurn, LinearMotion, RandomWalk, SwitchingMotion
from locbounds.noise import Gaussian, GaussianMixture, Noise, Sum
from locbounds.registry import bounds_of
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight, KnownSight, MarkovSight, Sight
from locbounds.verdict import dangers

DEGREES_LIKE = 180.0  # coordinates within this, and closer together than a metre, look like degrees
ROUND = 6  # digits of a number read by a person


def understood(scenario: Scenario) -> dict[str, Any]:
    """The scenario as text, one entry per question.

    Parameters
    ----------
    scenario
        Any scenario.

    Returns
    -------
    dict
        ``model``: time, motion, prior as sentences; ``links``: a row per anchor; ``bounds``: id, status and reasons
        of every bound; ``dangers``: sentences about what is legal but dangerous.

    Examples
    --------
    >>> import locbounds as lb
    >>> seen = understood(lb.papers.fritsche2013.scenario())
    >>> seen["model"]["time"]
    '100 steps of 0.2 s: steps 0..100 from 0 to 20 s, step 0 is the prior'
    >>> seen["links"][0]["NLOS error"]
    'mean 513 m, deviation 435.639 m'
    """
    verdicts = {m.id: m.verdict(scenario) for m in bounds_of("scenario")}
    return {
        "title": scenario.title,
        "model": {"time": _time(scenario), "motion": _motion(scenario), "prior": _prior(scenario)},
        "links": [_link(link, scenario) for link in scenario.links],
        "bounds": [{"id": id, "status": str(v.status), "reasons": list(v.reasons)} for id, v in verdicts.items()],
        "dangers": [*dangers(scenario), *_looks_like_degrees(scenario)],
    }


def _number(value: Any) -> str:
    return f"{float(value):.{ROUND}g}"


def _numbers(values: Any) -> str:
    values = np.asarray(values)
    return _number(values[0]) if np.all(values == values[0]) else f"({', '.join(map(_number, values))})"


def _point(values: Any) -> str:
    return f"({', '.join(map(_number, np.asarray(values)))})"


def _time(scenario: Scenario) -> str:
    t, dt = scenario.times.time_s, scenario.times.intervals
    even = np.ptp(dt) <= 1e-9 * np.max(np.abs(t))
    each = f"{_number(dt[0])} s" if even else f"{_number(dt.min())} to {_number(dt.max())} s"
    steps = f"{scenario.steps} step{'s' if scenario.steps > 1 else ''}"
    return (
        f"{steps} of {each}: steps 0..{scenario.steps} from {_number(t[0])} to {_number(t[-1])} s, step 0 is the prior"
    )


def _motion(scenario: Scenario) -> str:
    motion: Any = scenario.motion
    dt = float(np.mean(scenario.times.intervals))
    where = f"in {scenario.dim}-D"
    if isinstance(motion, SwitchingMotion):
        kinds = ", ".join(type(m).__name__ for m in motion.motions)
        return f"switches {where} between {len(motion.motions)} motions ({kinds}); chain: {_sight(motion.sight)}"
    if isinstance(motion, LinearMotion):
        return f"linear {where}, its own matrices at every step, state {', '.join(motion.state_names)}"
    q = np.max(motion.intensity)
    number = _numbers(np.atleast_1d(motion.intensity))
    if isinstance(motion, RandomWalk):
        return f"random walk {where}, diffusion {number} m^2/s: the position changes by {np.sqrt(q * dt):.3g} m a step"
    if isinstance(motion, ConstantAcceleration):
        change = f"the acceleration changes by {np.sqrt(q * dt):.3g} m/s^2 a step"
        return f"constant acceleration {where}, white jerk, density {number} m^2/s^5: {change}"
    if isinstance(motion, CoordinatedTurn):
        turn = f"{_number(np.degrees(motion.rate_rad_s) * dt)} degrees a step"
        kind = f"white acceleration, density {number} m^2/s^3"
        return f"turn {where} by {turn}, {kind}: the velocity changes by {np.sqrt(q * dt):.3g} m/s a step"
    if motion.discrete:
        kind = f"acceleration constant during a step, variance {number} m^2/s^4"
        change = np.sqrt(q) * dt
    else:
        kind = f"white acceleration, density {number} m^2/s^3"
        change = np.sqrt(q * dt)
    return f"constant velocity {where}, {kind}: the velocity changes by {change:.3g} m/s a step"


def _prior(scenario: Scenario) -> str:
    mean, deviation = scenario.prior.mean, np.sqrt(np.diag(scenario.prior.covariance))
    names, units = ("position", "velocity", "acceleration"), ("m", "m/s", "m/s^2")
    size, dim = scenario.motion.state_size, scenario.dim
    regular = scenario.motion.position_index == tuple(range(dim)) and size in (dim, 2 * dim, 3 * dim)
    if regular and not isinstance(scenario.motion, LinearMotion):
        blocks = [(names[i], units[i], np.arange(i * dim, (i + 1) * dim)) for i in range(size // dim)]
    else:
        index = np.array(scenario.motion.position_index)
        blocks = [("position", "m", index), ("other components", "", np.setdiff1d(np.arange(size), index))]
    parts = [
        f"{name} {_point(mean[at])} {unit}, deviation {_numbers(deviation[at])} {unit}".replace(" ,", ",").rstrip()
        for name, unit, at in blocks
        if len(at)
    ]
    cross = np.any(scenario.prior.covariance != np.diag(np.diag(scenario.prior.covariance)))
    return "; ".join(parts) + ("; correlated" if cross else "")


def _link(link: Link, scenario: Scenario) -> dict[str, str]:
    reports = scenario.steps if link.reports is None else int(np.sum(link.reports))
    return {
        "anchor": link.name,
        "position m": _point(link.measurement.anchor),
        "sight": _sight(link.sight) + ("" if link.chain is None else f"; chain {link.chain}, shared"),
        "LOS error": _noise(link.noises[LOS]),
        "NLOS error": "; ".join(_noise(noise) for noise in link.noises[NLOS:]) or "none",
        "ranges": f"{reports} of {scenario.steps}",
    }


def _sight(sight: Sight) -> str:
    if isinstance(sight, KnownSight):
        return f"known: NLOS at {int(np.sum(sight.modes != LOS))} of {len(sight.modes)} steps"
    if len(sight.start) != 2:
        return f"{len(sight.start)} conditions, starts with {_point(sight.start)}"
    start = f"starts NLOS with {_number(sight.start[NLOS])}"
    if isinstance(sight, DwellSight):
        los, nlos = sight.dwell_s
        return f"LOS lasts {_number(los)} s, NLOS {_number(nlos)} s; {start}"
    if isinstance(sight, MarkovSight):
        stays = np.diag(sight.transition)
        keeps = (
            _number(stays[0]) if stays[0] == stays[1] else f"{_number(stays[0])} in LOS, {_number(stays[1])} in NLOS"
        )
        return f"kept with {keeps} a step; {start}"
    return type(sight).__name__


def _noise(noise: Noise) -> str:
    text = f"mean {_number(noise.mean)} m, deviation {_number(np.sqrt(noise.variance))} m"
    if isinstance(noise, Gaussian):
        return text
    if isinstance(noise, GaussianMixture):
        return f"{text}, {len(noise.weights)} components"
    return f"{noise_name(noise)}: {text}, {noise.regularity().status}"


def noise_name(noise: Noise) -> str:
    """What a person calls a law."""
    if isinstance(noise, Sum):
        return f"{noise_name(noise.first)} + {noise_name(noise.second)}"
    words = "".join(f" {c.lower()}" if c.isupper() else c for c in type(noise).__name__)
    return words.strip().replace("gaussian", "Gaussian").replace("laplace", "Laplace").replace("student t", "Student t")


def _looks_like_degrees(scenario: Scenario) -> list[str]:
    """A sentence if positions look like latitudes and longitudes."""
    points = np.vstack([scenario.anchors, scenario.motion.position(scenario.prior.mean)])
    near = np.all(np.ptp(points, axis=0) < 1.0)
    if near and np.all(np.abs(points) <= DEGREES_LIKE) and np.all(np.abs(points).max(axis=0) > 1.0):
        return ["all positions lie within one metre: are these degrees? Positions are metres in a local plane"]
    return []
