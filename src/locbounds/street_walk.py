"""A walk through a city: which links are blocked at each step, and how much longer their paths are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import LOS, NLOS, Float, ndarray
from locbounds.errors import InputError
from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian
from locbounds.priors import GaussianPrior
from locbounds.propagation import City, Links, street_links
from locbounds.propagation.links import UNREACHED
from locbounds.scenario import Link, Scenario
from locbounds.sight import KnownSight
from locbounds.times import Times

WALK_M_S = 1.4  # a pedestrian


class Walk(NamedTuple):
    """Places of a mobile at steps 0..K, and its links there, from :func:`street_walk`.

    Attributes
    ----------
    step_s
        Seconds between two steps.
    positions
        [steps + 1, 2] in metres.
    links
        Of these places, in their order.

    Examples
    --------
    >>> import shapely, locbounds as lb
    >>> city = lb.City([shapely.box(0, 0, 30, 40)])
    >>> walk = lb.street_walk(city, {"bs": (-5.0, 60.0)}, [[-5.0, 0.0], [40.0, 0.0]], step_s=5.0)
    >>> walk.letters("bs"), walk.links.excess_m[-1].round(2).tolist()
    ('NNNNNN', [7.68])
    """

    step_s: float
    positions: Float[ndarray, "times 2"]
    links: Links

    def letters(self, anchor: str) -> str:
        """Sight at steps 1..K, one letter each, as scenario files write it."""
        return "".join("LN"[int(s != LOS)] for s in self.links.sight[1:, self.links.names.index(anchor)])

    def scenario(
        self,
        *,
        std_m: float,
        nlos_std_m: float | None = None,
        psd_m2_s3: float = 0.1,
        position_std_m: float = 20.0,
        velocity_std_m_s: float = 1.0,
        levels: int = 1,
        title: str = "Random tracks with the sights of a walk through a city",
    ) -> Scenario:
        """The scenario of a mobile whose links are blocked as on this walk, for trackers and their bounds.

        Per anchor the sight is known at every step. In NLOS the range has a mean error, the excess of the path; where
        the excess varies, the variance that is left is added to that of the noise. Prior and motion know no streets:
        bounds and filters average over random tracks with that schedule of sights, unless
        :class:`~locbounds.AlongTrack` of these positions says otherwise.

        Parameters
        ----------
        std_m
            Standard deviation of a range in LOS.
        nlos_std_m
            In NLOS, without the spread of the excess; by default the same.
        psd_m2_s3
            Intensity of the mobile's acceleration.
        position_std_m, velocity_std_m_s
            Prior spread around the start of the walk.
        levels
            Number of NLOS conditions per anchor. 1: one mean excess per anchor, as scenario files can hold. More: the
            excess is known at every step up to the width of a level; in Python only.
        title
            Of the scenario.

        Raises
        ------
        InputError
            If an anchor has no path to some step.
        """
        if levels < 1:
            raise InputError(f"{levels} levels of the excess", "Give at least 1")
        links = self.links
        lost = np.argwhere(links.sight == UNREACHED)
        if len(lost):
            step, m = lost[0]
            raise InputError(
                f"anchor {links.names[m]} is out of reach at step {step} of the walk",
                "Leave that anchor out: it is in a closed courtyard, or the mobile is",
            )
        times = Times.uniform(step_s=self.step_s, steps=len(self.positions) - 1)
        velocity = (self.positions[1] - self.positions[0]) / self.step_s
        spread = np.array([position_std_m] * 2 + [velocity_std_m_s] * 2)
        prior = GaussianPrior(np.append(self.positions[0], velocity), np.diag(spread**2))
        made = [
            self._link(m, std_m, std_m if nlos_std_m is None else nlos_std_m, levels) for m in range(len(links.names))
        ]
        return Scenario(title, times, ConstantVelocity(psd_m2_s3), prior, made)

    def _link(self, m: int, std_m: float, nlos_std_m: float, levels: int) -> Link:
        blocked, excess = self.links.sight[1:, m] == NLOS, self.links.excess_m[1:, m]
        modes, noises = np.zeros(len(blocked), int), [Gaussian(0.0, std_m)]
        edges = (
            np.quantile(excess[blocked], np.linspace(0, 1, levels + 1)[1:-1]) if blocked.any() else np.zeros(levels - 1)
        )
        level = np.searchsorted(edges, excess, side="right")
        for k in range(levels):
            mine = blocked & (level == k)
            modes[mine] = k + 1
            mean, spread = (excess[mine].mean(), excess[mine].std()) if mine.any() else (0.0, 0.0)
            noises.append(Gaussian(float(mean), float(np.hypot(nlos_std_m, spread))))
        place = Range(self.links.anchors[m])
        return Link(self.links.names[m], place, KnownSight(modes, levels + 1), tuple(noises))

    def table(self) -> list[tuple[Any, ...]]:
        """One row per step and anchor: step, time_s, x_m, y_m, anchor_id, sight, excess_m, length_m."""
        rows = []
        for k, (x, y) in enumerate(self.positions):
            for m, name in enumerate(self.links.names):
                sight = {LOS: "los", NLOS: "nlos"}.get(int(self.links.sight[k, m]), "none")
                numbers = (self.links.excess_m[k, m], self.links.length_m[k, m])
                rows.append((k, k * self.step_s, x, y, name, sight, *(float(v) for v in numbers)))
        return rows


TABLE_COLUMNS = ("step", "time_s", "x_m", "y_m", "anchor_id", "sight", "excess_m", "length_m")


def street_walk(
    city: City,
    anchors: Any,
    waypoints: Any,
    *,
    speed_m_s: float = WALK_M_S,
    step_s: float = 1.0,
    roof: Sequence[str] | bool = (),
) -> Walk:
    """Walk through the streets at constant speed, from one waypoint to the next by the shortest way.

    Parameters
    ----------
    city
        The buildings.
    anchors
        Name -> position in metres, or positions [anchors, 2].
    waypoints
        [waypoints, 2] in metres, at least two, on streets.
    speed_m_s
        Speed of the mobile.
    step_s
        Seconds between two steps; the walk ends at the last full step.
    roof
        Names of anchors on roofs, or True for all that are inside a building.

    Raises
    ------
    InputError
        If a waypoint is inside a building or cannot be reached, or the walk is shorter than a step.

    Examples
    --------
    >>> import shapely
    >>> city = City([shapely.box(0, 0, 30, 40)])
    >>> street_walk(city, {"bs": (-5.0, 60.0)}, [[-5.0, 0.0], [40.0, 0.0]], step_s=8.0).positions.round(1).tolist()
    [[-5.0, 0.0], [6.2, 0.0], [17.4, 0.0], [28.6, 0.0], [39.8, 0.0]]
    """
    stops = np.asarray(waypoints, dtype=float)
    if stops.ndim != 2 or stops.shape[1] != 2 or len(stops) < 2 or not np.isfinite(stops).all():
        raise InputError(f"the waypoints have the shape {stops.shape}", "Give at least two [x, y] in metres")
    if not (speed_m_s > 0 and step_s > 0 and np.isfinite(speed_m_s * step_s)):
        raise InputError(f"a walk of {speed_m_s} m/s in steps of {step_s} s", "Give positive numbers")
    for k, bad in enumerate(city.inside(stops)):
        if bad:
            building = city.building_at(stops[k])
            raise InputError(
                f"waypoint {k + 1} at ({stops[k][0]:g}, {stops[k][1]:g}) m is inside "
                + (f"building {building.id}" if building else "a gap between buildings that counts as wall"),
                "Move it onto a street",
            )
    way = [stops[:1]]
    for k in range(len(stops) - 1):
        part = street_links(city, stops[k : k + 1], stops[k + 1 : k + 2]).path(0, 0)
        if not len(part):
            raise InputError(
                f"there is no way from waypoint {k + 1} to waypoint {k + 2}", "One of them is in a closed courtyard"
            )
        way.append(part[1:])
    corners = np.concatenate(way)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    at = np.arange(int(np.floor(along[-1] / (speed_m_s * step_s) + 1e-9)) + 1) * speed_m_s * step_s
    if len(at) < 2:
        raise InputError(
            f"the walk of {along[-1]:.1f} m is shorter than one step", "Give more waypoints or shorter steps"
        )
    positions = np.stack([np.interp(at, along, corners[:, axis]) for axis in (0, 1)], axis=1)
    inside = city.inside(positions)
    positions[inside] = corners[np.searchsorted(along, at[inside])]  # rounding beside a wall
    return Walk(step_s, positions, street_links(city, anchors, positions, roof=roof))
