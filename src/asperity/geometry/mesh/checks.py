"""Checks and repairs of the arrays of which a mesh is made.

Invalid arrays are refused with one line. Harmless defects (a triangle without area, a repeated
triangle, an unused vertex) are repaired and noted.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, NoReturn, SupportsInt

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices, Mask
from asperity.errors import AsperityError

UNITS = {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
"""Metres per unit of length of a mesh file."""
SMALLEST, LARGEST = 1e-4, 2.0
"""Smallest and largest extent of a mesh [m]: objects that a hand holds or touches."""
MAX_FACES = 2_000_000
SAME_PLACE = 1e-7
"""Vertices closer than this, in sizes of the mesh, coincide: float32 resolves no less."""
_THIN = 1e-9
_LARGEST_UV = 1e6


class Corners(NamedTuple):
    """A mesh under construction: vertices, and attributes of the corners of its triangles.

    Attributes
    ----------
    vertices : (n, 3) array
    faces : (m, 3) int64 array
    uv : (m, 3, 2) array or None
    normals : (m, 3, 3) array or None
    material : (m,) int64 array or None
        Number of the material of each triangle, -1: none.
    """

    vertices: Array
    faces: Indices
    uv: Array | None = None
    normals: Array | None = None
    material: Indices | None = None

    def kept(self, which: NDArray[Any]) -> Corners:
        """Return the mesh with only some of the triangles, given as a mask or as indices."""
        rest = (None if a is None else a[which] for a in (self.uv, self.normals, self.material))
        return Corners(self.vertices, self.faces[which], *rest)

    def turned(self, which: Mask) -> Corners:
        """Return the mesh with the triangles of a mask wound the other way round."""
        order = np.where(which[:, None], (0, 2, 1), (0, 1, 2))
        rows = np.arange(len(order))[:, None]
        uv, normals = (None if a is None else a[rows, order] for a in (self.uv, self.normals))
        return Corners(self.vertices, self.faces[rows, order], uv, normals, self.material)


def refuse(name: str, reason: str) -> NoReturn:
    """Raise `AsperityError` with one line that names the mesh."""
    raise AsperityError(f"mesh {name!r}: {reason}") from None


def checked_corners(
    vertices: Any, faces: Any, uv: Any, normals: Any, name: str, material: Any = None
) -> Corners:
    """Return the four arrays as `Corners`, or raise `AsperityError` naming the invalid value."""
    points = _numbers(name, "vertices", vertices)
    if points.ndim != 2 or points.shape[1] != 3:
        refuse(name, f"vertices have shape {points.shape}; valid: (n, 3)")
    triangles = _whole_numbers(name, faces)
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        refuse(name, f"faces have shape {triangles.shape}; valid: (m, 3), triangles only")
    if len(triangles) > MAX_FACES:
        refuse(name, f"{len(triangles)} triangles are too many; valid: at most {MAX_FACES}")
    _check_finite(name, "vertices", points)
    _check_range(name, triangles, len(points))
    corners = Corners(points, triangles)
    if uv is not None:
        coordinates = _at_corners(name, "uv", _numbers(name, "uv", uv), corners, 2)
        if np.abs(coordinates).max() > _LARGEST_UV:
            far = np.abs(coordinates).max()
            refuse(name, f"uv reach {far:.4g}; valid: -1e6 to 1e6, best 0 to 1")
        corners = corners._replace(uv=coordinates)
    if normals is not None:
        values = _at_corners(name, "normals", _numbers(name, "normals", normals), corners, 3)
        corners = corners._replace(normals=values)
    if material is not None:
        numbers = _whole_numbers(name, material)
        if numbers.shape != (len(triangles),):
            refuse(name, f"material has shape {numbers.shape}; valid: ({len(triangles)},)")
        corners = corners._replace(material=numbers)
    return corners


def _array(name: str, what: str, values: Any, kinds: str, valid: str) -> NDArray[Any]:
    """Return values as an array that is not empty and whose type is one of `kinds`."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        refuse(name, f"{what} must be an array of numbers with rows of equal length")
    if array.size == 0:
        refuse(name, f"it has no {what}; valid: one triangle or more")
    if array.dtype.kind not in kinds:
        refuse(name, f"{what} hold {array.dtype} values; valid: {valid}")
    return array


def _numbers(name: str, what: str, values: Any) -> Array:
    """Return a copy of `values` as float64."""
    # Adding 0 turns -0 into 0, so that equal positions have equal bytes.
    with np.errstate(over="ignore"):
        return _array(name, what, values, "iuf", "real numbers").astype(np.float64) + 0.0


def _whole_numbers(name: str, faces: Any) -> Indices:
    array = _array(name, "faces", faces, "iu", "whole numbers, indices of vertices")
    if array.dtype.kind == "u" and array.max() > np.iinfo(np.int64).max:
        refuse(name, f"a face names vertex {array.max()}; valid: indices of vertices")
    return array.astype(np.int64)


def _check_finite(name: str, what: str, values: Array) -> None:
    wrong = ~np.isfinite(values)
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = first[0] if len(first) == 2 else first[:2]
        count = np.count_nonzero(wrong)
        refuse(
            name,
            f"{what}[{where}] is {values[first]}, the first of {count} values that are not finite; "
            "valid: finite numbers",
        )


