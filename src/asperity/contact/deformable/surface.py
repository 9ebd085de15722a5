"""A textured surface with moving vertices: an elastic layer on a mesh, divided into taxels."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.contact.deformable.records import SurfaceArrays
from asperity.contact.soft.blocks import RAYS
from asperity.contact.soft.press import TaxelArrays
from asperity.contact.soft.skin import foundation_modulus
from asperity.errors import AsperityError, require_between, require_positive
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.displaced.relief import MeshRelief
from asperity.geometry.mesh.checks import same_places
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import crosses
from asperity.texture.height_field import HeightField

MOST_TAXELS = 1_000_000
_SAME_NORMAL = 1e-6
"""Largest difference between normals of corners that share one [-]."""


class DeformableSurface:
    """An elastic layer on a textured mesh whose vertices may move.

    Taxels have fixed barycentric coordinates in the triangles, and the area and texture height of
    the state at rest: the texture is stretched with the surface, and keeps its height. A taxel's
    ray goes from the textured surface into the body, along the interpolated normal of its triangle.
    Hard edges of the mesh stay hard.

    Parameters
    ----------
    mesh : Mesh
        At rest.
    thickness : float
        Of the layer [m], 1e-6 to 1.
    modulus : float
        Its Young's modulus [Pa], 1 to 1e13.
    poisson : float
        Its Poisson's ratio [-], from 0 to below 0.5.
    pitch : float
        Distance between taxels [m]; each triangle has a square number of them, one at least.
    texture : HeightField, optional
        Waves shorter than `pitch` are averaged. None: smooth.
    mapping : {"uv", "triplanar", "planar", "cylindrical"}
        Of the texture to the mesh at rest; see `Body`.
    offset : (2,)
        Position of the map [m]; see `Body`.
    friction : float
        Coulomb's coefficient [-], 0 to 100; see `SkinContact`.
    rise : float
        Distance of the texture's zero level from the mesh, outwards [m], 0 to 1.

    Raises
    ------
    AsperityError
        A value is outside its range, there are more than a million taxels, or the mesh has no
        texture coordinates for the mapping "uv".
    """

    def __init__(
        self,
        mesh: Mesh,
        *,
        thickness: float,
        modulus: float,
        pitch: float,
        poisson: float = 0.45,
        texture: HeightField | None = None,
        mapping: str = "triplanar",
        offset: Sequence[float] = (0.0, 0.0),
        friction: float = 0.0,
        rise: float = 0.0,
    ) -> None:
        require_between("thickness", thickness, 1e-6, 1.0, "m")
        require_between("modulus", modulus, 1.0, 1e13, "Pa")
        require_positive("pitch", pitch, "m")
        require_between("friction", friction, 0.0, 100.0)
        self._rise = require_between("rise", rise, 0.0, 1.0, "m")
        self.mesh, self.thickness, self.friction = mesh, float(thickness), float(friction)
        self.stiffness_per_area = foundation_modulus(modulus, poisson, thickness)
        """K, pressure over compression [Pa/m]; see `foundation_modulus`."""
        self.pitch = float(pitch)
        piece = Geom("mesh", (1.0, 1.0, 1.0))  # not used: the surface is that of the mesh
        self._body = Body(mesh.name, [piece], texture, mapping, offset, mesh)
        corners = mesh.vertices[mesh.faces]
        self._area = 0.5 * np.linalg.norm(crosses(corners), axis=1)
        self._sides = np.maximum(np.rint(np.sqrt(self._area) / self.pitch), 1.0)
        total = float((self._sides**2).sum())
        if total > MOST_TAXELS:
            raise AsperityError(
                f"pitch {self.pitch:g} m gives {total:.3g} taxels on {mesh.name!r}; valid: at "
                f"most {MOST_TAXELS}, a pitch of "
                f"{self.pitch * np.sqrt(total / MOST_TAXELS):.2g} m or more"
            )

    @property
    def taxel_count(self) -> int:
        """Number of taxels."""
        return len(self.arrays.height)

    @cached_property
    def taxel_area(self) -> Array:
        """Area of each taxel at rest [m^2], (n,)."""
        return np.repeat(self.arrays.area / np.diff(self.arrays.first), np.diff(self.arrays.first))

    @cached_property
    def normals(self) -> Array:
        """Unit normal of each triangle at rest, (m, 3)."""
        across = crosses(self.mesh.vertices[self.mesh.faces])
        return np.ascontiguousarray(across / np.linalg.norm(across, axis=1, keepdims=True))

    def corner_normals(self, vertices: Array) -> Array:
        """Return the unit normals at the corners of the triangles (m, 3, 3) for vertices (v, 3)."""
        arrays = self.arrays
        corners = vertices[arrays.faces]
        across = crosses(corners)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        edges = [corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], across]
        own = np.einsum("mck,kmi->mci", arrays.tilt, np.array(edges))
        total = np.zeros((len(arrays.first_member) - 1, 3))
        np.add.at(total, arrays.shared, own)
        total /= np.linalg.norm(total, axis=1, keepdims=True)
        return np.asarray(total[arrays.shared])

    @cached_property
    def arrays(self) -> SurfaceArrays:
        """The surface at rest, for kernels."""
        mesh, corners = self.mesh, self.mesh.vertices[self.mesh.faces]
        area, sides = self._area, self._sides
        counts = sides.astype(np.int64) ** 2
        first = np.concatenate([[0], np.cumsum(counts)])
        weight, height = np.empty((first[-1], 3)), np.empty(first[-1])
        relief = MeshRelief(self._body, self.pitch)
        for side in np.unique(sides.astype(np.int64)):
            faces = np.flatnonzero(sides == side)
            parts = np.broadcast_to(_centroids(side), (len(faces), side**2, 3))
            rows = first[faces][:, None] + np.arange(side**2)
            weight[rows], height[rows] = parts, relief.heights(faces, parts)[0]
        height += self._rise
        highest = np.maximum.reduceat(np.abs(height), first[:-1]) + self.thickness
        shared = _shared_normals(mesh)
        members = np.argsort(shared.ravel(), kind="stable")
        starts = np.searchsorted(shared.ravel()[members], np.arange(shared.max() + 2))
        faces = np.array(mesh.faces, dtype=np.int64)
        return SurfaceArrays(
            faces, shared, members, starts, _components(corners, self.normals, mesh.normals), area,
            highest, first, weight, height,
        )  # fmt: skip

    def taxels(self) -> TaxelArrays:
        """Return new arrays of the taxels; points and rays are not filled yet."""
        n, area = self.taxel_count, self.taxel_area
        return TaxelArrays(
            np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 2, 3)), area,
            np.full(n, self.thickness), np.full(n, self.stiffness_per_area), np.zeros(0, RAYS),
        )  # fmt: skip


def _centroids(side: int) -> Array:
    """Return barycentric coordinates of the middles of `side`^2 equal parts of a triangle."""
    i, j = (index.ravel() for index in np.indices((side, side)))
    upright, reversed_ = i + j < side, i + j < side - 1
    u = np.concatenate([i[upright] + 1.0 / 3.0, i[reversed_] + 2.0 / 3.0]) / side
    v = np.concatenate([j[upright] + 1.0 / 3.0, j[reversed_] + 2.0 / 3.0]) / side
    return np.stack([1.0 - u - v, u, v], axis=1)


def _shared_normals(mesh: Mesh) -> Indices:
    """Return the numbers of the normals at the corners, with equal ones at one point shared."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    places = same_places(corners, 1e-7 * size)
    rounded = np.rint(mesh.normals.reshape(-1, 3) / _SAME_NORMAL)
    rows = np.column_stack([places, rounded])
    _, shared = np.unique(rows, axis=0, return_inverse=True)
    return shared.reshape(-1, 3).astype(np.int64)


def _components(corners: Array, across: Array, normals: Array) -> Array:
    """Return the normals at corners (m, 3, 3) in terms of two edges and the triangle's normal."""
    axes = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], across], axis=2)
    return np.ascontiguousarray(np.linalg.solve(axes[:, None], normals[..., None])[..., 0])
