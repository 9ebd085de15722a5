"""Contact of one body, the tool, with bodies that do not move relative to each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.clock import ends_in
from asperity._core.kernels import Repeated
from asperity.contact.body_arrays import Geometry, flatten_bodies
from asperity.contact.broad_phase.facet_bvh import FacetTable, facet_table
from asperity.contact.broad_phase.geom_pairs import GeomPairs, geom_pairs
from asperity.contact.broad_phase.mujoco_pairs import Candidates, Collider, no_candidates
from asperity.contact.contacts import Contacts, empty_contacts
from asperity.contact.geom_tick import tick
from asperity.contact.manifold.covered import covered_faces
from asperity.contact.manifold.inside import with_thickness
from asperity.contact.manifold.mesh_memory import MeshMemory, forget, mesh_memory
from asperity.contact.manifold.records import MAX_PATCHES as MAX_MESH_PATCHES
from asperity.contact.many_poses import PoseBatch, solve_geoms, solve_meshes
from asperity.contact.mesh_tick import mesh_tick
from asperity.contact.narrow_phase.mesh_workspace import FacetSpace
from asperity.contact.records import (
    ForceLaw,
    ForceParameters,
    GridMethod,
    MeshModel,
    Output,
    PointLaw,
    Query,
    SceneModel,
    forget_geoms,
    geom_memory,
)
from asperity.contact.refused import refuse_for_maps, refuse_laws
from asperity.contact.response.point_laws import OTADUY_LIN
from asperity.contact.response.settings import LAWS, ForceSettings
from asperity.contact.response.stiffness import (
    AT_REST,
    ContactDerivatives,
    SlipMotion,
    contact_stiffness,
)
from asperity.contact.search_room import SearchRoom, most_geoms, search_room
from asperity.geometry.bodies import Body
from asperity.geometry.poses import rotation_of
from asperity.texture.packed import PackedTextures

MAX_PATCHES = 32
"""Maximum number of patches of contact between geoms."""
MAX_PAIRS = 512
"""Maximum number of pairs of geoms."""


class BodyArrays(NamedTuple):
    """Bodies as arrays, shared by all solvers of contact between them."""

    textures: PackedTextures
    geometry: Geometry
    facets: FacetTable | None
    """None if no body is a mesh."""
    frames: NDArray[np.float64]
    """Frames of the bodies in the model's first pose, (bodies, 3, 4)."""
    geom_number: NDArray[np.int64]
    """For each geom of the MuJoCo model its number in `geometry`; -1 for none."""
    centres: NDArray[np.float64]
    """Centre of mass of each body in its own frame [m], (bodies, 3)."""
    is_mesh: NDArray[np.bool_]
    """(bodies,)"""
    with_stiffness_map: dict[int, str]
    """Names of the bodies with a stiffness map, by their numbers."""


def body_arrays(bodies: Sequence[Body], collider: Collider, group: NDArray[np.int64]) -> BodyArrays:
    """Return the arrays of some bodies; those of one `group` are rigidly connected."""
    textures, geometry = flatten_bodies(bodies)
    geometry = geometry._replace(covered=covered_faces(geometry, collider.frames, group))
    is_mesh = np.array([body.mesh is not None for body in bodies])
    facets = with_thickness(facet_table(bodies, textures, geometry)) if is_mesh.any() else None
    with_map = {i: body.name for i, body in enumerate(bodies) if body.stiffness_maps}
    return BodyArrays(
        textures, geometry, facets, collider.frames, collider.geom_number, collider.centres,
        is_mesh, with_map,
    )  # fmt: skip


