"""Plan files: TOML, from what is measured and where to a :class:`~locbounds.Plan` and the area of its maps."""

import math
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from locbounds.errors import InputError
from locbounds.io.anchors_csv import anchor_positions, hoisted
from locbounds.io.build import at, build_noises, covariance_of, merged
from locbounds.io.complain import close_key, complain, quoted
from locbounds.io.kinds import expect
from locbounds.io.plan_schema import AreaSection, PlanAnchor, PlanFile, PlanLinks, PriorTable, Shape
from locbounds.io.plan_units import NOISES, UNITS, Written
from locbounds.io.schema import NlosTable
from locbounds.io.toml import parse_toml, read_toml
from locbounds.noise import Gaussian, Noise
from locbounds.plan import FLAT, Plan, aoa, rss, soft, tdoa, toa
from locbounds.priors import (
    GaussianPrior,
    PositionPrior,
    PriorMixture,
    Prism,
    UniformBox,
    UniformDisc,
    UniformPolygon,
    UniformPrior,
)


class PlanMap(NamedTuple):
    """What a plan file says.

    Attributes
    ----------
    plan : Plan
    area : UniformPrior
        Uniform law of the plane over the area of the map.
    height_m : float or None
        In 3-D: height of the map.
    heights_m : tuple of float or None
        In 3-D: lowest and highest position of the device, if the file gives them.
    names, positions
        Of the anchors; positions [anchors, space] in metres.
    left_out : tuple of str
        Anchors that are known to be NLOS and tell nothing.
    notes : tuple of str
        What a reader of the results should know.
    """

    plan: Plan
    area: UniformPrior
    height_m: float | None
    heights_m: tuple[float, float] | None
    names: tuple[str, ...]
    positions: np.ndarray
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def read_plan(path: str | os.PathLike) -> PlanMap:
    r"""A plan from a plan file.

    Parameters
    ----------
    path
        TOML; a relative ``anchors_csv`` in it is relative to the file.

    Raises
    ------
    InputError
        If the file cannot be read or a value not be used; the error names key, value, remedy and nearest known key.

    Examples
    --------
    >>> import tempfile
    >>> from locbounds.io.plan_example import PLAN
    >>> path = Path(tempfile.mkdtemp()) / "plan.toml"
    >>> _ = path.write_text(PLAN.format(name="plan.toml"))
    >>> read_plan(path).plan.channel_names
    ('a2-a1', 'a3-a1', 'a4-a1')
    """
    path = Path(path)
    return _plan(read_toml(path, f"Make one with: locbounds new {path} --like plan"), path.parent, path.name)


def read_text(text: str, *, folder: str | os.PathLike = ".", source: str = "plan") -> PlanMap:
    r"""A plan from the text of a plan file; as :func:`read_plan`.

    >>> try:
    ...     read_text('format = 1\n[area]\ncenter_m = [0, 0]\nradius_m = 9\n[links]\nmeasure = "rss"\nlos.std_m = 4')
    ... except InputError as error:
    ...     print(error.cause, error.remedy, sep="\n")
    plan: unknown key links.los.std_m = 4
    Did you mean std_db? The errors of "rss" are in dB
    """
    return _plan(parse_toml(text, source), Path(folder), source)


def _plan(keys: dict[str, Any], folder: Path, source: str) -> PlanMap:
    expect(keys, "plan", source)
    with at(source):
        written = Written(hoisted(keys))
    try:
        file = PlanFile.model_validate(written.keys)
    except ValidationError as error:
        raise complain(error, source, PlanFile, written) from None
    with at(source):
        return _build(written.in_si(file), folder)


def _build(file: PlanFile, folder: Path) -> PlanMap:
    positions = anchor_positions(file.anchors, file.anchors_csv, folder)
    dims = {len(p) for p in positions.values()}
    if len(dims) > 1:
        raise InputError("anchors have 2 and 3 coordinates", "Use the same number of coordinates everywhere")
    dim = dims.pop()
    area, height, prior = _area(file.area, dim)
    heights = (float(prior.low), float(prior.high)) if isinstance(prior, Prism) else None
    if file.prior is not None:
        with at("prior"):
            prior = _prior(file.prior, dim)
    plan, left_out, notes = _measured(file, positions)
    plan = plan.replace(title=file.title, prior=prior)
    few = plan.too_few()
    if few and prior is not None:
        notes = (*notes, f"no Cramér-Rao bound: {few}; the numbers over the prior rest on it")
    elif few:
        raise InputError(
            f"{few}: there are {plan.size} measured numbers of {len(positions) - len(left_out)} anchors",
            "Add anchors or measurements" + (", or give NLOS links a noise (nlos)" if left_out else ""),
        )
    places = np.array(list(positions.values()))
    return PlanMap(plan, area, height, heights, tuple(positions), places, left_out, notes)


