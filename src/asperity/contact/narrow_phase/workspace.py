"""Scratch memory of a search for the deepest point between two bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.structures import by_reference
from asperity.contact.narrow_phase.records import CANDIDATE, PATCH, SEARCH


@by_reference
class Workspace(NamedTuple):
    """Scratch memory of a search for the deepest point between two bodies, allocated once."""

    patches_a: NDArray[np.void]
    """PATCH records of the tool A."""
    patches_b: NDArray[np.void]
    """PATCH records of the body B."""
    candidates: NDArray[np.void]
    """CANDIDATE records: pairs of patches."""
    search: NDArray[np.void]
    """One SEARCH record."""
    frame: NDArray[np.float64]
    """Axes u, v, n of the contact frame in its rows, world axes, (3, 3)."""
    vectors: NDArray[np.float64]
    """Scratch memory of a tick, (10, 3)."""
    near: NDArray[np.float64]
    """Rotation and translation of both bodies from the contact's origin, (2, 3, 4)."""


def workspace(patches: int, pairs: int) -> Workspace:
    """Allocate memory for `patches` patches of each body and `pairs` candidates."""
    return Workspace(
        np.zeros(patches, PATCH),
        np.zeros(patches, PATCH),
        np.zeros(pairs, CANDIDATE),
        np.zeros(1, SEARCH),
        np.zeros((3, 3)),
        np.zeros((10, 3)),
        np.zeros((2, 3, 4)),
    )
