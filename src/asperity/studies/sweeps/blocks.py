"""Blocks: the chunks into which the results of a study are cut, each written at once.

Combinations are numbered in C order, the last axis fastest. A block is cut along one axis; it has
one place of each axis before that one and all places of those after it. So the numbers of its
combinations are consecutive, and it is one chunk of every array.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple


class SweepBlock(NamedTuple):
    """One chunk of every array."""

    slices: tuple[slice, ...]
    """Its places on each axis."""
    first: int
    """Number of its first combination."""
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """How many combinations it has."""
        return math.prod(self.shape)

    @property
    def places(self) -> slice:
        """The numbers of its combinations."""
        return slice(self.first, self.first + self.size)


def block_shape(shape: tuple[int, ...], most: int) -> tuple[int, ...]:
    """Return the shape of blocks of at most `most` combinations, and at least one."""
    out, room = [1] * len(shape), max(most, 1)
    for i in reversed(range(len(shape))):
        if shape[i] > room:
            out[i] = math.ceil(shape[i] / math.ceil(shape[i] / room))
            break
        out[i] = shape[i]
        room //= shape[i]
    return tuple(out)


def blocks(shape: tuple[int, ...], chunk: tuple[int, ...]) -> Iterator[SweepBlock]:
    """Yield the blocks of arrays of a shape, in the order of their combinations."""
    first = 0
    for starts in itertools.product(
        *(range(0, n, size) for n, size in zip(shape, chunk, strict=True))
    ):
        slices = tuple(
            slice(start, min(start + size, n))
            for start, size, n in zip(starts, chunk, shape, strict=True)
        )
        block = SweepBlock(slices, first, tuple(s.stop - s.start for s in slices))
        yield block
        first += block.size
