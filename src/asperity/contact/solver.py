"""From a pose of the tool to the wrench on it: query, patches, depths, forces, their sum.

A *patch* is where the tool touches one body of the scene with one normal: the pairs of geoms
whose normals agree. Its normal and its bristle are remembered while it lasts, in the scene body's
frame; a pair's normal turns only continuously, so that pushing past the middle of a thin plate
does not flip its side. All patches on one body share its stiffness, by weights that follow their
depths and sum to one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.clock import ends_in
from asperity._core.kernels import Repeated
from asperity.contact.body_arrays import Geometry, flattened
from asperity.contact.broad_phase.facet_bvh import FacetTable, facet_table
from asperity.contact.broad_phase.mujoco_pairs import Collider
from asperity.contact.contacts import (
    Baseline,
    Contacts,
    ForceParameters,
    GridMethod,
    Memory,
    contacts_for,
    memory_for,
)
from asperity.contact.geom_tick import tick
from asperity.contact.manifold.mesh_memory import (
    FacetMemory,
    facet_memory,
    forget,
)
from asperity.contact.mesh_tick import mesh_tick
from asperity.contact.narrow_phase.mesh_workspace import (
    MAX_CANDIDATES,
    MAX_SURFACE_PATCHES,
    FacetSpace,
    facet_space,
)
from asperity.contact.narrow_phase.mesh_workspace import MAX_PATCHES as FACET_PATCHES
from asperity.contact.narrow_phase.workspace import workspace
from asperity.contact.response.point_laws import OTADUY_LIN
from asperity.contact.response.settings import LAWS, ForceSettings
from asperity.contact.response.stiffness import contact_stiffness
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.texture.packed import PackedTextures

if TYPE_CHECKING:
    import mujoco

MAX_PATCHES = 32
MAX_PAIRS = 512


class ContactSolver:
    """Contact forces between a tool and the bodies of a scene.

    Parameters
    ----------
    model : mujoco.MjModel
        The scene; the tool is its body with a freejoint. It is not changed.
    bodies : sequence of Body
        The same bodies with their textures; geoms in the order of the model.
    tool : str
        Name of the tool.
    settings : ForceSettings
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Sequence[Body],
        tool: str,
        settings: ForceSettings | None = None,
    ) -> None:
        self.settings = settings or ForceSettings()
        self._collider = Collider(model, bodies, tool)
        self.centre = self._collider.centre
        """The tool's centre of mass in its own frame [m]."""
        self._textures, self._geometry = flattened(bodies)
        self._tool = [body.name for body in bodies].index(tool)
        most = max(len(body.geoms) for body in bodies)
        mesh = [body.mesh is not None for body in bodies]
        self.by_facets = np.array(
            [i != self._tool and (mesh[i] or mesh[self._tool]) for i in range(len(bodies))],
            np.int64,
        )
        """Which bodies the tool meets facet by facet: all, if it is a mesh itself (bodies,)."""
        if self.by_facets.any():
            _refuse_for_meshes(self.settings)
        self._facets = _facet_side(bodies, self._textures, self._geometry, self.by_facets)
        self._by_geoms = sum(self.by_facets) < len(bodies) - 1
        patches, pairs = (3 * most, 9 * most * most) if self._by_geoms else (1, 1)
        if self._facets is not None:
            patches, pairs = max(patches, MAX_SURFACE_PATCHES), max(pairs, MAX_CANDIDATES)
        self._space = workspace(patches, pairs)
        self._number_by_geoms = self._collider.number.copy()
        for i, geom in enumerate(self._collider.number):
            if geom >= 0 and self.by_facets[self._geometry.body[geom]]:
                self._number_by_geoms[i] = -1
        self._memory: Memory = memory_for(MAX_PAIRS, MAX_PATCHES, most)
        most_patches = MAX_PATCHES if self._facets is None else MAX_PATCHES + FACET_PATCHES
        self.contacts: Contacts = contacts_for(most_patches)
        """The contacts of the last pose; only the first `contacts.count[0]` rows are valid."""
        self._pose, self._wrench = np.zeros(7), np.zeros(6)
        self._tick, self._mesh_tick = Repeated(tick), Repeated(mesh_tick)
        self._stiffness, self._room = Repeated(contact_stiffness), np.zeros(9)
        self._parameters = _parameters(self.settings)
        # None compiles a tick without them, in half the time.
        self._grid, self._baseline = _grid_method(self.settings), _baseline(self.settings)
        self.reset()

    def change(self, settings: ForceSettings) -> None:
        """Take another stiffness and friction from the next pose on; the law stays what it is."""
        kept = replace(
            self.settings, stiffness=settings.stiffness, friction=settings.friction,
            bristle_stiffness=settings.bristle_stiffness,
        )  # fmt: skip
        self.settings, self._parameters = kept, _parameters(kept)

    def reset(self) -> None:
        """Forget all normals, bristles and noise of the past."""
        if self._facets is not None:
            forget(self._facets.memory)
        self._memory.counts[:] = 0
        self._memory.noise[:] = 0.0
        # The generator counts on from here: seeds must not begin a few steps apart.
        self._memory.noise[3] = float(np.random.default_rng(self.settings.seed).integers(2**48))
        self.contacts.count[:] = 0

    def wrench(
        self, pose: NDArray[np.float64], dt: float, seconds: float = math.inf
    ) -> NDArray[np.float64]:
        """Return the wrench on the tool at a pose.

        Parameters
        ----------
        pose : (7,)
            Of the tool's frame: position [m], unit quaternion wxyz.
        dt : float
            Time since the last call [s], by which bristles and noise advance; 0 only looks.
        seconds : float
            After so long [s] searches end with what they have found; what they do not know any
            closer is the `gap` of their contacts, and `was_cut` is true. What comes before a
            search is not cut short.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes. The same
            array every time.
        """
        # Of its own, whatever the caller's are like: the kernels are told their types only once.
        self._pose[:] = pose
        pose, dt = self._pose, float(dt)
        search = self._space.search[0]
        search["deadline"], search["is_cut_short"] = ends_in(seconds), False
        held = None if self._facets is None else self._facets.memory.held
        count, geoms, places, distances, margins = self._collider.query(pose, held)
        if self._by_geoms:
            self._tick(
                self._textures, self._geometry, self._tool, self._collider.poses,
                self.centre, self._number_by_geoms, count, geoms, places, distances,
                margins, pose, dt, self._parameters, self._grid, self._baseline, self._memory,
                self._space, self.contacts, self._wrench,
            )  # fmt: skip
        else:
            self._wrench[:] = 0.0
            self.contacts.count[:] = 0
        if self._facets is not None and self._touch(count, geoms, distances, dt):
            count, geoms, _, distances, _ = self._collider.query(pose)
            self._touch(count, geoms, distances, dt)
        return self._wrench

    @property
    def was_cut(self) -> bool:
        """Whether a search of the last pose was ended by its time."""
        return bool(self._space.search[0]["is_cut_short"])

    def _touch(
        self, count: int, geoms: NDArray[np.int32], distances: NDArray[np.float64], dt: float
    ) -> bool:
        """Add what the tool meets facet by facet; return whether all contacts are needed first."""
        assert self._facets is not None
        missing: bool = self._mesh_tick(
            self._textures, self._facets.table, self._geometry, self.by_facets, self._tool,
            self._collider.poses, self.centre, self._collider.number, count, geoms,
            distances, self._pose, dt, self._parameters, self._facets.memory, self._facets.space,
            self._space, self.contacts, self._wrench,
        )  # fmt: skip
        return missing

    def stiffness(self) -> NDArray[np.float64]:
        """Return how the last wrench falls with the tool's motion, (6, 6): see `LinearContact`.

        Without the term that grows with the depth (`engine.stiffness`).
        """
        out = np.empty((6, 6))
        self._stiffness(
            self.contacts, self._pose, self.centre, self._parameters, self.by_facets, self._room,
            out,
        )  # fmt: skip
        return out


