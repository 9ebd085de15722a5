"""The contact solver: from a pose of the tool to the contacts and the wrench on it.

Between geoms a contact is one direction along which the tool may leave a body, and the wrench is
the gradient of one potential (`response.potential`). Between meshes it is a *patch*, a part of the
overlap region with one normal (`manifold.mesh_manifold`).
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
from asperity.contact.body_arrays import flatten_bodies
from asperity.contact.broad_phase.facet_bvh import facet_table
from asperity.contact.broad_phase.mujoco_pairs import Collider
from asperity.contact.contacts import Contacts, empty_contacts
from asperity.contact.geom_tick import tick
from asperity.contact.manifold.covered import covered_faces
from asperity.contact.manifold.mesh_memory import MeshMemory, forget, mesh_memory
from asperity.contact.manifold.records import MAX_PATCHES as MAX_MESH_PATCHES
from asperity.contact.mesh_tick import mesh_tick
from asperity.contact.narrow_phase.mesh_workspace import (
    MAX_CANDIDATES,
    MAX_SURFACE_PATCHES,
    FacetSpace,
    facet_space,
)
from asperity.contact.narrow_phase.workspace import Workspace, workspace
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
from asperity.contact.response.point_laws import OTADUY_LIN
from asperity.contact.response.settings import LAWS, ForceSettings
from asperity.contact.response.stiffness import contact_stiffness
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body

if TYPE_CHECKING:
    import mujoco

MAX_PATCHES = 32
"""Room for patches of contact between geoms."""
MAX_PAIRS = 512
"""Room for pairs of geoms."""


class ContactSolver:
    """Contact forces between a tool and the bodies of a scene.

    Parameters
    ----------
    model : mujoco.MjModel
        The scene; the tool is its body with a freejoint. The model is not changed.
    bodies : sequence of Body
        The bodies of the model with their textures, in any order; the geoms of each in the order
        of the model.
    tool : str
        Name of the tool.
    settings : ForceSettings, optional
        Force law and its parameters; by default those of `ForceSettings()`.

    Attributes
    ----------
    contacts : Contacts
        The contacts of the last pose, in arrays that are used again; only the first
        `contacts.count[0]` rows are valid.
    centre : (3,) array
        The tool's centre of mass in its own frame [m].
    by_facets : (bodies,) array of int
        Whether contact of the tool with a body is between facets: where either is a mesh.

    Raises
    ------
    AsperityError
        No body has the name `tool`; a body has not as many geoms as its body in the model; or a
        mesh is involved and `settings` has another law than "otaduy-lin" or another gradient
        than "exact".

    Notes
    -----
    Forces are those of Otaduy & Lin (2004, Eqs 2 and 3), with certified penetration depths and
    exact gradients. The baselines are listed in `response.point_laws`.
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
        self._scene = _scene_model(bodies, tool, self._collider)
        self.by_facets = _meets_by_facets(bodies, self._scene.tool)
        if self.by_facets.any():
            _refuse_for_meshes(self.settings)
        self._mesh = _mesh_side(bodies, self._scene, self.by_facets)
        self._by_geoms = sum(self.by_facets) < len(bodies) - 1
        self._model = _without_meshes(self._scene, self.by_facets)
        most = max(len(body.geoms) for body in bodies)
        self._memory = geom_memory(MAX_PAIRS, MAX_PATCHES, most)
        self._space = _search_space(most, self._by_geoms, self._mesh is not None)
        # Fields of one record: much faster to set than those of `search[0]`.
        self._deadline = self._space.search["deadline"]
        self._is_cut_short = self._space.search["is_cut_short"]
        most_patches = MAX_PATCHES if self._mesh is None else MAX_PATCHES + MAX_MESH_PATCHES
        self.contacts: Contacts = empty_contacts(most_patches)
        # The kernels look up the types of their arguments at the first call only.
        self._pose, self._out = np.zeros(7), Output(self.contacts, np.zeros(6))
        self._tick, self._mesh_tick = Repeated(tick), Repeated(mesh_tick)
        self._stiffness = Repeated(contact_stiffness)
        self._law = _force_law(self.settings)
        self.reset()

    def change(self, settings: ForceSettings) -> None:
        """Change stiffness and friction from the next pose on.

        Parameters
        ----------
        settings : ForceSettings
            Its `stiffness`, `friction`, `dissipation` and `bristle_stiffness` are used; all else
            stays.
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
        # The generator counts up from here: seeds must not begin a few steps apart.
        forget_geoms(self._memory, np.random.default_rng(self.settings.seed).integers(2**48).item())
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
            Time since the last call [s], by which bristles and noise advance. With 0 nothing is
            remembered of this pose.
        seconds : float
            Time limit of the searches [s]. A search that reaches it returns the best that it has
            found; its remaining uncertainty is the `gap` of the contact, and `was_cut` is true.
            Only the searches are cut short.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes. The same
            array in every call.
        """
        self._pose[:] = pose
        self._deadline[0], self._is_cut_short[0] = ends_in(seconds), False
        in_contact = None if self._mesh is None else self._mesh.memory.in_contact
        query = Query(self._pose, float(dt), self._collider.query(self._pose, in_contact))
        if self._by_geoms:
            self._tick(self._model, self._law, query, self._memory, self._space, self._out)
        else:
            self._out.wrench[:] = 0.0
            self.contacts.count[:] = 0
        if self._mesh is not None and self._add_meshes(self._mesh, query):
            # The tool has jumped: bodies that it was in contact with have to be queried after all.
            self._add_meshes(
                self._mesh, query._replace(candidates=self._collider.query(self._pose))
            )
        return self._out.wrench

    def _add_meshes(self, mesh: _MeshSide, query: Query) -> bool:
        """Add contact between facets; return whether candidates of all bodies are needed."""
        missing: bool = self._mesh_tick(
            mesh.model, self._law.parameters, query, mesh.memory, mesh.space, self._space, self._out
        )
        return missing

    @property
    def was_cut(self) -> bool:
        """Whether the time limit ended a search of the last pose."""
        return bool(self._is_cut_short[0])

    def stiffness(self) -> NDArray[np.float64]:
        """Return the negative derivative of the last wrench by the tool's motion.

        Returns
        -------
        (6, 6) array
            About the tool's centre of mass, world axes [N/m, N/rad; N, N m/rad]; symmetric and
            positive semidefinite but for friction. Without the term that grows with the depth
            (see `response.stiffness`).
        """
        out = np.empty((6, 6))
        self._stiffness(
            self.contacts, self._pose, self.centre, self._law.parameters, self.by_facets, out
        )
        return out


