"""A soft skin: an elastic layer on one body, divided into taxels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity._core.arrays import Array, Indices
from asperity.contact.soft.blocks import BLOCK, RAYS
from asperity.contact.soft.press import TaxelArrays, lay
from asperity.contact.soft.solids import smooth, solids_of
from asperity.errors import AsperityError, require_between, require_finite, require_positive
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.poses import rotation_of

MOST_TAXELS = 1024
"""Maximum number of taxels along one side of the grid."""
_STEEPEST = 0.2
"""Smallest cosine between `facing` and the surface of a taxel."""
_THINNEST = 0.05
"""Smallest thickness of the layer over a lump, as a fraction of its thickness."""


def foundation_modulus(modulus: float, poisson: float, thickness: float) -> float:
    """Return K, the pressure over the compression of a thin elastic layer [Pa/m].

    `(1 - nu) E / ((1 + nu) (1 - 2 nu) h)`, for a layer bonded to a rigid base, without lateral
    strain (Johnson, *Contact Mechanics*, 1985, section 4.3).

    Parameters
    ----------
    modulus : float
        Young's modulus E [Pa], above 0.
    poisson : float
        Poisson's ratio nu [-], from 0 to below 0.5; at 0.5 such a layer is incompressible.
    thickness : float
        h [m], above 0.

    Raises
    ------
    AsperityError
        A value is outside its range.
    """
    require_positive("modulus", modulus, "Pa")
    require_positive("thickness", thickness, "m")
    if not (isinstance(poisson, int | float) and 0.0 <= poisson < 0.5):
        raise AsperityError(
            f"poisson must be 0 or above and below 0.5 (a layer of 0.5 cannot be compressed), got "
            f"{poisson!r}"
        )
    return (1.0 - poisson) * modulus / ((1.0 + poisson) * (1.0 - 2.0 * poisson) * thickness)


def grid_axes(facing: ArrayLike) -> Array:
    """Return the directions of columns, rows and of the vector `facing` (3,), as rows (3, 3)."""
    out = np.asarray(facing, dtype=np.float64) / np.linalg.norm(facing)
    along = np.array([0.0, 1.0, 0.0] if abs(out[0]) > 0.9 else [1.0, 0.0, 0.0])
    along -= out * (out @ along)
    along /= np.linalg.norm(along)
    return np.array([along, np.cross(out, along), out])


@dataclass(frozen=True, eq=False)
class SoftSkin:
    """An elastic layer on a textured body, with a grid of taxels.

    The grid is projected along `facing`: each taxel is at the outermost point of the body's
    textured surface over its cell. Its ray goes from there into the body, against the normal of
    the *smooth* surface. Cells over no surface, or over one steeper than 78 degrees, have no taxel.

    Parameters
    ----------
    body : Body
        Of simple geoms.
    thickness : float
        h [m], 1e-6 to 1.
    modulus : float
        Young's modulus E [Pa], 1 to 1e13.
    poisson : float
        Poisson's ratio [-], from 0 to below 0.5.
    taxels : (2,) of int
        Rows and columns of the grid, 1 to 1024 each.
    facing : (3,)
        Outward direction of the skin, in the body's frame; its length does not matter.
    size : (2,), optional
        Width (along columns) and height (along rows) of the grid [m]; by default the whole body.
    middle : (3,), optional
        Point of the body's frame under the middle of the grid [m].
    friction : float
        Coulomb's coefficient [-], 0 to 100; see `SkinContact`.
    lumps : sequence of (4,)
        Rigid balls within the layer: middle in the body's frame and radius [m]. Where a taxel's ray
        meets one, the layer ends there, and is stiffer in inverse proportion. A lump has to be at
        least a twentieth of the thickness below the surface.

    Raises
    ------
    AsperityError
        A value is outside its range, the body is a mesh, the skin has no taxel, or a lump is not
        within the layer.
    """

    body: Body
    thickness: float
    modulus: float
    poisson: float = 0.45
    taxels: Sequence[int] = (64, 64)
    facing: Sequence[float] = (0.0, 0.0, 1.0)
    size: Sequence[float] | None = None
    middle: Sequence[float] | None = None
    friction: float = 0.0
    lumps: Sequence[Sequence[float]] = ()

    def __post_init__(self) -> None:
        require_between("thickness", self.thickness, 1e-6, 1.0, "m")
        require_between("modulus", self.modulus, 1.0, 1e13, "Pa")
        foundation_modulus(self.modulus, self.poisson, self.thickness)
        require_between("friction", self.friction, 0.0, 100.0)
        shape = require_finite("taxels", self.taxels, 2)
        for name, count in zip(("rows", "columns"), shape, strict=True):
            require_between(f"{name} of taxels", count, 1, MOST_TAXELS)
            if count != int(count):
                raise AsperityError(f"{name} of taxels must be a whole number, got {count!r}")
        object.__setattr__(self, "taxels", tuple(int(count) for count in shape))
        facing = require_finite("facing", self.facing, 3)
        if not math.hypot(*facing) > 1e-9:
            raise AsperityError(f"facing must not be zero, got {self.facing!r}")
        if self.size is not None:
            for value in require_finite("size", self.size, 2):
                require_positive("size", value, "m")
        if self.middle is not None:
            require_finite("middle", self.middle, 3)
        if self.body.mesh is not None:
            raise AsperityError(
                f"body {self.body.name!r} is a mesh; a soft skin needs one of simple geoms "
                "(spheres, capsules, ellipsoids, cylinders, boxes, planes), and DeformableSurface "
                "makes a mesh soft"
            )
        if not len(self.arrays.area):
            raise AsperityError(
                f"no taxel of the skin lies on body {self.body.name!r}; change facing, size or "
                "middle"
            )

    @property
    def stiffness_per_area(self) -> float:
        """K, pressure over compression away from lumps [Pa/m]; see `foundation_modulus`."""
        return foundation_modulus(self.modulus, self.poisson, self.thickness)

    @cached_property
    def axes(self) -> Array:
        """Directions of columns, rows and `facing`, rows of a (3, 3) array in the body's frame."""
        return grid_axes(self.facing)

    @property
    def arrays(self) -> TaxelArrays:
        """The taxels, in the order of `cells`."""
        return self._place_taxels[0]

    @property
    def cells(self) -> Indices:
        """Number of each taxel's cell, row by row, (n,)."""
        return self._place_taxels[1]

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """Ends of the grid along columns, and along rows [m]: first, last, first, last."""
        ends = np.array([_ranges(geom, self.axes[:2]) for geom in self.body.geoms])
        low, high = ends[:, :, 0].min(axis=0), ends[:, :, 1].max(axis=0)
        if not np.isfinite(low).all():
            if self.size is None:
                raise AsperityError(
                    f"body {self.body.name!r} is a plane without a size; give the skin a size"
                )
            low = high = np.zeros(2)
        place = 0.5 * (low + high) if self.middle is None else self.axes[:2] @ self.middle
        size = high - low if self.size is None else np.array(self.size)
        half = 0.5 * size
        first, last = (place - half).tolist(), (place + half).tolist()
        return first[0], last[0], first[1], last[1]

    @cached_property
    def _place_taxels(self) -> tuple[TaxelArrays, Indices]:
        rows, columns = self.taxels
        first, last, low, high = self.extent
        u = first + (np.arange(columns) + 0.5) * ((last - first) / columns)
        v = low + (np.arange(rows) + 0.5) * ((high - low) / rows)
        cell = (last - first) * (high - low) / (rows * columns)
        behind = -1e-3 - 2.0 * max(_reach(geom) for geom in self.body.geoms)
        starts = (
            u[None, :, None] * self.axes[0] + v[:, None, None] * self.axes[1]
            + behind * self.axes[2]
        ).reshape(-1, 3)  # fmt: skip
        point, normal = np.empty_like(starts), np.empty_like(starts)
        solids = solids_of([self.body], [np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])])
        facing = self.axes[2].copy()
        lay(solids, smooth(solids), np.ascontiguousarray(starts), facing, point, normal)
        cosine = normal @ self.axes[2]
        cells = np.flatnonzero(cosine >= _STEEPEST)
        # In the order of square tiles, so that blocks of taxels are compact.
        side = math.isqrt(BLOCK)
        row, column = np.divmod(cells, columns)
        cells = cells[np.lexsort((column, row, column // side, row // side))]
        inwards = -normal[cells]
        one = self.axes[0] - inwards * (inwards @ self.axes[0])[:, None]
        one /= np.linalg.norm(one, axis=1)[:, None]
        along = np.stack([one, np.cross(one, inwards)], axis=1)
        points = point[cells].copy()
        thickness = self._thickness(points, inwards)
        modulus = self.stiffness_per_area * self.thickness / thickness
        return TaxelArrays(
            points, inwards.copy(), along, cell / cosine[cells], thickness, modulus,
            _make_blocks(points, inwards, thickness),
        ), cells  # fmt: skip

    def _thickness(self, points: Array, inwards: Array) -> Array:
        """Return the thickness of the layer over lumps, along the rays of taxels [m], (n,)."""
        out = np.full(len(points), float(self.thickness))
        for number, lump in enumerate(self.lumps):
            x, y, z, radius = require_finite(f"lump {number}", lump, 4)
            require_positive(f"radius of lump {number}", radius, "m")
            away = np.array([x, y, z]) - points
            depth = np.einsum("ij,ij->i", away, inwards)
            half = radius**2 - (np.einsum("ij,ij->i", away, away) - depth**2)
            top = np.where(half > 0.0, depth - np.sqrt(np.maximum(half, 0.0)), np.inf)
            if top.min(initial=np.inf) >= self.thickness:
                raise AsperityError(
                    f"lump {number} at {list(lump[:3])} m lies under no taxel of the skin, which "
                    f"is {1e3 * self.thickness:g} mm thick; change its place or its radius"
                )
            out = np.minimum(out, top)
        if out.min(initial=np.inf) < _THINNEST * self.thickness:
            raise AsperityError(
                f"a lump is {1e3 * out.min():.3g} mm below the surface of the skin; valid: "
                f"{1e3 * _THINNEST * self.thickness:.3g} mm or more, a twentieth of its thickness"
            )
        return out

    def as_grid(self, values: Array, fill: float = 0.0) -> Array:
        """Return values of taxels (n, ...) as a grid (rows, columns, ...); `fill` elsewhere."""
        rows, columns = self.taxels
        out = np.full((rows * columns, *values.shape[1:]), fill)
        out[self.cells] = values
        return out.reshape(rows, columns, *values.shape[1:])


def _make_blocks(points: Array, inwards: Array, thickness: Array) -> NDArray[np.void]:
    """Return the `RAYS` of each block of `BLOCK` taxels."""
    out = np.zeros(-(-len(points) // BLOCK), RAYS)
    for number, rays in enumerate(out):
        part = slice(number * BLOCK, (number + 1) * BLOCK)
        starts, along = points[part], inwards[part].mean(axis=0)
        rays["along"] = along / np.linalg.norm(along)
        rays["middle"] = 0.5 * (starts.min(axis=0) + starts.max(axis=0))
        rays["radius"] = np.linalg.norm(starts - rays["middle"], axis=1).max()
        rays["height"] = np.abs((starts - rays["middle"]) @ rays["along"]).max()
        rays["spread"] = np.linalg.norm(inwards[part] - rays["along"], axis=1).max()
        # As in `deepest`.
        rays["reach"] = 2.0 * thickness[part].max()
    return out


def _reach(geom: Geom) -> float:
    """Return an upper bound of a geom's distance from the origin of its body's frame [m]."""
    return float(np.linalg.norm(geom.position) + sum(geom.size))


def _ranges(geom: Geom, directions: Array) -> list[tuple[float, float]]:
    """Return the range of a geom along each direction [m]."""
    size, out = geom.size, []
    for direction in directions:
        x, y, z = np.abs(rotation_of(geom.quaternion).T @ direction)
        if geom.kind == "plane":
            sides = [s if s > 0.0 else math.inf for s in size[:2]]
            half = sum(c * s for c, s in zip((x, y), sides, strict=True) if c > 1e-9)
        elif geom.kind == "box":
            half = x * size[0] + y * size[1] + z * size[2]
        elif geom.kind == "ellipsoid":
            half = math.hypot(x * size[0], y * size[1], z * size[2])
        elif geom.kind == "cylinder":
            half = math.hypot(x, y) * size[0] + z * size[1]
        else:
            half = size[0] + z * (size[1] if geom.kind == "capsule" else 0.0)
        at = float(direction @ np.asarray(geom.position))
        out.append((at - half, at + half))
    return out
