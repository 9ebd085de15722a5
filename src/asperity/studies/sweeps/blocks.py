"""The results of a study cut into blocks: each a chunk of every array, and a run of combinations.

Combinations are numbered in the order of the axes, the last one fastest. A block is cut along one
axis, has one place of each axis before it and all of those after it: so its combinations have
consecutive numbers, and it is one chunk of every array, which is written at once and never read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple


class Block(NamedTuple):
    """One chunk of every array."""

    slices: tuple[slice, ...]
    first: int
    """Number of its first combination."""
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """How many combinations it has."""
        return math.prod(self.shape)


def block_shape(shape: tuple[int, ...], most: int) -> tuple[int, ...]:
    """Return the shape of blocks of at most `most` combinations, but of one at least."""
    out, room = [1] * len(shape), max(most, 1)
    for i in reversed(range(len(shape))):
        if shape[i] > room:
            out[i] = math.ceil(shape[i] / math.ceil(shape[i] / room))
            break
        out[i] = shape[i]
        room //= shape[i]
    return tuple(out)


def blocks(shape: tuple[int, ...], chunk: tuple[int, ...]) -> Iterator[Block]:
    """Yield the blocks of arrays of a shape, in the order of their combinations."""
    starts = [range(0, n, c) for n, c in zip(shape, chunk, strict=True)]
    number = 0
    for flat in range(math.prod(len(s) for s in starts)):
        place, rest = [0] * len(shape), flat
        for i in reversed(range(len(shape))):
            rest, k = divmod(rest, len(starts[i]))
            place[i] = starts[i][k]
        stops = [min(p + c, n) for p, c, n in zip(place, chunk, shape, strict=True)]
        block = Block(
            tuple(slice(p, s) for p, s in zip(place, stops, strict=True)),
            number,
            tuple(s - p for p, s in zip(place, stops, strict=True)),
        )
        yield block
        number += block.size