def _check_range(name: str, faces: Indices, count: int) -> None:
    wrong = ((faces < 0) | (faces >= count)).any(axis=1)
    if wrong.any():
        face = int(np.argmax(wrong))
        index = next(int(i) for i in faces[face] if not 0 <= i < count)
        refuse(name, f"face {face} names vertex {index}; valid: 0 to {count - 1}")


def _at_corners(name: str, what: str, values: Array, corners: Corners, width: int) -> Array:
    """Return values per corner or per vertex as values per corner."""
    n, m = len(corners.vertices), len(corners.faces)
    if values.shape not in ((n, width), (m, 3, width)):
        refuse(
            name,
            f"{what} have shape {values.shape}; valid: ({m}, 3, {width}), one to a corner of each "
            f"triangle, or ({n}, {width}), one to a vertex",
        )
    _check_finite(name, what, values)
    return values if values.ndim == 3 else values[corners.faces]


def check_size(name: str, vertices: Array, unit: str = "m", *, of_file: bool = False) -> None:
    """Raise `AsperityError` if the extent of a mesh is out of range; suggest units that fit.

    Parameters
    ----------
    name : str
    vertices : (n, 3) array
        In `unit`.
    unit : str
        One of `UNITS`.
    of_file : bool
        Whether the user can choose the unit by `unit=`.
    """
    with np.errstate(over="ignore"):
        extents = extents_of(vertices)
        far = float(extents.max() * UNITS[unit])
    if SMALLEST <= far <= LARGEST:
        return
    if of_file:
        valid = [
            f"unit={u!r} ({length(extents.max() * UNITS[u])})"
            for u in UNITS
            if SMALLEST <= extents.max() * UNITS[u] <= LARGEST
        ]
        advice = f"; its largest extent would do with {' or '.join(valid)}" if valid else ""
    else:
        advice = "; are its vertices in mm? they have to be in m"
    size = " x ".join(f"{e * UNITS[unit]:.4g}" for e in extents)
    refuse(name, f"its extents are {size} m; valid: 0.1 mm to 2 m for the largest{advice}")


def extents_of(points: Array) -> Array:
    """Return the extents (3,) of points (n, 3); axis by axis, which is ten times faster."""
    return np.array([np.ptp(points[:, axis]) for axis in range(points.shape[1])])


def length(metres: float) -> str:
    """Return a length as text, in um, mm or m."""
    if metres < 1e-3:
        return f"{metres * 1e6:.3g} um"
    return f"{metres * 1e3:.3g} mm" if metres < 1.0 else f"{metres:.3g} m"


def same_places(vertices: Array, tolerance: float) -> Indices:
    """Return the place of each vertex: an index shared by all vertices within a tolerance.

    Files split a vertex where texture coordinates or normals differ, and STL splits all of them.
    """
    from scipy.spatial import KDTree  # slow to import, as are others here

    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    pairs = KDTree(unique).query_pairs(tolerance, output_type="ndarray")
    if not len(pairs):
        return inverse.astype(np.int64)
    return joined(len(unique), pairs[:, 0], pairs[:, 1])[inverse]


def joined(count: int, first: NDArray[Any], second: NDArray[Any]) -> Indices:
    """Return the index of the connected component of each of `count` items, joined in pairs."""
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    links = sparse.coo_matrix((np.ones(len(first), dtype=bool), (first, second)), (count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def cleaned(corners: Corners, name: str, notes: list[str]) -> tuple[Corners, Indices]:
    """Return a mesh without useless elements, and the places of its vertices.

    Triangles without area, repeated triangles and unused vertices are dropped.
    """
    used = np.unique(corners.faces)
    points = corners.vertices[used]
    if not extents_of(points).any():
        refuse(name, "all its vertices are at one place; valid: triangles with an area")
    check_size(name, points)
    size = float(extents_of(points).max())
    places = np.zeros(len(corners.vertices), dtype=np.int64)
    places[used] = same_places(points, SAME_PLACE * size)

    at = places[corners.faces]
    empty = (at == np.roll(at, 1, axis=1)).any(axis=1)
    empty |= facet_heights(corners.vertices[corners.faces]) <= _THIN * size
    if empty.all():
        refuse(name, f"none of its {len(empty)} triangles has an area; valid: one at least")
    if empty.any():
        notes.append(f"{count_of(empty.sum(), 'triangle')} without area dropped")
        corners = corners.kept(~empty)
    _, first = np.unique(np.sort(places[corners.faces], axis=1), axis=0, return_index=True)
    if len(first) < len(corners.faces):
        twice = len(corners.faces) - len(first)
        notes.append(f"{count_of(twice, 'triangle')} dropped: the same three corners as another")
        corners = corners.kept(np.sort(first))
    used, faces = np.unique(corners.faces, return_inverse=True)
    if len(used) < len(corners.vertices):
        spare = len(corners.vertices) - len(used)
        notes.append(f"{count_of(spare, 'vertex', 'vertices')} dropped that no triangle uses")
    faces = faces.reshape(corners.faces.shape).astype(np.int64)
    return corners._replace(vertices=corners.vertices[used], faces=faces), places[used]


def facet_heights(triangles: Array) -> Array:
    """Return the smallest height of each triangle [m], (m, 3, 3) -> (m,)."""
    sides = np.roll(triangles, -1, axis=1) - triangles
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    twice_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return twice_area / np.maximum(longest, math.ulp(0.0))


def count_of(count: SupportsInt, one: str, many: str = "") -> str:
    """Return a count with its noun."""
    count = int(count)
    return f"{count} {one if count == 1 else many or one + 's'}"
