"""Pressure and shear of a deformable surface on a grid, projected along z.

A cell has the mean over evenly spaced samples, so that the sum over all cells equals that over the
taxels up to the size of the cells.
"""

from __future__ import annotations

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.contact.deformable.surface import DeformableSurface
from asperity.contact.deformable.surface_contact import SurfaceContact

_STEEPEST = 0.2
"""Smallest cosine between z and the normal of a visible triangle, as for taxels of a soft skin."""
_MOST_CELLS = 256
"""Maximum number of cells along one side of the grid."""
_SAMPLES = 4
"""Samples along each side of a cell."""


class TaxelGrid:
    """The taxels visible from above in each cell of a grid, for the surface at rest.

    Attributes
    ----------
    taxels : (2,) of int
        Rows (along y) and columns (along x) of cells about as large as a taxel.
    extent : (4,) of float
        Ends of the grid along columns, and along rows [m]: first, last, first, last.
    taxel : (rows, columns, 4, 4) array of int
        Number of the taxel at each sample of the cell; -1 if there is none.
    """

    def __init__(self, surface: DeformableSurface) -> None:
        arrays, mesh = surface.arrays, surface.mesh
        low, high = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
        cell = max(surface.pitch, float((high - low).max()) / _MOST_CELLS)
        columns, rows = np.maximum(np.rint((high - low) / cell), 1.0).astype(int).tolist()
        self.taxels = rows, columns
        self.extent = float(low[0]), float(high[0]), float(low[1]), float(high[1])
        across, along = _SAMPLES * columns, _SAMPLES * rows
        x = low[0] + (np.arange(across) + 0.5) * ((high[0] - low[0]) / across)
        y = low[1] + (np.arange(along) + 0.5) * ((high[1] - low[1]) / along)
        taxel, top = np.full((along, across), -1), np.full((along, across), -np.inf)
        for face in np.flatnonzero(surface.normals[:, 2] > _STEEPEST):
            corners = mesh.vertices[mesh.faces[face]]
            (left, front), (right, back) = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
            inside = np.ix_((y >= front) & (y <= back), (x >= left) & (x <= right))
            at = np.stack(np.meshgrid(x[inside[1].ravel()], y[inside[0].ravel()]), axis=-1)
            axes = (corners[1:, :2] - corners[0, :2]).T
            local = (at - corners[0, :2]) @ np.linalg.inv(axes).T
            weights = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
            height = weights @ corners[:, 2]
            is_seen = (weights.min(axis=2) >= -1e-9) & (height > top[inside])
            first, last = arrays.first[face], arrays.first[face + 1]
            apart = weights[:, :, None] - arrays.weight[first:last]
            nearest = first + (apart**2).sum(axis=3).argmin(axis=2)
            taxel[inside] = np.where(is_seen, nearest, taxel[inside])
            top[inside] = np.where(is_seen, height, top[inside])
        cells = taxel.reshape(rows, _SAMPLES, columns, _SAMPLES)
        self.taxel: Indices = np.ascontiguousarray(cells.swapaxes(1, 2))


class SeenFromAbove:
    """The fields of a contact on a grid, with the interface of `SkinContact`.

    Parameters
    ----------
    contact : SurfaceContact
    grid : TaxelGrid
    """

    def __init__(self, contact: SurfaceContact, grid: TaxelGrid) -> None:
        self._contact, self._grid = contact, grid

    @property
    def pressure(self) -> Array:
        """Pressure along each taxel's ray [Pa], (rows, columns)."""
        return self._to_grid(self._contact.out.traction[:, 0])

    @property
    def shear(self) -> Array:
        """Traction normal to each taxel's ray, along x and y [Pa], (rows, columns, 2)."""
        along = self._contact.state.taxels.along[:, :, :2]
        return self._to_grid(np.einsum("nk,nki->ni", self._contact.out.traction[:, 1:], along))

    @property
    def contact_area(self) -> float:
        """Area of the taxels in contact [m^2]."""
        return self._contact.contact_area

    def _to_grid(self, values: Array) -> Array:
        found = values[self._grid.taxel]
        found[self._grid.taxel < 0] = 0.0
        return np.asarray(found.mean(axis=(2, 3)))
