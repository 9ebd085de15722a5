"""Triangle meshes: low-resolution surfaces whose detail is in a texture.

Each corner of each triangle has a position, a unit normal along which the texture displaces it, and
texture coordinates. Corners at one vertex share the normal unless an edge between them is hard: a
displaced surface is closed but at its hard edges, and flat faces between these stay flat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from numpy.typing import ArrayLike

from asperity._core.arrays import Array, Indices
from asperity.errors import require_between
from asperity.geometry.mesh.checks import Corners, checked_corners, cleaned, count_of
from asperity.geometry.mesh.crossings import crossing_triangles
from asperity.geometry.mesh.materials import Material
from asperity.geometry.mesh.normals import HARD_ANGLE, given_normals, smooth_normals
from asperity.geometry.mesh.topology import edges_of, wound_alike
from asperity.geometry.mesh.uv import uv_notes


@dataclass(frozen=True, eq=False)
class Mesh:
    """A checked surface of triangles; made by `mesh_from_arrays`.

    Attributes
    ----------
    vertices : (n, 3) array
        [m], in the body's frame.
    faces : (m, 3) int64 array
        Vertices of each triangle, counter-clockwise as seen from outside.
    normals : (m, 3, 3) array
        Unit normals at the corners of each triangle, along which the texture displaces the surface.
    uv : (m, 3, 2) array or None
        Texture coordinates of the corners [-], 0 to 1 over the texture's whole extent, v upwards.
    name : str
    notes : tuple of str
        Findings and repairs: mirrored charts, open borders, and so on.
    materials : tuple of Material
        Of the file, those that its parts have.
    material : (m,) int64 array or None
        Number of each triangle's material in `materials`, -1: none.
    up : str
        Axis that points upwards as the kind of file or the file states it, "" without.
    """

    vertices: Array
    faces: Indices
    normals: Array
    uv: Array | None = None
    name: str = "mesh"
    notes: tuple[str, ...] = ()
    materials: tuple[Material, ...] = ()
    material: Indices | None = None
    up: str = ""


def mesh_from_arrays(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    uv: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    hard_angle: float | None = None,
    material: ArrayLike | None = None,
    name: str = "mesh",
) -> Mesh:
    """Return a checked mesh of triangles, repaired where possible.

    Repaired, with a note: triangles without area and repeated triangles are dropped; neighbours are
    wound consistently; a closed mesh that is inside out is inverted. Only noted: borders, edges of
    more than two triangles, triangles that cross (checked for up to 20,000), and texture
    coordinates that are mirrored, overlap, leave 0..1 or have no area.

    Parameters
    ----------
    vertices : (n, 3) array
        [m]; the largest extent from 0.1 mm to 2 m.
    faces : (m, 3) array of int
        Vertices of each triangle, counter-clockwise as seen from outside; at most 2,000,000.
        Vertices that coincide (to 1e-7 of the size) count as one, since files split them at seams.
    uv : (m, 3, 2) or (n, 2) array, optional
        Texture coordinates of the triangles' corners or of the vertices [-], v upwards, within
        1e6.
    normals : (m, 3, 3) or (n, 3) array, optional
        Directions along which the texture displaces the surface, of any length; they are reversed
        where they point inwards. Where they differ at one vertex the displaced surface opens.
    hard_angle : float, optional
        Angle [degrees], 0 to 180, between the normals of two triangles beyond which their edge is
        hard; given normals are then ignored. None: the given normals, or 44 where there are none.
        180: no edge is hard.
    material : (m,) array of int, optional
        Number of the material of each triangle, which `Mesh.material` keeps; -1: none.
    name : str
        For messages.

    Returns
    -------
    Mesh
        Its arrays are read-only copies. Without given normals all triangles around a vertex, up to
        its hard edges, share one, weighted by their angles there (Thuermer and Wuethrich, J.
        Graphics Tools 3, 43 (1998)); around a vertex within a plane it is exactly the plane's. How
        a flat face is meshed has no influence, and facets of at most an eighth of its area do not
        tilt it.

    Raises
    ------
    AsperityError
        Arrays that are empty, of another shape or type, not finite; indices out of range;
        triangles all without area; a size outside the range; one line.
    """
    if hard_angle is not None:
        require_between("hard_angle", hard_angle, 0.0, 180.0, "degrees")
    notes: list[str] = []
    given_corners = checked_corners(vertices, faces, uv, normals, name, material)
    corners, places = cleaned(given_corners, name, notes)
    corners = wound_alike(corners, places, notes)
    at = places[corners.faces]
    if corners.normals is None or hard_angle is not None:
        limit = math.radians(HARD_ANGLE if hard_angle is None else hard_angle)
        directions = smooth_normals(
            corners.vertices, corners.faces, at, limit, notes, note_hard=hard_angle is not None
        )
    else:
        given = corners.normals
        directions = given_normals(corners.vertices, corners.faces, at, given, notes)
    _note_crossings(corners, at, notes)
    if corners.uv is not None:
        notes += uv_notes(corners.vertices[corners.faces], corners.uv, at, edges_of(at))
    for array in (corners.vertices, corners.faces, directions, corners.uv, corners.material):
        if array is not None:
            array.setflags(write=False)
    return Mesh(
        corners.vertices, corners.faces, directions, corners.uv, name, tuple(notes),
        material=corners.material,
    )  # fmt: skip


def _note_crossings(corners: Corners, at: Indices, notes: list[str]) -> None:
    crossed = crossing_triangles(corners.vertices[corners.faces], at)
    if crossed is None:
        notes.append("not looked for triangles that cross: there are too many")
    elif crossed:
        notes.append(
            f"the surface runs through itself: {count_of(crossed, 'triangle')} cross another"
        )
