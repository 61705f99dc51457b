"""The one result type of bounds and filters: labelled, with standard errors and provenance."""

import datetime
import functools
import math
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError, RefusedError
from locbounds.precision import traced
from locbounds.quadrature import standard_error
from locbounds.verdict import Status, Verdict

if TYPE_CHECKING:
    import xarray

NORMAL_95 = 1.959963984540054  # 97.5 % quantile of the standard normal law


class Provenance(eqx.Module):
    """Where a number comes from.

    Attributes
    ----------
    seed, samples
        Seed and number of Monte Carlo draws (0 where nothing is drawn).
    how
        The engine or estimator, in words.
    references
        Citation keys.
    versions
        Versions of the libraries that matter.
    """

    seed: int = eqx.field(static=True)
    samples: int = eqx.field(static=True)
    how: str = eqx.field(static=True)
    references: tuple[str, ...] = eqx.field(static=True)
    versions: tuple[tuple[str, str], ...] = eqx.field(static=True, default=())
    date: str = eqx.field(static=True, default="")

    @classmethod
    def now(cls, seed: int, samples: int, how: str, references: tuple[str, ...]) -> "Provenance":
        """Provenance with today's versions and date."""
        return cls(seed, samples, how, references, _versions(), datetime.date.today().isoformat())


@functools.cache
def _versions() -> tuple[tuple[str, str], ...]:
    return tuple((name, version(name)) for name in ("locbounds", "jax", "numpy"))


