"""What a mesh file holds, before it is checked: parts, materials, its unit.

The readers (`obj`, `gltf`, `ply`, `stl`) return `Contents`; `files.read_mesh` makes one mesh of it.
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
_STATED = re.compile(
    r"\bunits?\b\s*(?:(?:are|is|in)\b\s*|[=:]\s*)\"?\s*([a-z]+)", flags=re.IGNORECASE
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
    """

    parts: list[FilePart] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unit: str | None = None


def stated_unit(comments: str) -> str | None:
    """Return the unit of length that comments state ("units: mm"), None if they state none."""
    for word in _STATED.findall(comments):
        name = word.lower()
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
    step = max(_step(points[:, axis]) for axis in range(3))
    if step <= _COARSE * size:
        return None
    return (
        f"it lies {length(far * metres)} from the origin, where its coordinates have steps of "
        f"{length(step * metres)} on a size of {length(size * metres)}: the shape is coarse; "
        "export it near the origin, or with more digits"
    )


def _step(values: Array) -> float:
    """Return the step to which values of one axis are rounded, 0 if none is found."""
    distinct = np.unique(values)
    if len(distinct) < 4:  # faces of a box: rounding shows on sloping surfaces only
        return 0.0
    largest = float(np.abs(distinct).max())
    step = 0.0
    if np.array_equal(distinct, distinct.astype(np.float32)):
        step = float(np.spacing(np.float32(largest)))
    for digits in range(3, 8):  # of a text that keeps few
        unit = 10.0 ** (math.floor(math.log10(largest)) + 1 - digits)
        steps = distinct / unit
        if unit < np.ptp(distinct) and np.allclose(steps, np.round(steps), rtol=0.0, atol=1e-6):
            return max(step, unit)
    return step


def fans(counts: Sequence[int] | Indices) -> tuple[Indices, Indices]:
    """Return the triangles (m, 3) of fans of polygons, as numbers of corners, and their polygons.

    Parameters
    ----------
    counts : (n,) array of int
        Corners of each polygon; those of fewer than 3 give none.
    """
    count = np.asarray(counts, dtype=np.int64)
    of = np.repeat(np.arange(len(count)), np.maximum(count - 2, 0))
    first = np.cumsum(count) - count
    starts = np.cumsum(np.maximum(count - 2, 0)) - np.maximum(count - 2, 0)
    k = np.arange(len(of)) - starts[of]
    return np.stack([first[of], first[of] + k + 1, first[of] + k + 2], axis=1), of
