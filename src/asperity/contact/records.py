"""Arguments of the compiled ticks: `(model, law, query, memory, workspace, out)`.

All arrays are allocated once and written in place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.structures import by_reference
from asperity.contact.body_arrays import Geometry
from asperity.contact.broad_phase.facet_bvh import FacetTable
from asperity.contact.broad_phase.mujoco_pairs import Candidates
from asperity.contact.contacts import Contacts
from asperity.contact.narrow_phase.records import PENETRATION
from asperity.contact.response.ways_out import WaysOut, ways_out
from asperity.texture.packed import PackedTextures

MAX_SEPARATIONS = 256
"""Maximum number of separations of all pairs, including those without weight."""


@by_reference
class SceneModel(NamedTuple):
    """The bodies of a scene; constant except for the tool's frame."""

    textures: PackedTextures
    geometry: Geometry
    tool: int
    """Number of the tool among the bodies."""
    centre: NDArray[np.float64]
    """The tool's centre of mass in its own frame [m], (3,)."""
    frames: NDArray[np.float64]
    """Frames of the bodies, (bodies, 3, 4); the tool's is filled by each tick."""
    geom_number: NDArray[np.int64]
    """For each geom of the MuJoCo model its number in `geometry`; -1 for one to be ignored."""


@by_reference
class MeshModel(NamedTuple):
    """A scene with meshes."""

    scene: SceneModel
    facets: FacetTable
    by_facets: NDArray[np.int64]
    """Whether contact of the tool with a body is between facets, (bodies,)."""


class ForceParameters(NamedTuple):
    """The part of `ForceSettings` that every force law uses."""

    stiffness: float
    """[N/m]"""
    friction: float
    """Coulomb's coefficient [-]."""
    dissipation: float
    """a of Hunt & Crossley [s/m]."""
    bristle_stiffness: float
    """[N/m]"""
    max_nodes: int
    """Maximum number of boxes that a search evaluates."""
    tolerance: float
    """Gap up to which a depth counts as certified [m]; negative: derived from the textures."""
    patch_radius: float
    """How far the parts of an overlap region extend beyond the lines that split it [m]; negative:
    derived from the size of the bodies."""


class GridMethod(NamedTuple):
    """Parameters of a depth and its gradient from samples on a grid; see `ForceSettings`."""

    soft: bool
    """Whether to use the soft maximum; else central differences."""
    step: float
    """Of the central differences [m]."""
    lever: float
    """Length that converts a rotation to a distance [m]."""
    grid: int
    """Samples along a side."""
    window: float
    """Side of the grid [m]."""
    beta: float
    """Of the soft maximum [1/m]."""
    soft_area: float
    """Reference area of the soft maximum [m^2]."""


class PointLaw(NamedTuple):
    """A force law that reads the texture at one point; see `ForceSettings`."""

    law: int
    """Index into `settings.LAWS`."""
    ho_gain: float
    """K of Ho et al. [-]."""
    noise_level: float
    """Standard deviation of the noise over the normal force [-]."""
    noise_bandwidth: float
    """Corner frequency of the noise [Hz]."""
    smooth: SceneModel
    """The scene without textures, whose depth such a law uses."""


class ForceLaw(NamedTuple):
    """Force law and its parameters."""

    parameters: ForceParameters
    grid: GridMethod | None
    """None: exact gradients. (A tick without a grid compiles in half the time.)"""
    point: PointLaw | None
    """None: the law of Otaduy & Lin."""


class Query(NamedTuple):
    """Pose of the tool, time step and candidates."""

    pose: NDArray[np.float64]
    """Of the tool's frame: position [m], unit quaternion wxyz; (7,)."""
    dt: float
    """Time since the last tick [s]; 0 leaves the memory as it is."""
    candidates: Candidates
    """Pairs of geoms that MuJoCo finds close to each other."""


GEOM_PAIR = np.dtype(
    [
        ("geom_a", "i8"),  # geom of the tool
        ("geom_b", "i8"),  # geom of the scene
        ("part", "i8"),  # number of its part; -1 for none
    ],
    align=True,
)
"""A geom of the tool and one of the scene that may touch."""

