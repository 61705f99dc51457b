r"""The Barankin bound at given places, in the form with several test points.

For an estimator without bias at theta and at theta + h_i, with ``L_i = p(z | theta + h_i) / p(z | theta)``,

    Cov >= H (E[L L^T] - 1 1^T)^-1 H^T,      E[L_i L_j] = exp((m_i - m)^T C^-1 (m_j - m))  (Gaussian noise)

Short test vectors along the axes give the Cramér-Rao bound; longer ones can only add to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.result import Result
from locbounds.static.common import static_result, verdict_of
from locbounds.static.pair_laws import GaussianPairs
from locbounds.static.plan_laws import means, pair_law
from locbounds.static.weiss_weinstein_search import fan

SHORT = 1e-3  # test vectors of the local part: so many deviations away
LENGTHS = 0.5 * 1.6 ** np.arange(10)  # of the others, in deviations of the Cramér-Rao bound
DIRECTIONS = 12
RANK = 1e-10
LARGE = 40.0  # exponents beyond which one does not count beside the exponential
FARTHEST = 600.0  # squared distance of a test point that adds something: exp(-600)


def barankin_matrix(
    H: Float[ndarray, "space tests"], v: Float[ndarray, "tests channels"]
) -> Float[ndarray, "space space"]:
    """The bound from test vectors H and the whitened differences ``v_i = W (m(theta + h_i) - m(theta))``.

    Rows are scaled by ``exp(-|v_i|^2 / 2)``, so that far test points vanish instead of overflowing.

    >>> step = np.array([[1e-4]])
    >>> round(float(barankin_matrix(step, 2 * step.T)[0, 0]), 6)
    0.25
    """
    square, inner = np.square(v).sum(1), v @ v.T
    both = -0.5 * (square[:, None] + square)
    B = np.where(inner < LARGE, np.exp(both) * np.expm1(np.minimum(inner, LARGE)), np.exp(both + inner))
    moved = H * np.exp(-0.5 * square)
    size = np.sqrt(np.maximum(np.diagonal(B), 0.0))
    keep = (size > 0) & (square < FARTHEST)
    B, moved = B[np.ix_(keep, keep)] / np.outer(size[keep], size[keep]), moved[:, keep] / size[keep]
    values, vectors = np.linalg.eigh(B)
    good = values > RANK * max(values.max(initial=0.0), 1e-300)
    parts = (moved @ vectors[:, good]) / np.sqrt(values[good])
    return parts @ parts.T


@double_precision
def barankin(plan: Plan, points: Any, *, tests: Float[ndarray, "space tests"] | None = None) -> Result | list[Result]:
    """Barankin bound on the variance of unbiased estimators at given places.

    Parameters
    ----------
    plan
        Gaussian noise; a prior is not used.
    points
        One place [space] or several [points, space], in metres.
    tests
        Test vectors [space, tests] in metres; by default short ones along the axes, which give the Cramér-Rao bound,
        and ten lengths in 24 directions, up to 34 deviations of it. Where the place cannot be told locally, lengths
        are relative to the distance of the anchors.

    Returns
    -------
    Result or list of Result
        One per place; ``covariance[0]`` bounds the covariance matrix.

    Raises
    ------
    RefusedError
        If the noise is not Gaussian.
    InputError
        If points or test vectors have the wrong shape.

    Notes
    -----
    The form of McAulay and Seidman of the bound that the chapter's Table 1 names for deterministic positions (Rife et
    al. 1975). Never below the Cramér-Rao bound; above it where far places look alike.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 2.0)
    >>> print(lb.barankin(plan, [1.0, 2.0]))
    Barankin bound: position RMSE 2.338 m at (1, 2);
    valid under (estimators without bias at the place and at all test points)
    """
    law = pair_law(plan)
    if not isinstance(law, GaussianPairs) or np.any(np.isfinite(law.period) & (law.std > 0.2)):
        raise RefusedError(
            "the Barankin bound is implemented for Gaussian noise (angles below 0.2 rad)", "Use crlb, wwb or ezzb"
        )
    verdict = verdict_of("barankin", plan)
    places = np.asarray(points, float)
    single = places.ndim == 1
    places = np.atleast_2d(places)
    if places.shape[1] != plan.dim or not np.all(np.isfinite(places)):
        raise InputError(f"the points have shape {np.shape(points)}", f"Give [points, {plan.dim}] metres")
    given = None if tests is None else np.asarray(tests, float)
    if given is not None and (given.ndim != 2 or given.shape[0] != plan.dim):
        raise InputError(f"the test vectors have shape {given.shape}", f"Give [{plan.dim}, tests] metres")
    out = []
    for place in places:
        H = _tests(plan, place) if given is None else given
        gap = means(plan, place + H.T) - means(plan, place[None])
        round_ = np.isfinite(law.period)
        gap[:, round_] -= law.period[round_] * np.round(gap[:, round_] / law.period[round_])
        matrix = barankin_matrix(H, gap @ law.whitener.T)
        where = "at (" + ", ".join(f"{x:g}" for x in place) + ")"
        diagnostics = {"tests_m": H, "point_m": place}
        out.append(
            static_result("barankin", matrix, verdict, "several test points", track=where, diagnostics=diagnostics)
        )
    return out[0] if single else out


def _tests(plan: Plan, place: ndarray) -> ndarray:
    information = np.asarray(plan.information(place[None]))[0]
    values = np.linalg.eigvalsh(information)
    anchors = plan.anchors
    wide = float(np.max(np.linalg.norm(anchors - place, axis=1))) if len(anchors) else 1.0
    deviation = values[0] ** -0.5 if values[0] > 1e-12 * max(values[-1], 1e-300) else wide
    deviation = min(deviation, wide)
    narrow = SHORT * min(values[-1] ** -0.5 if values[-1] > 0 else deviation, deviation)
    directions = fan(plan.dim, DIRECTIONS)
    around = np.concatenate([directions, -directions], axis=1)
    return np.concatenate([narrow * np.eye(plan.dim), *(k * deviation * around for k in LENGTHS)], axis=1)
