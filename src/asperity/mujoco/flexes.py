"""Flexes of a MuJoCo model as deformable textured surfaces, and the bodies that they may touch.

MuJoCo's elements have a radius. The textured surface is offset by it from the flex's triangles,
along their normals; between them is the elastic layer (`contact.deformable`). A sheet has two such
surfaces, one on each side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.contact.deformable.surface import DeformableSurface
from asperity.errors import AsperityError, require_between
from asperity.geometry.bodies import Body, Surface
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.normals import HARD_ANGLE
from asperity.geometry.mesh.topology import crosses
from asperity.mujoco.bodies import Carried, CarriedBodies, simple_geom
from asperity.mujoco.flex_material import flex_material
from asperity.mujoco.names import geom_name, resolve, touchable
from asperity.mujoco.textures import Layer, surface_of
from asperity.scene.mjcf import GEOMS
from asperity.texture.friction_map import FrictionMap

_MODULUS, _POISSON, _MOST_POISSON = 1e5, 0.3, 0.45
"""Of the layer of a flex without elasticity [Pa, -], and the largest default of the ratio."""
_MOST_TAXELS = 100_000
"""Maximum number of taxels with the default pitch."""
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


@dataclass(frozen=True, eq=False)
class FlexSurface:
    """A flex with a texture.

    Attributes
    ----------
    flex : int
        Its number in the model.
    name : str
        For messages.
    sides : tuple of DeformableSurface
        One, or two for a sheet.
    vertices : (v,) array of int
        Numbers of the flex's vertices in the sides' meshes.
    bodies : mapping
        Bodies that it may touch, by the number of the body in the model.
    is_met : (ngeom,) array of bool
        Whether a geom belongs to these bodies.
    top : float
        Height of the texture above the flex's radius [m].
    friction : float
        Coulomb's coefficient given for it, nan for none.
    damping : float
        Of the layer, over its stiffness [s].
    """

    flex: int
    name: str
    sides: tuple[DeformableSurface, ...]
    vertices: NDArray[np.int64]
    bodies: Mapping[int, tuple[Carried, ...]]
    is_met: NDArray[np.bool_]
    top: float
    friction: float
    damping: float


def flex_surfaces(
    model: mujoco.MjModel, textures: Mapping[str, Any], carried: CarriedBodies
) -> tuple[tuple[FlexSurface, ...], list[str]]:
    """Return the flexes that have textures, and notes.

    Parameters
    ----------
    model : mujoco.MjModel
    textures : mapping
        See `names.resolve`.
    carried : CarriedBodies
        The geoms' textures.

    Raises
    ------
    AsperityError
        A flex or a texture that cannot be used; one line.
    """
    named = {one.flex: one for one in resolve(model, textures) if one.kind == "flex"}
    if not named:
        return (), []
    if int(model.opt.enableflags) & int(getattr(mujoco.mjtEnableBit, "mjENBL_IPC", 0)):
        raise AsperityError(
            "the model's flag ipc solves the contacts of flexes itself; switch it off to give a "
            "flex a texture"
        )
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    notes: list[str] = []
    out = []
    for flex, one in named.items():
        start, count = int(model.flex_vertadr[flex]), int(model.flex_vertnum[flex])
        places = np.array(data.flexvert_xpos[start : start + count])
        try:
            out.append(_flex_surface(model, flex, one.value, places, carried, notes))
        except AsperityError as error:
            text = str(error)
            name = f"flex {one.name!r}"
            raise AsperityError(text if text.startswith(name) else f"{name}: {text}") from None
    return tuple(out), notes


def _flex_surface(
    model: mujoco.MjModel, flex: int, value: Any, places: NDArray[np.float64],
    carried: CarriedBodies, notes: list[str],
) -> FlexSurface:  # fmt: skip
    name = f"flex {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)!r}"
    layer = value if isinstance(value, Layer) else Layer(value)
    surface = Surface() if layer.texture is None else surface_of(layer.texture, "triplanar")
    if surface.stiffness is not None:
        raise AsperityError("a flex takes no stiffness; give Layer(texture, modulus=...) [Pa]")
    if isinstance(surface.friction, FrictionMap):
        raise AsperityError("a flex takes one number for its friction, not a map")
    if int(model.flex_dim[flex]) == 1:
        raise AsperityError("it is a line (dim 1), which can have no texture; valid: dim 2 or 3")
    if hasattr(model, "flex_passive") and model.flex_passive[flex]:
        raise AsperityError("its contacts are passive, which MuJoCo applies itself; switch it off")
    bodies, is_met = _bodies(model, flex, carried, name, notes)
    mesh, vertices = _mesh(model, flex, places, surface.mapping, name)
    radius = float(model.flex_radius[flex])
    sides = mesh.vertices[mesh.faces]
    edge = float(np.median(np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2)))
    thickness = radius or 0.25 * edge
    if layer.thickness is not None:
        most = radius if int(model.flex_dim[flex]) == 2 else 1.0
        thickness = require_between("thickness", layer.thickness, 1e-6, most, "m")
    own = flex_material(model, flex, places)
    modulus, poisson = own or (_MODULUS, _POISSON)
    modulus = float(modulus if layer.modulus is None else layer.modulus)
    limited = min(max(float(poisson), 0.0), _MOST_POISSON)
    poisson = limited if layer.poisson is None else layer.poisson
    pitch = layer.pitch
    if pitch is None:
        area = 0.5 * float(np.linalg.norm(crosses(sides), axis=1).sum())
        pitch = _pitch(edge, area, surface, bodies, name, notes)
    made = [
        DeformableSurface(
            one, thickness=thickness, modulus=modulus, poisson=poisson, pitch=pitch,
            texture=surface.texture, mapping=surface.mapping, offset=surface.offset, rise=radius,
        )
        for one in ([mesh, _turned(mesh)] if int(model.flex_dim[flex]) == 2 else [mesh])
    ]  # fmt: skip
    count = sum(one.taxel_count for one in made)  # a texture that cannot be used is refused here
    whose = "given" if layer.modulus is not None else "the flex's own" if own else "assumed"
    notes.append(
        f"{name} has a layer of {1e3 * thickness:.3g} mm, {modulus:.3g} Pa ({whose}), Poisson's "
        f"ratio {poisson:.2g}, and {count} taxels {1e3 * pitch:.3g} mm apart"
    )
    field = surface.texture
    top = float(np.abs(field.coefficients).max()) if field is not None else 0.0
    damping = float(model.flex_damping[flex]) if own else 0.0
    friction = np.nan if surface.friction is None else float(surface.friction)
    return FlexSurface(flex, name, tuple(made), vertices, bodies, is_met, top, friction, damping)


def flex_triangles(model: mujoco.MjModel, flex: int) -> NDArray[np.int32]:
    """Return the surface of a solid flex, or the elements of a sheet, (n, 3); empty for a rope."""
    dim = int(model.flex_dim[flex])
    if dim == 3:
        start, count = int(model.flex_shelldataadr[flex]), int(model.flex_shellnum[flex])
        return np.array(model.flex_shell[start : start + 3 * count]).reshape(-1, 3)
    if dim == 2:
        start, count = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
        return np.array(model.flex_elem[start : start + 3 * count]).reshape(-1, 3)
    return np.zeros((0, 3), np.int32)


def _mesh(
    model: mujoco.MjModel, flex: int, places: NDArray[np.float64], mapping: str, name: str
) -> tuple[Mesh, NDArray[np.int64]]:
    """Return the triangles of a flex at rest, oriented outwards, and the vertices that they use."""
    used, faces = np.unique(flex_triangles(model, flex), return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int64)
    uv = _uv(model, flex, len(places))[used] if mapping == "uv" else None
    mesh = mesh_from_arrays(places[used], faces, uv=uv, hard_angle=HARD_ANGLE, name=name)
    if not np.array_equal(mesh.vertices, places[used]) or len(mesh.faces) != len(faces):
        raise AsperityError("its surface has triangles without area, or some of them twice")
    return mesh, used.astype(np.int64)


def _uv(model: mujoco.MjModel, flex: int, count: int) -> NDArray[np.float64]:
    """Return the texture coordinates of the vertices of a flex, (count, 2)."""
    start = int(model.flex_texcoordadr[flex])
    if start < 0:
        raise AsperityError(
            "it has no texture coordinates for mapping uv; valid: triplanar, planar"
        )
    later = model.flex_texcoordadr[model.flex_texcoordadr > start]
    found = model.flex_texcoord[start : int(later.min()) if later.size else None]
    if len(found) != count:
        raise AsperityError(
            f"it has {len(found)} texture coordinates for {count} vertices; mapping uv needs one "
            "for each"
        )
    # MuJoCo's v is reversed.
    return np.asarray(found, dtype=np.float64) * [1.0, -1.0] + [0.0, 1.0]


def _turned(mesh: Mesh) -> Mesh:
    """Return the other side of a sheet."""
    uv = None if mesh.uv is None else np.ascontiguousarray(mesh.uv[:, ::-1])
    return replace(
        mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]),
        normals=np.ascontiguousarray(-mesh.normals[:, ::-1]), uv=uv,
    )  # fmt: skip


def _bodies(
    model: mujoco.MjModel, flex: int, carried: CarriedBodies, name: str, notes: list[str]
) -> tuple[dict[int, tuple[Carried, ...]], NDArray[np.bool_]]:
    """Return the bodies that a flex may touch, by the body that carries them, and their geoms."""
    kinds, wanted = model.geom_contype, model.geom_conaffinity
    meets = (kinds & model.flex_conaffinity[flex]) | (wanted & model.flex_contype[flex]) != 0
    meets &= touchable(model)
    simple = np.array(
        [kind != _MESH and mujoco.mjtGeom(int(kind)) in GEOMS for kind in model.geom_type], bool
    )
    left = [geom_name(model, int(g)) for g in np.flatnonzero(meets & ~simple)]
    if left:
        shown = ", ".join(left[:4]) + (", ..." if len(left) > 4 else "")
        notes.append(f"{name} meets {shown} in MuJoCo's own contacts: no simple geom")
    kinds, wanted = model.flex_contype, model.flex_conaffinity
    others = (kinds & wanted[flex]) | (wanted & kinds[flex]) != 0
    for other in np.flatnonzero(others & (np.arange(model.nflex) != flex)).tolist():
        notes.append(
            f"{name} meets flex {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, other)!r} in "
            "MuJoCo's own contacts, without texture: both yield"
        )
    is_met = np.asarray(meets & simple)
    found = []
    for one in carried.bodies:
        mine = is_met[list(one.geoms)]
        if one.is_textured and mine.any():
            if not mine.all():
                raise AsperityError(
                    f"it may touch some geoms of the texture of {one.body.name} and not others "
                    "(contype, conaffinity); give these geoms textures of their own"
                )
            found.append(one)
    smooth = is_met & ~carried.is_textured[: model.ngeom]
    for carrier in np.unique(model.geom_bodyid[smooth]).tolist():
        own = np.flatnonzero(smooth & (model.geom_bodyid == carrier)).tolist()
        body = Body(geom_name(model, own[0]), [simple_geom(model, g, None, True) for g in own])
        found.append(Carried(body, carrier, np.eye(3, 4), tuple(own), False, False))
    out: dict[int, tuple[Carried, ...]] = {}
    for one in found:
        out[one.carrier] = (*out.get(one.carrier, ()), one)
    return out, is_met


def _pitch(
    edge: float, area: float, surface: Surface, bodies: Mapping[int, tuple[Carried, ...]],
    name: str, notes: list[str],
) -> float:  # fmt: skip
    """Return the default distance between taxels [m]."""
    fields = [f for group in bodies.values() for one in group for f in one.body.fields]
    fields += [surface.texture] if surface.texture is not None else []
    fields = [f for f in fields if f.lowest or f.highest]
    wanted = min([edge / 8.0, *(f.shortest_wavelength / 4.0 for f in fields)])
    least = float(np.sqrt(area / _MOST_TAXELS))
    if wanted < least:
        notes.append(
            f"{name} has taxels {1e3 * least:.3g} mm apart, where a quarter of the shortest wave "
            f"is {1e3 * wanted:.3g} mm: what is finer is averaged"
        )
    return max(wanted, least)
