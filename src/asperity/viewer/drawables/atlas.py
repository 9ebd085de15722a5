"""The relief of a mesh as an image: every triangle has a region, coloured by height.

Teeth of half a millimetre on a hammer need more triangles than a page can show, but not more
pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.geometry.displaced.relief import MeshRelief
from asperity.viewer.drawables.materials import Paint

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
_SIZE = 2048
"""Rows and columns of the image, a size that every browser supports."""
_GUTTER = 2
"""Margin around each triangle [pixels], so that a filtered image shows no neighbours."""
_AT_ONCE = 400
"""Triangles coloured in one NumPy call."""
_DARKER = 0.55
"""Darkening of slopes: factor of (1 - cosine) of their angle to the smooth surface."""


class Atlas:
    """Layout of a mesh's triangles in an image, and the image.

    Two triangles share a cell, cut along its diagonal.

    Parameters
    ----------
    body : Body
        With a mesh and a texture.
    faces : (m,) array of bool
        Triangles to include.
    paint : callable
        Colours of points with heights.
    """

    def __init__(self, body: Body, faces: NDArray[np.bool_], paint: Paint) -> None:
        assert body.mesh is not None
        self._body, self._paint = body, paint
        self._faces = np.flatnonzero(faces)
        self._number = np.cumsum(faces) - 1
        cells = (len(self._faces) + 1) // 2
        # The largest triangle of which enough pairs fit.
        wide, high = 5 * _GUTTER, 2 * _GUTTER
        side = int(np.sqrt(_SIZE**2 / max(cells, 1)))
        while (_SIZE // (side + wide)) * (_SIZE // (side + high)) < cells:
            side -= 1
        self._side = side
        self._across = _SIZE // (side + wide)
        self._cell = np.array([side + wide, side + high])

    def places(self, face: Whole, weights: Array) -> Array:
        """Return positions (n, k, 2) of points with weights (n, k, 3) in triangles (n,).

        In the image from its upper left corner, 0 to 1, as glTF's texture coordinates.
        """
        number = self._number[face]
        cell, second = number // 2, number % 2 == 1
        corner = np.stack([cell % self._across, cell // self._across], axis=-1) * self._cell
        inside = np.where(
            second[:, None, None],
            [4.0 * _GUTTER, _GUTTER] + self._side * (1.0 - weights[..., 1:]),
            _GUTTER + self._side * weights[..., 1:],
        )
        return np.asarray((corner[:, None] + inside) / _SIZE)

    def image(self) -> NDArray[np.uint8]:
        """Return the image, (rows, columns, 3)."""
        out = np.full((_SIZE, _SIZE, 3), 255, np.uint8)
        mesh = self._body.mesh
        assert mesh is not None
        corners = mesh.vertices[mesh.faces[self._faces]]
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        relief = MeshRelief(self._body, float(np.median(sides)) / self._side)
        columns, rows = self._cell
        x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
        second = x + y > self._side + 3.5 * _GUTTER
        # Beyond a triangle's edge the relief continues for a pixel or two.
        s = np.where(second, 1.0 - (x - 4 * _GUTTER) / self._side, (x - _GUTTER) / self._side)
        t = np.where(second, 1.0 - (y - _GUTTER) / self._side, (y - _GUTTER) / self._side)
        weights = np.stack([1.0 - s - t, s, t], axis=-1)
        for half in (0, 1):
            mine = second == bool(half)
            for some in np.array_split(
                np.arange(half, len(self._faces), 2), 1 + len(self._faces) // _AT_ONCE
            ):
                if not some.size:
                    continue
                pixels = self._colours(relief, self._faces[some], weights[mine])
                left = some // 2 % self._across * columns
                top = some // 2 // self._across * rows
                at_y, at_x = np.nonzero(mine)
                out[top[:, None] + at_y, left[:, None] + at_x] = pixels
        return out

    def _colours(self, relief: MeshRelief, face: Whole, weights: Array) -> NDArray[np.uint8]:
        """Return colours (n, k, 3) of triangles (n,) at the same weights (k, 3) in each."""
        tiled = np.broadcast_to(weights, (len(face), *weights.shape))
        height, turned = relief.heights(face, tiled)
        mesh = self._body.mesh
        assert mesh is not None
        points = np.einsum("kc,ncx->nkx", weights, mesh.vertices[mesh.faces[face]])
        colour = self._paint(points.reshape(-1, 3), height.reshape(-1))
        shade = 1.0 - _DARKER * (1.0 - turned.reshape(-1, 1))
        return np.asarray((255.0 * colour * shade).reshape(*height.shape, 3), dtype=np.uint8)
