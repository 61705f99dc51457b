"""Any linear Gaussian motion, matrix by matrix."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.linalg import is_positive_semidefinite
from locbounds.motion.base import Motion
from locbounds.precision import float64, traced


class LinearMotion(Motion):
    """Linear Gaussian motion with its own F and Q at every step.

    Parameters
    ----------
    F
        [steps, state, state]: ``x_k = F[k-1] x_{k-1} + v_k`` for k = 1..K.
    Q
        [steps, state, state]: covariances of v_k, positive semidefinite, possibly singular.
    position_index
        Which state components are the position.
    state_names
        Names of the components with units; ``x0``, ``x1``, ... if left out.

    Raises
    ------
    InputError
        If shapes do not match, a Q is not positive semidefinite, or the scenario has another number of steps.

    Examples
    --------
    >>> LinearMotion(np.ones((5, 1, 1)), np.ones((5, 1, 1)), position_index=(0,)).transitions(np.ones(5)).shape
    (5, 1, 1)
    """

    F: Float[Array, "steps state state"] = eqx.field(converter=float64)
    Q: Float[Array, "steps state state"] = eqx.field(converter=float64)
    index: tuple[int, ...] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)

    def __init__(self, F, Q, *, position_index=(0, 1), state_names=None):
        self.F, self.Q = F, Q
        self.index = tuple(int(i) for i in position_index)
        n = np.shape(F)[-1] if np.ndim(F) else 0
        self.names = tuple(f"x{i}" for i in range(n)) if state_names is None else tuple(state_names)

    def __check_init__(self):
        if self.F.ndim != 3 or self.F.shape[1] != self.F.shape[2] or self.Q.shape != self.F.shape:
            raise InputError(
                f"F has shape {self.F.shape}, Q has shape {self.Q.shape}",
                "Give [steps, state, state] each; np.broadcast_to(F, (steps, n, n)) repeats one matrix",
            )
        n = self.F.shape[1]
        if len(self.names) != n:
            raise InputError(f"there are {len(self.names)} state names for {n} components", "Give one each")
        if not self.index or len(set(self.index)) < len(self.index) or not set(self.index) <= set(range(n)):
            raise InputError(f"the position is {self.index} of {n} state components", "Name different components")
        if traced(self.F, self.Q):
            return
        if not np.all(np.isfinite(self.F)):
            raise InputError("F holds numbers that are not finite", "Correct them")
        for k, Q in enumerate(self.Q, start=1):
            if not is_positive_semidefinite(Q):
                raise InputError(
                    f"Q of step {k} is not positive semidefinite", "Give a symmetric one, eigenvalues >= 0"
                )

    @property
    def state_names(self) -> tuple[str, ...]:
        return self.names

    @property
    def position_index(self) -> tuple[int, ...]:
        return self.index

    def transition(self, dt: Scalar) -> Float[Array, "state state"]:
        raise RefusedError("this motion is given step by step, not as a function of an interval", "Use transitions")

    def covariance(self, dt: Scalar) -> Float[Array, "state state"]:
        raise RefusedError("this motion is given step by step, not as a function of an interval", "Use covariances")

    def transitions(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps state state"]:
        return jnp.asarray(self._fitting(intervals).F)

    def covariances(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps state state"]:
        return jnp.asarray(self._fitting(intervals).Q)

    def _fitting(self, intervals: Float[Array, " steps"]) -> "LinearMotion":
        if len(intervals) != len(self.F):
            raise InputError(
                f"the motion has matrices for {len(self.F)} steps, the times for {len(intervals)}",
                "Give one F and one Q per step",
            )
        return self


def whitened(
    F: Float[ndarray, "steps state state"],
    first: Float[ndarray, "state numbers"],
    roots: Float[ndarray, "steps state inputs"],
) -> Float[ndarray, "times state theta"]:
    """How independent standard normal numbers theta (those of x_0, then those of every step) make the states.

    Parameters
    ----------
    F
        ``x_k = F[k-1] x_{k-1} + v_k`` for k = 1..K.
    first, roots
        Any matrices R whose ``R R'`` are the covariances of x_0 and of v_1..v_K.

    Returns
    -------
    X
        [steps+1, state, theta]: the deviation of x_k from its mean is ``X_k theta``.

    Examples
    --------
    >>> whitened(np.ones((2, 1, 1)), np.array([[2.0]]), np.array([[[1.0]], [[3.0]]]))[:, 0].tolist()
    [[2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 1.0, 3.0]]
    """
    steps, _, inputs = roots.shape
    start = first.shape[1]
    X = np.zeros((steps + 1, len(first), start + steps * inputs))
    X[0, :, :start] = first
    for k in range(1, steps + 1):
        X[k] = F[k - 1] @ X[k - 1]
        X[k, :, start + (k - 1) * inputs : start + k * inputs] = roots[k - 1]
    return X
