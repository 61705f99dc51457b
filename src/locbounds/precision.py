"""Double precision at one boundary.

Importing locbounds never switches the user's JAX configuration. Every public function that computes is decorated
with :func:`double_precision`: plain calls run inside ``jax.enable_x64(True)`` and return NumPy float64; calls that
carry JAX tracers (``grad``, ``jit``, ``vmap``) go straight to the kernel, if the caller's JAX computes in double
precision, and raise :class:`~locbounds.errors.PrecisionError` otherwise. A call inside a user's ``jit`` that depends on
none of its arguments is a plain call: it is computed at once, and is a constant of the compiled function.
"""

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, ParamSpec, TypeVar

import jax
import jax.core
import jax.numpy as jnp
import numpy as np

from locbounds.errors import PrecisionError

P = ParamSpec("P")
R = TypeVar("R")


def _is_tracer(leaf: Any) -> bool:
    return isinstance(leaf, jax.core.Tracer)


def traced(*values: Any) -> bool:
    """Whether any array in these values is being traced by a JAX transformation."""
    return any(_is_tracer(leaf) for leaf in jax.tree.leaves(values))


def _widen(leaf: Any) -> Any:
    """A concrete floating-point array as NumPy float64; anything else unchanged."""
    if isinstance(leaf, jax.Array | np.ndarray) and not jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
        array = np.asarray(leaf)
        return array.astype(np.float64) if array.dtype.kind == "f" else array
    return leaf


def _at_once() -> AbstractContextManager:
    """Compute now even inside a user's ``jit``, which would otherwise take over everything that is computed."""
    being_traced = _is_tracer(jnp.zeros(()))
    return jax.ensure_compile_time_eval() if being_traced else nullcontext()


def double_precision(function: Callable[P, R]) -> Callable[P, R]:
    """Run a function in double precision, whatever the caller's JAX configuration is.

    Examples
    --------
    >>> import numpy as np, jax.numpy as jnp
    >>> @double_precision
    ... def third(x):
    ...     return jnp.asarray(x) / 3
    >>> third(np.ones(2)).dtype
    dtype('float64')
    """

    @functools.wraps(function)
    def boundary(*args: P.args, **kwargs: P.kwargs) -> R:
        if traced(args, kwargs):
            if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
                raise PrecisionError(
                    f"{function.__name__} is being transformed by JAX (grad, jit or vmap) in single precision",
                    'Add the line jax.config.update("jax_enable_x64", True) before the first use of JAX',
                )
            return function(*args, **kwargs)
        with _at_once(), jax.enable_x64(True):
            args, kwargs = jax.tree.map(_widen, (args, kwargs))
            return jax.tree.map(_widen, function(*args, **kwargs))

    return boundary


def float64(value: Any) -> Any:
    """A model leaf: NumPy float64, or a traced array (also from a list with tracers) while JAX transforms the model."""
    if value is None or type(value) is object:  # object(): what JAX puts into a pytree to look at its structure
        return value
    return jnp.asarray(value, dtype=float) if traced(value) else np.asarray(value, dtype=np.float64)
