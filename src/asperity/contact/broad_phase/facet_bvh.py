"""The facets of all bodies of a scene in flat arrays, with a bounding volume hierarchy per body.

Facets serve two purposes. The *overlap region* of a contact, its area, centroid and normal, is
integrated over pairs of facets that face each other. And facets of meshes, boxes and planes are the
surface patches on texture depths are searched. Round geoms have exact patches
(`narrow_phase.surface_patch`): their facets only approximate them in the overlap region.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import kernel
from asperity._core.structures import by_reference
from asperity.contact.body_arrays import Geometry
from asperity.contact.broad_phase.polyhedra import Polyhedra, polyhedra, steepness
from asperity.contact.broad_phase.surface_sizes import flat_area, is_convex_body, surface_width
from asperity.contact.narrow_phase.surface_patch import PLANAR, TRIPLANAR
from asperity.geometry.bodies import MAPPINGS, Body, Geom
from asperity.geometry.facets.facets import MOST_SIDES, Facets, joined, mesh_facets, taken
from asperity.geometry.facets.tessellate import geom_triangles, is_round
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.texture_coordinates import places_on_map
from asperity.geometry.poses import rotation_of
from asperity.texture.highest import texture_top
from asperity.texture.packed import PackedTextures

_LEAF = 2
"""Maximum number of facets in a leaf of a tree."""
DIRECTIONS = 6
"""Number of directions of contact with a body: the positive and negative axes of its frame."""
_SHARPNESS = 8
"""Power of the cosine to a direction in a facet's share of it."""
_LEAST_SHARE = 0.02
"""Smaller shares of a facet are set to 0."""
_EVERYWHERE = 1e9

Array = NDArray[np.float64]


@by_reference
class FacetTable(NamedTuple):
    """All facets of a scene. Rows are facets, in the order of the trees, unless stated otherwise.

    A facet is parametrised by (x, y) in its plane, measured from the centre of its rectangle.
    """

    points: Array
    """Corners in the body's frame [m], (n, 8, 3)."""
    sides: NDArray[np.int64]
    """Number of corners, (n,)."""
    origin: Array
    """Centre of the bounding rectangle in the body's frame [m], (n, 3)."""
    axes: Array
    """Unit vectors x, y and the normal z in the body's frame, (n, 3, 3)."""
    corners: Array
    """Corners in the plane [m], (n, 8, 2)."""
    half: Array
    """Half sides of the bounding rectangle [m], (n, 2)."""
    rows: Array
    """Borders `k0 + k1 x + k2 y <= 0`, and whether they are edges of the body; (n, 8, 4)."""
    count_rows: NDArray[np.int64]
    """Number of borders, (n,); 0 for a rectangle, whose borders are its sides."""
    w: Array
    """Interpolated normal, before normalisation: at the centre, by x, by y; (n, 9)."""
    unit: Array
    """1 where the normal is constant, else 0; (n,)."""
    bends: Array
    """Bounds of the first [1/m] and second [1/m^2] derivatives of the normal, (n, 2)."""
    least: Array
    """Smallest length of w, (n,)."""
    place: Array
    """Position on the texture, or in its frame: at the centre, by x, by y; (n, 9) [m]."""
    spread: Array
    """Singular values of the linear map from (x, y) to the texture, (n, 2)."""
    body: NDArray[np.int64]
    """Body that the facet belongs to, (n,)."""
    surface: NDArray[np.int64]
    """Number of its surface in `Geometry`, (n,)."""
    mapping: Array
    """PLANAR or TRIPLANAR, (surfaces,)."""
    top: Array
    """Highest point of the texture on the facet [m], (n,)."""
    shares: Array
    """Weights of the facet in the six directions, summing to 1; (n, 6)."""
    geom: NDArray[np.int64]
    """Round geom that the facet approximates, -1 for a facet that is itself searched; (n,)."""
    slack: Array
    """Largest distance of a body's facets inside its smooth surface [m], (bodies,)."""
    friction: Array
    """Coulomb's coefficient [-], nan if it is given by a map or the force law; (n,)."""
    stiffness: Array
    """Contact stiffness [N/m], nan if it is given by a map or the force law; (n,)."""
    has_map: NDArray[np.bool_]
    """Whether any surface of a body has a stiffness map, (bodies,)."""
    compliance: Array
    """Largest and least compliance of a body's surfaces [m/N], 0 if none has any, (bodies, 2)."""
    varies: NDArray[np.bool_]
    """Whether friction or stiffness differ between the facets of a body, (bodies,)."""
    first_surface: NDArray[np.int64]
    """Number of the surface of a body's first geom, (bodies,)."""
    raised: Array
    """Upper bound on the height of a body's textures above its surface [m], (bodies,)."""
    lowered: Array
    """Upper bound on their depth below it [m], (bodies,)."""
    middle: Array
    """Centres of the trees' boxes in the body's frame [m], (nodes, 3)."""
    reach: Array
    """Half sides of the boxes [m], (nodes, 3)."""
    child: NDArray[np.int64]
    """First of a box's two consecutive children; -1 for a leaf; (nodes,)."""
    first: NDArray[np.int64]
    """First facet in a box, (nodes,)."""
    last: NDArray[np.int64]
    """One past the last facet in a box, (nodes,)."""
    root: NDArray[np.int64]
    """Root of the tree of each body, (bodies,)."""
    flat_area: Array
    """Mean area of a body's plane faces, weighted by their areas [m^2], (bodies,)."""
    width: Array
    """Second largest standard deviation of a body's surface [m], (bodies,)."""
    thickness: NDArray[np.float64]
    """Least thickness of the body behind the facet if it is a thin wall [m], else inf; (n,)."""
    is_convex: NDArray[np.bool_]
    """Whether a body is convex, (bodies,)."""
    polyhedra: Polyhedra
    """The bodies that are convex, with few faces."""