def _refuse_for_meshes(settings: ForceSettings) -> None:
    """Refuse laws and gradients that contact with meshes does not have."""
    for name, value, only in (
        ("law", settings.law, "otaduy-lin"),
        ("gradient", settings.gradient, "exact"),
    ):
        if value != only:
            raise AsperityError(f"where a mesh is involved, {name} must be {only!r}, got {value!r}")


class _FacetSide(NamedTuple):
    """What contact with meshes needs besides."""

    table: FacetTable
    memory: FacetMemory
    space: FacetSpace


def _facet_side(
    bodies: Sequence[Body],
    textures: PackedTextures,
    geometry: Geometry,
    by_facets: NDArray[np.int64],
) -> _FacetSide | None:
    if not by_facets.any():
        return None
    table = facet_table(bodies, textures, geometry)
    space = facet_space(table, len(geometry.kind))
    return _FacetSide(table, facet_memory(len(bodies)), space)


def _parameters(settings: ForceSettings) -> ForceParameters:
    bristle = settings.bristle_stiffness
    return ForceParameters(
        stiffness=float(settings.stiffness),
        friction=float(settings.friction),
        bristle_stiffness=float(settings.stiffness if bristle is None else bristle),
        max_nodes=int(settings.max_nodes),
        tolerance=-1.0 if settings.tolerance is None else float(settings.tolerance),
        patch_radius=float(settings.patch_radius),
        edge_fade=float(settings.edge_fade),
    )


def _grid_method(settings: ForceSettings) -> GridMethod | None:
    if settings.gradient == "exact":
        return None
    return GridMethod(
        soft=settings.gradient == "soft",
        step=float(settings.step),
        lever=float(settings.lever),
        grid=int(settings.grid),
        window=float(settings.window),
        beta=1.0 / settings.softness,
        soft_area=float(settings.soft_area),
    )


def _baseline(settings: ForceSettings) -> Baseline | None:
    law = LAWS.index(settings.law)
    if law == OTADUY_LIN:
        return None
    return Baseline(
        law=law,
        ho_gain=float(settings.ho_gain),
        noise_level=float(settings.noise_level),
        noise_bandwidth=float(settings.noise_bandwidth),
    )
