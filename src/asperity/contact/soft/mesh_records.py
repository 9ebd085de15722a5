"""Records of mesh facets for the exits of rays from a mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices
from asperity._core.structures import by_reference
from asperity.geometry.facets.facets import MOST_SIDES

FACET = np.dtype(
    [
        ("origin", "f8", 3),  # middle of its rectangle in the geom's frame [m]
        ("axes", "f8", (3, 3)),  # x, y and the outward normal of its plane, in rows
        ("w", "f8", (3, 3)),  # in these axes: at the origin [-], by x and by y [1/m]
        ("is_level", "?"),  # w is the normal everywhere
        ("place", "f8", (3, 2)),  # (u, v) on the texture [m]: at the origin, by x, by y
        ("half", "f8", 2),  # half sides of the rectangle, with the facet's extensions [m]
        ("sides", "i8"),
        # k0 + k1 x + k2 y <= 0 within, for each side, and the extension beyond it [m].
        ("borders", "f8", (MOST_SIDES, 4)),
        ("slope", "f8"),  # bound of the texture's slope along the facet [-]
        ("bend", "f8"),  # bound of the second derivative of the displaced surface [1/m]
        ("lean", "f8"),  # largest distance of w from the normal [-]
        ("first", "i8"),  # first of its neighbours, and one past the last
        ("last", "i8"),
        ("has_corners", "?"),  # some of them touch it only at a corner
    ],
    align=True,
)
"""A facet of a mesh; see `geometry.facets` and `facet_edges`."""

NODE = np.dtype(
    [
        ("middle", "f8", 3),  # [m]
        ("reach", "f8", 3),  # half sides [m]
        ("after", "i8"),  # next box that is not its descendant
        ("first", "i8"),  # first facet of a leaf, and one past the last; equal for inner boxes
        ("last", "i8"),
    ],
    align=True,
)
"""A box of the tree over facets, in the geom's frame, followed by its descendants."""

NEIGHBOUR = np.dtype([("facet", "i8"), ("is_convex", "?")], align=True)
"""A facet that touches another one along an edge or at a corner, and whether that is convex."""


@by_reference
class MeshFacets(NamedTuple):
    """The facets of all meshes among some solids."""

    facets: NDArray[np.void]
    """`FACET` records."""
    nodes: NDArray[np.void]
    """`NODE` records."""
    neighbours: NDArray[np.void]
    """`NEIGHBOUR` records."""
    root: Indices
    """First box of each geom that is a mesh, (geoms,)."""
    grow: Array
    """Largest distance of the textured surface outside the boxes of a geom [m], (geoms,)."""
