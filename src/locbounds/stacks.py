"""Equally structured pytrees as one whose arrays have a leading axis: traced and compiled once for all of them."""

from collections.abc import Iterable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def stacks(trees: Iterable[Any]) -> list[tuple[np.ndarray, Any]]:
    """Which trees are alike, and each such group as one tree for ``jax.vmap``.

    Examples
    --------
    >>> [(index.tolist(), tree.tolist()) for index, tree in stacks([np.zeros(2), np.zeros(3), np.ones(2)])]
    [([0, 2], [[0.0, 0.0], [1.0, 1.0]]), ([1], [[0.0, 0.0, 0.0]])]
    """
    trees = list(trees)
    groups: dict[Any, list[int]] = {}
    for m, tree in enumerate(trees):
        leaves, structure = jax.tree.flatten(tree)
        groups.setdefault((structure, tuple((np.shape(x), jnp.result_type(x)) for x in leaves)), []).append(m)

    def stack(*leaves):
        return (jnp if any(isinstance(x, jax.Array) for x in leaves) else np).stack(leaves)

    return [(np.array(index), jax.tree.map(stack, *(trees[m] for m in index))) for index in groups.values()]
