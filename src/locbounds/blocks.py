"""Blocks of randomness: the unit of work, of resume and of distribution.

Draws come in blocks of fixed size; block ``b`` of stream ``s`` uses ``fold_in(fold_in(key(seed), s), b)``. A result is
therefore the same for any chunking, and grows by adding blocks.
"""

from enum import IntEnum

import jax

from locbounds.axes import Array
from locbounds.errors import InputError

GROUPS = 32  # block groups kept apart: every standard error comes from the spread over these


class Stream(IntEnum):
    """Independent random streams of one seed."""

    TRACKS = 0
    SIGHT_AND_NOISE = 1
    MEASUREMENTS = 2
    SCHEDULES = 3
    FILTER = 4


def check_seed(seed: int) -> int:
    """The seed as an int, or an InputError."""
    if isinstance(seed, bool) or int(seed) != seed or not 0 <= seed < 2**32:
        raise InputError(f"the seed is {seed!r}", "Give a whole number from 0 to 2^32 - 1")
    return int(seed)


def block_key(seed: int | Array, stream: Stream, block: int | Array) -> Array:
    """The key of one block.

    >>> block_key(0, Stream.TRACKS, 3).shape
    ()
    """
    return jax.random.fold_in(jax.random.fold_in(jax.random.key(seed), int(stream)), block)
