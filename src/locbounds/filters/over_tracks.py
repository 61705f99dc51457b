"""Run a kernel over any number of tracks, in chunks that fit the cache, on all cores."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array
from locbounds.cores import on_all_cores
from locbounds.precision import traced

# XLA's CPU compiler drops optimisation barriers before it fuses; without that pass they hold, here three times as fast.
CPU_OPTIONS = {"xla_disable_hlo_passes": "cse_barrier_expander"}
ELEMENTS = 4096  # hypotheses x tracks per pass on a CPU: large against the cost of a pass, small enough for the cache
ACCELERATOR_TRACKS = 65_536  # tracks per call elsewhere


def over_tracks(
    kernel: Callable[..., Any],
    model: Any,
    data: tuple[Array, ...],
    first: tuple[Array, ...],
    *,
    hypotheses: int,
    **static: Any,
) -> tuple[Any, ...]:
    """Run a kernel over all tracks, in chunks that fit the cache, on all cores.

    Parameters
    ----------
    kernel
        ``kernel(model, *data, **static)`` with data [steps, links, tracks]; returns a tuple of arrays (or None)
        [steps, ..., tracks].
    model
        Pytree of arrays shared by all tracks.
    data
        Arrays [runs, steps, links].
    first
        The results' rows at step 0, the same for all tracks.
    hypotheses
        Rows of the arrays [rows, tracks] that the kernel works on: sets how many tracks make a chunk.
    static
        Hashable options of the kernel.

    Returns
    -------
    tuple of arrays or None
        The kernel's results with the tracks first and step 0 added, [runs, steps+1, ...].
    """
    if traced(model, data):
        results = kernel(model, *(jnp.moveaxis(jnp.asarray(d), 0, -1) for d in data), **static)
        return tuple(
            None if r is None else _with_first(row, jnp.moveaxis(r, -1, 0))
            for r, row in zip(results, first, strict=True)
        )
    on_cpu = jax.default_backend() == "cpu"
    run = _compiled(kernel, tuple(sorted(static)), on_cpu)
    runs = len(data[0])
    size = max(8, ELEMENTS // hypotheses) if on_cpu else ACCELERATOR_TRACKS
    size = min(size, 1 << max(3, (runs - 1).bit_length()))  # few shapes, few compilations
    model = jax.tree.map(jnp.asarray, model)

    def compute(begin: int) -> tuple[np.ndarray | None, ...]:
        parts = run(model, *(_chunk(d, begin, size) for d in data), **static)
        return tuple(None if part is None else np.moveaxis(np.asarray(part), -1, 0) for part in parts)

    def store(begin: int, parts: tuple[np.ndarray | None, ...]) -> None:
        for result, part in zip(results, parts, strict=True):
            if result is not None and part is not None:
                rows = result[begin : begin + size, 1:]
                rows[...] = part[: len(rows)]

    parts = compute(0)  # compiles, once
    results = [None if p is None else np.empty((runs, p.shape[1] + 1, *p.shape[2:])) for p in parts]
    for result, row in zip(results, first, strict=True):
        if result is not None:
            result[:, 0] = row
    store(0, parts)
    on_all_cores(lambda begin: store(begin, compute(begin)), range(size, runs, size))
    return tuple(results)


def _with_first(row: Array, later: Array) -> Array:
    return jnp.concatenate([jnp.broadcast_to(row, (len(later), 1, *row.shape)), later], axis=1)


def _chunk(data: Array, begin: int, size: int) -> np.ndarray:
    """``data[begin:begin+size]`` with the tracks last; the last track is repeated where there are too few."""
    part = np.asarray(data[begin : begin + size])
    if len(part) < size:
        part = np.concatenate([part, np.repeat(part[-1:], size - len(part), axis=0)])
    return np.ascontiguousarray(np.moveaxis(part, 0, -1))


@functools.cache
def _compiled(kernel: Callable[..., Any], static: tuple[str, ...], on_cpu: bool) -> Callable[..., Any]:
    return jax.jit(kernel, static_argnames=static, compiler_options=CPU_OPTIONS if on_cpu else None)
