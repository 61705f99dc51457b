"""All cores that this process may use."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import jax

Item = TypeVar("Item")
R = TypeVar("R")


def on_all_cores(work: Callable[[Item], R], items: Iterable[Item]) -> list[R]:
    """What a function returns for every item, in order; a thread per core, in double precision.

    Threads suffice, as JAX and NumPy let others run while they compute. Let the function have been called once before:
    it is then compiled, and no thread compiles it again.

    >>> on_all_cores(abs, [-1, 2, -3])
    [1, 2, 3]
    """
    items = list(items)
    workers = min(_cores(), len(items))
    if workers < 2:
        return [_in_double_precision(work, item) for item in items]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda item: _in_double_precision(work, item), items))


def _in_double_precision(work: Callable[[Item], R], item: Item) -> R:
    with jax.enable_x64(True):  # the scope is per thread
        return work(item)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
