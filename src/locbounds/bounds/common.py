"""What every bound does before and after its own computation."""

from typing import Any

import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds.expectation import Expectation, Prior
from locbounds.bounds.precision_control import Estimate
from locbounds.errors import InputError, RefusedError
from locbounds.horizon import Horizon
from locbounds.linalg import is_positive_semidefinite
from locbounds.model import JumpMarkov
from locbounds.precision import traced
from locbounds.registry import method
from locbounds.result import Provenance, Result
from locbounds.scenario import Scenario
from locbounds.verdict import Status, Verdict


def prepare(id: str, scenario: Scenario, expectation: Expectation | None) -> tuple[Expectation, Verdict]:
    """The expectation to use and the verdict; a RefusedError before any Monte Carlo where an assumption fails."""
    expectation = Prior() if expectation is None else expectation
    expectation.check(scenario)
    conditions = (f"conditional on {expectation.label}",) if expectation.label else ()
    verdict = method(id).verdict(scenario, conditions)
    if verdict.status is Status.REFUSED:
        raise RefusedError(f"{id} does not apply: {'; '.join(verdict.reasons)}", f"See: locbounds explain {id}")
    return expectation, verdict


def further_information(
    scenario: Scenario | JumpMarkov, extra: Array | None
) -> Float[Array, "times state state"] | None:
    """Information of further independent measurements about the state at steps 0..K, checked.

    Raises
    ------
    InputError
        If the shape does not fit or a matrix is no information.
    """
    if extra is None:
        return None
    size = scenario.state_size if isinstance(scenario, JumpMarkov) else scenario.motion.state_size
    wanted = (scenario.steps + 1, size, size)
    if np.shape(extra) != wanted:
        raise InputError(
            f"the extra information has shape {np.shape(extra)}, the scenario needs {wanted}",
            "Give one matrix about the state for each of the steps 0..K, zero where nothing more is measured",
        )
    if traced(extra):
        return extra
    extra = np.asarray(extra, dtype=float)
    bad = [k for k, matrix in enumerate(extra) if not is_positive_semidefinite(matrix)]
    if bad:
        raise InputError(
            f"the extra information of step {bad[0]} is not symmetric or negative in some direction",
            "Give H' R^-1 H of every further measurement H x + noise with covariance R",
        )
    return extra


def bound_result(
    id: str,
    scenario: Scenario | JumpMarkov,
    estimate: Estimate,
    verdict: Verdict,
    expectation: Expectation,
    seed: int,
    samples: int,
    how: str,
    diagnostics: dict[str, Any],
    horizon: Horizon | None = None,
) -> Result:
    """A bound's result from its estimate, with the registry's labels."""
    entry, horizon = method(id), horizon or Horizon()
    return Result(
        id=entry.id,
        name=entry.name + horizon.label,
        kind=entry.kind,
        sees=horizon.sees(entry.sees),
        time_s=scenario.times.time_s,
        position_mse=estimate.position_mse,
        replicates=estimate.replicates,
        covariance=estimate.covariance,
        verdict=verdict,
        provenance=Provenance.now(seed, samples, how, entry.references),
        track=expectation.label,
        scenario=scenario.fingerprint() if isinstance(scenario, Scenario) else "",
        diagnostics=diagnostics,
    )