SEPARATION = np.dtype(
    [
        ("geom_a", "i8"),  # geoms of the pair, or of the first of the part
        ("geom_b", "i8"),
        ("kind", "i8"),  # FACE_B, FACE_A, EDGES or CURVED of `manifold.separation`
        ("part", "i8"),  # number of its part among those that touch
        ("owner", "i8"),  # number of its part among all
        ("normal", "f8", 3),  # n, unit vector out of the scene's geom, world axes
        ("normal_rate", "f8", (3, 6)),  # by the tool's translation [1/m] and rotation
        ("gap", "f8"),  # g, translation along n that separates the smooth geoms [m]
        ("gap_rate", "f8", 6),
        ("share", "f8"),  # blending weight, 0 to 1: how well the direction is defined
        ("share_rate", "f8", 6),
        ("rough", "f8"),  # bound of the sum of both textures' |height| [m]
        ("reach", "f8"),  # extension of its face beyond its edges if it is the only one [m]
        ("thinned", "?"),  # whether shorter separations near it stand for it: `response.thinning`
        ("aligned", "f8"),  # least cosine to another direction that may represent it unsearched
        ("scale", "f8"),  # square root of the two surfaces' stiffness over that of the force law
        ("gap_scale", "f8"),  # the same for g: with a stiffness map, at its softest point
        ("friction", "f8"),  # Coulomb's coefficient of the two surfaces without a friction map [-]
        ("depth", "f8"),  # penetration depth of the textured surfaces along n [m]
        ("weight", "f8"),  # derivative of the way out by this depth
    ],
    align=True,
)
"""Direction along which the tool may leave a geom of the scene."""

GEOM_PATCH = np.dtype(
    [
        ("body", "i8"),  # number of the scene body
        ("normal", "f8", 3),  # unit normal
        ("point", "f8", 3),  # deepest point [m]; nan if unknown
        ("bristle", "f8", 3),  # deflection of the bristle [m]
    ],
    align=True,
)
"""State of a contact kept for the next tick: start of its search, and friction. Body's frame."""

MEMORY_STATE = np.dtype(
    [
        ("pairs", "i8"),  # number of pairs in this tick
        ("separations", "i8"),  # number of separations in this tick
        ("parts", "i8"),  # number of parts in this tick
        ("way_out", "f8"),  # s of `response.potential` in this tick [m]; 0 without contact
        ("last_patches", "i8"),  # number of patches of the last tick
        ("has_frame", "i8"),  # whether there was a last tick
        ("dropped", "i8"),  # pairs, parts and contacts dropped for lack of room
    ],
    align=True,
)

NOISE = np.dtype(
    [
        ("value", "f8", 3),  # low-passed Gaussian noise of unit variance, world axes
        ("counter", "f8"),  # state of the random number generator, a whole number
    ],
    align=True,
)
"""State of the noise of Siira & Pai."""


@by_reference
class GeomMemory(NamedTuple):
    """State of contact between geoms kept between ticks, and scratch memory of one tick."""

    state: NDArray[np.void]
    """One `MEMORY_STATE` record, (1,)."""
    last_patches: NDArray[np.void]
    """`GEOM_PATCH` records of the last tick, (patches,)."""
    frame: NDArray[np.float64]
    """The tool's frame in the last tick, (3, 4)."""
    noise: NDArray[np.void]
    """One `NOISE` record, (1,)."""
    pairs: NDArray[np.void]
    """`GEOM_PAIR` records of this tick, (pairs,)."""
    patches: NDArray[np.void]
    """`GEOM_PATCH` records of this tick, one a contact, (patches,)."""
    geoms: NDArray[np.int64]
    """Geoms of one part, those of the tool and those of the scene; (2, geoms)."""
    separations: NDArray[np.void]
    """`SEPARATION` records of this tick, (separations,)."""
    results: NDArray[np.void]
    """Depth along each separation, `PENETRATION` records (separations,)."""
    ways: WaysOut
    """Choices of separations."""


class Output(NamedTuple):
    """Results of a tick."""

    contacts: Contacts
    wrench: NDArray[np.float64]
    """Force [N] and torque about the tool's centre of mass [N m], world axes; (6,)."""


def geom_memory(pairs: int, patches: int, geoms: int) -> GeomMemory:
    """Allocate an empty memory.

    Parameters
    ----------
    pairs, patches : int
        Maximum numbers of pairs of geoms, and of contacts.
    geoms : int
        Largest number of geoms of one body.
    """
    return GeomMemory(
        state=np.zeros(1, MEMORY_STATE),
        last_patches=np.zeros(patches, GEOM_PATCH),
        frame=np.zeros((3, 4)),
        noise=np.zeros(1, NOISE),
        pairs=np.zeros(pairs, GEOM_PAIR),
        patches=np.zeros(patches, GEOM_PATCH),
        geoms=np.zeros((2, geoms), np.int64),
        separations=np.zeros(MAX_SEPARATIONS, SEPARATION),
        results=np.zeros(MAX_SEPARATIONS, PENETRATION),
        ways=ways_out(MAX_SEPARATIONS),
    )


def forget_geoms(memory: GeomMemory, seed: int) -> None:
    """Reset the memory to that of a tool that has not touched anything.

    `seed` is the first value of the noise's counter.
    """
    for name in MEMORY_STATE.names or ():
        memory.state[name] = 0
    memory.noise["value"] = 0.0
    memory.noise["counter"] = float(seed)