def facet_table(bodies: Sequence[Body], textures: PackedTextures, geometry: Geometry) -> FacetTable:
    """Build the facets and trees of `bodies`."""
    sets, geoms, surfaces, properties, trees, roots, slacks = [], [], [], [], [], [], []
    first_facet = first_node = first_geom = 0
    for body in bodies:
        facets, geom_of, is_round_geom, slack = _body_facets(body, first_geom)
        order, tree = _tree(facets.points, facets.sides)
        facets = taken(facets, order)
        sets.append(facets)
        geoms.append(np.where(is_round_geom, geom_of, -1)[order])
        surfaces.append(geometry.surface[geom_of[order]])
        properties.append(_properties(body, facets.region, surfaces[-1], geometry))
        tree[2][tree[2] >= 0] += first_node
        trees.append((tree[0], tree[1], tree[2], tree[3] + first_facet, tree[4] + first_facet))
        roots.append(first_node)
        slacks.append(slack)
        first_facet += len(facets)
        first_node += len(tree[0])
        first_geom += len(body.geoms)
    facets = joined(sets)
    owner = np.repeat(np.arange(len(bodies)), [len(s) for s in sets])
    surface = np.concatenate(surfaces)
    is_mesh = np.array([body.mesh is not None for body in bodies])[owner]
    place, spread, mapping = _texture_placement(facets, surface, is_mesh, geometry)
    first_geoms = np.cumsum([0, *(len(body.geoms) for body in bodies)])[:-1]
    raised, lowered = _heights(textures, geometry, len(bodies))
    rows, count_rows = _rows(facets)
    low, high, child, first, last = (np.concatenate(part) for part in zip(*trees, strict=True))
    is_plane = [bool(np.all(own < 0)) for own in geoms]
    solids = polyhedra(sets, is_plane, steepness(textures, geometry, len(bodies)), bodies)
    return FacetTable(
        points=facets.points, sides=facets.sides, origin=facets.origin, axes=facets.axes,
        corners=facets.corners, half=facets.half, rows=rows, count_rows=count_rows,
        w=facets.w.reshape(-1, 9).copy(),
        unit=np.all(facets.w[:, 1:] == 0.0, axis=(1, 2)).astype(np.float64),
        bends=facets.bends,
        least=facets.least, place=place, spread=spread, body=owner,
        surface=surface, mapping=mapping,
        top=_texture_tops(facets, surface, textures, geometry, place, mapping),
        shares=_shares(facets.axes[:, 2]), geom=np.concatenate(geoms),
        friction=np.concatenate([row[:, 0] for row in properties]),
        stiffness=np.concatenate([row[:, 1] for row in properties]),
        has_map=np.bincount(geometry.body, geometry.stiffness_map[geometry.surface] >= 0) > 0.0,
        compliance=np.array([_compliances(*each) for each in zip(bodies, properties, strict=True)]),
        varies=np.array([_are_different(row) for row in properties]),
        slack=np.array(slacks), first_surface=geometry.surface[first_geoms], raised=raised,
        lowered=lowered, middle=0.5 * (low + high), reach=0.5 * (high - low), child=child,
        first=first, last=last, root=np.array(roots),
        flat_area=np.array([flat_area(part) for part in sets]),
        width=np.array([surface_width(part) for part in sets]),
        thickness=np.full(len(facets), np.inf),
        is_convex=(np.diff(solids.first_face) > 0) | [is_convex_body(body) for body in bodies],
        polyhedra=solids,
    )  # fmt: skip