class Result(eqx.Module):
    """Accuracy over time, of a bound or of a filter; one "time" for the position of a plan.

    Everything estimated carries its spread over ``groups`` independent groups of draws, from which the standard error
    of any average follows; a deterministic number has one group and the error zero.

    Attributes
    ----------
    id, name, kind
        Method id (``bcrb``, ``imm-ekf``), display name, ``"bound"``, ``"filter"`` or ``"estimator"``.
    sees
        What an estimator that this number speaks of may see (``ranges``: past and present ranges; ``sight``).
    time_s
        [steps+1] seconds, step 0 first.
    position_mse
        [steps+1] m^2: sum of the position coordinates' mean square errors (or its bound).
    replicates
        [groups, steps+1] deviation of each group's ``position_mse`` from the mean.
    covariance
        [steps+1, state, state] bound on (or estimate of) the mean square error matrix, in the state's units.
    verdict, provenance
        Whether the number may be quoted; where it comes from.
    track
        Label of the one track that the number is conditional on, or an empty string.
    scenario
        Fingerprint of the scenario that the number belongs to (of a filter: that its tracks were drawn from), or an
        empty string where that is not known: results of plans, of general models, or made by hand.
    diagnostics
        Further arrays by name, each explained in the docs of its producer.

    Examples
    --------
    >>> import locbounds as lb
    >>> bound = lb.bcrb(lb.papers.fritsche2013.scenario(steps=3), seed=0)
    >>> bound.position_rmse.sizes["step"], bound.kind, bound.verdict.status.value
    (4, 'bound', 'valid')
    """

    id: str = eqx.field(static=True)
    name: str = eqx.field(static=True)
    kind: str = eqx.field(static=True)
    sees: frozenset[str] = eqx.field(static=True)
    time_s: Float[Array, " times"]
    position_mse: Float[Array, " times"]
    replicates: Float[Array, "groups times"]
    covariance: Float[Array, "times state state"]
    verdict: Verdict = eqx.field(static=True)
    provenance: Provenance = eqx.field(static=True)
    track: str = eqx.field(static=True, default="")
    scenario: str = eqx.field(static=True, default="")
    diagnostics: dict[str, Any] = eqx.field(default_factory=dict)

    def _label(self, values: Array, name: str, units: str = "m") -> "xarray.DataArray":
        import xarray

        coords = {"step": np.arange(len(self.time_s)), "time_s": ("step", np.asarray(self.time_s))}
        return xarray.DataArray(
            np.asarray(values), coords, ("step",), name, {"units": units, "method": self.id, "kind": self.kind}
        )

    @property
    def position_rmse(self) -> "xarray.DataArray":
        """Root mean square position error per step, in metres."""
        return self._label(np.sqrt(self.position_mse), "position_rmse")

    @property
    def position_rmse_stderr(self) -> "xarray.DataArray":
        """Standard error of :attr:`position_rmse`, in metres."""
        return self._label(standard_error(self._rmse_replicates()), "position_rmse_stderr")

    def _rmse_replicates(self) -> Float[Array, "groups times"]:
        root = np.sqrt(np.asarray(self.position_mse))
        return np.asarray(self.replicates) / (2 * np.where(root > 0, root, 1.0))

    def mean_position_rmse(self, first_step: int = 0) -> Scalar:
        """Position RMSE in metres averaged over the steps from ``first_step`` on (0 includes the prior)."""
        if not 0 <= first_step < len(self.position_mse):
            raise InputError(f"first_step is {first_step}", f"Give a step from 0 to {len(self.position_mse) - 1}")
        return (jnp if traced(self.position_mse) else np).sqrt(self.position_mse[first_step:]).mean()

    def mean_position_rmse_stderr(self, first_step: int = 0) -> float:
        """Standard error of :meth:`mean_position_rmse`, computed on the average, not per step."""
        return float(standard_error(self._rmse_replicates()[:, first_step:].mean(axis=1)))

    def relative_stderr(self) -> float:
        """Largest relative standard error of the position RMSE over the steps: what ``rtol`` limits."""
        root = np.sqrt(np.asarray(self.position_mse))
        return float(np.max(standard_error(self._rmse_replicates()) / np.where(root > 0, root, 1.0)))

    def efficiency(self, bound: "Result") -> "Efficiency":
        """Mean square error of the bound over that of this filter, averaged over the steps, with a 95 % interval.

        Raises
        ------
        RefusedError
            If the bound does not bound this filter: it assumes less than the filter sees, belongs to one track, was
            refused, stands on other time steps, or belongs to another scenario.
        """
        if bound.kind != "bound" or self.kind == "bound":
            raise RefusedError(
                f"efficiency compares a filter with a bound, not a {self.kind} ({self.name}) with a {bound.kind} "
                f"({bound.name})",
                "Call filter_result.efficiency(bound_result)",
            )
        if not self.sees <= bound.sees:
            raise RefusedError(
                f"{self.name} sees {', '.join(sorted(self.sees - bound.sees))}, which {bound.name} assumes to be "
                "unknown: the filter may be better than this bound",
                "Compare a smoother, which uses ranges after the step, with a smoothing bound: horizon='smooth'"
                if "future-ranges" in self.sees - bound.sees
                else "Compare it with a bound for the same horizon"
                if any("steps-old" in what for what in self.sees | bound.sees)
                else "Use a bound that assumes at least as much, for example enumer for a filter told the sight",
            )
        if self.track and self.track == bound.track:
            raise RefusedError(
                f"{bound.name} along {bound.track} is conditional on it and bounds no error there",
                "Compare over tracks drawn from the model (evaluate), or look at both numbers side by side",
            )
        if self.track != bound.track:
            raise RefusedError(
                f"{bound.name} belongs to {bound.track or 'random tracks'}, {self.name} to "
                f"{self.track or 'random tracks'}",
                "A Bayesian bound holds over tracks drawn from the model: compare like with like",
            )
        if bound.verdict.status in (Status.REFUSED, Status.UNDECIDED):
            said = "was refused" if bound.verdict.status is Status.REFUSED else "is not known to be a bound"
            raise RefusedError(f"{bound.name} {said}: {bound.verdict}", "Choose a bound that applies")
        if not np.array_equal(self.time_s, bound.time_s):
            raise RefusedError("the time steps of filter and bound differ", "Compute both on one scenario")
        if self.scenario and bound.scenario and self.scenario != bound.scenario:
            raise RefusedError(
                f"{self.name} was run on tracks of another scenario than {bound.name} speaks of: numbers, noises, "
                "chains or a known sight schedule differ",
                "Compute both on one scenario (evaluate on what the bound is of)",
            )
        log_ratio = float(np.log(np.mean(bound.position_mse) / np.mean(self.position_mse)))
        spreads = [
            float(standard_error(np.asarray(r.replicates).mean(axis=1))) / float(np.mean(r.position_mse))
            for r in (bound, self)
        ]
        half = NORMAL_95 * math.hypot(*spreads)
        low, high = (float(np.exp(log_ratio + d)) for d in (-half, half))
        return Efficiency(float(np.exp(log_ratio)), low, high)

    def to_dataset(self) -> "xarray.Dataset":
        """All arrays with labels, units and provenance, as an xarray dataset."""
        import xarray

        data = {
            "position_rmse": self.position_rmse,
            "position_rmse_stderr": self.position_rmse_stderr,
            "position_mse": self._label(self.position_mse, "position_mse", "m2"),
            "covariance": (("step", "state_row", "state_column"), np.asarray(self.covariance)),
            "replicates": (("group", "step"), np.asarray(self.replicates)),
        }
        p = self.provenance
        attrs = {
            "method": self.id,
            "name": self.name,
            "kind": self.kind,
            "sees": ", ".join(sorted(self.sees)),
            "verdict": str(self.verdict),
            "track": self.track,
            "scenario": self.scenario,
            "seed": p.seed,
            "samples": p.samples,
            "how": p.how,
            "references": ", ".join(p.references),
            "versions": ", ".join(f"{n} {v}" for n, v in p.versions),
            "date": p.date,
        }
        return xarray.Dataset(data, attrs=attrs)

    def __str__(self) -> str:
        if traced(self):
            return f"{self.name}: traced"
        number = format_with_error(self.mean_position_rmse(), self.mean_position_rmse_stderr())
        where = "" if not self.track else f" {self.track}" if self.track.startswith("at ") else f" along {self.track}"
        over = f", mean over steps 0..{len(self.time_s) - 1}" if len(self.time_s) > 1 else ""
        return f"{self.name}: position RMSE {number}{over}{where}; {self.verdict}"


