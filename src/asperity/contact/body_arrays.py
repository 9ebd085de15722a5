"""The geoms, textures and frictions of a scene's bodies in flat arrays, for compiled kernels."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import small_kernel
from asperity._core.structures import by_reference
from asperity.geometry.bodies import KINDS, MAPPINGS, Body, Geom, Surface, map_origin
from asperity.geometry.mesh.texture_coordinates import length_round
from asperity.geometry.poses import rotation_of
from asperity.texture.friction_map import FrictionMap
from asperity.texture.packed import PackedTextures
from asperity.texture.packing import pack

if TYPE_CHECKING:
    from asperity.texture.height_field import HeightField
    from asperity.texture.sampled_map import SampledMap

FRICTION_MAP = np.dtype([("map", "i8"), ("scale", "f8", 2), ("shift", "f8", 2)], align=True)
"""Number of a surface's friction map among the textures, -1 for none. Its coordinates are `scale`
times those of the map that defines the surface's mapping, plus `shift` [m]."""


@by_reference
class Geometry(NamedTuple):
    """All geoms of a scene. Rows are geoms unless stated otherwise."""

    kind: NDArray[np.int64]
    """Index into `geometry.bodies.KINDS`, (geoms,)."""
    size: NDArray[np.float64]
    """As in MuJoCo [m], (geoms, 3)."""
    position: NDArray[np.float64]
    """In the body's frame [m], (geoms, 3)."""
    rotation: NDArray[np.float64]
    """From the geom's frame to the body's, (geoms, 3, 3)."""
    body: NDArray[np.int64]
    """Number of the body, (geoms,)."""
    surface: NDArray[np.int64]
    """Number of the surface, (geoms,)."""
    texture: NDArray[np.int64]
    """Number of each surface's texture, -1 for none; (surfaces,)."""
    mapping: NDArray[np.int64]
    """Index of each surface's texture mapping in `geometry.bodies.MAPPINGS`, (surfaces,)."""
    origin: NDArray[np.float64]
    """Point (u, v) = (0, 0) of the texture in the body's frame [m], (surfaces, 3); without a
    texture, that of the stiffness or friction map."""
    rms_slope: NDArray[np.float64]
    """Rms slope of each surface's texture [-], 0 without one; (surfaces,)."""
    texture_size: NDArray[np.float64]
    """Largest height or depth of each surface's texture [m], 0 without one; (surfaces,)."""
    friction: NDArray[np.float64]
    """Coulomb's coefficient of each surface [-], nan if it is given by a map or the force law;
    (surfaces,)."""
    friction_map: NDArray[np.void]
    """`FRICTION_MAP` records, (surfaces,)."""
    stiffness: NDArray[np.float64]
    """Contact stiffness of each surface [N/m], nan if it is given by a map or the force law;
    (surfaces,)."""
    stiffness_map: NDArray[np.int64]
    """Number of each surface's stiffness map among the textures, whose heights are minus the
    compliance [m/N]; -1 for none, (surfaces,)."""
    around: NDArray[np.float64]
    """Factor by which a cylindrical map is stretched to a whole number of periods, (geoms,)."""
    friction_around: NDArray[np.float64]
    """The same factor for the friction map, over `around`, (geoms,)."""
    covered: NDArray[np.int64]
    """Faces covered by another geom of the same rigid body, one bit each; see `covered_faces`."""

    def smooth(self) -> Geometry:
        """Return the geoms without textures."""
        return self._replace(texture=np.full_like(self.texture, -1))


def flatten_bodies(bodies: Sequence[Body]) -> tuple[PackedTextures, Geometry]:
    """Return the textures and geoms of `bodies` as arrays; a map of zeros counts as no texture."""
    surfaces, owners, numbers = _surfaces_of(bodies)
    rough = [s.texture for s in surfaces if s.texture is not None and _is_rough(s.texture)]
    fields = list({id(field): field for field in rough}.values())
    places = {id(field): number for number, field in enumerate(fields)}
    texture = [places.get(id(surface.texture), -1) for surface in surfaces]
    varying = [found for s in surfaces if (found := s.stiffness_map) is not None and _is_graded(s)]
    softs = list({id(found): found for found in varying}.values())
    soft_places = {id(found): len(fields) + number for number, found in enumerate(softs)}
    frictions = list({id(found): found for body in bodies for found in body.friction_maps}.values())
    first = len(fields) + len(softs)
    geoms = [(geom, number) for number, body in enumerate(bodies) for geom in body.geoms]
    laid = [(surfaces[n], geom) for n, (geom, _) in zip(numbers, geoms, strict=True)]
    around = np.array([_stretch(surface, surface.laid_map, geom) for surface, geom in laid])
    textures = pack([*fields, *softs], frictions)
    geometry = Geometry(
        np.array([KINDS.index(geom.kind) for geom, _ in geoms], dtype=np.int64),
        np.array([geom.size for geom, _ in geoms], dtype=np.float64),
        np.array([geom.position for geom, _ in geoms], dtype=np.float64),
        np.array([rotation_of(geom.quaternion) for geom, _ in geoms]),
        np.array([number for _, number in geoms], dtype=np.int64),
        np.array(numbers, dtype=np.int64),
        np.array(texture, dtype=np.int64),
        np.array([MAPPINGS.index(surface.mapping) for surface in surfaces], dtype=np.int64),
        np.array([_origin(surface) for surface in surfaces], dtype=np.float64),
        _of_textures({k: _rms_slope(textures, k) for k in {*texture} - {-1}}, texture),
        _of_textures(dict(enumerate(textures.maps["max_abs_surface"])), texture),
        _values([None if isinstance(s.friction, FrictionMap) else s.friction for s in surfaces]),
        _friction_maps(surfaces, owners, {id(f): first + k for k, f in enumerate(frictions)}),
        _values([_uniform_stiffness(surface) for surface in surfaces]),
        np.array([soft_places.get(id(s.stiffness), -1) for s in surfaces], dtype=np.int64),
        around,
        np.array([_stretch(s, s.friction_map, g) for s, g in laid]) / around,
        np.zeros(len(geoms), dtype=np.int64),
    )
    return textures, geometry


