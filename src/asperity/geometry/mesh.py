"""Triangle meshes: low-resolution bodies whose detail is in their texture.

A mesh knows three things at each corner of each triangle: where it is, the unit normal along
which the texture displaces it, and where it lies on the texture. Corners that share a vertex
share the normal unless an edge between them is declared hard; so a displaced surface does not
tear at its creases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles, checked; `mesh_from_arrays` makes it.

    Attributes
    ----------
    vertices : (n, 3) array
        [m], in the body's frame.
    faces : (m, 3) int64 array
        Vertices of each triangle, counter-clockwise as seen from outside.
    normals : (m, 3, 3) array
        Unit normals at the corners of each triangle; the texture moves the surface along them.
    uv : (m, 3, 2) array or None
        Texture coordinates of the corners [-], 0 to 1 over the texture's whole extent, v upwards.
    name : str
    notes : tuple of str
        What was found or changed when it was made: mirrored charts, open borders, and so on.
    """

    vertices: Array
    faces: NDArray[np.int64]
    normals: Array
    uv: Array | None = None
    name: str = "mesh"
    notes: tuple[str, ...] = ()