class _MeshSide(NamedTuple):
    """What contact with meshes needs in addition."""

    model: MeshModel
    memory: MeshMemory
    space: FacetSpace


def _scene_model(bodies: Sequence[Body], tool: str, collider: Collider) -> SceneModel:
    textures, geometry = flatten_bodies(bodies)
    number = [body.name for body in bodies].index(tool)
    covered = covered_faces(geometry, collider.frames, number)
    return SceneModel(
        textures=textures,
        geometry=geometry._replace(covered=covered),
        tool=number,
        centre=collider.centre,
        frames=collider.frames,
        geom_number=collider.geom_number,
    )


def _meets_by_facets(bodies: Sequence[Body], tool: int) -> NDArray[np.int64]:
    """Return which bodies the tool meets facet by facet: all of them if it is a mesh itself."""
    mesh = [body.mesh is not None for body in bodies]
    return np.array([i != tool and (mesh[i] or mesh[tool]) for i in range(len(bodies))], np.int64)


def _without_meshes(scene: SceneModel, by_facets: NDArray[np.int64]) -> SceneModel:
    """Return the scene without the geoms of bodies that the tool meets facet by facet."""
    number = scene.geom_number.copy()
    for i, geom in enumerate(number):
        if geom >= 0 and by_facets[scene.geometry.body[geom]]:
            number[i] = -1
    return scene._replace(geom_number=number)


def _mesh_side(
    bodies: Sequence[Body], scene: SceneModel, by_facets: NDArray[np.int64]
) -> _MeshSide | None:
    """Return what contact with meshes needs, None if no mesh is involved."""
    if not by_facets.any():
        return None
    facets = facet_table(bodies, scene.textures, scene.geometry)
    return _MeshSide(
        model=MeshModel(scene, facets, by_facets),
        memory=mesh_memory(len(bodies)),
        space=facet_space(facets, len(scene.geometry.kind)),
    )


def _search_space(geoms: int, by_geoms: bool, by_facets: bool) -> Workspace:
    """Allocate the memory of the search for bodies of at most so many geoms."""
    patches, pairs = (3 * geoms, 9 * geoms * geoms) if by_geoms else (1, 1)
    if by_facets:
        patches, pairs = max(patches, MAX_SURFACE_PATCHES), max(pairs, MAX_CANDIDATES)
    return workspace(patches, pairs)


def _refuse_for_meshes(settings: ForceSettings) -> None:
    """Refuse laws and gradients that contact with meshes does not have."""
    for name, value, only in (
        ("law", settings.law, "otaduy-lin"),
        ("gradient", settings.gradient, "exact"),
    ):
        if value != only:
            raise AsperityError(f"where a mesh is involved, {name} must be {only!r}, got {value!r}")


def _force_law(settings: ForceSettings) -> ForceLaw:
    return ForceLaw(_parameters(settings), _grid_method(settings), _point_law(settings))


def _parameters(settings: ForceSettings) -> ForceParameters:
    bristle = settings.bristle_stiffness
    return ForceParameters(
        stiffness=float(settings.stiffness),
        friction=float(settings.friction),
        dissipation=float(settings.dissipation),
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


def _point_law(settings: ForceSettings) -> PointLaw | None:
    law = LAWS.index(settings.law)
    if law == OTADUY_LIN:
        return None
    return PointLaw(
        law=law,
        ho_gain=float(settings.ho_gain),
        noise_level=float(settings.noise_level),
        noise_bandwidth=float(settings.noise_bandwidth),
    )
