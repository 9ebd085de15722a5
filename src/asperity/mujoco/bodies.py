"""Geoms of a MuJoCo model as asperity's bodies, each with its frame in the body that carries it.

A body's texture is one map in the body's frame, over all its geoms, so that a plate may be one box
or sixty-four. The texture of a geom or a material is a map in the frame of each geom (for a mesh,
that of its file). Geoms without a texture that may touch one with it are bodies too: the simple
geoms of a body together, a mesh as its convex hull, which MuJoCo uses for collisions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom, Surface
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.normals import HARD_ANGLE
from asperity.geometry.poses import rotation_of
from asperity.mujoco.names import geom_name, resolve, touchable
from asperity.mujoco.terrain import terrain_surface
from asperity.mujoco.textures import surface_of
from asperity.scene.mjcf import GEOMS, model_mesh
from asperity.texture.friction_map import FrictionMap

_HFIELD, _MESH = int(mujoco.mjtGeom.mjGEOM_HFIELD), int(mujoco.mjtGeom.mjGEOM_MESH)
_DEFAULT_MAPPINGS = {"plane": "planar", "box": "planar", "cylinder": "cylindrical"}
"""Default mapping of a texture by kind of geom; else triplanar."""
_ROUND = ("sphere", "ellipsoid")


@dataclass(frozen=True, eq=False)
class Carried:
    """One of asperity's bodies, and the body of the MuJoCo model that carries it."""

    body: Body
    carrier: int
    """Number of the body in the MuJoCo model."""
    local: NDArray[np.float64]
    """Its frame in the carrier's, (3, 4) [m]."""
    geoms: tuple[int, ...]
    """Its geoms in the MuJoCo model, in the order of `body.geoms`; all of them for a mesh."""
    is_flat: bool
    """Whether it may touch over an area or along an edge: its contacts are then split."""
    is_textured: bool


@dataclass(frozen=True, eq=False)
class CarriedBodies:
    """All bodies with a texture, and those that they may touch."""

    bodies: tuple[Carried, ...]
    is_textured: NDArray[np.bool_]
    """Whether each geom of the MuJoCo model has a texture, (ngeom,)."""
    top: NDArray[np.float64]
    """Upper bound of the height of each geom's texture [m], (ngeom,)."""
    friction: NDArray[np.float64]
    """Coulomb's coefficient given for the surface of each geom, nan for none; (ngeom,)."""
    notes: tuple[str, ...]


def carried_bodies(model: mujoco.MjModel, textures: Mapping[str, Any]) -> CarriedBodies:
    """Return the bodies for the given textures; see `names.resolve` for the names.

    Raises
    ------
    AsperityError
        An unknown name, a texture that cannot be used, or one that is too tall for its geom.
    """
    by_geom: dict[int, tuple[str, Any]] = {}
    can_be_touched = touchable(model)
    for named in resolve(model, textures):
        for geom in named.geoms:
            if can_be_touched[geom]:
                by_geom[geom] = ("body" if named.kind == "body" else "geom", named.value)
    made: dict[tuple[int, str], Surface] = {}  # the same texture is read once
    surfaces = {geom: _surface(model, geom, value, made) for geom, (_, value) in by_geom.items()}
    friction = np.full(max(model.ngeom, 1), np.nan)
    for geom, surface in surfaces.items():
        if isinstance(surface.friction, FrictionMap):
            raise AsperityError(
                f"{geom_name(model, geom)}: friction is MuJoCo's here, a number; a map is for "
                "contact without it"
            )
        if surface.stiffness_map is not None:
            raise AsperityError(
                f"{geom_name(model, geom)}: stiffness is one number in MuJoCo's contacts; a map is "
                "for contact without it"
            )
        if surface.friction is not None:
            friction[geom] = surface.friction
    # Friction is MuJoCo's: asperity's contacts have none of their own.
    without = {id(surface): replace(surface, friction=None) for surface in surfaces.values()}
    surfaces = {geom: without[id(surface)] for geom, surface in surfaces.items()}
    is_textured = np.zeros(max(model.ngeom, 1), bool)
    # A map of zeros is no texture: MuJoCo computes the contacts of such pairs.
    is_textured[[g for g, surface in surfaces.items() if _matters(surface)]] = True
    bodies: list[Carried] = []
    notes: list[str] = []
    for key, geoms in _groups(model, by_geom, is_textured, can_be_touched).items():
        one = _carried(model, key, geoms, surfaces, bool(is_textured[geoms[0]]), notes)
        if one is not None:
            bodies.append(one)
    top = np.zeros(max(model.ngeom, 1))
    for one in bodies:
        fields = one.body.fields
        if one.is_textured and fields and int(model.geom_type[one.geoms[0]]) != _HFIELD:
            top[list(one.geoms)] = max(float(np.abs(f.coefficients).max()) for f in fields)
    for geom, surface in surfaces.items():
        if int(model.geom_type[geom]) == _HFIELD and surface.texture is not None:
            top[geom] = float(np.abs(surface.texture.coefficients).max())
    return CarriedBodies(tuple(bodies), is_textured, top, friction, tuple(notes))


