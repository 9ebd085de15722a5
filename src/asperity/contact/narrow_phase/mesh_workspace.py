"""Scratch memory of contact between meshes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.structures import by_reference
from asperity.contact.broad_phase.facet_bvh import FacetTable
from asperity.contact.broad_phase.polyhedra import MOST_EDGES, MOST_FACES
from asperity.contact.manifold.overlap_region import OverlapRegion, overlap_region
from asperity.contact.manifold.records import (
    DIRECTION,
    MAX_DIRECTIONS,
    OVERLAP_SUMS,
    ContactManifold,
    contact_manifold,
)
from asperity.contact.manifold.residual import Residuals, residuals
from asperity.contact.narrow_phase.node_queue import NodeQueue, node_queue
from asperity.contact.narrow_phase.records import PATCH_SLOT
from asperity.contact.records import MAX_SEPARATIONS, SEPARATION
from asperity.contact.response.mesh_choices import MeshChoices, mesh_choices
from asperity.contact.response.ways_out import WaysOut, ways_out

MAX_SURFACE_PATCHES = 4096
"""Maximum number of surface patches of each body in one query."""
MAX_CANDIDATES = 32768
"""Maximum number of pairs of surface patches in one query."""


@by_reference
class PolyhedronSpace(NamedTuple):
    """Scratch memory of contact between convex polyhedra."""

    rows: NDArray[np.void]
    """`SEPARATION` records, B's frame; (separations,)."""
    used: NDArray[np.int64]
    """Number of them that count, (1,)."""
    rates: NDArray[np.float64]
    """Derivative of the way out by the tool's motion with all depths fixed, B's frame, (6,)."""
    faces: NDArray[np.void]
    """`OVERLAP_SUMS` of each face of B, (MOST_FACES,)."""
    edges: NDArray[np.float64]
    """A's edges in B's frame and the normals beside them, (MOST_EDGES, 3, 3)."""
    ways: WaysOut
    """Choices of separations."""


def polyhedron_space() -> PolyhedronSpace:
    """Allocate memory for contact between convex polyhedra."""
    return PolyhedronSpace(
        rows=np.zeros(MAX_SEPARATIONS, SEPARATION),
        used=np.zeros(1, np.int64),
        rates=np.zeros(6),
        faces=np.zeros(MOST_FACES, OVERLAP_SUMS),
        edges=np.zeros((MOST_EDGES, 3, 3)),
        ways=ways_out(MAX_SEPARATIONS),
    )


@by_reference
class FacetSpace(NamedTuple):
    """Scratch memory of contact between meshes, allocated once."""

    region: OverlapRegion
    manifold: ContactManifold
    slots: NDArray[np.void]
    """PATCH_SLOT records: the surface patch of each facet of A and of B, (2, facets)."""
    geom_slots: NDArray[np.void]
    """PATCH_SLOT records: the surface patches of each geom, (geoms,)."""
    listed: NDArray[np.int64]
    """Numbers of the facet pairs that may touch along n, (MAX_CANDIDATES,)."""
    clock: NDArray[np.int64]
    """Number of the last query, (1,)."""
    directions: NDArray[np.void]
    """`DIRECTION` records, (24,)."""
    residuals: Residuals
    """How much of each direction remains after the tool has left by another."""
    choices: MeshChoices
    """Choices of directions to leave by."""
    polyhedra: PolyhedronSpace
    way_out: NDArray[np.float64]
    """Way out of the tool from each body [m], (bodies,)."""
    rest: NDArray[np.float64]
    """The part of its gradient by the tool's motion that does not act at patches, (bodies, 6)."""
    spent: NDArray[np.float64]
    """Nodes evaluated by the searches of the current body, (1,)."""
    energy: NDArray[np.float64]
    """Energy of contact with each body [J], (bodies,)."""
    queue: NodeQueue
    lines: NDArray[np.float64]
    """Lines that bound sub-regions, `l_u u + l_v v + l_0 = 0`, (2, 3)."""
    stiffness: NDArray[np.float64]
    """Of contact with each body [N/m], (bodies,)."""
    friction: NDArray[np.float64]
    """Coulomb's coefficient of contact with each body without a friction map [-], (bodies,)."""


def facet_space(table: FacetTable, geoms: int) -> FacetSpace:
    """Allocate memory for contact between bodies with these facets."""
    facets = len(table.sides)
    return FacetSpace(
        region=overlap_region(facets),
        manifold=contact_manifold(),
        slots=np.zeros((2, facets), PATCH_SLOT),
        geom_slots=np.zeros(geoms, PATCH_SLOT),
        listed=np.zeros(MAX_CANDIDATES, np.int64),
        clock=np.zeros(1, np.int64),
        directions=np.zeros(MAX_DIRECTIONS, DIRECTION),
        residuals=residuals(),
        choices=mesh_choices(),
        polyhedra=polyhedron_space(),
        way_out=np.zeros(len(table.root)),
        rest=np.zeros((len(table.root), 6)),
        spent=np.zeros(1),
        energy=np.zeros(len(table.root)),
        queue=node_queue(),
        lines=np.zeros((2, 3)),
        stiffness=np.zeros(len(table.root)),
        friction=np.zeros(len(table.root)),
    )
