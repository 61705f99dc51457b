"""The static Bayesian Cramér-Rao bound: expected information of the measurements plus that of the prior."""

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.priors import GaussianPrior, PositionPrior
from locbounds.registry import method
from locbounds.result import Provenance, Result
from locbounds.verdict import Status

FIRST, MOST = 24, 200  # nodes along a line
RTOL = 1e-4
STEP = 1e-4  # of a central difference of the log-density, in deviations


@double_precision
def bayesian_information(plan: Plan, *, rtol: float = RTOL) -> tuple[Float[ndarray, "space space"], float]:
    """``E[J(theta)] + J_P`` in 1/m^2, and its relative change when the nodes were refined last.

    The chapter's (12), with J_D the expected Fisher information. Not every plan has one: ask the verdict first.
    """
    prior = plan.prior
    if prior is None:
        raise InputError("the plan has no prior", "Give one: plan.replace(prior=...)")
    n, J = FIRST, _information(plan, prior, FIRST)
    while True:
        n = n + n // 2
        finer = _information(plan, prior, n)
        change = float(np.abs(finer - J).max() / np.abs(np.diagonal(finer)).max())
        if change <= rtol or n > MOST or not np.all(np.isfinite(finer)):
            return finer, change
        J = finer


def _information(plan: Plan, prior: PositionPrior, n: int) -> ndarray:
    points, weights = prior.nodes(n)
    return np.einsum("n,nab->ab", weights, np.asarray(plan.information(points))) + prior_information(prior, n)


def prior_information(prior: PositionPrior, n: int = 40) -> Float[ndarray, "space space"]:
    """``E[score score^T]`` of a prior, 1/m^2.

    >>> prior_information(GaussianPrior([0.0, 0.0], np.diag([4.0, 1.0]))).tolist()
    [[0.25, 0.0], [0.0, 1.0]]
    """
    if isinstance(prior, GaussianPrior):
        return np.linalg.inv(np.asarray(prior.covariance))
    points, weights = prior.nodes(n)
    step = STEP * np.sqrt(np.diagonal(np.asarray(prior.covariance)))
    moves = np.diag(step)
    score = np.stack(
        [(prior.log_density(points + d) - prior.log_density(points - d)) / (2 * np.linalg.norm(d)) for d in moves], -1
    )
    return np.einsum("n,na,nb->ab", weights, score, score)


def bcrb_of_plan(plan: Plan, *, rtol: float = 1e-3) -> Result:
    """What ``lb.bcrb`` returns for a plan."""
    entry = method("bcrb")
    verdict = entry.verdict(plan)
    if verdict.status is Status.REFUSED:
        raise RefusedError(
            f"the Bayesian Cramér-Rao bound does not exist here: {'; '.join(verdict.reasons)}",
            "The Ziv-Zakai bound (ezzb) exists for every prior and measurement, Weiss-Weinstein (wwb) unless one jumps",
        )
    J, change = bayesian_information(plan, rtol=min(rtol, RTOL))
    if not np.all(np.isfinite(J)):
        raise RefusedError(
            "the expected information is not a number: a measurement has no derivative where the prior is positive",
            "Make its function differentiable there (the root of zero and 0/0 are not); ezzb needs no derivative",
        )
    if not change <= rtol:
        doubt = f"the expected information may be infinite: more nodes changed it by {change:.1%}"
        reasons = verdict.reasons if verdict.status is not Status.VALID else ()
        verdict = verdict._replace(status=Status.UNDECIDED, reasons=(doubt, *reasons))
    matrix = np.linalg.inv(J)
    return Result(
        id="bcrb",
        name=entry.name,
        kind="bound",
        sees=frozenset({"measurement"}),
        time_s=np.zeros(1),
        position_mse=np.array([np.trace(matrix)]),
        replicates=np.zeros((1, 1)),
        covariance=matrix[None],
        verdict=verdict,
        provenance=Provenance.now(0, 0, "inverse of the expected information", ("mcguire2009", "vantrees1968")),
        diagnostics={"information": J, "quadrature_error": change / 2},
    )