def _matters(surface: Surface) -> bool:
    """Return whether a surface differs from MuJoCo's own."""
    field = surface.texture
    rough = field is not None and bool(field.lowest or field.highest)
    return rough or surface.stiffness is not None


def _surface(
    model: mujoco.MjModel, geom: int, value: Any, made: dict[tuple[int, str], Surface]
) -> Surface:
    """Return the surface of a geom, from the cache `made` by value and mapping if possible."""
    kind = int(model.geom_type[geom])
    simple = GEOMS.get(mujoco.mjtGeom(kind))
    if kind != _HFIELD and simple is None:
        name = mujoco.mjtGeom(kind).name[7:].lower()
        raise AsperityError(
            f"{geom_name(model, geom)} is of type {name}, which can have no texture; valid: "
            f"{', '.join(GEOMS.values())}, hfield"
        )
    default = "planar" if kind == _HFIELD else _DEFAULT_MAPPINGS.get(simple or "", "triplanar")
    if (id(value), default) not in made:
        try:
            made[id(value), default] = surface_of(value, default)
        except AsperityError as error:
            raise AsperityError(f"{geom_name(model, geom)}: {error}") from None
    if made[id(value), default].mapping == "uv" and kind != _MESH:
        raise AsperityError(
            f"{geom_name(model, geom)} has no texture coordinates for mapping uv; valid: planar, "
            "triplanar"
        )
    return made[id(value), default]


def _groups(
    model: mujoco.MjModel, by_geom: Mapping[int, tuple[str, Any]], is_textured: NDArray[np.bool_],
    can_be_touched: NDArray[np.bool_],
) -> dict[tuple[Any, ...], list[int]]:  # fmt: skip
    """Return the geoms of each of asperity's bodies, by a key."""
    partners = _partners(model, is_textured, can_be_touched)
    groups: dict[tuple[Any, ...], list[int]] = {}
    for geom in range(model.ngeom):
        if not (is_textured[geom] or partners[geom]):
            continue
        owner, kind = int(model.geom_bodyid[geom]), int(model.geom_type[geom])
        if not is_textured[geom]:
            key: tuple[Any, ...] = ("mesh", geom) if kind in (_MESH, _HFIELD) else ("smooth", owner)
        elif by_geom[geom][0] == "body" and kind != _HFIELD:
            key = ("body", owner, id(by_geom[geom][1]), kind == _MESH)
        else:
            key = ("geom", geom)
        groups.setdefault(key, []).append(geom)
    return groups


