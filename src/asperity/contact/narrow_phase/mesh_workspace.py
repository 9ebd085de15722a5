"""The room that contact between facets works in, allocated once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.broad_phase.facet_bvh import BINS, FacetTable
from asperity.contact.manifold.overlap_region import FootprintSpace, footprint_space
from asperity.contact.narrow_phase.best_first import MAX_NODES
from asperity.contact.narrow_phase.records import NODE, PENETRATION

WINDOWS = 4
"""Most patches that the footprint of one direction is split into."""
MAX_PATCHES = 288
MAX_SURFACE_PATCHES = 4096
MAX_CANDIDATES = 32768


class PatchRows(NamedTuple):
    """The patches of one pose, before their forces are summed; rows are patches."""

    count: NDArray[np.int64]  # type: ignore[assignment]  # hides tuple.count
    """How many there are, and how often there was no room; (2,)."""
    where: NDArray[np.int64]
    """Body, direction and window, (n, 3)."""
    result: NDArray[np.void]
    """Penetration of each patch, `PENETRATION` records (n,)."""
    normal: NDArray[np.float64]
    """n of each, world axes, (n, 3)."""
    weight: NDArray[np.float64]
    """Part of the stiffness, (n,)."""


class FacetSpace(NamedTuple):
    """Room for contact between meshes, allocated once."""

    footprint: FootprintSpace
    rows: PatchRows
    slots: NDArray[np.int64]
    """Chart of each facet in the contact frame, (2, facets), and when it was made, (2, facets)."""
    geom_slots: NDArray[np.int64]
    """First patch, number of patches, and when they were made, of each geom; (3, geoms)."""
    clock: NDArray[np.int64]
    directions: NDArray[np.float64]
    """What is found of each direction; see `engine.touch`."""
    nodes: NDArray[np.void]
    """NODE records of the best-first search."""
    heap: NDArray[np.int64]
    """Numbers of the open nodes, the one with the largest bound on top."""
    keys: NDArray[np.float64]
    """Their bounds [m]."""
    retired: NDArray[np.int64]
    """Numbers of the nodes that a search has pruned or left."""
    left: NDArray[np.int64]
    """Number of retired nodes, of nodes after that search, and of nodes in use, (3,)."""
    lines: NDArray[np.float64]
    """Lines (in u and v) that windows are bounded by: (2, 3)."""
    frames: NDArray[np.float64]
    """Small rotations and places, (8, 3, 4)."""


def facet_space(table: FacetTable, geoms: int) -> FacetSpace:
    """Return room for contact between bodies of these facets."""
    facets = len(table.sides)
    return FacetSpace(
        footprint=footprint_space(facets),
        rows=PatchRows(
            count=np.zeros(2, np.int64),
            where=np.zeros((MAX_PATCHES, 3), np.int64),
            result=np.zeros(MAX_PATCHES, PENETRATION),
            normal=np.zeros((MAX_PATCHES, 3)),
            weight=np.zeros(MAX_PATCHES),
        ),
        slots=np.zeros((4, facets), np.int64),
        geom_slots=np.zeros((3, geoms), np.int64),
        clock=np.zeros(1, np.int64),
        directions=np.zeros((BINS, 13)),
        nodes=np.zeros(MAX_NODES, NODE),
        heap=np.zeros(MAX_NODES, np.int64),
        keys=np.zeros(MAX_NODES),
        retired=np.zeros(MAX_NODES, np.int64),
        left=np.zeros(3, np.int64),
        lines=np.zeros((2, 3)),
        frames=np.zeros((8, 3, 4)),
    )
