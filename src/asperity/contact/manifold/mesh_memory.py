"""What contact with meshes remembers from one tick to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.neighbour_records import (
    NeighbourList,
    clear_lists,
    neighbour_list,
)
from asperity.contact.manifold.records import MAX_PARTS


class MeshMemory(NamedTuple):
    """State of contact with each scene body in each of the six directions."""

    known: NDArray[np.int64]
    """Whether the tool was near the body in the last tick, (bodies,)."""
    active: NDArray[np.int64]
    """Whether there was contact, (bodies, 6)."""
    depth: NDArray[np.float64]
    """Mean depth of the patches [m], (bodies, 6): 0 where they did not touch, -inf where nothing
    overlapped, inf where the overlap was too deep to be a contact."""
    deepest: NDArray[np.float64]
    """Depth of the deepest patch [m], (bodies, 6); -inf where nothing overlapped."""
    guess: NDArray[np.float64]
    """Deepest point of each patch in the tool's frame [m], (bodies, 6, 4, 3); nan if unknown."""
    frame: NDArray[np.float64]
    """The tool's frame in the last tick, (3, 4)."""
    has_frame: NDArray[np.int64]
    """Whether there was a last tick, (1,)."""
    bristle: NDArray[np.float64]
    """Deflection of each patch's bristle in the body's frame [m], (bodies, 6, 4, 3)."""
    in_contact: NDArray[np.bool_]
    """Whether there was contact in any direction, so that MuJoCo's query is not needed; (bodies,).
    """
    lists: NeighbourList
    """Pairs of facets near each other."""


def mesh_memory(bodies: int) -> MeshMemory:
    """Allocate the memory for a scene of `bodies` bodies, with no contact in it."""
    return MeshMemory(
        known=np.zeros(bodies, np.int64),
        active=np.zeros((bodies, DIRECTIONS), np.int64),
        depth=np.full((bodies, DIRECTIONS), -np.inf),
        deepest=np.full((bodies, DIRECTIONS), -np.inf),
        guess=np.full((bodies, DIRECTIONS, MAX_PARTS, 3), np.nan),
        frame=np.zeros((3, 4)),
        has_frame=np.zeros(1, np.int64),
        bristle=np.zeros((bodies, DIRECTIONS, MAX_PARTS, 3)),
        in_contact=np.zeros(bodies, np.bool_),
        lists=neighbour_list(bodies),
    )


def forget(memory: MeshMemory) -> None:
    """Reset the memory to that of a tool that has not touched anything."""
    memory.known[:] = 0
    memory.has_frame[:] = 0
    memory.active[:] = 0
    memory.depth[:] = -np.inf
    memory.deepest[:] = -np.inf
    memory.guess[:] = np.nan
    memory.bristle[:] = 0.0
    memory.in_contact[:] = False
    clear_lists(memory.lists)
