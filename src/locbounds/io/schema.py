"""The keys of a scenario file, version 1.

Every key carries its unit and one line that teaches it; the same line is the remedy in error messages and the
comment in written files. A wrong unit is an unknown key with a suggestion.
"""

from difflib import get_close_matches
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from locbounds.io.noise_families import EVERY_KEY, FAMILIES, MADE_OF, PLAIN
from locbounds.io.values import (
    ROUNDING,
    Chain,
    Dwell,
    Law,
    Matrix,
    Number,
    Numbers,
    PerAxis,
    Point,
    Positive,
    Positives,
    Probability,
    Spread,
    Stay,
    Text,
    Whole,
    fail,
)

FORMAT = 1


def key(description: str, default: Any = None) -> Any:
    """An optional key."""
    return Field(default, description=description)


def needed(description: str) -> Any:
    """A key that must be there."""
    return Field(description=description)


class Section(BaseModel):
    """A table of the file; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def given(self, *names: str) -> list[str]:
        """Which of these keys the file has."""
        return [name for name in names if getattr(self, name) is not None]


class TimeSection(Section):
    """When the steps happen."""

    step_s: Positive | None = key("seconds between two steps, for example step_s = 0.2")
    steps: Whole | None = key("results at steps 0..steps; step 0 is the prior")
    times_s: Numbers | None = key("instead of step_s and steps: times of steps 0, 1, ..., strictly increasing")

    @model_validator(mode="after")
    def _one_way(self):
        if self.given("step_s", "steps", "times_s") not in (["step_s", "steps"], ["times_s"]):
            raise fail(
                f"has {', '.join(self.given('step_s', 'steps', 'times_s')) or 'no times'}",
                "Give step_s and steps, or the list times_s",
            )
        return self


MOTION_KEYS = {
    "constant-velocity": ("psd_m2_s3",),
    "constant-velocity-discrete": ("acceleration_var_m2_s4",),
    "random-walk": ("diffusion_m2_s",),
    "constant-acceleration": ("jerk_psd_m2_s5",),
    "coordinated-turn": ("psd_m2_s3", "turn_rate_rad_s"),
}
DERIVATIVES = ("position_m", "velocity_m_s", "acceleration_m_s2")  # of the prior, as many as the motion's state has
SPREADS = ("position_std_m", "velocity_std_m_s", "acceleration_std_m_s2")
ORDER = {"random-walk": 1, "constant-acceleration": 3}  # how many of them; 2 for all others


class MotionSection(Section):
    """How the mobile moves."""

    model: Literal[
        "constant-velocity",
        "constant-velocity-discrete",
        "random-walk",
        "constant-acceleration",
        "coordinated-turn",
    ] = needed(
        '"constant-velocity" (white acceleration), "constant-velocity-discrete" (constant during a step), '
        '"random-walk", "constant-acceleration" (white jerk) or "coordinated-turn" (known turn rate)'
    )
    psd_m2_s3: PerAxis | None = key("power spectral density of the acceleration, a number or one per axis")
    acceleration_var_m2_s4: PerAxis | None = key("variance of the acceleration of each step, a number or one per axis")
    diffusion_m2_s: PerAxis | None = key("variance of the displacement per second, a number or one per axis")
    jerk_psd_m2_s5: PerAxis | None = key("power spectral density of the jerk, a number or one per axis")
    turn_rate_rad_s: Number | None = key("turn rate, positive to the left")

    @model_validator(mode="after")
    def _matching_intensity(self):
        wanted = list(MOTION_KEYS[self.model])
        given = self.given(*dict.fromkeys(name for names in MOTION_KEYS.values() for name in names))
        if given != wanted:
            raise fail(
                f'has model = "{self.model}" with {", ".join(given) or "no intensity"}',
                f"This model takes {' and '.join(wanted)} and nothing else",
            )
        return self


class PriorSection(Section):
    """Where the mobile starts."""

    position_m: Point = needed("mean position at step 0, for example position_m = [500, 500]; three numbers for 3-D")
    position_std_m: Spread | None = key("a number, one per axis, or a covariance matrix in m^2")
    velocity_m_s: Point | None = key("mean velocity at step 0, for example velocity_m_s = [5, 5]")
    velocity_std_m_s: Spread | None = key("a number, one per axis, or a covariance matrix in (m/s)^2")
    acceleration_m_s2: Point | None = key("mean acceleration at step 0, for model = constant-acceleration")
    acceleration_std_m_s2: Spread | None = key("a number, one per axis, or a covariance matrix in (m/s^2)^2")
    covariance: Matrix | None = key("instead of the deviations: covariance of position and velocity, in m and m/s")

    @property
    def means(self) -> list[str]:
        """Which of position, velocity and acceleration the file has."""
        return self.given(*DERIVATIVES)

    @model_validator(mode="after")
    def _fits(self):
        n, means = len(self.position_m), self.means
        if means != list(DERIVATIVES[: len(means)]):
            raise fail("has acceleration_m_s2 without velocity_m_s", "Give position, velocity and acceleration")
        for name in means:
            if len(getattr(self, name)) != n:
                word = name.split("_")[0]
                raise fail(
                    f"has {n} position and {len(getattr(self, name))} {word} coordinates", "Give as many of each"
                )
        spreads = SPREADS[: len(means)]
        for name in self.given(*SPREADS[len(means) :]):
            raise fail(f"has {name} without {DERIVATIVES[SPREADS.index(name)]}", "Give both or neither")
        if self.covariance is None:
            for name in spreads:
                value = getattr(self, name)
                if value is None:
                    raise fail(f"has no {name}", f"Add {name}: {type(self).model_fields[name].description}")
                if isinstance(value, tuple) and len(value) != n:
                    raise fail(f"has {n} coordinates, but {name} has {len(value)}", "Give one per coordinate")
        elif self.given(*spreads):
            raise fail("has both a covariance and deviations", "Keep one of them")
        elif len(self.covariance) != len(means) * n:
            raise fail(
                f"has a covariance of {len(self.covariance)} rows",
                f"Give {len(means) * n}: {', then '.join(name.split('_')[0] for name in means)}",
            )
        return self


class SightTable(Section):
    """How a link switches between LOS and NLOS."""

    stay: Stay | None = key("probability of keeping the sight over one step: a number, or { los = .., nlos = .. }")
    dwell_s: Dwell | None = key("mean time in LOS and in NLOS, { los = 2, nlos = 2 }")
    transition: Chain | None = key("rows: sight now, columns: sight at the next step, [[0.9, 0.1], [0.3, 0.7]]")
    known: Any = key(
        'known sight: "LLNN", one letter per step, or [{ until_s = 2, sight = "los" }, { sight = "nlos" }]'
    )
    start: Law | None = key("probabilities at step 0, { los = 0.5, nlos = 0.5 }; left out: the chain's long-run shares")

    @model_validator(mode="after")
    def _one_way(self):
        ways = self.given("stay", "dwell_s", "transition", "known")
        if len(ways) != 1:
            raise fail(f"has {', '.join(ways) or 'no chain'}", "Give one of stay, dwell_s, transition, known")
        if ways == ["known"] and self.start is not None:
            raise fail("has known and start", "A known sight needs no start: remove it")
        return self


class NoiseTable(Section):
    """Noise of a range in one sight condition."""

    mean_m: Number | None = key("mean error in metres; 0 if left out")
    std_m: Positive | None = key("standard deviation in metres, positive")
    weights: Positives | None = key("shares of a Gaussian mixture, summing to one, with means_m and stds_m")
    means_m: Numbers | None = key("means of the mixture's components")
    stds_m: Positives | None = key("standard deviations of the mixture's components")
    family: Text | None = key(f"law of the error, gaussian if left out: {', '.join(FAMILIES)}")
    center_m: Number | None = key("centre of the law, or of its Gaussian part, in metres; 0 if left out")
    scale_m: Positive | None = key("scale of an exponential, Laplace, gamma or Student t law in metres, positive")
    start_m: Number | None = key("smallest value of a one-sided law in metres; 0 if left out")
    low_m: Number | None = key("lower limit in metres")
    high_m: Number | None = key("upper limit in metres")
    shape: Positive | None = key("shape of a gamma law, positive; 1 is exponential")
    degrees: Positive | None = key("degrees of freedom of a Student t law, positive")
    median_m: Positive | None = key("median of a log-normal law above start_m, in metres, positive")
    log_std: Positive | None = key("standard deviation of the logarithm of a log-normal law, positive")
    sum: tuple["NoiseTable", ...] | None = key("independent errors that add, [{ std_m = 1 }, { family = .. }]")
    mixture: tuple["NoiseTable", ...] | None = key("one of several errors, [{ share = 0.9, std_m = 1 }, { .. }]")
    share: Probability | None = key("share of this law in a mixture")
    samples: Whole | None = key(
        "this Gaussian error is averaged over so many samples per step; a bias that they share stands outside"
    )

    @model_validator(mode="after")
    def _one_way(self):
        check_noise_keys(self)
        check_samples(self)
        return self

    def laws(self) -> dict[str, Any]:
        """The keys that belong to families, with their values."""
        return {name: getattr(self, name) for name in EVERY_KEY}


def check_noise_keys(table: NoiseTable) -> None:
    """Raise unless the keys of a noise table describe one law."""
    made_of, mixture = table.given(*MADE_OF), table.given(*PLAIN)
    single = table.given(*EVERY_KEY)
    if made_of:
        extra = made_of[1:] + table.given("family") + mixture + single
        if extra:
            raise fail(f"has {made_of[0]} and {', '.join(extra)}", f"Keep {made_of[0]}, or the others")
        return check_parts(table)
    if table.family is not None:
        return check_family(table, table.family, mixture + single)
    strange = [name for name in single if name not in FAMILIES["gaussian"].keys]
    if strange:
        fits = [f for f, family in FAMILIES.items() if set(single) <= set(family.keys)] or list(FAMILIES)
        raise fail(f"has {', '.join(strange)} but no family", f"Add family, one of: {', '.join(fits)}")
    if mixture and (len(mixture) < 3 or single):
        raise fail(
            f"has {', '.join(table.given('mean_m', 'std_m') + mixture)}",
            "Give std_m (and mean_m), or weights, means_m and stds_m",
        )
    if not mixture and table.std_m is None:
        raise fail("has no std_m", f"Add std_m: {NoiseTable.model_fields['std_m'].description}")
    if mixture and not len(table.weights or ()) == len(table.means_m or ()) == len(table.stds_m or ()):
        raise fail("has weights, means_m and stds_m of different lengths", "Give one of each per component")
    if mixture and abs(sum(table.weights or ()) - 1) > ROUNDING:
        raise fail(f"has weights that sum to {sum(table.weights or ()):.6g}", "Weights must sum to one")
    return None


def check_family(table: NoiseTable, family: str, given: list[str]) -> None:
    """Raise unless the keys are those of the family."""
    if family not in FAMILIES:
        near = get_close_matches(family.lower().replace("_", "-"), FAMILIES, n=1, cutoff=0.4)
        hint = f"Did you mean {near[0]}? " if near else ""
        raise fail(f"has the unknown family {family!r}", f"{hint}Known: {', '.join(FAMILIES)}")
    keys = FAMILIES[family].keys
    strange = [name for name in given if name not in keys]
    missing = [name for name in FAMILIES[family].needed if name not in given]
    if strange:
        near = get_close_matches(strange[0], missing or list(keys), n=1, cutoff=0.3)
        hint = f"Did you mean {near[0]}? " if near else ""
        raise fail(f'has {strange[0]}, which family = "{family}" does not take', f"{hint}It takes: {', '.join(keys)}")
    if missing:
        teaching = NoiseTable.model_fields[missing[0]].description
        raise fail(f'has family = "{family}" but no {missing[0]}', f"Add {missing[0]}: {teaching}")


def check_parts(table: NoiseTable) -> None:
    """Raise unless a sum has parts, and a mixture shares that sum to one."""
    if table.sum is not None:
        if len(table.sum) < 2:
            raise fail(f"has a sum of {len(table.sum)} errors", "Give at least two, [{ std_m = 1 }, { .. }]")
        if any(part.share is not None for part in table.sum):
            raise fail("has share in a sum", "Shares belong to a mixture; the errors of a sum all add")
        return
    shares = [part.share for part in table.mixture or ()]
    if not shares or None in shares:
        raise fail("has a mixture with a law without share", "Give every law of the mixture its share")
    total = sum(share or 0.0 for share in shares)
    if min(share or 0.0 for share in shares) == 0 or abs(total - 1) > ROUNDING:
        raise fail(f"has a mixture whose shares are {shares}", "Give positive shares that sum to one")


def check_samples(table: NoiseTable) -> None:
    """Raise unless errors that are averaged are Gaussian: only then nothing is lost with the single samples."""
    if table.samples is not None and not gaussian(table):
        raise fail(
            "has samples of an error that is not Gaussian, for which the mean does not stand for all samples",
            "Put samples beside std_m, and a bias that the samples share outside: "
            'sum = [{ std_m = 1.6, samples = 10 }, { family = "uniform", .. }]; locbounds.Epoch takes any law',
        )


def gaussian(table: NoiseTable) -> bool:
    """Whether a noise table describes one Gaussian error."""
    if table.sum is not None:
        return all(map(gaussian, table.sum))
    return table.mixture is None and table.weights is None and table.family in (None, "gaussian")


class NlosTable(NoiseTable):
    """Noise of a range in NLOS."""

    plus_los: bool = Field(False, strict=True, description="true: this is the excess on top of LOS noise")


class OutlierTable(Section):
    """Rare wide errors that both sight conditions share."""

    share: Probability = needed("share of measurements, for example 0.01; 0 for none")
    mean_m: Number = Field(0.0, description="mean error of outliers in metres")
    std_m: Positive = needed("standard deviation of outliers in metres, positive")

    @model_validator(mode="after")
    def _some_regular(self):
        if self.share == 1:
            raise fail("has share = 1", "Not every measurement can be an outlier: give a share below 1")
        return self


class LinksSection(Section):
    """What all links share."""

    measure: Literal["range"] | None = key('what a link measures: "range", the distance to the anchor in metres')
    sight: SightTable | None = key("switching of LOS and NLOS, for example { stay = 0.9 } or { dwell_s = { .. } }")
    los: NoiseTable | None = key("range error in LOS, for example { std_m = 150 }")
    nlos: NlosTable | None = key("range error in NLOS, for example { plus_los = true, mean_m = 513, std_m = 409 }")
    outlier: OutlierTable | None = key("rare wide errors in both, for example { share = 0.01, std_m = 2000 }")
    missing_steps: tuple[Whole, ...] | None = key("steps without a measurement, for example [4, 5]")


class AnchorTable(LinksSection):
    """One anchor: its position, and what differs from [links]."""

    position_m: Point | None = key("position in metres, for example position_m = [-3000, -2000]")


class ScenarioFile(Section):
    """A whole scenario file."""

    format: Literal[1] = needed(f"version of the file format, format = {FORMAT}")
    title: Text = Field("", description="one line that names the scenario")
    anchors_csv: Text | None = key("table of anchors with the columns anchor_id, x_m, y_m and, in 3-D, z_m")
    time: TimeSection = needed("a section [time] with step_s and steps")
    motion: MotionSection = needed('a section [motion] with model = "constant-velocity" and psd_m2_s3')
    prior: PriorSection = needed("a section [prior] with position_m, position_std_m, velocity_m_s, velocity_std_m_s")
    links: LinksSection = Field(LinksSection(), description="a section [links] with what all links share")
    anchors: dict[str, AnchorTable] = Field(
        {}, description="a section [anchors], a line NAME = { position_m = [..] } each"
    )

    @model_validator(mode="after")
    def _prior_of_the_motion(self):
        wanted = DERIVATIVES[: ORDER.get(self.motion.model, 2)]
        missing, extra = set(wanted) - set(self.prior.means), set(self.prior.means) - set(wanted)
        for name in (d for d in DERIVATIVES if d in missing):
            raise fail(
                f'prior has no {name}, which motion.model = "{self.motion.model}" needs',
                f"Add {name}: {PriorSection.model_fields[name].description}",
            )
        if extra:
            raise fail(
                f"prior has {', '.join(d for d in DERIVATIVES if d in extra)}, which "
                f'motion.model = "{self.motion.model}" does not know',
                "Remove it and its deviation, or choose another model",
            )
        return self
