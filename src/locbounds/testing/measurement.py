"""What every measurement promises: one smooth number per position."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.testing.suite import run

POINTS, REACH_M = 20, 100.0
DIFFERENCE = 1e-5


def check_measurement(measurement: Any, *, dim: int | None = None) -> None:
    """Check a measurement of your own, ``h(position)``.

    Parameters
    ----------
    measurement
        Callable of a position [space], with an ``anchor`` [space].
    dim
        2 or 3; by default the anchor's.

    Raises
    ------
    Nonconforming
        Listing every check that fails.

    Notes
    -----
    ``anchor``: 2 or 3 finite coordinates. ``scalar``: one finite number per position. ``gradient``: JAX's derivative
    agrees with differences. ``at the anchor``: value and gradient are not NaN there. ``batches``: ``vmap`` gives what
    single positions give.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.testing import check_measurement
    >>> check_measurement(lb.Range([3.0, 4.0]))
    """
    run(measurement, CHECKS, len(measurement.anchor) if dim is None else dim)


def _points(measurement: Any, dim: int) -> Any:
    rng = np.random.default_rng(0)
    return np.asarray(measurement.anchor) + REACH_M * rng.normal(size=(POINTS, dim))


def _anchor(measurement: Any, dim: int) -> str | None:
    anchor = np.asarray(measurement.anchor)
    good = anchor.shape == (dim,) and dim in (2, 3) and np.all(np.isfinite(anchor))
    return None if good else f"it is {anchor}, in {dim} dimensions"


def _scalar(measurement: Any, dim: int) -> str | None:
    values = [np.asarray(measurement(jnp.asarray(p))) for p in _points(measurement, dim)]
    if any(v.shape != () for v in values):
        return f"h(position) has the shape {values[0].shape}, not that of a number"
    return None if np.all(np.isfinite(values)) else "h(position) is not finite away from the anchor"


def _gradient(measurement: Any, dim: int) -> str | None:
    step = 1e-4
    for p in _points(measurement, dim):
        slope = np.asarray(jax.grad(measurement)(jnp.asarray(p)))
        moves = step * np.eye(dim)
        expected = [(float(measurement(p + d)) - float(measurement(p - d))) / (2 * step) for d in moves]
        if not np.allclose(slope, expected, rtol=DIFFERENCE, atol=DIFFERENCE):
            return f"the derivative at {p.round(2)} is {slope}, by differences {np.array(expected)}"
    return None


def _at_the_anchor(measurement: Any, dim: int) -> str | None:
    at = jnp.asarray(measurement.anchor, dtype=float)
    value, slope = float(measurement(at)), np.asarray(jax.grad(measurement)(at))
    return "value or gradient is NaN" if np.isnan(value) or np.any(np.isnan(slope)) else None


def _batches(measurement: Any, dim: int) -> str | None:
    points = jnp.asarray(_points(measurement, dim))
    together, alone = np.asarray(jax.vmap(measurement)(points)), [float(measurement(p)) for p in points]
    return None if np.allclose(together, alone) else "vmap gives other numbers than single positions"


CHECKS = {
    "anchor": _anchor,
    "scalar": _scalar,
    "gradient": _gradient,
    "at the anchor": _at_the_anchor,
    "batches": _batches,
}
