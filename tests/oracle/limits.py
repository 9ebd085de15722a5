"""What part of two bodies the brute-force reference looks at: half-planes, and a range of overlap.

*Half-planes* cut the domain: only lines parallel to n within all of them count, the border itself
too. A maximum may lie on the border; points along it are looked at, as along rims.

A *range of overlap* tells sheets apart. Where a body has several sheets over one another (the two
arms of a hook), each crossing of a line with A is paired with each crossing with B, and a pair
counts only if the overlap of its two base points, (x_B - x_A).n without textures, lies in the
range. It is meant to leave out whole sheets: where it cuts through one, the cut is no better
known than a line's distance to the next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from asperity.errors import AsperityError
from oracle.raster import (
    Crossings,
    Envelope,
    Grid,
    crossings_of,
    envelope_of,
    keep_highest,
    no_envelope,
)
from oracle.windows import Window

_SLACK = 1e-12
"""How far outside a half-plane [m] a place still counts as in it."""

Array = NDArray[np.float64]


class Limits(NamedTuple):
    """Half-planes `a u + b v <= c` as rows, (a, b) of length 1, and the range of overlap [m]."""

    half_planes: Array
    overlap: tuple[float, float] | None

    @classmethod
    def of(
        cls, region: ArrayLike | None, depth_range: Sequence[float] | None, origin: Array
    ) -> Limits:
        """Return the limits that a caller asked for, moved to an `origin` (u, v) [m]."""
        rows = np.zeros((0, 3)) if region is None else np.array(region, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 3 or not np.all(np.isfinite(rows)):
            raise AsperityError(f"region must be rows (a, b, c) of finite numbers, got {region!r}")
        length = np.hypot(rows[:, 0], rows[:, 1])
        if np.any(length == 0.0):
            raise AsperityError("a row (a, b, c) of region needs an a or a b other than 0")
        rows = rows / length[:, None]
        rows[:, 2] -= rows[:, :2] @ origin
        overlap = None
        if depth_range is not None:
            low, high = (float(value) for value in depth_range)
            if not low <= high:
                raise AsperityError(f"depth_range must be (lowest, highest), got {depth_range!r}")
            overlap = (low, high)
        return cls(rows, overlap)

    def inside(self, places: Array, but: int = -1) -> NDArray[np.bool_]:
        """Return which `places` (..., 2) lie in all half-planes, `but` for one."""
        rows = self.half_planes[np.arange(len(self.half_planes)) != but]
        beyond = places @ rows[:, :2].T - rows[:, 2]
        return np.all(beyond <= _SLACK, axis=-1)

    def allows(self, overlap: Array) -> NDArray[np.bool_]:
        """Return which overlaps of base points [m] lie in the range."""
        if self.overlap is None:
            return np.ones(overlap.shape, dtype=np.bool_)
        return (overlap >= self.overlap[0]) & (overlap <= self.overlap[1])

    def clipped(self, box: Array) -> Array | None:
        """Return low and high of what the half-planes leave of a box; None for nothing."""
        corners = [box[[i, j], [0, 1]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
        for row in self.half_planes:
            kept = []
            for here, there in zip(corners, corners[1:] + corners[:1], strict=True):
                before, after = row[:2] @ here - row[2], row[:2] @ there - row[2]
                if before <= 0.0:
                    kept.append(here)
                if (before <= 0.0) != (after <= 0.0):
                    kept.append(here + (there - here) * before / (before - after))
            corners = kept
        if not corners:
            return None
        return np.array([np.min(corners, axis=0), np.max(corners, axis=0)])

    def border(self, grid: Grid) -> Array:
        """Return points (m, 2) along the borders of the half-planes, on the grid."""
        found = [np.zeros((0, 2))]
        half = 0.5 * grid.spacing * np.array(grid.shape)
        reach = math.hypot(*half)
        for number, (a, b, c) in enumerate(self.half_planes):
            middle = grid.origin + half
            away = a * middle[0] + b * middle[1] - c
            if abs(away) <= reach:
                along = np.arange(-reach, reach + grid.spacing, grid.spacing)
                places = middle - away * np.array([a, b]) + along[:, None] * [-b, a]
                found.append(places[self.inside(places, number)])
        return np.concatenate(found)


def envelopes(
    windows: tuple[list[Window], list[Window]], grid: Grid, limits: Limits
) -> tuple[Envelope, Envelope]:
    """Return what counts of A and B on each line: the deepest pair within the range of overlap.

    Where one body has no crossing with a line, or none that is allowed, the other's highest
    crossing that goes with the nearest pair is kept, so that the first one's rim finds it.
    """
    if limits.overlap is None:
        return envelope_of(windows[0], grid), envelope_of(windows[1], grid)
    a, b = (no_envelope(side, grid) for side in windows)
    on_a, on_b = (_all_crossings(side, grid) for side in (a, b))
    _keep_pairs(a, on_a, b, on_b, limits)
    paired = (a.owner >= 0).reshape(-1)
    if not paired.any():
        return a, b
    nearest = ndimage.distance_transform_edt(
        a.owner < 0, return_distances=False, return_indices=True
    )
    # Both before either changes.
    beside_a, beside_b = a.base[tuple(nearest)].reshape(-1), b.base[tuple(nearest)].reshape(-1)
    for envelope, mine, other in ((a, on_a, beside_b), (b, on_b, beside_a)):
        keep_highest(
            envelope, mine.kept(~paired[mine.line] & limits.allows(mine.base + other[mine.line]))
        )
    return a, b


def _all_crossings(envelope: Envelope, grid: Grid) -> Crossings:
    """Return all crossings of an envelope's windows, ordered by line."""
    nothing = np.zeros(0, np.intp)
    found = [Crossings(nothing, np.zeros(0), np.zeros(0), nothing, np.zeros((0, 2)))]
    found += crossings_of(envelope, grid, displaced=True, with_base=True)
    joined = Crossings(*(np.concatenate(part) for part in zip(*found, strict=True)))
    return joined.kept(np.argsort(joined.line, kind="stable"))


def _keep_pairs(a: Envelope, on_a: Crossings, b: Envelope, on_b: Crossings, limits: Limits) -> None:
    """Put the deepest allowed pair of crossings on each line into the two envelopes."""
    start = np.searchsorted(on_b.line, on_a.line, "left")
    counts = np.searchsorted(on_b.line, on_a.line, "right") - start
    first = np.repeat(np.arange(counts.size), counts)
    second = np.arange(first.size) - np.repeat(np.cumsum(counts) - counts - start, counts)
    allowed = limits.allows(on_a.base[first] + on_b.base[second])
    first, second = first[allowed], second[allowed]
    depth, line = on_a.rise[first] + on_b.rise[second], on_a.line[first]
    order = np.lexsort((depth, line))
    deepest = order[np.append(line[order][1:] != line[order][:-1], True)] if order.size else order
    keep_highest(a, on_a.kept(first[deepest]))
    keep_highest(b, on_b.kept(second[deepest]))
