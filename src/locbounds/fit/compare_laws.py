"""Which law range errors follow: families fitted to some errors, compared on others that were held out.

The errors are taken as one law, whatever the order in time; standard errors of comparisons take the errors of one
group (a track, a place) as dependent. Likelihoods are those of densities in 1/m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import jax.numpy as jnp
import numpy as np

from locbounds.axes import ndarray
from locbounds.errors import InputError
from locbounds.fit.noise_law import LAWS, LawFit, fit_noise_law, log_densities
from locbounds.fit.one_sided import ONE_SIDED, ContradictedError
from locbounds.precision import double_precision


@dataclass(frozen=True)
class LawComparison:
    """One family in a comparison.

    Attributes
    ----------
    fit : LawFit or None
        None where the errors contradict the family.
    family : str
    held_out, held_out_stderr : float
        Mean log-likelihood of a held-out error, with its standard error over groups; minus infinity where the law
        calls one of them impossible.
    behind, behind_stderr : float
        How far it lies behind the winner per held-out error, and the standard error of that over groups.
    impossible : int
        Held-out errors outside the law's support.
    ks : float
        Largest difference of the distribution functions of law and held-out errors.
    regularity : str
        Whether a Cramér-Rao bound exists with this law.
    note : str
    """

    family: str
    fit: LawFit | None
    held_out: float = -np.inf
    held_out_stderr: float = np.nan
    behind: float = np.inf
    behind_stderr: float = np.nan
    impossible: int = 0
    ks: float = np.nan
    regularity: str = ""
    note: str = ""
    per_error: ndarray = field(default_factory=lambda: np.empty(0), repr=False)


@double_precision
def compare_noise_laws(
    error_m,
    held_out_m,
    *,
    groups=None,
    families: Sequence[str] = LAWS,
    start_m: float | None = None,
) -> list[LawComparison]:
    """Fit families to errors and compare them on others.

    Parameters
    ----------
    error_m, held_out_m : array
        Errors to fit to, and to compare on, m; NaN is left out.
    groups : array, optional
        The group (track, place) of every held-out error: errors within a group are taken as dependent.
    families : sequence of str
        Which of `LAWS`.
    start_m : float, optional
        Smallest value of the one-sided families; fitted, too, if left out.

    Returns
    -------
    list of LawComparison
        The best one first, by held-out likelihood; those that the errors contradict last, with the reason.

    Raises
    ------
    InputError
        As `fit_noise_law`, except for contradicted families.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> rows = compare_noise_laws(rng.laplace(0, 1, 4000), rng.laplace(0, 1, 2000), families=("gaussian", "laplace"))
    >>> [row.family for row in rows]
    ['laplace', 'gaussian']
    """
    held = np.asarray(held_out_m, float).ravel()
    there = np.isfinite(held)
    group = np.arange(len(held)) if groups is None else np.asarray(groups).ravel()
    held, group = held[there], np.unique(group[there], return_inverse=True)[1]
    if not len(held):
        raise InputError("no errors are held out", "Hold some tracks out, for example --hold-out 4")
    rows = [_compared(error_m, held, group, family, start_m) for family in families]
    rows.sort(key=lambda row: (row.fit is None, -row.held_out, row.impossible))
    best = rows[0].per_error
    return [_behind(row, best, group) for row in rows]


def _compared(error_m, held: ndarray, group: ndarray, family: str, start: float | None) -> LawComparison:
    try:
        fit = fit_noise_law(error_m, family, start_m=start)
    except ContradictedError as error:
        return LawComparison(family, None, note=error.cause)
    each = log_densities(fit.noise, held)
    impossible = int((each == -np.inf).sum())
    x = np.sort(held)
    F, n = np.asarray(fit.noise.cdf(jnp.asarray(x))), len(x)
    ks = float(max((np.arange(1, n + 1) / n - F).max(), (F - np.arange(n) / n).max()))
    notes = [f"impossible held out: {impossible}"] if impossible else []
    if family in ONE_SIDED and start is None:
        notes.append("start fitted")
    status = fit.noise.regularity().status
    return LawComparison(
        family,
        fit,
        *_mean(each, group),
        impossible=impossible,
        ks=ks,
        regularity=status,
        note="; ".join(notes),
        per_error=each,
    )


def _behind(row: LawComparison, best: ndarray, group: ndarray) -> LawComparison:
    if row.fit is None or row.impossible or not np.all(np.isfinite(best)):
        return row
    behind, stderr = _mean(best - row.per_error, group)
    return replace(row, behind=behind, behind_stderr=stderr)


def _mean(x: ndarray, group: ndarray) -> tuple[float, float]:
    """Mean, and its standard error over groups."""
    mean = float(x.mean())
    if not np.isfinite(mean):
        return mean, float("nan")
    sums = np.bincount(group, weights=x - mean)
    k = len(sums)
    return mean, float(np.sqrt((sums**2).sum() * k / (k - 1)) / len(x)) if k > 1 else float("nan")
