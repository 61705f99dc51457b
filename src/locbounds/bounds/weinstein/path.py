r"""Weiss-Weinstein bound with test functions that shift the whole path: any Q, also a singular one, and any horizon.

The states are linear functions of independent standard normal numbers theta = (x_0, noises of the motion, whitened).
A shift u of theta moves the i-th measured quantity by ``D_i u`` and has

    log eta(u) = -|u|^2 / 8 + log rho(D u),

rho being the Bhattacharyya coefficient of all measurements that an estimator may use. Any shifts u_1, u_2, .. give the
valid bound ``H G^-1 H'`` for the error of ``X theta``, with columns ``X u_m`` in H. The best directions of a Gaussian
problem with information i per measurement are the columns of ``V = (I + D' i D)^-1 X'``; they are made orthogonal in
the covariance ``X V``. Directions for several guesses of i and several lengths of each are taken together and scaled to
the best common size. With lengths tending to zero the bound of a Gaussian problem is its covariance ``X V``.
"""

from collections.abc import Callable

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.bounds.weinstein.gram import LOST, ROUNDING, gram
from locbounds.horizon import Horizon

GUESSES = (0.2, 1.0, 10.0)  # of the information, in units of a rough one
LENGTHS = (1.0, 2.0, 3.0)  # of the test shifts, relative to each other
SCALES = np.geomspace(0.02, 2.5, 22)  # common scales, in deviations of the Gaussian problem
LONGEST = 100.0  # deviations: where the search ends
FINER = 12
NOTHING = 1e-12  # relative variance of a direction that says nothing new

LogRho = Callable[[Float[ndarray, "rows *n"]], Float[ndarray, "*n"]]


def path_bounds(
    X: Float[ndarray, "times state theta"],
    slopes: Float[ndarray, "channels steps state"],
    information: Float[ndarray, " channels"],
    log_rho: LogRho,
    index: ndarray,
    horizon: Horizon,
) -> Float[ndarray, "times state state"]:
    """Bounds at steps 0..K on the mean square error matrices of states that are linear in theta.

    Parameters
    ----------
    X
        How theta makes the states.
    slopes
        Gradients of what the channels measure at steps 1..K.
    information
        Rough information per measurement of each channel.
    log_rho
        Logarithm of the coefficient of all measurements of steps 1..j, for the shifts of what all channels measure at
        step 1, then at step 2, ...
    index
        Components of the position.
    horizon
        Which measurements may be used.

    Examples
    --------
    A walk from a known place, measured with a standard deviation of 1/2:

    >>> X, gaussian = np.tril(np.ones((3, 2)), -1)[:, None], lambda u: -np.sum(u**2, 0) / 2
    >>> path_bounds(X, np.ones((1, 2, 1)), np.array([4.0]), gaussian, np.array([0]), Horizon())[:, 0, 0].round(4)
    array([0.    , 0.2   , 0.2069])
    """
    D = np.einsum("cka,kat->kct", slopes, X[1:])
    out = []
    for k, X_k in enumerate(X):
        last = horizon.last(k, len(X) - 1)
        if last == 0:
            out.append(X_k @ X_k.T)
            continue
        rows = D[:last].reshape(last * len(information), -1)
        matter = np.any(rows != 0, 0) | np.any(X_k != 0, 0)  # later noises do not
        guesses = np.outer(GUESSES, np.tile(information, last))
        out.append(path_bound(rows[:, matter], log_rho, guesses, X_k[:, matter], index))
    return np.stack(out)


