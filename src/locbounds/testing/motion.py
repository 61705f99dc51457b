"""What every motion model promises: F and Q of one linear Gaussian motion, for any interval."""

from collections.abc import Sequence
from itertools import pairwise

import jax
import numpy as np

from locbounds.linalg import is_positive_semidefinite
from locbounds.motion import Motion
from locbounds.testing.suite import run

SAME = 1e-9


def check_motion(motion: Motion, *, intervals_s: Sequence[float] = (0.1, 0.7, 3.0), continuous: bool = True) -> None:
    """Check a motion model of your own.

    Parameters
    ----------
    motion
        An instance.
    intervals_s
        Intervals to try, in seconds.
    continuous
        Whether the motion runs in continuous time, so that two intervals make one: ``F(a+b) = F(b) F(a)`` and
        ``Q(a+b) = F(b) Q(a) F(b)' + Q(b)``. False for noise that is constant during each interval.

    Raises
    ------
    Nonconforming
        Listing every check that fails.

    Notes
    -----
    ``names``: one different name per state component; the position is 2 or 3 of them. ``shapes``: F and Q [state,
    state], finite. ``covariance``: Q symmetric without negative eigenvalues. ``composition``: as above. ``traceable``:
    JAX can trace the interval, and gives the same numbers.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.testing import check_motion
    >>> check_motion(lb.ConstantVelocity(0.5))
    """
    run(motion, CHECKS, tuple(intervals_s), continuous)


def _names(motion: Motion, intervals, continuous) -> str | None:
    names, index = motion.state_names, motion.position_index
    if len(set(names)) < len(names) or len(names) != motion.state_size:
        return f"state names are {names}"
    if motion.dim not in (2, 3) or len(set(index)) < len(index) or not all(0 <= i < len(names) for i in index):
        return f"position_index is {index} of {len(names)} components"
    x = np.arange(float(len(names)))
    same = np.array_equal(np.asarray(motion.position(x)), x[list(index)])
    return None if same else "position(x) is not what position_index says"


def _shapes(motion: Motion, intervals, continuous) -> str | None:
    n = motion.state_size
    for dt in intervals:
        for name, matrix in (("F", motion.transition(dt)), ("Q", motion.covariance(dt))):
            if np.shape(matrix) != (n, n) or not np.all(np.isfinite(np.asarray(matrix))):
                return f"{name} for {dt} s has shape {np.shape(matrix)} or numbers that are not finite"
    return None


def _covariance(motion: Motion, intervals, continuous) -> str | None:
    bad = [dt for dt in intervals if not is_positive_semidefinite(np.asarray(motion.covariance(dt)))]
    return f"Q for {bad[0]} s is not symmetric positive semidefinite" if bad else None


def _composition(motion: Motion, intervals, continuous) -> str | None:
    if not continuous:
        return None
    for a, b in pairwise(intervals):
        (F_a, Q_a), (F_b, Q_b), (F, Q) = (
            (np.asarray(motion.transition(dt)), np.asarray(motion.covariance(dt))) for dt in (a, b, a + b)
        )
        if not np.allclose(F, F_b @ F_a, rtol=SAME, atol=SAME):
            return f"F({a} + {b}) is not F({b}) F({a})"
        if not np.allclose(Q, F_b @ Q_a @ F_b.T + Q_b, rtol=SAME, atol=SAME * np.abs(Q).max()):
            return f"Q({a} + {b}) is not F({b}) Q({a}) F({b})' + Q({b})"
    return None


def _traceable(motion: Motion, intervals, continuous) -> str | None:
    pairs = jax.jit(jax.vmap(lambda dt: (motion.transition(dt), motion.covariance(dt))))(np.array(intervals))
    alone = [np.stack([np.asarray(f(dt)) for dt in intervals]) for f in (motion.transition, motion.covariance)]
    same = all(np.allclose(a, b, rtol=SAME) for a, b in zip(pairs, alone, strict=True))
    return None if same else "traced by JAX, F or Q has other numbers"


CHECKS = {
    "names": _names,
    "shapes": _shapes,
    "covariance": _covariance,
    "composition": _composition,
    "traceable": _traceable,
}
