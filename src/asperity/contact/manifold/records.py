"""Records of the contact manifold, each one element of a structured array."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.structures import by_reference
from asperity.contact.narrow_phase.records import PENETRATION

MAX_PARTS = 4
"""Maximum number of parts of one direction's overlap region."""
MAX_DIRECTIONS = 24
"""Maximum number of directions in which the tool may leave a body: six, except of polyhedra."""
MAX_PATCHES = 288
"""Maximum number of patches in one tick."""

OVERLAP_SUMS = np.dtype(
    [
        ("volume", "f8"),  # integral of w = d + reach over the region [m^3]
        ("first_moment", "f8", 3),  # integral of w x, x a point on B's surface [m^4]
        ("second_moment", "f8", 6),  # integral of w x x^T: xx, xy, xz, yy, yz, zz [m^5]
        ("normal", "f8", 3),  # integral of w n [m^3]
        ("deepest", "f8"),  # largest overlap d of the smooth bodies [m]; -inf if none
        ("deepest_point", "f8", 3),  # point of A's surface where it is attained [m]
        ("deepest_slope", "f8", 3),  # m there: a motion v of A changes the overlap by -m . v
    ],
    align=True,
)
"""Integrals over the overlap region of one direction, in B's frame. d is the overlap [m]."""

DIRECTION = np.dtype(
    [
        ("normal", "f8", 3),  # unit normal of B's surface, B's frame
        ("depth", "f8"),  # root mean square of the patches' depths [m]; -inf if not searched
        ("first", "i8"),  # row of the first patch
        ("patches", "i8"),  # number of patches; 0 if not searched
        ("visited", "?"),  # whether it has been searched or skipped
        ("is_deferred", "?"),  # whether its depth is only known to be within bounds
        ("lowest", "f8"),  # lower bound of the depth [m]
        ("highest", "f8"),  # upper bound of the depth [m]; inf if unknown
        ("known", "?"),  # whether the residuals after leaving by it are filled
        ("own_volume", "f8"),  # of two convex bodies: integral of w over its facets [m^3]
        ("presence", "f8"),  # how far it counts, 0 to 1
        ("presence_rate", "f8"),  # derivative of the way out by that [m]; of two convex bodies
        ("height_rate", "f8"),  # derivative of the way out by the region's largest overlap
        ("rate", "f8"),  # derivative of the way out by the depth
        ("turn", "f8", 3),  # derivative of the way out by the normal [m]
        ("volume_rate", "f8"),  # derivatives by the integrals of the region [1/m^2]
        ("first_rate", "f8", 3),  # [1/m^3]
        ("second_rate", "f8", 6),  # [1/m^4]
    ],
    align=True,
)
"""One of the directions in which the tool may leave a body, in one tick."""

MESH_PATCH = np.dtype(
    [
        ("body", "i8"),  # number of the scene body
        ("direction", "i8"),  # 0 to 23
        ("part", "i8"),  # part of the direction's overlap region, 0 to 3
        ("normal", "f8", 3),  # n, world axes
        ("weight", "f8"),  # share of the body's stiffness
        ("line_rate", "f8", 2),  # derivative of the depth by the offsets of the two split lines
        ("base", "f8", 3),  # deepest point on B's smooth surface, B's frame [m]
        ("guess", "f8", 3),  # the same on A's surface, A's frame: start of the next tick's search
    ],
    align=True,
)
"""One patch of contact between meshes: a part of the overlap region of one direction."""

PATCH_COUNT = np.dtype(
    [
        ("patches", "i8"),  # number of patches
        ("dropped", "i8"),  # patches and facet pairs dropped for lack of room
    ],
    align=True,
)


@by_reference
class ContactManifold(NamedTuple):
    """The patches between the tool and all scene bodies, in one tick."""

    count: NDArray[np.void]  # type: ignore[assignment]  # hides tuple.count
    """One `PATCH_COUNT` record, (1,)."""
    patches: NDArray[np.void]
    """`MESH_PATCH` records, (MAX_PATCHES,)."""
    result: NDArray[np.void]
    """Depth of each, `PENETRATION` records (MAX_PATCHES,)."""


def contact_manifold() -> ContactManifold:
    """Allocate an empty manifold."""
    return ContactManifold(
        count=np.zeros(1, PATCH_COUNT),
        patches=np.zeros(MAX_PATCHES, MESH_PATCH),
        result=np.zeros(MAX_PATCHES, PENETRATION),
    )