class BodyContact:
    """Contact of one body with others, which stay in the model's first pose.

    Parameters
    ----------
    arrays : BodyArrays
    tool : int
        Number of the body that moves.
    others : sequence of int
        Numbers of the bodies that it may touch. They do not move relative to each other.
    settings : ForceSettings
    room : SearchRoom, optional
        Scratch memory of the search, which solvers that run in turn may share; by default new.

    Attributes
    ----------
    contacts : Contacts
        The contacts of the last pose, in arrays that the next call overwrites; only the first
        `contacts.count[0]` rows are valid.
    centre : (3,) array
        The tool's centre of mass in its own frame [m].
    by_facets : (bodies,) array of int
        Whether contact of the tool with a body is between facets: if either is a mesh.

    Raises
    ------
    AsperityError
        A mesh or a stiffness map is involved and `settings` has another law than "otaduy-lin" or
        another gradient than "exact"; or both of two bodies have a stiffness map.
    """

    def __init__(
        self,
        arrays: BodyArrays,
        tool: int,
        others: Sequence[int],
        settings: ForceSettings,
        room: SearchRoom | None = None,
    ) -> None:
        self.settings = settings
        self.centre = arrays.centres[tool]
        self.by_facets = np.zeros(len(arrays.is_mesh), np.int64)
        self.by_facets[list(others)] = arrays.is_mesh[list(others)] | arrays.is_mesh[tool]
        if self.by_facets.any():
            refuse_laws(settings, "where a mesh is involved")
        mapped = {i: arrays.with_stiffness_map.get(i) for i in (tool, *others)}
        refuse_for_maps(settings, mapped[tool], [mapped[i] for i in others])
        self._scene = _scene_model(arrays, tool, others)
        self._by_geoms = bool((self.by_facets[list(others)] == 0).any())
        self._model = _exclude_facet_bodies(self._scene, self.by_facets)
        facets = arrays.facets if self.by_facets.any() else None
        room = room or search_room(arrays.geometry, facets, self._by_geoms)
        self._mesh = _mesh_side(arrays, self._scene, self.by_facets, room)
        self._memory = geom_memory(MAX_PAIRS, MAX_PATCHES, most_geoms(arrays.geometry))
        self._space = room.search
        # Fields of one record: much faster to set than those of `search[0]`.
        self._deadline = self._space.search["deadline"]
        self._is_cut_short = self._space.search["is_cut_short"]
        most_patches = MAX_PATCHES if self._mesh is None else MAX_PATCHES + MAX_MESH_PATCHES
        self.contacts: Contacts = empty_contacts(most_patches)
        # The types of a kernel's arguments are looked up at the first call only.
        self._pose, self._out = np.zeros(7), Output(self.contacts, np.zeros(6))
        self._tick, self._mesh_tick = Repeated(tick), Repeated(mesh_tick)
        self._derivatives = Repeated(contact_stiffness)
        self._law = _force_law(self.settings, self._model)
        self._pairs: GeomPairs | None = None
        self.reset()

    def change(self, settings: ForceSettings) -> None:
        """Change stiffness and friction from the next pose on.

        Parameters
        ----------
        settings : ForceSettings
            Its `stiffness`, `friction`, `dissipation` and `bristle_stiffness` are used.
        """
        self.settings = replace(
            self.settings, stiffness=settings.stiffness, friction=settings.friction,
            bristle_stiffness=settings.bristle_stiffness, dissipation=settings.dissipation,
        )  # fmt: skip
        self._law = self._law._replace(parameters=_parameters(self.settings))

    def reset(self) -> None:
        """Forget all contacts, their bristles, and the noise of Siira & Pai."""
        if self._mesh is not None:
            forget(self._mesh.memory)
        # The generator counts up from here: seeds must not start a few steps apart.
        forget_geoms(self._memory, np.random.default_rng(self.settings.seed).integers(2**48).item())
        self.contacts.count[:] = 0

    def leave(self, dt: float) -> None:
        """Set the state of a tool without contact; with `dt` 0 the memory is not changed."""
        self.contacts.count[:] = 0
        self._out.wrench[:] = 0.0
        if dt > 0.0 and (self._mesh is None or self._mesh.memory.has_frame[0] == 1):
            if self._mesh is not None:
                forget(self._mesh.memory)
            self._memory.state["has_frame"] = self._memory.state["last_patches"] = 0

    def turn_to_world(self, turn: NDArray[np.float64], move: NDArray[np.float64]) -> None:
        """Transform the results of the last pose from the bodies' first to their current poses.

        `turn` (3, 3) and `move` (3,) are the rotation and translation from first to current pose.
        """
        contacts, count = self.contacts, int(self.contacts.count[0])
        for vectors in (contacts.normal, contacts.slope_normal, contacts.force, contacts.point):
            vectors[:count] = vectors[:count] @ turn.T
        contacts.point[:count] += move
        # The pose is kept only for the centre of mass, about which the stiffness is.
        arm = turn @ rotation_of(self._pose[3:]) @ self.centre
        self._pose[:3] = turn @ self._pose[:3] + move
        self._pose[3:] = [1.0, 0.0, 0.0, 0.0]
        self._pose[:3] += arm - self.centre

    @property
    def in_contact(self) -> NDArray[np.bool_] | None:
        """Whether candidates of each body may be omitted, (bodies,)."""
        return None if self._mesh is None else self._mesh.memory.in_contact

    def wrench_at(
        self,
        pose: NDArray[np.float64],
        dt: float,
        candidates: Candidates,
        all_candidates: Callable[[], Candidates],
        seconds: float = math.inf,
    ) -> NDArray[np.float64]:
        """Return the wrench (6,) on the tool at a pose, with the bodies in the first pose.

        Parameters
        ----------
        candidates : Candidates
            Pairs of geoms that may touch. Those of the bodies `in_contact` may be omitted.
        all_candidates : callable
            Returns the candidates of all bodies; it is called if the tool has jumped.
        pose, dt, seconds
            See `ContactSolver.wrench`.
        """
        self._pose[:] = pose
        self._deadline[0], self._is_cut_short[0] = ends_in(seconds), False
        query = Query(self._pose, float(dt), candidates)
        if self._by_geoms:
            self._tick(self._model, self._law, query, self._memory, self._space, self._out)
        else:
            self._out.wrench[:] = 0.0
            self.contacts.count[:] = 0
        if self._mesh is not None and self._add_meshes(self._mesh, query):
            self._add_meshes(self._mesh, query._replace(candidates=all_candidates()))
        return self._out.wrench

    def solve_batch(
        self,
        poses: NDArray[np.float64],
        collider: Collider,
        wrench_out: NDArray[np.float64],
        certified_out: NDArray[np.bool_],
    ) -> None:
        """Fill wrenches (n, 6) and certificates (n,) of independent poses (n, 7)."""
        self.reset()
        first = np.zeros(len(poses) + 1, np.int64)
        if self._mesh is None:
            if self._pairs is None:
                self._pairs = geom_pairs(self._scene, collider.allowed_pairs(self._scene.tool))
            batch = PoseBatch(
                poses, first, no_candidates(len(self._pairs.geoms)), wrench_out, certified_out
            )
            solve_geoms(
                self._model, self._pairs, self._law, batch, self._memory, self._space, self.contacts
            )
            return
        found: list[tuple[NDArray[Any], ...]] = [no_candidates(0)[1:]]
        for i, pose in enumerate(poses):
            collider.place(self._scene.tool, pose)
            near = collider.query()
            first[i + 1] = first[i] + near.count
            found.append(tuple(part[: near.count].copy() for part in near[1:]))
        rows = [np.concatenate(parts) for parts in zip(*found, strict=True)]
        near = Candidates(int(first[-1]), *rows)
        solve_meshes(
            self._model if self._by_geoms else None, tuple(self._mesh), self._law,
            PoseBatch(poses, first, near, wrench_out, certified_out),
            self._memory, self._space, self.contacts,
        )  # fmt: skip

    def _add_meshes(self, mesh: _MeshSide, query: Query) -> bool:
        """Add contact between facets; return whether candidates of all bodies are needed."""
        missing: bool = self._mesh_tick(
            mesh.model, self._law.parameters, query, mesh.memory, mesh.space, self._space, self._out
        )
        return missing

    @property
    def was_cut(self) -> bool:
        """Whether a search of the last pose ended at the time limit."""
        return bool(self._is_cut_short[0])

    @property
    def energy(self) -> float:
        """Energy U of the last pose [J], whose negative gradient is the wrench without friction."""
        if self.contacts.count[0] == 0:
            return 0.0
        way_out = self._memory.state["way_out"].item()
        of_meshes = 0.0 if self._mesh is None else sum(self._mesh.space.energy.tolist())
        return 0.5 * self.settings.stiffness * way_out * way_out + of_meshes

    def stiffness(self) -> NDArray[np.float64]:
        """Return the negative derivative of the last wrench by the tool's motion.

        Returns
        -------
        (6, 6) array
            About the tool's centre of mass, world axes [N/m, N/rad; N, N m/rad]; symmetric and
            positive semidefinite without friction; see `response.stiffness`.
        """
        return self.derivatives().stiffness

    def damping(self) -> NDArray[np.float64]:
        """Return the derivative by velocity, as `stiffness`; zero without `dissipation`."""
        return self.derivatives().damping

    def derivatives(self, motion: SlipMotion = AT_REST) -> ContactDerivatives:
        """Return the derivatives of the last wrench by pose and velocity, after a motion."""
        out = ContactDerivatives(np.empty((6, 6)), np.empty((6, 6)), np.empty(6))
        self._derivatives(self.contacts, self._pose, self.centre, self._law.parameters, motion, out)
        return out