class Efficiency(eqx.Module):
    """Ratio of mean square errors, bound over filter, with a 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def format_with_error(value: Any, error: float, unit: str = "m") -> str:
    """A number with its standard error, rounded to two digits of the error.

    >>> format_with_error(51.2345, 0.034), format_with_error(3.0, 0.0)
    ('51.234 +- 0.034 m', '3.000 m')
    """
    if not (math.isfinite(float(value)) and math.isfinite(error)):  # a filter that diverged
        return f"{float(value):.3g} {unit}"
    if error <= 1e-12 * abs(float(value)):  # nothing random, up to rounding
        return f"{float(value):.3f} {unit}"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{float(value):.{digits}f} +- {error:.{digits}f} {unit}"


def tightest(
    bounds: "list[Result] | tuple[Result, ...]", *, sees: frozenset[str] = frozenset({"ranges"})
) -> list[Result]:
    """The largest of the valid bounds that hold for estimators which see this only, compared by average RMSE.

    Bounds within four standard errors of the largest are returned with it: none of them is tighter than the other
    as far as the draws can tell. Refused bounds, numbers conditional on a track and bounds that speak of estimators
    which see less are left out.

    Parameters
    ----------
    bounds
        Results of bounds for one scenario.
    sees
        What the estimators see, by default ranges up to the present step.

    Returns
    -------
    list of Result
        Largest first; empty if none is valid.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(stay=0.6, steps=3)
    >>> [b.id for b in tightest([lb.bcrb(scenario), lb.enumer(scenario), lb.los_only(scenario)])]
    ['bcrb']
    """
    valid = [b for b in bounds if b.kind == "bound" and b.verdict.status is Status.VALID and sees <= b.sees]
    if not valid:
        return []
    valid.sort(key=lambda b: -float(b.mean_position_rmse()))
    top = valid[0]

    def close(b: Result) -> bool:
        gap = float(top.mean_position_rmse() - b.mean_position_rmse())
        return gap <= 4 * float(np.hypot(top.mean_position_rmse_stderr(), b.mean_position_rmse_stderr()))

    return [b for b in valid if b is top or close(b)]
