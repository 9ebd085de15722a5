"""What contact between meshes is handed from tick to tick, and the room that it works in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.broad_phase.facet_bvh import BINS
from asperity.contact.broad_phase.neighbour_records import NotedFacets, note_nothing, noted_facets
from asperity.contact.narrow_phase.mesh_workspace import WINDOWS


class FacetMemory(NamedTuple):
    """What is remembered of each body of the scene and each direction; see `touch`."""

    known: NDArray[np.int64]
    """Whether the body was met at the last pose, (bodies,)."""
    active: NDArray[np.int64]
    """Whether there was contact, (bodies, 6)."""
    depth: NDArray[np.float64]
    """Of the textured surfaces, the patches' mean [m]: 0 where they do not touch, -inf where
    nothing overlapped, inf where it was too deep to be a contact; (bodies, 6)."""
    deepest: NDArray[np.float64]
    """Of the deepest patch [m]; -inf where nothing overlapped; (bodies, 6)."""
    guess: NDArray[np.float64]
    """Deepest place of each patch in the tool's frame, nan if unknown; (bodies, 6, 4, 3)."""
    pose: NDArray[np.float64]
    """The tool's last rotation and position, (3, 4);"""
    at: NDArray[np.int64]
    """and whether there was one, (1,)."""
    bristle: NDArray[np.float64]
    """Deflection of each patch's bristle in the body's frame [m], (bodies, 6, 4, 3)."""
    held: NDArray[np.bool_]
    """Whether a body is in contact, of which MuJoCo need not be asked; (bodies,)."""
    noted: NotedFacets
    """What facets were near each body."""


def facet_memory(bodies: int) -> FacetMemory:
    """Return a memory of nothing."""
    return FacetMemory(
        known=np.zeros(bodies, np.int64),
        active=np.zeros((bodies, BINS), np.int64),
        depth=np.full((bodies, BINS), -np.inf),
        deepest=np.full((bodies, BINS), -np.inf),
        guess=np.full((bodies, BINS, WINDOWS, 3), np.nan),
        pose=np.zeros((3, 4)),
        at=np.zeros(1, np.int64),
        bristle=np.zeros((bodies, BINS, WINDOWS, 3)),
        held=np.zeros(bodies, np.bool_),
        noted=noted_facets(bodies),
    )


def forget(memory: FacetMemory) -> None:
    """Make a memory one of nothing."""
    memory.known[:] = 0
    memory.at[:] = 0
    memory.active[:] = 0
    memory.depth[:] = -np.inf
    memory.deepest[:] = -np.inf
    memory.guess[:] = np.nan
    memory.bristle[:] = 0.0
    memory.held[:] = False
    note_nothing(memory.noted)
