"""Standard errors from groups of draws (batch means)."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, ndarray


def standard_error(deviation: Float[Array, "groups *n"]) -> Float[ndarray, "*n"] | Any:
    """Standard error of a mean of independent, equally large groups, from their deviations from it.

    One group carries no error information: the mean is then exact by assertion and the error zero.

    >>> round(float(standard_error(np.array([1.0, -1.0, 1.0, -1.0]))), 4)
    0.5774
    """
    groups = len(deviation)
    if groups < 2:
        return np.zeros(np.shape(deviation)[1:])
    return np.sqrt(np.sum(np.square(deviation), axis=0) / (groups * (groups - 1)))


def deviations(group_means: Float[Array, "groups *n"]) -> tuple[Float[Array, "*n"], Float[Array, "groups *n"]]:
    """The mean over groups and each group's deviation from it.

    >>> mean, deviation = deviations(jnp.array([1.0, 3.0]))
    >>> float(mean), deviation.tolist()
    (2.0, [-1.0, 1.0])
    """
    mean = jnp.mean(group_means, axis=0)
    return mean, group_means - mean
