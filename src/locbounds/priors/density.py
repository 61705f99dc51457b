"""A prior known by its density."""

from collections.abc import Callable
from typing import Any

import equinox as eqx

from locbounds.errors import InputError


class DensityPrior(eqx.Module):
    """Law of the state at step 0, given by a log-density and a sampler.

    Parameters
    ----------
    log_density
        ``log_density(x)``: log-density of one state [state], differentiable by JAX; constants do not matter.
    sample
        ``sample(key)``: one draw [state].

    Raises
    ------
    InputError
        If one of them cannot be called.

    Notes
    -----
    The density must be smooth and vanish where it ends: its information is ``E[grad log p grad log p^T]``.

    Examples
    --------
    >>> import jax, jax.numpy as jnp
    >>> prior = DensityPrior(lambda x: jnp.sum(-jnp.logaddexp(x, -x)), lambda key: jax.random.logistic(key, (2,)) / 2)
    >>> float(prior.log_density(jnp.zeros(2))) < 0
    True
    """

    log_density: Callable[..., Any]
    sample: Callable[..., Any]

    def __check_init__(self):
        if not (callable(self.log_density) and callable(self.sample)):
            raise InputError("log_density and sample of a prior must be functions", "Give log_density(x), sample(key)")
