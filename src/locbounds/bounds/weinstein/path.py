r"""Weiss-Weinstein bound with test functions that shift the whole path: any Q, also a singular one.

The states are linear functions of independent standard normal numbers theta = (x_0, noises of the motion, whitened).
A shift u of theta moves the observed quantity of step j by ``D_j u`` and has

    log eta(u) = -|u|^2 / 8 + sum_j log rho_j(D_j u),

rho_j being the Bhattacharyya coefficient of the measurements of step j. Any u gives a valid bound. The best direction
for the quantity ``D_k theta`` of a Gaussian problem with information i_j per step is
``V = (I + sum_j i_j D_j' D_j)^-1 D_k'``; several lengths of it are taken together and scaled to the best common size.
With one length tending to zero the bound of a Gaussian problem is its Kalman variance ``D_k V``.
"""

from collections.abc import Callable

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.bounds.weinstein.gram import gram, largest_square

LENGTHS = np.array([1.0, 2.0, 3.0, 4.5])  # of the test shifts, relative to each other
SCALES = np.geomspace(0.02, 2.5, 22)  # common scales, in deviations of the Gaussian problem
FINER = 12

LogRho = Callable[[Float[ndarray, "steps *n"]], Float[ndarray, "steps *n"]]


def path_bound(
    D: Float[ndarray, "steps theta"],
    log_rho: LogRho,
    information: Float[ndarray, "guesses steps"],
    target: Float[ndarray, " theta"] | None = None,
) -> tuple[float, float]:
    """Bound on the mean square error of one linear function of the path from all these steps' measurements.

    Parameters
    ----------
    D
        How theta moves the observed quantity of every step.
    log_rho
        ``log rho_j`` of the shifts of the observed quantity, [steps, ...], summed over the measurements of the step.
    information
        Guesses of the information per step, which set the directions; the best guess counts, none can do harm.
    target
        The function whose error is bounded; by default the observed quantity of the last step.

    Returns
    -------
    bound, scale
        The bound, and the scale of the best test shifts in posterior deviations.

    Examples
    --------
    One standard normal number, measured with a standard deviation of 1/2: the Bayesian variance is 1/5.

    >>> bound, _ = path_bound(np.ones((1, 1)), lambda u: -(u**2) / 8 * 4, np.array([[4.0]]))
    >>> round(bound, 4)
    0.2
    """
    target = D[-1] if target is None else target
    best, best_scale = 0.0, float("nan")
    for i in information:
        V = np.linalg.solve(np.eye(D.shape[1]) + (D.T * i) @ D, target)
        variance = float(target @ V)
        if variance <= 0:
            continue
        unit = V / np.sqrt(variance)

        def value(scales: ndarray, unit: ndarray = unit, reach: float = float(np.sqrt(variance))) -> ndarray:
            t = scales[:, None] * LENGTHS

            def log_eta(t: ndarray) -> ndarray:
                moved = (D @ unit).reshape(-1, *(1 for _ in t.shape)) * t
                return -(t**2) * (unit @ unit) / 8 + log_rho(moved).sum(0)

            G = gram(log_eta(t[:, :, None] - t[:, None]), log_eta(t[:, :, None] + t[:, None]), log_eta(t))
            return largest_square(reach * t, G)

        found = value(SCALES)
        at = int(np.argmax(found))
        near = np.geomspace(SCALES[max(at - 1, 0)], SCALES[min(at + 1, len(SCALES) - 1)], FINER)
        finer = value(near)
        if finer.max() > best:
            best, best_scale = float(finer.max()), float(near[np.argmax(finer)])
    return best, best_scale
