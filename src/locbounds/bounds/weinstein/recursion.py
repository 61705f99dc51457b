r"""Recursive Weiss-Weinstein bound with test functions that shift one state each, exponent 1/2.

The shift h of x_j alone changes the law of x_0 (or the step to x_j), the step away from it, and z_j. With the blocks of
the prior's information,

    A_j = Q_j^-1 + F_{j+1}' Q_{j+1}^-1 F_{j+1}  ("interior"),   A_j = Q_j^-1  ("end": no later state),
    C_j = Q_j^-1 F_j  between x_{j-1} and x_j,      log eta_j(h) = -h' A_j h / 8 + log rho_j(h),

the Gram matrix of all test functions (:mod:`locbounds.bounds.weinstein.gram`) is block tridiagonal. Between x_{j-1}
shifted by g and x_j shifted by h the difference of the two moved laws is

    B = 4 sinh(-h' C_j g / 4) kappa_j(g, h),     kappa_j = rho_{j-1,j}(g, h) / (rho_{j-1}(g) rho_j(h)),

kappa = 1 where the measurements of different steps are independent given the states. Blocks further apart are zero:
moving x_j one way or the other makes no difference to x_{j-2}. Eliminating block by block,

    K_j = G_j(interior) - B_j K_{j-1}^-1 B_j',      W_k = H_k [G_k(end) - B_k K_{k-1}^-1 B_k']^-1 H_k',

only the interior blocks are carried forward; the end block gives the filtering bound of its step
(Rapoport, Oshman 2004). Where Q is tiny beside the prior the differences cancel: rounding is added to them, and the
bound gets looser, never larger than the exact one.
"""

from typing import Protocol, runtime_checkable

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.bounds.weinstein.gram import LEAST, gram
from locbounds.bounds.weinstein.path import projected


@runtime_checkable
class Coefficients(Protocol):
    """Bhattacharyya coefficients of the measurements, for shifts of the states."""

    def single(self, j: int, u: Float[ndarray, "*n state"]) -> Float[ndarray, "*n"]:
        """``log rho_j(u)``: x_j moved by u (step j = 0 has no measurement: zero)."""
        ...

    def excess(self, j: int, g: Float[ndarray, "m state"], h: Float[ndarray, "l state"]) -> Float[ndarray, "l m"]:
        """``log kappa_j(g, h)``: x_{j-1} moved by g and x_j by h."""
        ...


def weiss_weinstein_recursion(
    F: Float[ndarray, "steps state state"],
    Q: Float[ndarray, "steps state state"],
    P0: Float[ndarray, "state state"],
    shifts: Float[ndarray, "times m state"],
    coefficients: Coefficients,
) -> Float[ndarray, "times state state"]:
    """Filtering bounds on the mean square error matrix at steps 0..K.

    Parameters
    ----------
    F, Q, P0
        Linear Gaussian motion and prior; Q and P0 have to be regular.
    shifts
        Test shifts of every state; a shift and its negative are one.
    coefficients
        What the measurements say.
    """
    information = [np.linalg.inv(P0), *np.linalg.inv(Q)]
    before, carried, used, bounds = np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0, bool), []
    for k, h in enumerate(shifts):
        cross = np.zeros((len(h), len(h)))
        log_rho = [coefficients.single(k, u) for u in (h[:, None] - h, h[:, None] + h, h)]
        end, fine = _block(h, information[k], log_rho)
        if k:
            C = information[k] @ F[k - 1]
            both = fine[:, None] & used  # for these the argument is below 300
            with np.errstate(over="ignore", invalid="ignore"):
                cross = 4 * np.sinh(-h @ C @ shifts[k - 1].T / 4) * np.exp(coefficients.excess(k, shifts[k - 1], h))
            cross = projected(np.where(both, cross, 0.0).T, carried, before)
        bounds.append(projected(h, end - cross, end))
        if k < len(F):
            before, used = _block(h, information[k] + F[k].T @ information[k + 1] @ F[k], log_rho)
            carried = before - np.where(used[:, None] & used, cross, 0.0)
    found = np.stack(bounds)
    return 0.5 * (found + np.swapaxes(found, 1, 2))


def _block(h: ndarray, A: ndarray, log_rho: list[ndarray]) -> tuple[ndarray, ndarray]:
    """A diagonal block, and which of its shifts are of use."""

    def log_eta(u: ndarray, log_rho: ndarray) -> ndarray:
        return -np.einsum("...a,ab,...b->...", u, A, u) / 8 + log_rho

    difference, total, single = (
        log_eta(u, r) for u, r in zip((h[:, None] - h, h[:, None] + h, h), log_rho, strict=True)
    )
    return gram(difference, total, single), single > LEAST