def _region(shape: Shape, path: str) -> UniformPrior:
    """A region of the plane, or a box."""
    with at(path):
        if shape.outline_m is not None:
            for name, rings in (("outline_m", [shape.outline_m]), ("holes_m", shape.holes_m or [])):
                if any(len(corner) != 2 for ring in rings for corner in ring):
                    raise InputError(f"{name} has corners of three coordinates", "Give [x, y]; heights are height_m")
            corners = np.asarray(shape.outline_m)
            if len(corners) > 2 and np.linalg.matrix_rank(corners - corners[0]) < 2:
                raise InputError("the corners of outline_m lie on one line", "Give corners that enclose an area")
            return UniformPolygon(shape.outline_m, shape.holes_m or ())
        if shape.center_m is not None:
            return UniformDisc(shape.center_m, shape.radius_m)
        return UniformBox(shape.low_m, shape.high_m)


def _area(area: AreaSection, dim: int) -> tuple[UniformPrior, float | None, PositionPrior | None]:
    """Region of the plane, height of the map, and the prior that is uniform over it."""
    region, height = _region(area, "area"), area.height_m
    number: Any = height
    span = height if isinstance(height, list) else None
    if height is not None:
        numbers = span or [height]
        if any(isinstance(h, bool) or not isinstance(h, int | float) or not math.isfinite(h) for h in numbers) or (
            span is not None and (len(span) != 2 or not span[0] < span[1])
        ):
            raise InputError(
                f"area.height_m is {quoted(height)}", "Give a height in metres, or [lowest, highest] of the device"
            )
    if dim == 2:
        if height is not None or region.dim == 3:
            raise InputError(
                "the area has heights, the anchors do not", "Give anchors three coordinates, or no heights"
            )
        return region, None, region
    if region.dim == 3:
        if height is not None:
            raise InputError("area has height_m and corners of three coordinates", "Keep one of them")
        assert isinstance(region, UniformBox)  # no other region has heights
        span = [float(region.low[2]), float(region.high[2])]
        region = UniformBox(region.low[:2], region.high[:2])
    if span is not None:
        return region, 0.5 * (span[0] + span[1]), Prism(region, *span)
    if height is None:
        raise InputError(
            "the anchors have heights, the area has none", "area.height_m: the height of the map, or [lowest, highest]"
        )
    return region, float(number), None


def _prior(table: PriorTable, dim: int) -> PositionPrior:
    if table.mixture is not None:
        return PriorMixture(
            [part.share or 0.0 for part in table.mixture], [_prior(part, dim) for part in table.mixture]
        )
    if table.position_m is not None:
        spread, n = np.asarray(table.position_std_m, dtype=float), len(table.position_m)
        if spread.ndim == 1 and len(spread) != n:
            raise InputError(f"position_m has {n} coordinates, position_std_m {len(spread)}", "Give as many of each")
        prior: PositionPrior = GaussianPrior(table.position_m, covariance_of(spread, n))
    else:
        prior = _region(table, "region")
    if prior.dim != dim:
        raise InputError(f"it has {prior.dim} coordinates, the anchors have {dim}", "Use the same number everywhere")
    return prior


class _Link(NamedTuple):
    name: str
    position: tuple[float, ...]
    table: PlanLinks
    noise: Noise | None


