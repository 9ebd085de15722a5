"""Penetration depth by brute force, on surfaces that are displaced for real.

The engine finds the deepest point by bounds and Newton steps. This module shares nothing with it
but the height field: every face of every geom is sampled densely in its own parameters, each sample
is moved along its base normal (`reference_sheets.py`), and the facets between the samples are
rasterised onto one grid of lines parallel to n. The sheets of a body together make an *envelope*,
the upper surface of B or the lower surface of A; the largest overlap of the two envelopes is read
off, on the lines and along the rims. The best places are then looked at again, each in a window
eight times finer, several times over.

It is slow (about a second a call) and not certified: a peak that no line of the first grid comes
near is missed. It is meant for tests.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from asperity.contact.reference_raster import (
    NEAR,
    Envelope,
    Grid,
    Window,
    envelope_of,
    rims_of,
    shadow,
    windows_near,
    windows_over,
)
from asperity.contact.reference_sheets import STEEPEST, Sheet, frame_along, sheets
from asperity.errors import AsperityError

if TYPE_CHECKING:
    from asperity.geometry.bodies import Body
    from asperity.texture.height_field import HeightField

_CANDIDATES = (48, 16, 8, 4, 3)
"""How many of the best pixels are looked at again, zoom by zoom (ours; the last one repeats)."""
_FINER = 8
_FINEST_GRID = 1200
"""Lines along n per side of the first grid, at most, where a fine texture asks for many."""
_LINES_PER_WAVE = 6
_BLOCK = 8
"""Of a block of so many lines per side, one peak is followed: rims make rows of false ones."""

Array = NDArray[np.float64]


class Reference(NamedTuple):
    """What `reference_depth` finds.

    Attributes
    ----------
    depth : float
        Directional penetration depth [m], above 0 = overlap; -inf where the silhouettes do not
        overlap. On a rim it is low by up to slope times `resolution`.
    point_on_a, point_on_b : (3,) array
        The deepest pair of points, on the displaced surfaces [m], in the world; NaN: none.
    resolution : float
        Distance between lines along n in the last window [m].
    """

    depth: float
    point_on_a: Array
    point_on_b: Array
    resolution: float


class _Candidate(NamedTuple):
    depth: float
    place: Array
    windows: tuple[list[Window], list[Window]]
    parameters: Array
    sheets: tuple[Sheet, Sheet]
    spacing: float


def reference_depth(
    body_a: Body,
    pose_a: ArrayLike,
    body_b: Body,
    pose_b: ArrayLike,
    normal: ArrayLike,
    *,
    samples: int = 400,
    zooms: int = 6,
) -> Reference:
    """Return how deep A reaches into B along `normal`, by brute force.

    `delta = max (h_B - h_A)` over all lines parallel to n on which both bodies have a facet with
    |w.n| of at least 0.2 (w.n > 0 on B, < 0 on A).

    Parameters
    ----------
    body_a, body_b : Body
        The two bodies; a plane may meet anything but a plane.
    pose_a, pose_b : (7,) array
        Position [m] and quaternion wxyz.
    normal : (3,) array
        Unit normal of B, pointing towards A.
    samples : int
        Lines along n per side of the first grid; more are used where a texture is finer.
    zooms : int
        How often the best candidates are looked at again, each time eight times finer.
    """
    pose_a, pose_b = (np.asarray(pose, dtype=np.float64) for pose in (pose_a, pose_b))
    n = np.asarray(normal, dtype=np.float64)
    if n.shape != (3,) or not abs(np.linalg.norm(n) - 1.0) < 1e-6:
        raise AsperityError(f"normal must be a vector of 3 numbers of length 1, got {normal!r}")
    frame = frame_along(n)
    sides = (
        sheets(body_a, pose_a, frame, pose_a[:3], -1.0),
        sheets(body_b, pose_b, frame, pose_a[:3], 1.0),
    )
    candidates = _first_look(sides, (body_a, body_b), samples)
    for zoom in range(zooms):
        if not candidates:
            nowhere = np.full(3, np.nan)
            return Reference(-np.inf, nowhere, nowhere, np.nan)
        count = _CANDIDATES[min(zoom, len(_CANDIDATES) - 1)]
        # What a line between two lines may add: slopes of A and B of up to 1 each.
        least = candidates[0].depth - 2.0 * candidates[0].spacing
        looked = [_look_closer(c) for c in candidates[:count] if c.depth >= least]
        candidates = sorted(looked, key=lambda found: -found.depth)
    best = candidates[0]
    points = []
    for sheet, at in zip(best.sheets, best.parameters, strict=True):
        place = sheet.at(at[:1], at[1:])[0] * [1.0, 1.0, sheet.sense]
        points.append(place @ frame + pose_a[:3])
    return Reference(best.depth, points[0], points[1], best.spacing)


def _first_look(
    sides: tuple[list[Sheet], list[Sheet]], bodies: tuple[Body, Body], samples: int
) -> list[_Candidate]:
    """Return the best pixels of the first grid, best first; none where no line meets both."""
    textures = [body.texture for body in bodies]
    # A spline rises above its samples by a little.
    reach = sum(1.3 * max(abs(t.lowest), abs(t.highest)) for t in textures if t is not None)
    region = _common_shadow(sides, reach)
    if region is None:
        return []
    grid = Grid.over(region, 2.0 * np.max(region[1] - region[0]) / samples)
    windows = [windows_over(side, region, reach) for side in sides]
    smooth, rough = (
        envelope_of(windows[0], grid, displaced).rise
        + envelope_of(windows[1], grid, displaced).rise
        for displaced in (False, True)
    )
    region = _promising(smooth, rough, grid, textures, reach)
    widest = np.max(region[1] - region[0])
    finest = min((t.shortest_wavelength for t in textures if t is not None), default=np.inf)
    spacing = np.clip(finest / _LINES_PER_WAVE, widest / _FINEST_GRID, widest / samples)
    grid = Grid.over(region, float(spacing))
    a, b = (envelope_of(windows_over(side, region, reach), grid) for side in sides)
    return _peaks(a, b, grid, _CANDIDATES[0])


def _common_shadow(sides: tuple[list[Sheet], list[Sheet]], reach: float) -> Array | None:
    """Return low and high (u, v) [m] of where both shadows along n may overlap, or None."""
    region = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    for side in sides:
        ends = [shadow(sheet) for sheet in side]
        low = np.min([e[0] for e in ends], axis=0) - reach
        high = np.max([e[1] for e in ends], axis=0) + reach
        region = np.array([np.maximum(region[0], low), np.minimum(region[1], high)])
    if np.any(np.isinf(region) & (region[1] > region[0])):
        raise AsperityError("the reference needs one bounded body: a plane cannot meet a plane")
    return region if np.all(region[1] > region[0]) else None


def _promising(
    smooth: Array, rough: Array, grid: Grid, textures: list[HeightField | None], reach: float
) -> Array:
    """Return low and high (u, v) [m] of where textures can lift the overlap to what is reached."""
    best = np.max(rough)
    across = 2 * int(np.ceil(reach / grid.spacing)) + 3
    bound = ndimage.maximum_filter(smooth, across) + grid.spacing
    # A facet's texture counts in full where it is level, by STEEPEST where it is steep.
    bound += sum(max(1.3 * t.highest, STEEPEST * t.highest) for t in textures if t is not None)
    hits = np.argwhere(bound >= best) if np.isfinite(best) else np.argwhere(bound > -np.inf)
    if not hits.size:
        hits = np.array([[0, 0], grid.shape])
    low, high = hits.min(axis=0) - 1, hits.max(axis=0) + 1
    return grid.origin + grid.spacing * np.stack([low, high])


def _peaks(a: Envelope, b: Envelope, grid: Grid, most: int) -> list[_Candidate]:
    """Return the deepest places, on lines and on rims, best first, one per block of lines."""
    found = [_on_lines(a, b, grid)]
    found += [_on_rim(a, b, grid, of_a) for of_a in (True, False)]
    depth, places, owner, parameters = (np.concatenate(part) for part in zip(*found, strict=True))
    lines = np.rint((places - grid.origin) / grid.spacing).astype(int)
    taken: set[tuple[int, ...]] = set()
    peaks: list[_Candidate] = []
    for k in np.argsort(-depth, kind="stable"):
        block = tuple(lines[k] // _BLOCK)
        if block in taken:
            continue
        taken.add(block)
        windows = windows_near(a, lines[k]), windows_near(b, lines[k])
        sheets = a.windows[owner[k, 0]].sheet, b.windows[owner[k, 1]].sheet
        peaks.append(_Candidate(depth[k], places[k], windows, parameters[k], sheets, grid.spacing))
        if len(peaks) == most:
            break
    return peaks


def _on_lines(a: Envelope, b: Envelope, grid: Grid) -> tuple[Array, Array, Array, Array]:
    """Return depth, place, owners and parameters of the local maxima among the lines."""
    depth = a.rise + b.rise
    hits = np.isfinite(depth) & (depth == ndimage.maximum_filter(depth, 3))
    owner = np.stack([a.owner[hits], b.owner[hits]], axis=-1)
    parameters = np.stack([a.parameters[hits], b.parameters[hits]], axis=1)
    return depth[hits], grid.origin + grid.spacing * np.argwhere(hits), owner, parameters


def _on_rim(a: Envelope, b: Envelope, grid: Grid, of_a: bool) -> tuple[Array, Array, Array, Array]:
    """Return the same of points on the rims of one body, over or under the other's surface."""
    mine, other = (a, b) if of_a else (b, a)
    rim = rims_of(mine.windows, grid.spacing)
    at = ((rim.places[:, :2] - grid.origin) / grid.spacing).T
    nowhere = -1e6
    filled = np.where(np.isfinite(other.rise), other.rise, nowhere)
    across = ndimage.map_coordinates(filled, at, order=1, cval=nowhere)
    # A rise that is mixed with that of an empty line is none.
    hits = across > -1e3
    line = tuple(np.rint(at[:, hits]).astype(int))
    owner = np.stack([rim.owner[hits], other.owner[line]], axis=-1)
    parameters = np.stack([rim.parameters[hits], other.parameters[line]], axis=1)
    if not of_a:
        owner, parameters = owner[:, ::-1], parameters[:, ::-1]
    return rim.places[hits, 2] + across[hits], rim.places[hits, :2], owner, parameters


def _look_closer(candidate: _Candidate) -> _Candidate:
    """Return the deepest place of the window round a candidate, on a finer grid."""
    spacing = candidate.spacing / _FINER
    half = int((NEAR + 0.5) * _FINER)
    grid = Grid(candidate.place - half * spacing, spacing, (2 * half + 1, 2 * half + 1))
    a, b = (envelope_of(windows, grid) for windows in candidate.windows)
    found = _peaks(a, b, grid, 1)
    return found[0] if found else candidate._replace(spacing=spacing)
