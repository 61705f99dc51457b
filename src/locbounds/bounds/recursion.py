"""From increments of information about the last positions to the bound at every horizon.

Covariance form on a window of the last states: no inverse of the process noise or the prior, so that singular ones
work, and a cost linear in steps. With a window as long as the scenario it is the exact inverse of the whole
information matrix ``J_{0:k}`` at every k; with a shorter one, older information is kept as it was when it left the
window.
"""

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.linalg import symmetrize
from locbounds.scenario import Scenario


def covariance_recursion(
    scenario: Scenario, increments: Float[Array, "steps window space window space"]
) -> Float[Array, "times state state"]:
    """Bound on the mean square error matrix at steps 0..K.

    Parameters
    ----------
    scenario
        Motion and prior are taken from it.
    increments
        Information that the measurement of step k adds about the positions at ages 0..W-1 (age 0 is step k).

    Notes
    -----
    Window covariance S of [x_k, position at age 1, ..., position at age W-1]; predict ``S <- T S T' + Q``, update
    ``S <- S - S D (I + S_pp D)^-1 ...`` with the information increment D on the positions.
    """
    window, d = increments.shape[1:3]
    n = scenario.motion.state_size
    position = np.array(scenario.motion.position_index)
    size = n + d * (window - 1)
    observed = np.concatenate([position, np.arange(n, size)])
    shift = np.zeros((size, size))  # ages move on by one; the newest old position is taken from the state
    if window > 1:
        shift[n + np.arange(d), position] = 1.0
    shift[np.arange(n + d, size), np.arange(n, size - d)] = 1.0

    def step(S, inputs):
        F, Q, D = inputs
        T = jnp.asarray(shift).at[:n, :n].set(F)
        S = (T @ S @ T.T).at[:n, :n].add(Q)
        D = D.reshape(window * d, window * d)
        cross = S[:, observed]
        S = symmetrize(S - cross @ jnp.linalg.solve(jnp.eye(window * d) + D @ cross[observed], D @ cross.T))
        return S, S[:n, :n]

    P0 = jnp.asarray(scenario.prior.covariance)
    first = jnp.zeros((size, size)).at[:n, :n].set(P0)
    _, later = jax.lax.scan(step, first, (scenario.transition, scenario.process_noise, increments))
    return jnp.concatenate([P0[None], later])
