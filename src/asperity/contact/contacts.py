"""What the engine hands to its kernel and gets back: parameters, memory, contacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.narrow_phase.records import PENETRATION


class ForceParameters(NamedTuple):
    """The part of `ForceSettings` that every law uses."""

    stiffness: float
    friction: float
    bristle_stiffness: float
    max_nodes: int
    tolerance: float
    """-1: from the textures."""
    patch_radius: float
    edge_fade: float


class GridMethod(NamedTuple):
    """How a depth and its gradient come from samples on a grid; see `ForceSettings`."""

    soft: bool
    step: float
    lever: float
    grid: int
    window: float
    beta: float
    soft_area: float


class Baseline(NamedTuple):
    """A law that takes the texture at one point; see `ForceSettings`."""

    law: int
    ho_gain: float
    noise_level: float
    noise_bandwidth: float


class Memory(NamedTuple):
    """What is remembered from one pose to the next."""

    counts: NDArray[np.int64]
    """How many pairs and patches are remembered, whether a pose is, and how often there was no
    room for one more; (4,)."""
    pairs: NDArray[np.int64]
    """Geom of the tool and of the scene, and whether it is deep: (pairs, 3)."""
    normals: NDArray[np.float64]
    """Of each pair, in the scene body's frame, (pairs, 3)."""
    bodies: NDArray[np.int64]
    """Scene body of each patch."""
    patches: NDArray[np.float64]
    """Normal, deepest place, bristle's deflection of each patch in the body's frame: (n, 9)."""
    pose: NDArray[np.float64]
    """The tool's last rotation and position, (3, 4)."""
    noise: NDArray[np.float64]
    """State of Siira & Pai's noise, (4,)."""
    now_pairs: NDArray[np.int64]
    now_normals: NDArray[np.float64]
    now_weights: NDArray[np.float64]
    new_bodies: NDArray[np.int64]
    new_patches: NDArray[np.float64]
    geoms: NDArray[np.int64]
    """The geoms of a patch: the tool's and the scene's, (2, geoms)."""
    results: NDArray[np.void]
    """What the search left for each patch."""


class Contacts(NamedTuple):
    """The contacts of one pose, in arrays allocated once; the first `count[0]` rows are valid.

    `count[1]` says how much there was no room for: contacts, or facets that may be some.

    World axes; `point` lies on the tool's surface. `slope_normal` is m, the normal of the
    textured surfaces, with m.n = 1. `status`: 0 certified, 1 the budget was spent before
    the gap was closed, 2 there was no room for a contact.
    """

    count: NDArray[np.int64]  # type: ignore[assignment]  # hides tuple.count
    body: NDArray[np.int64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    slope_normal: NDArray[np.float64]
    depth: NDArray[np.float64]
    gap: NDArray[np.float64]
    weight: NDArray[np.float64]
    force: NDArray[np.float64]
    status: NDArray[np.int64]
    nodes: NDArray[np.int64]
    ties: NDArray[np.int64]


def memory_for(pairs: int, patches: int, geoms: int) -> Memory:
    """Return an empty memory with room for so many pairs, patches and geoms of one body."""
    return Memory(
        counts=np.zeros(4, np.int64),
        pairs=np.zeros((pairs, 3), np.int64),
        normals=np.zeros((pairs, 3)),
        bodies=np.zeros(patches, np.int64),
        patches=np.zeros((patches, 9)),
        pose=np.zeros((3, 4)),
        noise=np.zeros(4),
        now_pairs=np.zeros((pairs, 4), np.int64),
        now_normals=np.zeros((pairs, 3)),
        now_weights=np.zeros(pairs),
        new_bodies=np.zeros(patches, np.int64),
        new_patches=np.zeros((patches, 9)),
        geoms=np.zeros((2, geoms), np.int64),
        results=np.zeros(patches, PENETRATION),
    )


def contacts_for(patches: int) -> Contacts:
    """Return room for so many contacts."""
    return Contacts(
        count=np.zeros(2, np.int64),
        body=np.zeros(patches, np.int64),
        point=np.zeros((patches, 3)),
        normal=np.zeros((patches, 3)),
        slope_normal=np.zeros((patches, 3)),
        depth=np.zeros(patches),
        gap=np.zeros(patches),
        weight=np.zeros(patches),
        force=np.zeros((patches, 3)),
        status=np.zeros(patches, np.int64),
        nodes=np.zeros(patches, np.int64),
        ties=np.zeros(patches, np.int64),
    )
