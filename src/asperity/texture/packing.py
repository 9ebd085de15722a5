"""Textures and maps of a scene packed into flat arrays: see `packed`.

Bounds of slopes and second derivatives come from pyramids over the Bezier points of the cells (a
spline lies in their convex hull), highest points from overlapping windows (`highest`). To work them
out takes longer than all else when a scene is made ready, so those of the last textures are kept.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.texture.bounds import halved
from asperity.texture.cell_peaks import sharpen_peaks
from asperity.texture.friction_map import FrictionMap
from asperity.texture.height_field import HeightField
from asperity.texture.highest import WINDOW_LEVEL, windows
from asperity.texture.packed import BLOCK_BOUNDS, LEVEL, TEXTURE_MAP, PackedTextures
from asperity.texture.stiffness_map import StiffnessMap

_MOST_BLOCKS = 2 * 512**2
"""Largest number of blocks into which the cells of a coarse texture are subdivided."""
_MOST_KEPT = 128 * 2**20
"""Bytes of bounds that are kept for textures that come again."""
_SHARP = 1e-4
"""How much too high the highest point of a cell may be, relative to the texture's rms height."""


def pack(
    fields: Sequence[HeightField | StiffnessMap], frictions: Sequence[FrictionMap] = ()
) -> PackedTextures:
    """Return textures, and behind them maps of friction, as flat arrays, which may be empty."""
    maps = np.zeros(len(fields) + len(frictions), TEXTURE_MAP)
    coefficients = [np.zeros(0)]
    bounds, tops = [np.zeros(0, BLOCK_BOUNDS)], [np.zeros(0, np.float32)]
    levels, window_levels = [np.zeros(0, LEVEL)], [np.zeros(0, WINDOW_LEVEL)]

    def count(parts: list[NDArray]) -> int:
        return sum(map(len, parts))

    for i, field in enumerate(fields):
        one = _bounds_of(field)
        maps[i] = one.map
        maps[i]["first_coefficient"], maps[i]["first_level"] = count(coefficients), count(levels)
        maps[i]["first_window_level"] = count(window_levels)
        levels.append(_behind(one.levels, count(bounds)))
        window_levels.append(_behind(one.windows, count(tops)))
        coefficients.append(np.ascontiguousarray(field.coefficients).ravel())
        bounds.append(one.bounds)
        tops.append(one.tops)
    for own, friction in zip(maps[len(fields) :], frictions, strict=True):
        c, wraps = friction.coefficients, friction.border == "wrap"
        own["first_coefficient"], own["coefficient_columns"] = count(coefficients), c.shape[1]
        own["rows"], own["columns"] = (n - 4 if wraps else n - 3 for n in c.shape)
        own["wraps"], own["cells_per_metre"] = wraps, 1.0 / np.asarray(friction.pixel_size)
        coefficients.append(c.ravel())
    return PackedTextures(
        np.concatenate(coefficients),
        np.concatenate(bounds),
        np.concatenate(levels),
        maps,
        np.concatenate(tops),
        np.concatenate(window_levels),
    )


def _behind(levels: NDArray[np.void], count: int) -> NDArray[np.void]:
    """Return levels whose blocks or windows come after `count` others."""
    moved = levels.copy()
    moved["first"] += count
    return moved


class _Bounds(NamedTuple):
    """What `pack` works out of one texture, as if it were the only one."""

    map: NDArray[np.void]
    bounds: NDArray[np.void]
    levels: NDArray[np.void]
    tops: NDArray[np.float32]
    windows: NDArray[np.void]


_kept: dict[bytes, _Bounds] = {}
"""Bounds of the last textures by their content, the last used one last."""


def _bounds_of(field: HeightField | StiffnessMap) -> _Bounds:
    """Return the bounds of a texture: kept ones, if an equal one has been packed."""
    shape = field.coefficients.shape
    about = repr((shape, field.border, field.pixel_size, field.rms, field.lowest))
    digest = hashlib.sha256(about.encode())
    digest.update(np.ascontiguousarray(field.coefficients).data)
    key = digest.digest()
    found = _kept.pop(key, None) or _work_out(field)
    _kept[key] = found
    while sum(one.bounds.nbytes + one.tops.nbytes for one in list(_kept.values())) > _MOST_KEPT:
        _kept.pop(next(iter(_kept)), None)
    return found


def _work_out(field: HeightField | StiffnessMap) -> _Bounds:
    c = np.ascontiguousarray(field.coefficients)
    wraps = field.border == "wrap"
    rows, columns = (n - 4 if wraps else n - 3 for n in c.shape)
    parts = _parts(rows * columns)
    # The last cell of a wrapped texture repeats its first.
    cells = c[:-1, :-1] if wraps else c
    pyramid, levels = _pyramid(cells, field.pixel_size, parts)
    peaks = sharpen_peaks(
        _most(cells, 0, 0, parts=parts), cells, parts, max(_SHARP * field.rms, 1e-12)
    )
    highest, sizes = windows(_rounded_up(peaks), wraps)
    deepest = float(_most(-cells, 0, 0).max())
    pu, pv = field.pixel_size
    curvature = max(_largest(c, 2, 0) / pu**2, _largest(c, 0, 2) / pv**2)
    own = np.zeros(1, TEXTURE_MAP)
    own[0] = (
        0, c.shape[1], rows, columns, wraps, parts, 0, len(levels), 0,
        (1.0 / pu, 1.0 / pv), np.max(np.abs(c)), max(highest.max(), deepest),
        pyramid["slope"][-1],
        curvature + _largest(c, 1, 1) / (pu * pv), _third(c, pu, pv),
        field.rms, field.lowest, highest.max(),
    )  # fmt: skip
    return _Bounds(own[0], pyramid, levels, highest, sizes)