def path_bound(
    D: Float[ndarray, "rows theta"],
    log_rho: LogRho,
    information: Float[ndarray, "guesses rows"],
    X: Float[ndarray, "state theta"],
    index: ndarray,
) -> Float[ndarray, "state state"]:
    """Bound on the mean square error matrix of a linear function of the path.

    Parameters
    ----------
    D
        How theta moves what is measured, one row per measurement.
    log_rho
        Logarithm of the coefficient of all measurements, for shifts of what is measured.
    information
        Guesses of the information per measurement, which set the directions; none can do harm.
    X
        How theta makes the state whose error is bounded.
    index
        The scale is that of the bound which is largest in the sum of these diagonal entries.

    Examples
    --------
    One standard normal number, measured with a standard deviation of 1/2: the Bayesian variance is 1/5.

    >>> one = np.ones((1, 1))
    >>> path_bound(one, lambda u: -(u[0] ** 2) / 2, np.array([[4.0]]), one, np.array([0])).round(4)
    array([[0.2]])
    """
    first = np.concatenate([index, np.setdiff1d(np.arange(len(X)), index)])
    units = []
    for i in information:
        V = np.linalg.solve(np.eye(D.shape[1]) + (D.T * i) @ D, X[first].T)
        units.append(_orthogonal(V, X[first] @ V))
    units = np.concatenate(units)
    if not len(units):
        return np.zeros((len(X), len(X)))
    bounds_at = _Shifts(D, X, (units[:, None] * np.array(LENGTHS)[:, None]).reshape(-1, D.shape[1]), log_rho, index)
    scales, (value, _) = SCALES, bounds_at(SCALES)
    while np.argmax(value) == len(scales) - 1 and scales[-1] < LONGEST:  # the grid is too short
        scales = np.append(scales, scales[-1] * np.array([1.5, 2.25]))
        value = np.append(value, bounds_at(scales[-2:])[0])
    at = int(np.argmax(value))
    near = np.geomspace(scales[max(at - 1, 0)], scales[min(at + 1, len(scales) - 1)], FINER)
    value, bounds = bounds_at(near)
    return bounds[int(np.argmax(value))]


class _Shifts:
    """Bounds for scaled copies of some shifts of theta."""

    def __init__(self, D: ndarray, X: ndarray, shifts: ndarray, log_rho: LogRho, index: ndarray):
        self.H, self.log_rho, self.index = shifts @ X.T, log_rho, index
        self.parts = [
            (np.sum(u**2, -1), np.moveaxis(u @ D.T, -1, 0)[..., None])
            for u in (shifts[:, None] - shifts, shifts[:, None] + shifts, shifts)
        ]

    def __call__(self, scales: ndarray) -> tuple[ndarray, ndarray]:
        """Sums of the diagonal entries of the index [scales], and the matrices [scales, state, state]."""
        logs = [
            np.moveaxis(-square[..., None] * scales**2 / 8 + self.log_rho(moved * scales), -1, 0)
            for square, moved in self.parts
        ]
        H = scales[:, None, None] * self.H
        bounds = projected(H, gram(*logs))
        return bounds[:, self.index, self.index].sum(-1), bounds


def projected(
    H: Float[ndarray, "*n m state"], G: Float[ndarray, "*n m m"], before: Float[ndarray, "*n m m"] | None = None
) -> Float[ndarray, "*n state state"]:
    """``H' G^-1 H``; combinations of test functions that vanish up to rounding are left out, which keeps it valid.

    Parameters
    ----------
    H, G
        Shifts and Gram matrix.
    before
        What another block was subtracted from to get G: rounding of its size is added, so that nothing is made of it.

    Examples
    --------
    >>> projected(np.array([[1.0]]), np.array([[2.0]])).round(12)
    array([[0.5]])
    """
    scale = np.sqrt(np.einsum("...ii->...i", G if before is None else before))
    values, vectors = np.linalg.eigh(G / scale[..., :, None] / scale[..., None, :])
    values = values + (0.0 if before is None else ROUNDING)
    kept = values > LOST * np.maximum(values[..., -1:], 0.0)
    part = np.swapaxes(vectors, -1, -2) @ (H / scale[..., None])
    part = part * np.where(kept, 1 / np.sqrt(np.where(kept, values, 1.0)), 0.0)[..., None]
    return np.swapaxes(part, -1, -2) @ part


def _orthogonal(V: ndarray, S: ndarray) -> ndarray:
    """Combinations of the columns of V, one per row, uncorrelated in S and of variance one."""
    units: list[ndarray] = []
    done = np.zeros((0, len(S)))  # their covariances with all components
    for a in range(len(S)):
        weight = np.eye(len(S))[a]
        left = S[a, a] - np.sum(done[:, a] ** 2)
        if left <= NOTHING * S[a, a] or S[a, a] <= 0:
            continue
        unit = V @ weight - sum((d[a] * u for d, u in zip(done, units, strict=True)), np.zeros(len(V)))
        units.append(unit / np.sqrt(left))
        row = S[a] - done.T @ done[:, a]
        done = np.concatenate([done, (row / np.sqrt(left))[None]])
    return np.array(units).reshape(-1, len(V))