def _surfaces_of(bodies: Sequence[Body]) -> tuple[list[Surface], list[Body], list[int]]:
    """Return the surfaces of bodies, the body of each, and the surface's number for each geom."""
    surfaces: list[Surface] = []
    owners: list[Body] = []
    numbers: list[int] = []
    for body in bodies:
        own = body.surface
        known: dict[int, int] = {}
        for geom in body.geoms:
            key = id(geom.surface)
            if key not in known:
                known[key] = len(surfaces)
                surfaces.append(geom.surface or own)
                owners.append(body)
            numbers.append(known[key])
    return surfaces, owners, numbers


def _is_rough(texture: HeightField) -> bool:
    """Return whether a texture has a height other than 0."""
    return bool(texture.lowest or texture.highest)


def _is_graded(surface: Surface) -> bool:
    """Return whether the stiffness varies over a surface."""
    found = surface.stiffness_map
    # A cylindrical map covers the sides alone.
    return found is not None and (surface.mapping == "cylindrical" or found.lowest < found.highest)


def _uniform_stiffness(surface: Surface) -> float | None:
    """Return the stiffness of a surface if it is uniform."""
    found = surface.stiffness_map
    if found is None:
        return surface.stiffness  # type: ignore[return-value]
    return None if _is_graded(surface) else found.lowest


def _origin(surface: Surface) -> list[float]:
    """Return the point (u, v) = (0, 0) of a surface's map in the body's frame (3,) [m]."""
    return [*map_origin(surface.laid_map, surface.offset).tolist(), 0.0]


def _rms_slope(textures: PackedTextures, number: int) -> float:
    """Return the rms slope of a texture [-].

    It is the rms of the largest slopes in the smallest blocks, so that a few steps hardly matter.
    """
    finest = textures.levels[textures.maps[number]["first_level"]]
    slopes = textures.bounds["slope"][finest["first"] :][: finest["rows"] * finest["columns"]]
    return math.sqrt(np.mean(np.square(slopes, dtype=np.float64)))


def _of_textures(values: Mapping[int, float], texture: Sequence[int]) -> NDArray[np.float64]:
    """Return the value of each surface's texture, 0 without one."""
    return np.array([values.get(number, 0.0) for number in texture])


def _friction_maps(
    surfaces: Sequence[Surface], owners: Sequence[Body], numbers: Mapping[int, int]
) -> NDArray[np.void]:
    """Return the `FRICTION_MAP` records of surfaces; `numbers` are those of the maps by their id.

    On curved sides of simple geoms the map is stretched further: `Geometry.friction_around`.
    """
    out = np.zeros(len(surfaces), FRICTION_MAP)
    out["map"], out["scale"] = -1, 1.0
    for row, surface, body in zip(out, surfaces, owners, strict=True):
        laid, found = surface.laid_map, surface.friction_map
        if laid is None or found is None:
            continue
        row["map"] = numbers[id(found)]
        if surface.mapping == "uv":
            # Texture coordinates stretch every map over the same square.
            row["scale"] = np.asarray(found.size) / laid.size
            continue
        if body.mesh is not None and surface.mapping == "cylindrical":
            row["scale"][0] = length_round(body.mesh, found) / length_round(body.mesh, laid)
        start = map_origin(laid, surface.offset), map_origin(found, surface.offset)
        row["shift"] = row["scale"] * start[0] - start[1]
    return out


def _values(values: Sequence[float | None]) -> NDArray[np.float64]:
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)


def _stretch(surface: Surface, laid: SampledMap | None, geom: Geom) -> float:
    """Return the factor that stretches a cylindrical map so that it has no seam on a geom."""
    if surface.mapping != "cylindrical" or laid is None or laid.border != "wrap":
        return 1.0
    times = 2.0 * math.pi * geom.size[0] / laid.size[0]
    return max(round(times), 1) / times


@small_kernel
def pair_friction(a, b, usual):
    """Return Coulomb's coefficient between two surfaces: the larger, `usual` if neither has one."""
    if a != a:
        a = b
    elif b == b:
        a = max(a, b)
    return a if a == a else usual


@small_kernel
def pair_stiffness(a, b, usual):
    """Return the stiffness of two surfaces in series [N/m], `usual` if neither has one."""
    if a != a:
        a = b
    elif b == b:
        a = a * b / (a + b)
    return a if a == a else usual
