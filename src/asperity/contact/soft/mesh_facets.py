"""Facets of mesh bodies for the kernels of a skin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Mask
from asperity.contact.body_arrays import Geometry
from asperity.contact.broad_phase.facet_bvh import FacetTable, facet_table
from asperity.contact.soft.facet_edges import FacetEdges, Rims, facet_edges
from asperity.contact.soft.mesh_records import FACET, NEIGHBOUR, NODE, MeshFacets
from asperity.contact.soft.sheets import MESH
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.checks import SAME_PLACE, count_of, same_places
from asperity.geometry.mesh.topology import edges_of
from asperity.texture.packed import PackedTextures

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def as_one_geom(body: Body) -> Body:
    """Return a body with one mesh geom, at the middle of its mesh, instead of its convex pieces.

    Raises
    ------
    AsperityError
        The mesh is open.
    """
    mesh = body.mesh
    if mesh is None:
        return body
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    places = same_places(mesh.vertices, SAME_PLACE * float((high - low).max()))
    borders = int(np.count_nonzero(edges_of(places[mesh.faces]).size == 1))
    if borders:
        raise AsperityError(
            f"the mesh of body {body.name!r} is open, with {count_of(borders, 'border edge')}: it "
            "has no inside that could press into a soft layer; valid: closed meshes"
        )
    middle = 0.5 * (low + high)
    return replace(body, geoms=[Geom("mesh", 0.5 * (high - low), middle)])


def mesh_facets(
    bodies: Sequence[Body], textures: PackedTextures, geometry: Geometry, reach: NDArray[np.void]
) -> MeshFacets | None:
    """Return the facets of mesh bodies; None without any.

    Parameters
    ----------
    bodies : sequence of Body
        Of `as_one_geom`.
    textures, geometry
        Of all of these bodies.
    reach : (geoms,) array
        `REACH` records.
    """
    meshes = [body for body in bodies if body.mesh is not None]
    if not meshes:
        return None
    geoms = np.flatnonzero(geometry.kind == MESH)
    own = geometry._replace(body=np.arange(len(geoms)), surface=geometry.surface[geoms])
    table = facet_table(meshes, textures, own)
    root, grow = np.full(len(geometry.kind), -1), np.zeros(len(geometry.kind))
    facets, nodes = np.zeros(len(table.sides), FACET), _nodes(table)
    tree = np.searchsorted(table.root, np.arange(len(nodes)), side="right") - 1
    nodes["middle"] -= geometry.position[geoms][tree]
    neighbours, count = [], 0
    for body, g, (number, start) in zip(meshes, geoms, enumerate(table.root), strict=True):
        mine = table.body == number
        rims = _rims(table, mine, body, geometry.position[g])
        height = float(max(-reach["lowest"][g], reach["highest"][g]))
        edges = facet_edges(rims, height) if height > 0.0 else None
        made, found = _records(rims, edges)
        _fill_bounds(made, table, mine, reach[g], body.mapping == "triplanar")
        facets[mine] = made
        first = int(np.argmax(mine))
        found["facet"] += first
        facets["first"][mine] += count
        facets["last"][mine] += count
        neighbours.append(found)
        count += len(found)
        root[g] = start
        grow[g] = height + facets["borders"][mine, :, 3].max() + rims.close
    return MeshFacets(facets, nodes, np.concatenate(neighbours), root, grow)


def _nodes(table: FacetTable) -> NDArray[np.void]:
    """Return the boxes of trees as `NODE` records in depth-first order."""
    size, order = np.ones(len(table.child), dtype=np.int64), []
    for node in reversed(range(len(size))):
        child = table.child[node]
        if child >= 0:  # children come after their parents
            size[node] += size[child] + size[child + 1]
    for root in table.root:
        waiting = [root]
        while waiting:
            node = waiting.pop()
            order.append(node)
            if table.child[node] >= 0:
                waiting += [table.child[node] + 1, table.child[node]]
    nodes = np.zeros(len(order), NODE)
    for name in ("middle", "reach", "first", "last"):
        nodes[name] = getattr(table, name)[order]
    nodes["after"] = np.arange(len(order)) + size[order]
    nodes["first"] = np.where(table.child[order] >= 0, nodes["last"], nodes["first"])
    return nodes


def _rims(table: FacetTable, mine: Mask, body: Body, middle: Array) -> Rims:
    """Return the borders of a body's facets relative to its middle."""
    place, texture = table.place[mine].reshape(-1, 3, 3)[:, :, :2], body.texture
    if body.mapping == "triplanar":
        place = np.zeros_like(place)
    period = np.full(2, np.inf)
    if texture is not None and texture.border == "wrap":
        period = np.asarray(texture.size)
    points = table.points[mine] - middle
    return Rims(
        points, table.sides[mine], table.origin[mine] - middle, table.axes[mine],
        table.rows[mine, :, :3], table.w[mine].reshape(-1, 3, 3), place, period,
        SAME_PLACE * float(np.ptp(points.reshape(-1, 3), axis=0).max()),
    )  # fmt: skip