def _links(file: PlanFile, positions: dict[str, tuple[float, ...]]) -> list[_Link]:
    out = []
    for name, position in positions.items():
        own = file.anchors.get(name)
        mine = set() if own is None else own.model_fields_set
        table = merged(file.links, own, PlanAnchor)
        if table.measure is None:
            raise InputError(
                f"anchors.{name} has no measure, and neither has [links]",
                f"Add measure to [links]: {PlanLinks.model_fields['measure'].description}",
            )
        borrowed = [k for k in NOISES if getattr(table, k) is not None and k not in mine]
        if borrowed and UNITS[table.measure] != UNITS.get(file.links.measure or "", UNITS[table.measure]):
            unit = UNITS[table.measure][0]
            raise InputError(
                f'anchors.{name} measures "{table.measure}", but its {", ".join(borrowed)} of [links] is that of '
                f'"{file.links.measure}"',
                f"Give the anchor noise of its own, for example los = {{ std_{unit} = .. }}",
            )
        if table.los is None:
            raise InputError(
                f"anchors.{name} has no los, and neither has [links]",
                f"Add los to [links]: {PlanLinks.model_fields['los'].description}",
            )
        for k, measure in (("exponent", "rss"), ("near_field_m", "rss"), ("reference", "tdoa")):
            if k in mine and table.measure != measure:
                raise InputError(f'anchors.{name} has {k}, but measures "{table.measure}"', f"Remove {k}")
        with at(f"anchors.{name}"):
            los, nlos = build_noises(table.los, table.nlos or NlosTable.model_validate({"std_m": 1.0}), table.outlier)
            noise = soft(los, nlos if table.nlos is not None else None, table.nlos_probability())
        out.append(_Link(name, position, table, noise))
    return out


def _measured(file: PlanFile, positions: dict[str, tuple[float, ...]]) -> tuple[Plan, tuple[str, ...], tuple[str, ...]]:
    links = _links(file, positions)
    left_out = tuple(link.name for link in links if link.noise is None)
    by = {m: [k for k in links if k.noise is not None and k.table.measure == m] for m in UNITS}
    if not any(by.values()):
        raise InputError("every link is NLOS and carries nothing", "Give NLOS links a noise (nlos), or a known LOS")
    clock = FLAT if file.clock == "unknown" else file.clock_std_m
    notes: list[str] = []
    if left_out:
        notes.append(f"NLOS and without information, left out: {', '.join(left_out)}")
    if by["tdoa"] and not all(type(k.noise) is Gaussian for k in by["tdoa"]):
        if by["toa"] and clock is None:
            raise InputError(
                "times of arrival with a known clock beside differences whose noise is not Gaussian",
                'Use measure = "toa" with clock = "unknown" for the differences in a plan of their own',
            )
        notes.append("differences of arrival times with noise that is not Gaussian: arrival times of an unknown clock")
        by["toa"], by["tdoa"], clock = by["toa"] + by["tdoa"], [], FLAT
    if clock is not None and not by["toa"]:
        raise InputError('the plan has an unknown clock, and no "toa"', "Remove clock: differences need none")
    plan: Plan | None = None
    for measure, group in by.items():
        if group:
            made = _group(measure, group, clock, file.links.reference)
            plan = made if plan is None else plan + made
    assert plan is not None
    return plan, left_out, tuple(notes)


def _group(measure: str, group: list[_Link], clock: float | None, reference: str | None) -> Plan:
    places, names = [k.position for k in group], [k.name for k in group]
    noises: Any = [k.noise for k in group]
    if all(type(noise) is Gaussian for noise in noises):
        noises = [float(noise.std) for noise in noises]
    if measure == "toa":
        return toa(places, noises, clock_std_m=clock, names=names)
    if measure == "tdoa":
        chosen = names[0] if reference is None else reference
        if chosen not in names:
            near = close_key(chosen, names)
            raise InputError(
                f'links.reference is "{chosen}", which measures no differences',
                f"{f'Did you mean {near}? ' if near else ''}Known: {', '.join(names)}",
            )
        if len(group) < 2:
            raise InputError(
                f'only anchor {names[0]} measures "tdoa"', "A difference needs two anchors: add one, or measure toa"
            )
        return tdoa(places, noises, reference=names.index(chosen), names=names)
    if measure == "rss":
        parts = [
            rss([k.position], [n], exponent=k.table.exponent or 3.0, near_field_m=k.table.near_field_m, names=[k.name])
            for k, n in zip(group, noises, strict=True)
        ]
        total = parts[0]
        for part in parts[1:]:
            total = total + part
        return total
    return aoa(places, noises, names=names)
