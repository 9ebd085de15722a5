"""Bodies as flat arrays for the kernels of a skin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.contact.body_arrays import Geometry, flatten_bodies
from asperity.contact.broad_phase.geom_pairs import radius_around
from asperity.contact.soft.mesh_facets import as_one_geom, mesh_facets
from asperity.contact.soft.sheets import BOX, MESH, PLANE, REACH, Solids
from asperity.errors import AsperityError
from asperity.geometry.bodies import KINDS, MAPPINGS, Body
from asperity.geometry.poses import rotation_of
from asperity.texture.packed import PackedTextures


def solids_of(bodies: Sequence[Body], poses: Sequence[Array]) -> Solids:
    """Return the geoms, meshes and textures of bodies at their poses (7,).

    Raises
    ------
    AsperityError
        A body is not rigid, has a map of friction or stiffness, or an open mesh.
    """
    for body in bodies:
        if not isinstance(body, Body):
            raise AsperityError(
                f"a soft layer meets rigid bodies, got a {type(body).__name__}; valid: Body, as "
                "two surfaces that both yield do not meet each other"
            )
    refuse_property_maps(bodies)
    bodies = [as_one_geom(body) for body in bodies]
    textures, geometry = flatten_bodies(bodies)
    reach, frames = _reach(textures, geometry), np.empty((len(geometry.kind), 3, 4))
    meshes = mesh_facets(bodies, textures, geometry, reach)
    bound, extent = _bound(geometry, reach), _extent(geometry, reach)
    if meshes is not None:
        of_mesh = geometry.kind == MESH
        bound[of_mesh] = np.linalg.norm(geometry.size[of_mesh], axis=1) + meshes.grow[of_mesh]
        extent[of_mesh] = geometry.size[of_mesh] + meshes.grow[of_mesh, None]
    solids = Solids(textures, geometry, reach, frames, bound, extent, meshes)
    fill_frames(solids, poses)
    return solids


def require_bodies(what: str, bodies: Sequence[Body]) -> None:
    """Raise `AsperityError` unless there is a sequence of at least one body."""
    if not isinstance(bodies, Sequence):
        raise AsperityError(
            f"{what} meets a sequence of rigid bodies, got a {type(bodies).__name__}; valid: [Body]"
        )
    if not bodies:
        raise AsperityError(f"{what} needs one body at least to meet; got none")


def refuse_property_maps(bodies: Sequence[Body]) -> None:
    """Raise `AsperityError` for a friction or stiffness map: those of the skin are used."""
    for body in bodies:
        if body.friction_maps:
            raise AsperityError(
                f"friction of body {body.name!r} is a map; with a soft skin, friction is one "
                "number, the skin's"
            )
        if body.stiffness_maps:
            raise AsperityError(
                f"stiffness of body {body.name!r} is a map; with a soft skin, the skin's modulus "
                "counts: leave it out"
            )


def smooth(solids: Solids) -> Solids:
    """Return the same solids without textures."""
    geometry = solids.geometry
    return solids._replace(
        geometry=geometry.smooth(),
        reach=np.zeros(len(geometry.kind), REACH),
    )


def _reach(textures: PackedTextures, geometry: Geometry) -> NDArray[np.void]:
    """Return bounds of the textures on each geom, `REACH` records."""
    out = np.zeros(len(geometry.kind), REACH)
    for g, surface in enumerate(geometry.surface):
        k, mapping = int(geometry.texture[surface]), MAPPINGS[geometry.mapping[surface]]
        if k < 0:
            continue
        found = textures.maps[k]
        # The blending weights of three maps change along the surface too.
        factors = {"triplanar": 2.0, "cylindrical": max(1.0, float(geometry.around[g]))}
        factor = factors.get(mapping, 1.0)
        slope = float(found["max_slope"]) * factor
        bend = float(found["max_curvature"]) * factor**2
        if geometry.kind[g] not in (PLANE, BOX):
            bend += 4.0 * (1.0 + slope) / min(size for size in geometry.size[g] if size > 0.0)
        out[g] = -found["max_abs_surface"], max(found["highest"], 0.0), slope, bend
    return out


def _bound(geometry: Geometry, reach: NDArray[np.void]) -> Array:
    """Return the radius of each geom's bounding sphere [m]; infinite for planes."""
    kinds, sizes = (KINDS[kind] for kind in geometry.kind), geometry.size.tolist()
    out = np.array([
        np.inf if kind == "plane" else radius_around(kind, *size)
        for kind, size in zip(kinds, sizes, strict=True)
    ])  # fmt: skip
    # Raised faces of a box extend until they intersect: its corners are raised by three of them.
    return out + np.sqrt(3.0) * reach["highest"]


def _extent(geometry: Geometry, reach: NDArray[np.void]) -> Array:
    """Return half sides of the bounding box of each geom's textured surface [m], (geoms, 3)."""
    out = np.array(geometry.size)
    for own, kind in zip(out, geometry.kind, strict=True):
        name = KINDS[kind]
        if name == "plane":
            own[:] = np.inf, np.inf, 0.0
        elif name in ("sphere", "capsule", "cylinder"):
            radius, length = own[0], own[1] if name != "sphere" else 0.0
            own[:] = radius, radius, length if name == "cylinder" else radius + length
    return np.asarray(out + reach["highest"][:, None])


def fill_frames(solids: Solids, poses: Sequence[Array]) -> list[Array]:
    """Fill the frames of geoms from the poses (7,) of their bodies; return the rotations."""
    geometry, turns = solids.geometry, [rotation_of(pose[3:]) for pose in poses]
    for g, body in enumerate(geometry.body):
        solids.frames[g, :, :3] = turns[body] @ geometry.rotation[g]
        solids.frames[g, :, 3] = turns[body] @ geometry.position[g] + poses[body][:3]
    return turns
