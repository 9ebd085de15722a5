"""State of contact with meshes that is kept from one tick to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.structures import by_reference
from asperity.contact.broad_phase.neighbour_records import (
    NeighbourList,
    clear_lists,
    neighbour_list,
)
from asperity.contact.manifold.records import MAX_DIRECTIONS, MAX_PARTS


@by_reference
class MeshMemory(NamedTuple):
    """State of the last tick: start points of searches, and deflections of bristles."""

    known: NDArray[np.int64]
    """Whether the tool was near the body in the last tick, (bodies,)."""
    way_out: NDArray[np.float64]
    """Way out of the tool from the body [m], (bodies,)."""
    guess: NDArray[np.float64]
    """Deepest point of each patch in the tool's frame [m], (bodies, 24, 4, 3); nan if unknown."""
    frame: NDArray[np.float64]
    """The tool's frame in the last tick, (3, 4)."""
    has_frame: NDArray[np.int64]
    """Whether there was a last tick, (1,)."""
    bristle: NDArray[np.float64]
    """Deflection of each patch's bristle in the body's frame [m], (bodies, 24, 4, 3)."""
    in_contact: NDArray[np.bool_]
    """Whether there was contact, so that MuJoCo's query is not needed; (bodies,)."""
    lists: NeighbourList
    """Lists of nearby facet pairs."""


def mesh_memory(bodies: int) -> MeshMemory:
    """Allocate the memory for a scene of `bodies` bodies, with no contact in it."""
    return MeshMemory(
        known=np.zeros(bodies, np.int64),
        way_out=np.zeros(bodies),
        guess=np.full((bodies, MAX_DIRECTIONS, MAX_PARTS, 3), np.nan),
        frame=np.zeros((3, 4)),
        has_frame=np.zeros(1, np.int64),
        bristle=np.zeros((bodies, MAX_DIRECTIONS, MAX_PARTS, 3)),
        in_contact=np.zeros(bodies, np.bool_),
        lists=neighbour_list(bodies),
    )


def forget(memory: MeshMemory) -> None:
    """Reset the memory to that of a tool that has not touched anything."""
    memory.known[:] = 0
    memory.has_frame[:] = 0
    memory.way_out[:] = 0.0
    memory.guess[:] = np.nan
    memory.bristle[:] = 0.0
    memory.in_contact[:] = False
    clear_lists(memory.lists)