def _records(rims: Rims, edges: FacetEdges | None) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return the `FACET` and `NEIGHBOUR` records of a body, numbered from 0."""
    facets = np.zeros(len(rims.sides), FACET)
    for name in ("origin", "axes", "sides", "place"):
        facets[name] = getattr(rims, name)
    facets["w"] = np.einsum("nij,nkj->nki", rims.axes, rims.w)
    off = facets["w"] - [[0.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3]
    facets["is_level"] = np.abs(off).max(axis=(1, 2)) < 1e-12
    facets["borders"][:, :, :3] = rims.borders
    facets["borders"][:, :, 0] -= rims.close
    if edges is None:
        return facets, np.zeros(0, NEIGHBOUR)
    facets["borders"][:, :, 3] = edges.reach
    facets["has_corners"] = edges.has_corners
    order = np.argsort(edges.pairs[:, 0], kind="stable")
    found = np.zeros(len(order), NEIGHBOUR)
    found["facet"], found["is_convex"] = edges.pairs[order, 1], edges.is_convex[order]
    counts = np.bincount(edges.pairs[:, 0], minlength=len(facets))
    facets["last"] = np.cumsum(counts)
    facets["first"] = facets["last"] - counts
    return facets, found


def _fill_bounds(
    facets: NDArray[np.void], table: FacetTable, mine: Mask, reach: np.void, is_triplanar: bool
) -> None:
    """Fill extents, and bounds of slopes and curvatures from the `REACH` of the body."""
    height, w = max(-reach["lowest"], reach["highest"]), facets["w"]
    facets["half"] = table.half[mine] + facets["borders"][:, :, 3].max(axis=1)[:, None]
    stretch = np.ones(len(facets)) if is_triplanar else table.spread[mine, 1]
    first = np.where(facets["is_level"], 0.0, table.bends[mine, 0])
    # At the texture's height over the plane, diverging normals stretch the texture.
    spread = 1.0 / np.maximum(1.0 - height * first, 0.5)
    facets["slope"] = reach["slope"] * stretch * spread
    facets["bend"] = reach["bend"] * (stretch * spread) ** 2
    facets["bend"] += 4.0 * (1.0 + facets["slope"]) * first
    x, y = (facets["half"][:, None, k] * sign for k, sign in enumerate(_CORNERS.T))
    at = w[:, None, 0] + x[..., None] * w[:, None, 1] + y[..., None] * w[:, None, 2]
    at /= np.linalg.norm(at, axis=2, keepdims=True)
    lean = np.linalg.norm(at - [0.0, 0.0, 1.0], axis=2).max(axis=1)
    facets["lean"] = np.where(facets["is_level"], 0.0, lean + height * first)
