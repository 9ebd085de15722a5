"""What a mesh file holds, before it is checked: parts, materials, its unit.

The readers (`obj`, `gltf`, `ply`, `stl`, `threemf`, `usd`) return `Contents`; `files.read_mesh`
makes one mesh of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.geometry.mesh.checks import UNITS, Corners, length
from asperity.geometry.mesh.materials import Material

_FAR = 10.0
"""A mesh whose middle is farther from the origin, in its sizes, is far from it."""
_COARSE = 1e-5
"""Steps of coordinates above this share of the size lose shape."""
_LOST = 0.02
"""Steps of single precision above this share of the size leave no shape at all."""
_FLAT = 1e-9
_MOST_CORNERS = 2000
"""A concave polygon of more corners is read as a fan."""
_STATED = re.compile(
    r"\bunits?\b\s*(?:(?:are|is|in)\b\s*|[=:,]\s*|(?<=\s))\"?\s*([a-z]+)"
    r"|\buses ([a-z]+) as units\b"  # Maya, in each of its OBJ files
    r"|\bin (mm|cm|(?:milli|centi|micro)met(?:er|re)s?|inches|met(?:er|re)s)\b",
    flags=re.IGNORECASE,
)
_NAMES = {
    "meter": "m", "metre": "m", "millimeter": "mm", "millimetre": "mm", "centimeter": "cm",
    "centimetre": "cm", "decimeter": "dm", "decimetre": "dm", "micrometer": "um",
    "micrometre": "um", "micron": "um", "inch": "in", "inche": "in", "foot": "ft", "feet": "ft",
}  # fmt: skip


class FilePart(NamedTuple):
    """A part of a file in the frame of the whole, and the number of its material, -1: none."""

    corners: Corners
    material: int = -1


@dataclass
class Contents:
    """Parts and materials of a file.

    Attributes
    ----------
    parts : list of FilePart
    materials : list of Material
    notes : list of str
        What was left out, or doubted.
    unit : str or None
        Unit of length that the file states, one of `UNITS`.
    up : str or None
        Axis that points upwards, if the kind of file or the file states it.
    """

    parts: list[FilePart] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unit: str | None = None
    up: str | None = None


def stated_unit(comments: str) -> str | None:
    """Return the unit of length that comments state ("units: mm"), None if they state none."""
    for words in _STATED.findall(comments):
        name = "".join(words).lower()
        name = _NAMES.get(name.removesuffix("s"), _NAMES.get(name, name))
        if name in UNITS:
            return name
    return None


def coarse_note(points: Array, metres: float) -> str | None:
    """Return a note if coordinates far from the origin are stored too coarsely for their shape.

    Parameters
    ----------
    points : (n, 3) array
        In the file's unit.
    metres : float
        Metres a unit.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    far = float(np.abs(0.5 * (low + high)).max())
    if not (math.isfinite(far) and size > 0.0 and far > _FAR * size):
        return None
    step = max(_step(points[:, axis], size) for axis in range(3))
    if step <= _COARSE * size:
        return None
    return (
        f"it lies {length(far * metres)} from the origin, where its coordinates have steps of "
        f"{length(step * metres)} on a size of {length(size * metres)}: the shape is coarse; "
        "export it near the origin, or with more digits"
    )


def _step(values: Array, size: float) -> float:
    """Return the step to which values of one axis are rounded, 0 if none is found."""
    distinct = np.unique(values)
    largest = float(np.abs(distinct).max())
    if len(distinct) < 4:  # faces of a box: fine rounding shows on sloping surfaces only
        step = float(np.spacing(np.float32(largest)))
        single = np.array_equal(distinct, distinct.astype(np.float32))
        return step if single and step > _LOST * size else 0.0
    step = 0.0
    if np.array_equal(distinct, distinct.astype(np.float32)):
        step = float(np.spacing(np.float32(largest)))
    for digits in range(3, 8):  # of a text that keeps few
        unit = 10.0 ** (math.floor(math.log10(largest)) + 1 - digits)
        steps = distinct / unit
        if unit < np.ptp(distinct) and np.allclose(steps, np.round(steps), rtol=0.0, atol=1e-6):
            return max(step, unit)
    return step


def triangulated(points: Array, counts: Sequence[int] | Indices) -> tuple[Indices, Indices]:
    """Return the triangles (m, 3) of polygons, as numbers of corners, and their polygons (m,).

    Convex polygons become fans; of others ears are cut off.

    Parameters
    ----------
    points : (k, 3) array
        Places of the corners of all polygons, one after the other.
    counts : (n,) array of int
        Corners of each polygon; those of fewer than 3 give no triangle.
    """
    count = np.asarray(counts, dtype=np.int64)
    first = np.cumsum(count) - count
    sizes = np.maximum(count - 2, 0)
    of = np.repeat(np.arange(len(count)), sizes)
    k = np.arange(len(of)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    triangles = np.stack([first[of], first[of] + k + 1, first[of] + k + 2], axis=1)
    for polygon in _concave(points, count, first):
        start, n = int(first[polygon]), int(count[polygon])
        if n <= _MOST_CORNERS:
            triangles[of == polygon] = start + _ears(points[start : start + n])
    return triangles, of


def _concave(points: Array, count: Indices, first: Indices) -> Indices:
    """Return the polygons of more than three corners that are not convex."""
    large = np.flatnonzero(count > 3)
    if not len(large):
        return large
    sizes = count[large]
    own = np.repeat(large, sizes)
    k = np.arange(len(own)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    at, before, after = (
        points[first[own] + (k + step) % count[own]] for step in (0, count[own] - 1, 1)
    )
    turns = np.cross(at - before, after - at)
    starts = np.cumsum(sizes) - sizes
    origin = points[first[own]]
    normals = np.add.reduceat(np.cross(at - origin, after - origin), starts)
    along = np.einsum("ij,ij->i", turns, np.repeat(normals, sizes, axis=0))
    least = np.minimum.reduceat(along, starts)
    return large[least < -_FLAT * np.einsum("ij,ij->i", normals, normals)]


def _ears(points: Array) -> Indices:
    """Return the triangles (n - 2, 3) of a polygon (n, 3) by cutting off ears."""
    origin = points - points[0]
    normal = np.cross(origin, np.roll(origin, -1, axis=0)).sum(axis=0)
    drop = int(np.argmax(np.abs(normal)))
    axes = [(drop + 1) % 3, (drop + 2) % 3]
    flat = points[:, axes if normal[drop] > 0.0 else axes[::-1]]
    rest, out = list(range(len(points))), []
    while len(rest) > 3:
        for i in range(len(rest)):
            a, b, c = rest[i - 1], rest[i], rest[(i + 1) % len(rest)]
            others = flat[[j for j in rest if j not in (a, b, c)]]
            if _turn(flat[a], flat[b], flat[c]) > 0.0 and not _inside(others, flat[[a, b, c]]):
                break
        else:
            i, (a, b, c) = 1, rest[:3]  # it crosses itself: any triangle is as good
        out.append((a, b, c))
        del rest[i]
    return np.array([*out, tuple(rest)])


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _inside(points: Array, triangle: Array) -> bool:
    """Return whether any of some points (n, 2) is inside or on a triangle (3, 2)."""
    inside = np.ones(len(points), dtype=bool)
    for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
        side, away = b - a, points - a
        inside &= side[0] * away[:, 1] - side[1] * away[:, 0] >= 0.0
    # A corner that lies where one of the triangle does is no obstacle: bridges to holes have them.
    same = (points[:, None] == triangle).all(axis=2).any(axis=1)
    return bool((inside & ~same).any())