def _parts(cells: int) -> int:
    """Return the number of parts of a cell's side with bounds of their own: more in coarse maps."""
    parts = 1
    while parts < 4 and cells * (2 * parts) ** 2 <= _MOST_BLOCKS:
        parts *= 2
    return parts


def _pyramid(
    c: Array,
    pixel_size: tuple[float, float],
    parts: int,
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return the `BLOCK_BOUNDS` of all blocks, and the `LEVEL` of all levels."""
    pu, pv = pixel_size
    most = functools.partial(_most, c, parts=parts)
    slope = np.hypot(most(1, 0, True) / pu, most(0, 1, True) / pv)
    # Gershgorin: no eigenvalue of the Hessian exceeds the larger row sum.
    curvature = np.maximum(most(2, 0) / pu**2, most(0, 2) / pv**2)
    curvature += most(1, 1, True) / (pu * pv)
    # Rounded up to single precision, a bound remains a bound.
    level = np.stack([_rounded_up(slope), _rounded_up(curvature)], axis=-1)
    blocks, levels, first = [], [], 0
    while True:
        blocks.append(level.reshape(-1, 2))
        levels.append((first, level.shape[0], level.shape[1]))
        first += len(blocks[-1])
        if max(level.shape[:2]) == 1:
            bounds = np.concatenate(blocks).view(BLOCK_BOUNDS).reshape(-1)
            return bounds, np.array(levels, dtype=LEVEL)
        level = halved(halved(level, 0), 1)


def _most(c: Array, along_u: int, along_v: int, size: bool = False, parts: int = 1) -> NDArray:
    """Return for every cell an upper bound of a partial derivative, or of its absolute value.

    Within a cell the derivative is a polynomial and lies in the convex hull of its Bezier points.
    These belong to the cell alone, so they bound more sharply than the spline's coefficients, which
    also shape its neighbours.
    """
    spline: Array = np.diff(np.diff(c, along_u, axis=1), along_v, axis=0)
    rows, columns = c.shape[0] - 3, c.shape[1] - 3
    most = np.empty((parts * rows, parts * columns))
    # Piece by piece, so that what is computed fits into the cache.
    for i, along in enumerate(_bezier_points(spline, 3 - along_v, parts)):
        across = [_bezier_points(point.T, 3 - along_u, parts) for point in along]
        for j, pieces in enumerate(zip(*across, strict=True)):
            points = (np.abs(p) if size else p for piece in pieces for p in piece)
            most[i::parts, j::parts] = functools.reduce(np.maximum, points).T
    return most


def _bezier_points(c: Array, degree: int, parts: int) -> list[list[Array]]:
    """Return the Bezier points of the pieces of uniform B-splines along the first axis.

    Each piece is cut into `parts`, a power of two; the points of the first part of all pieces come
    first.
    """
    n = len(c) - degree
    k = [c[i : i + n] for i in range(degree + 1)]
    if degree == 3:
        k = [
            (k[0] + 4.0 * k[1] + k[2]) / 6.0, (2.0 * k[1] + k[2]) / 3.0,
            (k[1] + 2.0 * k[2]) / 3.0, (k[1] + 4.0 * k[2] + k[3]) / 6.0,
        ]  # fmt: skip
    elif degree == 2:
        k = [0.5 * (k[0] + k[1]), k[1], 0.5 * (k[1] + k[2])]
    pieces = [k]
    while len(pieces) < parts:
        pieces = [half for piece in pieces for half in _halves(piece)]
    return pieces


def _halves(k: list[Array]) -> tuple[list[Array], list[Array]]:
    """Return the Bezier points of both halves of a piece (de Casteljau)."""
    # The left half begins, the right half ends the rows of means.
    left, right = [k[0]], [k[-1]]
    while len(k) > 1:
        k = [one + two for one, two in itertools.pairwise(k)]
        for mean in k:
            mean *= 0.5
        left.append(k[0])
        right.append(k[-1])
    return left, right[::-1]


def _largest(c: Array, along_u: int, along_v: int) -> float:
    """Return the largest absolute coefficient of a partial derivative."""
    return float(np.max(np.abs(np.diff(np.diff(c, along_u, axis=1), along_v, axis=0))))


def _third(c: Array, pu: float, pv: float) -> float:
    """Return an upper bound of the absolute third derivative in any direction [1/m^2]."""
    parts = [_largest(c, 3 - k, k) / (pu ** (3 - k) * pv**k) for k in range(4)]
    # For a unit vector (a, b), (|a| + |b|)^3 is at most 2^1.5.
    return 2.0**1.5 * max(parts)


def _rounded_up(values: Array) -> NDArray[np.float32]:
    rounded = values.astype(np.float32)
    return np.where(rounded < values, np.nextafter(rounded, np.float32(np.inf)), rounded)
