"""Rigid bodies of simple geoms or a mesh, with one texture on all of them.

A geom has one of MuJoCo's kinds and sizes (half sizes). The texture belongs to the body, so a plate
feels the same whether it is modelled as one box or as sixty-four. A surface is displaced along the
unit normal of its base: `p = base + t w`, with the texture's height t.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from asperity._core.arrays import Array, Mask
from asperity.errors import AsperityError, require_between, require_choice, require_finite
from asperity.geometry.poses import rotation_of
from asperity.texture.friction_map import MOST_FRICTION, FrictionMap
from asperity.texture.stiffness_map import STIFFNESSES, StiffnessMap

if TYPE_CHECKING:
    from asperity.geometry.mesh.mesh import Mesh
    from asperity.texture.height_field import HeightField
    from asperity.texture.sampled_map import SampledMap

KINDS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
MAPPINGS = ("planar", "cylindrical", "triplanar", "uv")
_SIZES = {"plane": 2, "sphere": 1, "capsule": 2, "ellipsoid": 3, "cylinder": 2, "box": 3, "mesh": 3}
"""Number of sizes of each kind: half sides; radius; radius and half length; semi-axes."""


@dataclass(frozen=True)
class Surface:
    """What a geom's surface feels like.

    Parameters
    ----------
    texture : HeightField, optional
        None: smooth.
    mapping : {"planar", "cylindrical", "triplanar", "uv"}
        Mapping of texture, friction and stiffness to the body; see `Body`.
    offset : (2,)
        Position of the maps on the body [m]; see `Body`.
    friction : float or FrictionMap, optional
        Coulomb's coefficient [-], 0 to 100, or a map of it, read at the deepest point of a contact.
        Where two surfaces touch, the larger one counts, as in MuJoCo; where neither has one, that
        of `ForceSettings`. A cylindrical map covers the sides alone: the ends have none.
    stiffness : float or StiffnessMap, optional
        Stiffness of contact with this surface [N/m], 1e-6 to 1e9, or a map of it, as large as the
        texture, if there is one; see `docs/contact.md`. Two surfaces that both have one are springs
        in series; where neither has one, that of `ForceSettings` counts. Of two bodies that touch
        only one may have a map of it. A cylindrical map covers the sides alone.
    """

    texture: HeightField | None = None
    mapping: str = "planar"
    offset: Sequence[float] = (0.0, 0.0)
    friction: float | FrictionMap | None = None
    stiffness: float | StiffnessMap | None = None

    def __post_init__(self) -> None:
        require_choice("mapping", self.mapping, MAPPINGS)
        object.__setattr__(self, "offset", require_finite("offset", self.offset, 2))
        if self.friction is not None and not isinstance(self.friction, FrictionMap):
            require_between("friction", self.friction, 0.0, MOST_FRICTION)
        if isinstance(self.stiffness, StiffnessMap):
            _refuse_apart(self.stiffness, self.texture)
        elif self.stiffness is not None:
            require_between("stiffness", self.stiffness, *STIFFNESSES, "N/m")

    @property
    def friction_map(self) -> FrictionMap | None:
        """The friction, if it is a map."""
        return self.friction if isinstance(self.friction, FrictionMap) else None

    @property
    def stiffness_map(self) -> StiffnessMap | None:
        """The stiffness, if it is a map."""
        return self.stiffness if isinstance(self.stiffness, StiffnessMap) else None

    @property
    def laid_map(self) -> SampledMap | None:
        """The map by which places on the surface are measured: texture, stiffness or friction."""
        return self.texture or self.stiffness_map or self.friction_map


@dataclass(frozen=True)
class Geom:
    """A simple solid, placed in its body's frame.

    Parameters
    ----------
    kind : {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"}
        *mesh*: a convex piece of a body that has a `Mesh`. It bounds where the body may touch; the
        surface is that of the mesh.
    size : sequence of float
        MuJoCo's sizes [m]: radius (sphere); radius, half length (capsule, cylinder; along z);
        semi-axes (ellipsoid); half sides (box; mesh; plane, where 0 is unbounded).
    position : (3,)
        Of its centre in the body's frame [m].
    quaternion : (4,)
        Its orientation in the body's frame, wxyz, of unit length.
    surface : Surface, optional
        By default that of its body.
    """

    kind: str
    size: Sequence[float]
    position: Sequence[float] = (0.0, 0.0, 0.0)
    quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    surface: Surface | None = None

    def __post_init__(self) -> None:
        require_choice("kind of geom", self.kind, KINDS)
        count = _SIZES[self.kind]
        try:
            size = (*map(float, self.size), 0.0, 0.0)[:3]
            enough = len(self.size) >= count or self.kind == "plane"
        except (TypeError, ValueError):
            size, enough = (0.0, 0.0, 0.0), False
        if not enough:
            raise AsperityError(f"a {self.kind} needs {count} sizes [m], got {self.size!r}")
        least_wrong = min(size[:count]) < 0.0 if self.kind == "plane" else min(size[:count]) <= 0.0
        if not all(map(math.isfinite, size)) or least_wrong:
            raise AsperityError(f"sizes of a {self.kind} must be above 0 [m], got {self.size!r}")
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "position", require_finite("position", self.position, 3))
        object.__setattr__(self, "quaternion", unit_quaternion(self.quaternion))

    @property
    def smallest(self) -> float:
        """Smallest distance from its centre to its surface [m]; infinite for a plane."""
        return math.inf if self.kind == "plane" else min(self.size[: _SIZES[self.kind]])


@dataclass(frozen=True)
class Body:
    """A rigid body: geoms that move together, and the texture on them.

    Parameters
    ----------
    name : str
    geoms : sequence of Geom
        At least one; their union is one surface.
    texture : HeightField, optional
        None: smooth.
    mapping : {"planar", "cylindrical", "triplanar", "uv"}
        Mapping of the maps to the body. *planar*: (u, v) are x and y in the body's
        frame, on every face. *triplanar*: three planar maps, (y, z), (z, x) and (x, y), blended by
        the fourth powers of the normal's components. *cylindrical*: on the sides of cylinders and
        capsules, u around the axis and v along it; their ends are smooth. On a mesh: u around its z
        axis. *uv*: the mesh's texture coordinates, where 1 is a map's whole extent.
    offset : (2,)
        Position of the maps on the body [m]: of a corner if it wraps, of its middle if clamped.
    mesh : Mesh, optional
        Surface of a body of convex pieces; all its geoms are then of kind "mesh".
    friction : float or FrictionMap, optional
    stiffness : float or StiffnessMap, optional
        See `Surface`.
    """

    name: str
    geoms: Sequence[Geom]
    texture: HeightField | None = None
    mapping: str = "planar"
    offset: Sequence[float] = field(default=(0.0, 0.0))
    mesh: Mesh | None = None
    friction: float | FrictionMap | None = None
    stiffness: float | StiffnessMap | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "geoms", tuple(self.geoms))
        if not self.geoms:
            raise AsperityError(f"body {self.name!r} has no geoms; give it one at least")
        object.__setattr__(self, "offset", self.surface.offset)
        self._refuse_mixed()
        if self.mesh is None:
            for geom, surface in zip(self.geoms, self.surfaces, strict=True):
                self._refuse_surface(geom, surface)

    @property
    def surface(self) -> Surface:
        """The surface of all geoms that have none of their own."""
        return Surface(self.texture, self.mapping, self.offset, self.friction, self.stiffness)

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The surface of each geom."""
        own = self.surface
        return tuple(geom.surface or own for geom in self.geoms)

    @property
    def largest_friction(self) -> float:
        """Largest friction of a geom, or of a material of the mesh [-]; 0 if none has any."""
        own = [surface.friction for surface in self.surfaces]
        own += [] if self.mesh is None else [material.friction for material in self.mesh.materials]
        return max(f.highest if isinstance(f, FrictionMap) else f or 0.0 for f in own)

    @property
    def friction_map(self) -> FrictionMap | None:
        """The body's own friction, if it is a map."""
        return self.surface.friction_map

    @property
    def friction_maps(self) -> tuple[FrictionMap, ...]:
        """The maps of friction of all surfaces."""
        maps = (surface.friction_map for surface in self.surfaces)
        return tuple({id(found): found for found in maps if found is not None}.values())

    @property
    def stiffness_maps(self) -> tuple[StiffnessMap, ...]:
        """The maps of stiffness of all surfaces."""
        maps = (surface.stiffness_map for surface in self.surfaces)
        return tuple({id(found): found for found in maps if found is not None}.values())

    @property
    def fields(self) -> tuple[HeightField, ...]:
        """The textures of all surfaces."""
        fields = (surface.texture for surface in self.surfaces)
        return tuple({id(field): field for field in fields if field is not None}.values())

    @property
    def parts(self) -> tuple[Body, ...]:
        """Bodies in the same frame that together are this one, each with one surface."""
        if self.mesh is not None or all(geom.surface is None for geom in self.geoms):
            return (self,)
        geoms: dict[int, list[Geom]] = {}
        surfaces = self.surfaces
        for geom, surface in zip(self.geoms, surfaces, strict=True):
            geoms.setdefault(id(surface), []).append(replace(geom, surface=None))
        by_id = {id(surface): surface for surface in surfaces}
        return tuple(replace(self, geoms=own, **vars(by_id[key])) for key, own in geoms.items())

    def _refuse_mixed(self) -> None:
        of_mesh = [geom.kind == "mesh" for geom in self.geoms]
        if self.mesh is None and any(of_mesh):
            raise AsperityError(
                f"body {self.name!r} has geoms of kind mesh but no mesh; give it one"
            )
        if self.mesh is not None and any(geom.surface is not None for geom in self.geoms):
            raise AsperityError(
                f"body {self.name!r} has a mesh, whose surface is the body's: its pieces have none"
            )
        if self.mesh is not None and not all(of_mesh):
            raise AsperityError(
                f"body {self.name!r} has a mesh, so its geoms are convex pieces of kind mesh; "
                "put its other geoms into another body"
            )
        if self.mapping == "uv" and (self.mesh is None or self.mesh.uv is None):
            raise AsperityError(
                f"body {self.name!r} has no texture coordinates for mapping uv; "
                "valid: planar, triplanar"
            )

    def _refuse_surface(self, geom: Geom, surface: Surface) -> None:
        if surface.mapping == "cylindrical" and geom.kind not in ("cylinder", "capsule"):
            raise AsperityError(
                f"body {self.name!r}: a {geom.kind} has no cylindrical mapping; "
                "valid: planar, triplanar"
            )
        texture, smallest = surface.texture, geom.smallest
        if texture is None:
            return
        reach = max(abs(texture.highest), abs(texture.lowest))
        if reach > 0.5 * smallest:
            raise AsperityError(
                f"the texture of body {self.name!r} reaches {reach * 1e3:.4g} mm from its base, "
                f"but the body only {smallest * 1e3:.4g} mm from its middle; valid: at most half "
                f"of that, {0.5e3 * smallest:.4g} mm"
            )


def _refuse_apart(found: StiffnessMap, texture: HeightField | None) -> None:
    """Raise `AsperityError` for a map of stiffness that is not as large as the texture."""
    if texture is None:
        return
    alike = math.dist(found.size, texture.size) <= 1e-9 * max(texture.size)
    if not alike or found.border != texture.border:
        got, valid = (
            f"{1e3 * one.size[0]:.6g} x {1e3 * one.size[1]:.6g} mm, border {one.border!r}"
            for one in (found, texture)
        )
        raise AsperityError(
            "a map of stiffness lies as the texture of its surface does, and is as large: got "
            f"{got}; valid: {valid}"
        )


def unit_quaternion(quaternion: Sequence[float]) -> tuple[float, ...]:
    """Return `quaternion` (wxyz), whose length must be 1 to 1e-6, normalised."""
    values = require_finite("quaternion", quaternion, 4)
    length = math.hypot(*values)
    if abs(length - 1.0) > 1e-6:
        raise AsperityError(f"a quaternion must have length 1, got {values} of length {length:g}")
    return tuple(value / length for value in values)


def covers(geom: Geom, points: Array) -> Mask:
    """Return which `points` (..., 3) [m], in the body's frame, are inside or on `geom`."""
    x = (points - geom.position) @ rotation_of(geom.quaternion)
    size = np.asarray(geom.size, dtype=np.float64) + 1e-12
    across = np.hypot(x[..., 0], x[..., 1])
    if geom.kind == "plane":
        return x[..., 2] <= 1e-12
    if geom.kind == "box":
        return np.all(np.abs(x) <= size, axis=-1)
    if geom.kind == "cylinder":
        return (across <= size[0]) & (np.abs(x[..., 2]) <= size[1])
    if geom.kind == "capsule":
        return np.hypot(across, np.maximum(np.abs(x[..., 2]) - size[1], 0.0)) <= size[0]
    axes = size if geom.kind == "ellipsoid" else np.full(3, size[0])
    return np.sum((x / axes) ** 2, axis=-1) <= 1.0


def origin_of_map(body: Body) -> Array:
    """Return the position of (u, v) = (0, 0) of the texture on the body (2,) [m]."""
    return map_origin(body.texture, body.offset)


def map_origin(laid: SampledMap | None, offset: Sequence[float]) -> Array:
    """Return the position of (u, v) = (0, 0) of a map with this offset (2,) [m]."""
    origin = np.array(offset, dtype=np.float64)
    if laid is not None and laid.border == "clamp":
        origin -= 0.5 * np.asarray(laid.size)
    return origin