def _partners(
    model: mujoco.MjModel, is_textured: NDArray[np.bool_], can_be_touched: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return whether each geom may touch a textured one by the model's filters."""
    kinds, wanted = model.geom_contype, model.geom_conaffinity
    of_textured = np.flatnonzero(is_textured)
    any_kind = np.bitwise_or.reduce(kinds[of_textured]) if of_textured.size else 0
    any_wanted = np.bitwise_or.reduce(wanted[of_textured]) if of_textured.size else 0
    found = ((kinds & any_wanted) | (wanted & any_kind)) != 0
    for one, two in ((model.pair_geom1, model.pair_geom2), (model.pair_geom2, model.pair_geom1)):
        found[one[is_textured[two]]] = True
    return np.asarray(found & can_be_touched)


def _carried(
    model: mujoco.MjModel, key: tuple[Any, ...], geoms: Sequence[int],
    surfaces: Mapping[int, Surface], is_textured: bool, notes: list[str],
) -> Carried | None:  # fmt: skip
    """Return the body of some geoms; None if geoms without a texture cannot be one."""
    kind, first = int(model.geom_type[geoms[0]]), geoms[0]
    name, carrier = geom_name(model, first), int(model.geom_bodyid[first])
    try:
        if kind == _HFIELD:
            return _terrain(model, first, surfaces.get(first), is_textured)
        if kind == _MESH:
            return _of_meshes(model, key, geoms, surfaces.get(first), is_textured)
        whole = key[0] != "geom"
        local = np.eye(3, 4) if whole else frame_of(model.geom_pos[first], model.geom_quat[first])
        simple = [
            simple_geom(model, geom, surfaces.get(geom) if is_textured else None, whole)
            for geom in geoms
            if mujoco.mjtGeom(int(model.geom_type[geom])) in GEOMS
        ]
        if not simple:
            return None
        body = Body(name, simple)
    except AsperityError as error:
        text = str(error).replace(f"the texture of body {name!r}", "its texture")
        if is_textured:
            raise AsperityError(f"{name}: {text}") from None
        notes.append(f"{name} feels no texture: {text}")
        return None
    own = tuple(g for g in geoms if mujoco.mjtGeom(int(model.geom_type[g])) in GEOMS)
    is_flat = any(geom.kind not in _ROUND for geom in simple)
    return Carried(body, carrier, local, own, is_flat, is_textured)


def simple_geom(model: mujoco.MjModel, geom: int, surface: Surface | None, whole: bool) -> Geom:
    """Return a simple geom, in its body's frame if `whole`, else in its own."""
    kind = GEOMS[mujoco.mjtGeom(int(model.geom_type[geom]))]
    size = model.geom_size[geom]
    if not whole:
        return Geom(kind, size, surface=surface)
    return Geom(kind, size, model.geom_pos[geom], model.geom_quat[geom], surface)


def frame_of(position: NDArray[Any], quaternion: NDArray[Any]) -> NDArray[np.float64]:
    """Return the frame (3, 4) of a position and a quaternion."""
    return np.column_stack([rotation_of(quaternion), position])


def _of_meshes(
    model: mujoco.MjModel, key: tuple[Any, ...], geoms: Sequence[int], surface: Surface | None,
    is_textured: bool,
) -> Carried:  # fmt: skip
    """Return the body of mesh geoms: their surfaces where textured, else a convex hull."""
    first = geoms[0]
    carrier, name = int(model.geom_bodyid[first]), geom_name(model, first)
    if key[0] == "body":
        local = np.eye(3, 4)
    else:
        local = frame_of(model.geom_pos[first], model.geom_quat[first])
        number = int(model.geom_dataid[first])
        turn = rotation_of(model.mesh_quat[number]).T
        # From MuJoCo's frame, that of the inertia, to that of the file.
        local = np.column_stack(
            [local[:, :3] @ turn, local[:, 3] - local[:, :3] @ turn @ model.mesh_pos[number]]
        )
    parts = []
    for geom in geoms:
        vertices, faces = model_mesh(model, int(model.geom_dataid[geom]))
        if not is_textured:
            vertices, faces = _hull(vertices)
        turn = rotation_of(model.geom_quat[geom])
        inside = vertices @ turn.T + model.geom_pos[geom] - local[:, 3]
        parts.append((inside @ local[:, :3], faces))
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([f + start for (_, f), start in zip(parts, starts[:-1], strict=True)])
    uv = None
    if surface is not None and surface.mapping == "uv":
        uv = np.concatenate([mesh_uv(model, geom) for geom in geoms])
    mesh = mesh_from_arrays(vertices, faces, uv=uv, hard_angle=HARD_ANGLE, name=name)
    body = Body(name, [_bounding_box(mesh)], mesh=mesh)
    if is_textured and surface is not None:
        body = Body(
            name, body.geoms, surface.texture, surface.mapping, surface.offset, mesh,
            surface.friction, surface.stiffness,
        )  # fmt: skip
    return Carried(body, carrier, local, tuple(geoms), True, is_textured)


def _hull(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices and faces of the convex hull of points, oriented outwards."""
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    try:
        hull = ConvexHull(points)
    except QhullError:
        raise AsperityError("its mesh is flat") from None
    faces = hull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    used, renumbered = np.unique(faces, return_inverse=True)
    return points[used], renumbered.reshape(-1, 3).astype(np.int64)


def mesh_uv(model: mujoco.MjModel, geom: int) -> NDArray[np.float64]:
    """Return the texture coordinates of the corners of a mesh geom's triangles, (m, 3, 2)."""
    mesh = int(model.geom_dataid[geom])
    start = int(model.mesh_texcoordadr[mesh])
    if start < 0:
        raise AsperityError("its mesh has no texture coordinates; valid: planar, triplanar")
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    corners = model.mesh_facetexcoord[first : first + count]
    found = np.asarray(model.mesh_texcoord[start:][corners], dtype=np.float64)
    # MuJoCo's v is reversed.
    return np.stack([found[:, :, 0], 1.0 - found[:, :, 1]], axis=2)


def _bounding_box(mesh: Mesh) -> Geom:
    """Return the only geom of a mesh body: the mesh's bounding box."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return Geom("mesh", np.maximum(0.5 * (high - low), 1e-9), 0.5 * (low + high))


def _terrain(
    model: mujoco.MjModel, geom: int, surface: Surface | None, is_textured: bool
) -> Carried:
    """Return the body of a height field: a plane whose texture is the terrain."""
    terrain = terrain_surface(model, int(model.geom_dataid[geom]), surface)
    size = model.hfield_size[int(model.geom_dataid[geom])]
    body = Body(geom_name(model, geom), [Geom("plane", (*size[:2], 0.0), surface=terrain)])
    local = frame_of(model.geom_pos[geom], model.geom_quat[geom])
    # Its heights are too large to count as flat, for patches with a flat base.
    return Carried(body, int(model.geom_bodyid[geom]), local, (geom,), False, is_textured)