def _body_facets(
    body: Body, first_geom: int
) -> tuple[Facets, NDArray[np.int64], NDArray[np.bool_], float]:
    """Return a body's facets in its frame, the geom of each, whether it is round, and slack [m]."""
    if body.mesh is not None:
        mesh = body.mesh
        places = places_on_map(body, body.surface.laid_map)
        facets = mesh_facets(mesh.vertices, mesh.faces, mesh.normals, places, _regions(mesh))
        return facets, np.full(len(facets), first_geom), np.zeros(len(facets), bool), 0.0
    parts, slack, count = [], 0.0, len(body.geoms)
    for geom in body.geoms:
        vertices, faces, normals, off = geom_triangles(geom)
        rotation = rotation_of(geom.quaternion)
        vertices = vertices @ rotation.T + np.asarray(geom.position)
        normals = normals @ rotation.T
        facets = mesh_facets(vertices, faces, normals, None)
        if not is_round(geom):
            facets = taken(facets, np.flatnonzero(~_covered(facets, body.geoms, geom)))
        parts.append(facets)
        slack = max(slack, off)
    number = np.repeat(np.arange(count), [len(part) for part in parts])
    round_geoms = np.array([is_round(geom) for geom in body.geoms])
    return joined(parts), first_geom + number, round_geoms[number], slack


def _regions(mesh: Mesh) -> NDArray[np.int64] | None:
    """Return the material of each triangle, -1 for those without a friction or stiffness."""
    own = [m.friction is not None or m.stiffness is not None for m in mesh.materials]
    if mesh.material is None or not any(own):
        return None
    return np.where(np.array([*own, False])[mesh.material], mesh.material, -1)


def _properties(
    body: Body, region: NDArray[np.int64], surface: NDArray[np.int64], geometry: Geometry
) -> Array:
    """Return friction and stiffness of each facet of a body (n, 2); see `FacetTable` for nan."""
    out = np.column_stack([geometry.friction[surface], geometry.stiffness[surface]])
    if body.mesh is None or _regions(body.mesh) is None:
        return out
    for number, material in enumerate(body.mesh.materials):
        for column, value in enumerate((material.friction, material.stiffness)):
            if value is not None:
                out[region == number, column] = value
    return out


def _are_different(properties: Array) -> bool:
    """Return whether rows of friction and stiffness differ."""
    return len(np.unique(np.nan_to_num(properties, nan=-1.0), axis=0)) > 1


def _compliances(body: Body, properties: Array) -> tuple[float, float]:
    """Return the largest and least compliance of a body's surfaces [m/N], 0 if none has any."""
    numbers = properties[~np.isnan(properties[:, 1]), 1]
    least = [*(found.lowest for found in body.stiffness_maps), *numbers]
    most = [*(found.highest for found in body.stiffness_maps), *numbers]
    return (1.0 / min(least), 1.0 / max(most)) if least else (0.0, 0.0)


def _covered(facets: Facets, geoms: Sequence[Geom], own: Geom) -> NDArray[np.bool_]:
    """Return which facets are covered by another box of the body: inside or flush with it."""
    hidden = np.zeros(len(facets), dtype=bool)
    for geom in geoms:
        if geom is own or geom.kind != "box":
            continue
        out = facets.points + 1e-6 * facets.axes[:, None, 2]
        local = (out - np.asarray(geom.position)) @ rotation_of(geom.quaternion)
        hidden |= np.all(np.abs(local) < np.asarray(geom.size) + 1e-9, axis=(1, 2))
    return hidden


def _texture_placement(
    facets: Facets, surface: NDArray, is_mesh: NDArray[np.bool_], geometry: Geometry
) -> tuple[Array, Array, Array]:
    """Return `place`, `spread` and `mapping` of a `FacetTable`."""
    place = np.zeros((len(facets), 3, 3))
    spread = np.zeros((len(facets), 2))
    kinds = np.full(len(geometry.texture), PLANAR)
    kinds[geometry.mapping == MAPPINGS.index("triplanar")] = TRIPLANAR
    mapped = (geometry.texture[surface] >= 0) | (geometry.friction_map["map"][surface] >= 0)
    mapped |= geometry.stiffness_map[surface] >= 0
    blended = mapped & (kinds[surface] == TRIPLANAR)
    by_axes = blended | (mapped & ~is_mesh)
    place[by_axes, 0] = facets.origin[by_axes]
    place[by_axes, 1:] = facets.axes[by_axes, :2]
    spread[blended, 1] = 1.0
    planar = by_axes & ~blended
    place[planar, 0] -= geometry.origin[surface[planar]]
    by_uv = mapped & is_mesh & ~blended
    place[by_uv, :, :2] = np.swapaxes(facets.uv[by_uv], 1, 2)
    flat = planar | by_uv
    spread[flat] = np.linalg.svd(place[flat, 1:, :2], compute_uv=False)[:, ::-1]
    return place.reshape(-1, 9).copy(), spread, kinds