class _MeshSide(NamedTuple):
    """Model and memory of contact with meshes."""

    model: MeshModel
    memory: MeshMemory
    space: FacetSpace


def _scene_model(arrays: BodyArrays, tool: int, others: Sequence[int]) -> SceneModel:
    """Return the bodies of a solver; geoms of other bodies have the number -1."""
    number, is_in = arrays.geom_number.copy(), np.isin(arrays.geometry.body, [tool, *others])
    number[(number >= 0) & ~is_in[number]] = -1
    return SceneModel(
        arrays.textures, arrays.geometry, tool, arrays.centres[tool], arrays.frames.copy(), number
    )


def _exclude_facet_bodies(scene: SceneModel, by_facets: NDArray[np.int64]) -> SceneModel:
    """Return the scene without the geoms of bodies whose contact is between facets."""
    number = scene.geom_number.copy()
    number[(number >= 0) & (by_facets[scene.geometry.body[number]] == 1)] = -1
    return scene._replace(geom_number=number)


def _mesh_side(
    arrays: BodyArrays, scene: SceneModel, by_facets: NDArray[np.int64], room: SearchRoom
) -> _MeshSide | None:
    """Return model and memory of contact with meshes, None if no mesh is involved."""
    if arrays.facets is None or room.facets is None or not by_facets.any():
        return None
    return _MeshSide(
        model=MeshModel(scene, arrays.facets, by_facets),
        memory=mesh_memory(len(by_facets)),
        space=room.facets,
    )


def _force_law(settings: ForceSettings, model: SceneModel) -> ForceLaw:
    return ForceLaw(_parameters(settings), _grid_method(settings), _point_law(settings, model))


def _parameters(settings: ForceSettings) -> ForceParameters:
    bristle = settings.bristle_stiffness
    return ForceParameters(
        stiffness=float(settings.stiffness),
        friction=float(settings.friction),
        dissipation=float(settings.dissipation),
        bristle_stiffness=float(settings.stiffness if bristle is None else bristle),
        max_nodes=int(settings.max_nodes),
        tolerance=-1.0 if settings.tolerance is None else float(settings.tolerance),
        patch_radius=-1.0 if settings.patch_radius is None else float(settings.patch_radius),
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


def _point_law(settings: ForceSettings, model: SceneModel) -> PointLaw | None:
    law = LAWS.index(settings.law)
    if law == OTADUY_LIN:
        return None
    return PointLaw(
        law=law,
        ho_gain=float(settings.ho_gain),
        noise_level=float(settings.noise_level),
        noise_bandwidth=float(settings.noise_bandwidth),
        smooth=model._replace(geometry=model.geometry.smooth()),
    )
