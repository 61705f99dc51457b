"""What every bound does before and after its own computation."""

from typing import Any

from locbounds.bounds.expectation import Expectation, Prior
from locbounds.bounds.precision_control import Estimate
from locbounds.errors import RefusedError
from locbounds.model import JumpMarkov
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
) -> Result:
    """A bound's result from its estimate, with the registry's labels."""
    entry = method(id)
    return Result(
        id=entry.id,
        name=entry.name,
        kind=entry.kind,
        sees=entry.sees,
        time_s=scenario.times.time_s,
        position_mse=estimate.position_mse,
        replicates=estimate.replicates,
        covariance=estimate.covariance,
        verdict=verdict,
        provenance=Provenance.now(seed, samples, how, entry.references),
        track=expectation.label,
        diagnostics=diagnostics,
    )
