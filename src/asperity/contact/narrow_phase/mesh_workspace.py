"""Memory of contact between meshes, allocated once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.broad_phase.facet_bvh import BINS, FacetTable
from asperity.contact.manifold.overlap_region import FootprintSpace, footprint_space
from asperity.contact.narrow_phase.best_first import NodeQueue, node_queue
from asperity.contact.narrow_phase.records import PATCH_SLOT, PENETRATION

WINDOWS = 4
"""Most patches that the footprint of one direction is split into."""
MAX_PATCHES = 288
MAX_SURFACE_PATCHES = 4096
"""Most surface patches of either body in one query."""
MAX_CANDIDATES = 32768
"""Most pairs of surface patches in one query."""


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
    """Memory of contact between meshes, allocated once."""

    footprint: FootprintSpace
    rows: PatchRows
    slots: NDArray[np.void]
    """PATCH_SLOT records: the surface patch of each facet of A and of B, (2, facets)."""
    geom_slots: NDArray[np.void]
    """PATCH_SLOT records: the surface patches of each geom, (geoms,)."""
    clock: NDArray[np.int64]
    """Number of the last query, (1,)."""
    directions: NDArray[np.float64]
    """What is found of each direction; see `engine.touch`."""
    queue: NodeQueue
    lines: NDArray[np.float64]
    """Lines that bound sub-regions, `l_u u + l_v v + l_0 = 0`, (2, 3)."""
    frames: NDArray[np.float64]
    """Small rotations and places, (8, 3, 4)."""


def facet_space(table: FacetTable, geoms: int) -> FacetSpace:
    """Return memory for contact between bodies of these facets."""
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
        slots=np.zeros((2, facets), PATCH_SLOT),
        geom_slots=np.zeros(geoms, PATCH_SLOT),
        clock=np.zeros(1, np.int64),
        directions=np.zeros((BINS, 13)),
        queue=node_queue(),
        lines=np.zeros((2, 3)),
        frames=np.zeros((8, 3, 4)),
    )
