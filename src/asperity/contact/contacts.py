"""The contacts of a tool at one pose."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.structures import by_reference

NOT_CERTIFIED = 1
"""Status of a contact whose depth is not certified; see `Contacts`."""
NO_ROOM = 2
"""Status of a contact at a pose where others were dropped; see `Contacts`."""


@by_reference
class Contacts(NamedTuple):
    """The contacts of one pose, in arrays allocated once; the first `count[0]` rows are valid.

    Vectors are in world axes.
    """

    count: NDArray[np.int64]  # type: ignore[assignment]  # hides tuple.count
    """Number of contacts, and number of dropped ones: without room for them or for pairs of facets,
    with a search that ended before it found anything, or where the tool is beyond the range of a
    soft layer; (2,)."""
    body: NDArray[np.int64]
    """Number of the scene body, (n,)."""
    point: NDArray[np.float64]
    """Deepest point on the tool's textured surface [m], (n, 3)."""
    normal: NDArray[np.float64]
    """n, the unit normal of the body's smooth surface, (n, 3)."""
    slope_normal: NDArray[np.float64]
    """m, normal to the textured surfaces, not of unit length: m.n = 1; (n, 3)."""
    depth: NDArray[np.float64]
    """Penetration depth of the textured surfaces along n [m], (n,)."""
    gap: NDArray[np.float64]
    """Upper bound of the true depth minus `depth` [m], (n,)."""
    weight: NDArray[np.float64]
    """Stiffness of the contact over that of the force law, (n,)."""
    friction: NDArray[np.float64]
    """Coulomb's coefficient of the two surfaces [-], (n,)."""
    bristle_stiffness: NDArray[np.float64]
    """Of the bristle that holds the contact in place [N/m], (n,)."""
    force: NDArray[np.float64]
    """Force on the tool [N], (n, 3)."""
    status: NDArray[np.int64]
    """0: certified; 1: the search ended before the gap was within the tolerance, or a soft body is
    pressed harder than its model allows; 2: some other contact was dropped; (n,)."""
    nodes: NDArray[np.int64]
    """Boxes that the search evaluated, (n,)."""
    ties: NDArray[np.int64]
    """Number of equally deep points, (n,)."""


def empty_contacts(count: int) -> Contacts:
    """Allocate room for `count` contacts."""
    return Contacts(
        count=np.zeros(2, np.int64),
        body=np.zeros(count, np.int64),
        point=np.zeros((count, 3)),
        normal=np.zeros((count, 3)),
        slope_normal=np.zeros((count, 3)),
        depth=np.zeros(count),
        gap=np.zeros(count),
        weight=np.zeros(count),
        friction=np.zeros(count),
        bristle_stiffness=np.zeros(count),
        force=np.zeros((count, 3)),
        status=np.zeros(count, np.int64),
        nodes=np.zeros(count, np.int64),
        ties=np.zeros(count, np.int64),
    )