def _heights(textures: PackedTextures, geometry: Geometry, bodies: int) -> tuple[Array, Array]:
    """Return `raised` and `lowered` of a `FacetTable`."""
    raised, lowered = np.zeros(bodies), np.zeros(bodies)
    for body, surface in zip(geometry.body, geometry.surface, strict=True):
        if geometry.texture[surface] >= 0:
            texture = textures.maps[geometry.texture[surface]]
            raised[body] = max(raised[body], texture["max_abs_height"])
            lowered[body] = max(lowered[body], -texture["lowest"])
    return raised, lowered


def _rows(facets: Facets) -> tuple[Array, NDArray[np.int64]]:
    """Return the borders of facets and their numbers: 0 for rectangles along their axes."""
    corners = facets.corners
    rows = np.zeros((len(facets), MOST_SIDES, 4))
    count = facets.sides.copy()
    for k in range(MOST_SIDES):
        there = k < facets.sides
        after = np.where(
            (k + 1 < facets.sides)[:, None], corners[:, (k + 1) % MOST_SIDES], corners[:, 0]
        )
        side = after - corners[:, k]
        size = np.maximum(np.hypot(side[:, 0], side[:, 1]), 1e-300)
        out = np.stack([side[:, 1], -side[:, 0]], axis=1) / size[:, None]
        rows[:, k, 0] = np.where(there, -np.sum(out * corners[:, k], axis=1), 0.0)
        rows[:, k, 1:3] = np.where(there[:, None], out, 0.0)
        rows[:, k, 3] = facets.hard[:, k]
    on_sides = (
        np.abs(np.abs(corners) - facets.half[:, None]).max(axis=2)
        <= 1e-12 + 1e-9 * facets.half.max(axis=1)[:, None]
    )
    box = (
        (facets.sides == 4) & on_sides[:, :4].all(axis=1) & (facets.hard[:, :4] == 1.0).all(axis=1)
    )
    count[box] = 0
    return rows, count


def _shares(normals: Array) -> Array:
    """Return the weights of facets in the six directions, smooth functions of the normal."""
    along = np.stack([normals, -normals], axis=2).reshape(-1, DIRECTIONS)
    raw = np.maximum(along, 0.0) ** _SHARPNESS
    raw /= raw.sum(axis=1)[:, None]
    raw = np.maximum(raw - _LEAST_SHARE, 0.0)
    return raw / raw.sum(axis=1)[:, None]


def _texture_tops(
    facets: Facets, surface: NDArray, textures: PackedTextures, geometry: Geometry, place: Array,
    mapping: Array,
) -> Array:  # fmt: skip
    """Return the highest point of the texture on each facet [m]."""
    texture = geometry.texture[surface]
    at = place.reshape(-1, 3, 3)
    corners = facets.corners
    uv = at[:, None, 0, :2] + corners @ at[:, 1:, :2]
    box = np.stack([uv.min(axis=1), uv.max(axis=1)], axis=1)
    box[mapping[surface] != PLANAR] = [[-_EVERYWHERE] * 2, [_EVERYWHERE] * 2]
    out = np.zeros(len(facets))
    if len(textures.maps):
        _fill_tops(textures, texture, box, out)
    return out


@kernel
def _fill_tops(textures, texture, box, out):
    """Fill the highest point of each texture within a box of (u, v), (n, 2, 2) [m]."""
    for i in range(texture.size):
        if texture[i] >= 0:
            out[i] = texture_top(
                textures, texture[i], box[i, 0, 0], box[i, 1, 0], box[i, 0, 1], box[i, 1, 1]
            )


def _tree(
    points: Array, sides: NDArray[np.int64]
) -> tuple[NDArray[np.int64], tuple[Array, Array, NDArray, NDArray, NDArray]]:
    """Return the order of facets, and the tree over them: low, high, child, first, last."""
    low, high = points.min(axis=1), points.max(axis=1)
    middle = 0.5 * (low + high)
    order = np.arange(len(points))
    lows, highs, child, first, last = [], [], [], [], []

    def add(start: int, end: int) -> int:
        mine = order[start:end]
        lows.append(low[mine].min(axis=0))
        highs.append(high[mine].max(axis=0))
        child.append(-1)
        first.append(start)
        last.append(end)
        return len(lows) - 1

    waiting = [add(0, len(points))]
    while waiting:
        node = waiting.pop()
        start, end = first[node], last[node]
        if end - start <= _LEAF:
            continue
        mine = order[start:end]
        axis = int(np.argmax(np.ptp(middle[mine], axis=0)))
        order[start:end] = mine[np.argsort(middle[mine, axis], kind="stable")]
        half = (start + end) // 2
        child[node] = add(start, half)
        add(half, end)
        waiting += [child[node], child[node] + 1]
    return order, (
        np.array(lows), np.array(highs), np.array(child, dtype=np.int64),
        np.array(first, dtype=np.int64), np.array(last, dtype=np.int64),
    )  # fmt: skip
