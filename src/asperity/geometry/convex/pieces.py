"""Convex decomposition of a mesh for MuJoCo's collision detection.

MuJoCo collides a mesh as its convex hull, which would fill every hole. So a concave mesh is cut
into convex pieces by CoACD (Wei et al., ACM Trans. Graph. 41, 42 (2022)); the result is cached on
disk. The pieces only bound where the body may touch; its surface is that of the mesh.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from asperity._core.arrays import Array, Indices
from asperity._core.kept_arrays import kept_folder, read_arrays, write_arrays
from asperity.errors import AsperityError, require_between
from asperity.geometry.mesh.checks import SAME_PLACE, joined, refuse, same_places
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import Edges, crosses, edges_of

CONVEX_UP_TO = 1e-3
"""How deep a mesh may lie under its convex hull and count as convex, in sizes of the mesh."""
_CONVEX = 1e-6
_HAIR = 1e-4
_MAX_CORNERS = 4000
"""Directions in which the farthest corners of a solid with more corners are kept."""
_CHUNK = 4_000_000
_NEAR, _ROWS = 4, 256
"""Nearest facets that bound a distance, and points whose distances are measured at once."""
# CoACD's defaults took 106 s and made 92 pieces of one CAD part; these 11 to 16 s and 8 to 16.
_SETTINGS: dict[str, Any] = {"mcts_iterations": 50, "seed": 0}
_MAX_PIECES = 16


def convex_pieces(
    mesh: Mesh, *, threshold: float = 0.1, cache_folder: str | os.PathLike[str] | None = None
) -> tuple[Array, ...]:
    """Return convex solids whose union is, or approximates, a mesh.

    A closed convex mesh is its own hull, and so is each closed convex part of a mesh. Any other is
    cut by CoACD into up to 16 pieces (of several parts, at least 4 each); that takes seconds, for
    round surfaces a minute, so the result is cached on disk by the mesh and the settings. A sheet
    gets a thickness of 1e-4 of its size, because MuJoCo refuses solids without volume; its pieces
    still need `inertia="shell"`.

    Parameters
    ----------
    mesh : Mesh
    threshold : float
        Largest concavity of a piece by CoACD's measure, 0.01 (many pieces) to 1 (few): about the
        distance between the piece and its hull in sizes of the mesh.
    cache_folder : str or path, optional
        By default `asperity/convex-pieces` in the user's cache folder.

    Returns
    -------
    tuple of (k, 3) arrays
        Corners of each solid [m], in the mesh's frame: 4 to 4000, not coplanar. Of a convex mesh
        with more corners some are kept, spread over all directions.

    Raises
    ------
    AsperityError
        CoACD is not installed (`pip install 'asperity[bake]'`), or fails on the mesh; one line.
    """
    require_between("threshold", threshold, 0.01, 1.0)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    places = same_places(mesh.vertices, SAME_PLACE * size)
    _, first = np.unique(places, return_index=True)
    parts = _closed_parts(mesh.vertices[first], places[mesh.faces])
    settings = _SETTINGS | {"threshold": float(threshold)}
    settings["max_convex_hull"] = max(4, _MAX_PIECES // len(parts))
    pieces: list[Array] = []
    for points, faces in parts:
        edges = edges_of(faces)
        if _is_convex(points, faces, edges, size):
            pieces.append(points)
            continue
        closed = bool((edges.size == 2).all())
        settings["preprocess_mode"] = "off" if closed else "auto"
        file = _cache_file(points, faces, settings, cache_folder)
        cut = _read_pieces(file)
        if cut is None:
            cut = _cut(mesh.name, points, faces, settings)
            named = {f"arr_{k}": piece for k, piece in enumerate(cut)}
            write_arrays(file, named, "convex pieces")
        pieces += cut
    return tuple(_solid(piece, size) for piece in pieces)


def is_convex(vertices: Array, faces: Indices, tolerance: float) -> bool:
    """Return whether a surface of triangles lies on its convex hull, and covers it.

    Parameters
    ----------
    vertices : (n, 3) array
    faces : (m, 3) int array
    tolerance : float
        How deep it may lie under its hull, in sizes of the mesh.
    """
    size = float(np.ptp(vertices, axis=0).max())
    places = same_places(vertices, SAME_PLACE * size)
    _, first = np.unique(places, return_index=True)
    points, at = vertices[first], places[faces]
    return _is_convex(points, at, edges_of(at), size, tolerance)


def _closed_parts(points: Array, faces: Indices) -> list[tuple[Array, Indices]]:
    """Return the connected parts of a surface if each is a solid by itself, else the whole surface.

    A part that is open, or a cavity in another, is meaningless without the others.
    """
    edges = edges_of(faces)
    part = joined(len(faces), *edges.pairs.T // 3)
    count = int(part.max()) + 1
    if count > _MAX_PIECES or not (edges.size == 2).all():
        return [(points, faces)]
    parts = []
    for k in range(count):
        used, of_part = np.unique(faces[part == k], return_inverse=True)
        parts.append((points[used], of_part.reshape(-1, 3).astype(np.int64)))
    if min(_volume(*one) for one in parts) <= 0.0:
        return [(points, faces)]
    return parts


def _volume(points: Array, faces: Indices) -> float:
    """Return the volume that a closed surface encloses [m^3]."""
    a, b, c = (points[faces] - points.mean(axis=0)).swapaxes(0, 1)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def piece_error(mesh: Mesh, pieces: tuple[Array, ...]) -> float:
    """Return the largest distance by which the mesh extends beyond the pieces [m]; 0 if nowhere.

    It is measured at the vertices of the mesh and the middles of its triangles and their sides, to
    the nearest piece; as a collision margin of the pieces it makes them contain the mesh. The
    result is cached on disk beside the pieces.

    Parameters
    ----------
    mesh : Mesh
    pieces : tuple of (k, 3) arrays
        As from `convex_pieces`.
    """
    digest = hashlib.sha256(Path(__file__).read_bytes())  # an edit measures anew
    for part in (mesh.vertices, mesh.faces, *pieces):
        digest.update(f"{part.shape}".encode() + part.tobytes())
    file = kept_folder("convex-pieces") / f"error-{digest.hexdigest()[:32]}.npz"
    kept = (read_arrays(file) or {}).get("error")
    if kept is None or kept.shape != () or kept.dtype != float or not 0.0 <= kept < np.inf:
        kept = np.float64(_largest_error(mesh, pieces))
        write_arrays(file, {"error": kept}, "errors of convex pieces")
    return float(kept)


def _largest_error(mesh: Mesh, pieces: tuple[Array, ...]) -> float:
    points = _samples(mesh.vertices, mesh.faces)
    hulls = [ConvexHull(piece) for piece in pieces]
    noise = 1e-12 * np.abs(points).max()
    # Only the farthest point counts, and few may be it: an upper bound rules out the others.
    most = np.min([_near_distances(points, hull) for hull in hulls], axis=0)
    order, farthest = np.argsort(-most), noise
    for k in range(0, len(order), _ROWS):
        some = order[k : k + _ROWS]
        if most[some[0]] <= farthest:
            break
        # Outside a corner the distance to the planes is too small: a lower bound.
        bounds = np.stack([_outside(points[some], hull) for hull in hulls], axis=1)
        out = bounds.min(axis=1) > noise
        # Slivers have no nearest point, so that either may be too large.
        found = np.minimum(_to_nearest(points[some[out]], bounds[out], hulls), most[some[out]])
        farthest = max(farthest, float(found.max(initial=0.0)))
    return farthest if farthest > noise else 0.0


def _to_nearest(points: Array, bounds: Array, hulls: list[Any]) -> Array:
    """Return the distance of points to the nearest hull [m]; `bounds` (n, hulls) are below it."""
    nearest = np.full(len(points), np.inf)
    for rank in np.argsort(bounds, axis=1).T:
        bound = bounds[np.arange(len(points)), rank]
        open_still = bound < nearest
        for k in np.unique(rank[open_still]):
            which = np.flatnonzero(open_still & (rank == k))
            found = _distances(points[which], hulls[k])
            nearest[which] = np.minimum(nearest[which], found)
    return nearest


def _near_distances(points: Array, hull: Any) -> Array:
    """Return upper bounds of the distance of points to a hull [m]: to facets with a near middle."""
    from trimesh.triangles import closest_point  # trimesh takes a second to import

    triangles = hull.points[hull.simplices]
    near = KDTree(triangles.mean(axis=1)).query(points, k=min(_NEAR, len(triangles)))[1]
    near = near.reshape(len(points), -1)
    found = np.full(len(points), np.inf)
    for column in near.T:
        distance = np.linalg.norm(closest_point(triangles[column], points) - points, axis=1)
        found = np.fmin(found, distance)
    return found


def _samples(vertices: Array, faces: Indices) -> Array:
    """Return the vertices of triangles, the middles of their sides, and their centres."""
    triangles = vertices[faces]
    sides = 0.5 * (triangles + np.roll(triangles, -1, axis=1))
    samples = np.concatenate([vertices, sides.reshape(-1, 3), triangles.mean(axis=1)])
    return np.unique(samples, axis=0)


def _axes(points: Array) -> Array:
    """Return the principal axes of points in rows, that of the smallest extent last."""
    middle = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(middle.T @ middle)[1].T[::-1])


def _is_convex(
    points: Array, faces: Indices, edges: Edges, size: float, tolerance: float = _CONVEX
) -> bool:
    """Return whether a surface lies on its hull and covers it, or is a convex sheet."""
    axes = _axes(points)
    if np.ptp(points @ axes[2]) < _HAIR * size:
        return _is_convex_sheet(points @ axes[:2].T, faces)
    hull = ConvexHull(points)
    if (edges.size == 2).all():
        # A layer of the tolerance may be missing all over.
        missing, most = hull.volume - abs(_volume(points, faces)), tolerance * size * hull.area
        covers = missing <= max(1e-3 * hull.volume, most)
    else:  # sides that meet corners of others make no hole
        area = 0.5 * np.linalg.norm(crosses(points[faces]), axis=1).sum()
        covers = abs(area - hull.area) <= 1e-3 * hull.area
    if not covers:
        return False
    return _all_on(_samples(points, faces), hull, tolerance * size)


def _all_on(points: Array, hull: Any, tolerance: float) -> bool:
    """Return whether points within a hull all lie on its surface.

    The facet of a point is nearly always one of the nearest; all are tried only for the remaining
    points, since all facets for all points of a fine mesh would take hours.
    """
    middles = hull.points[hull.simplices].mean(axis=1)
    near = KDTree(middles).query(points, k=min(8, len(middles)))[1].reshape(len(points), -1)
    planes = hull.equations[near]
    depth = np.einsum("ijk,ik->ij", planes[:, :, :3], points) + planes[:, :, 3]
    rest = points[(depth < -tolerance).all(axis=1)]
    return all(_outside(some, hull).min() >= -tolerance for some in _chunks(rest, 100))


def _chunks(points: Array, rows: int) -> Iterator[Array]:
    return (points[k : k + rows] for k in range(0, len(points), rows))


def _is_convex_sheet(flat: Array, faces: Indices) -> bool:
    """Return whether coplanar triangles fill the hull of their corners, on one side or two."""
    a, b, c = flat[faces].swapaxes(0, 1)
    (x, y), (s, t) = (b - a).T, (c - a).T
    covered = 0.5 * np.abs(x * t - y * s).sum()
    try:
        whole = ConvexHull(flat).volume
    except QhullError:  # a sliver
        return True
    return bool(min(abs(covered - whole), abs(covered - 2.0 * whole)) <= _CONVEX * whole)


def _outside(points: Array, hull: Any) -> Array:
    """Return the signed distance of points above the highest plane of a hull [m]."""
    planes = np.unique(hull.equations, axis=0)
    some = _chunks(points, max(1, _CHUNK // len(planes)))
    return np.concatenate([(p @ planes[:, :3].T + planes[:, 3]).max(axis=1) for p in some])


def _distances(points: Array, hull: Any) -> Array:
    """Return the distance of points outside a hull to it [m]."""
    from trimesh.triangles import closest_point  # trimesh takes a second to import

    triangles = hull.points[hull.simplices]
    found = []
    for some in _chunks(points, max(1, _CHUNK // len(triangles))):
        # The nearest facet is one of those that a point is in front of.
        k, facet = np.nonzero(some @ hull.equations[:, :3].T + hull.equations[:, 3] > 0.0)
        distance = np.linalg.norm(closest_point(triangles[facet], some[k]) - some[k], axis=1)
        nearest = np.full(len(some), np.inf)
        np.minimum.at(nearest, k, np.nan_to_num(distance, nan=np.inf))
        found.append(nearest)
    return np.concatenate(found)


def _solid(points: Array, size: float) -> Array:
    """Return the corners of the hull of points, thickened if they have no volume."""
    hair = _HAIR * size
    for axis in _axes(points):
        if np.ptp(points @ axis) < hair:
            points = np.concatenate([points - 0.5 * hair * axis, points + 0.5 * hair * axis])
    corners = points[np.sort(ConvexHull(points).vertices)]
    if len(corners) > _MAX_CORNERS:
        # The farthest along directions spread over the sphere (Fibonacci's spiral).
        up = np.linspace(-1.0, 1.0, _MAX_CORNERS)
        turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(_MAX_CORNERS)
        level = np.sqrt(1.0 - up**2)
        directions = np.stack([level * np.cos(turn), level * np.sin(turn), up])
        corners = corners[np.unique([(corners @ d).argmax() for d in directions.T])]
    return np.ascontiguousarray(corners)


def _cut(name: str, points: Array, faces: Indices, settings: dict[str, Any]) -> list[Array]:
    """Return the pieces into which CoACD cuts a mesh."""
    try:
        import coacd
    except ImportError:
        raise AsperityError(
            f"mesh {name!r} is not convex: its convex pieces need coacd, which is not installed; "
            "valid: pip install 'asperity[bake]', or convex meshes in its place"
        ) from None
    coacd.set_log_level("error")
    pieces = coacd.run_coacd(coacd.Mesh(points, faces.astype(np.int32)), **settings)
    solids = [np.asarray(corners, dtype=np.float64) for corners, _ in pieces]
    solids = [corners for corners in solids if len(corners) and np.isfinite(corners).all()]
    if not solids:
        refuse(name, "CoACD found no convex pieces in it; valid: a closed surface")
    return solids


def _cache_file(
    points: Array, faces: Indices, settings: dict[str, Any], folder: str | os.PathLike[str] | None
) -> Path:
    """Return the cache file of a mesh, named by a hash of all inputs."""
    try:
        tool = version("coacd")
    except ImportError:
        tool = "none"
    digest = hashlib.sha256(f"{tool} {sorted(settings.items())}".encode())
    digest.update(points.tobytes())
    digest.update(faces.tobytes())
    root = kept_folder("convex-pieces") if folder is None else Path(folder)
    return root / f"{digest.hexdigest()[:32]}.npz"


def _read_pieces(file: Path) -> list[Array] | None:
    """Return the pieces in a file; None if it is missing or damaged."""
    found = read_arrays(file)
    if found is None:
        return None
    pieces = [found.get(f"arr_{k}", np.empty(0)) for k in range(len(found))]
    good = [p.ndim == 2 and p.shape[1] == 3 and p.dtype == float for p in pieces]
    return pieces if pieces and all(good) and np.isfinite(np.concatenate(pieces)).all() else None
