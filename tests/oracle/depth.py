"""Penetration depth by brute force, on surfaces that are displaced for real.

The engine finds the deepest point by bounds and Newton steps. This module shares nothing with it
but the height field: every face of every geom and every triangle of a mesh is sampled densely in
its own parameters, each sample is moved along its base normal (`reference_sheets.py`,
`reference_mesh.py`), and the facets between the samples are rasterised onto one grid of lines
parallel to n. The sheets of a body together make an *envelope*, the upper surface of B or the lower
surface of A; the largest overlap of the two envelopes is read off, on the lines and along the rims.
The best places are then looked at again, each in a window eight times finer, several times over.

It is slow (about a second a call, two or three for meshes) and not certified: a peak that no line
of the first grid comes near is missed. Where the answer is known exactly, what it finds is within
1e-9 m of it, far below the 0.05 % of a texture's relief that is wanted. It is meant for tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from asperity.errors import AsperityError
from oracle.limits import Limits, envelopes
from oracle.meshes import mesh_surface
from oracle.peaks import Candidate, peaks
from oracle.raster import NEAR, Grid, envelope_of
from oracle.sheets import STEEPEST, frame_along, sheets
from oracle.windows import Side, Window, shadow, windows_over

if TYPE_CHECKING:
    from asperity.geometry.bodies import Body

_CANDIDATES = (48, 16, 8, 4, 3)
"""How many of the best pixels are looked at again, zoom by zoom (ours; the last one repeats)."""
_FINER = 8
_FINEST_GRID = 1200
"""Lines along n per side of the first grid, at most, where a fine texture asks for many."""
_LINES_PER_WAVE = 6

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


def reference_depth(
    body_a: Body,
    pose_a: ArrayLike,
    body_b: Body,
    pose_b: ArrayLike,
    normal: ArrayLike,
    *,
    samples: int = 400,
    zooms: int = 6,
    region: ArrayLike | None = None,
    depth_range: Sequence[float] | None = None,
) -> Reference:
    """Return how deep A reaches into B along `normal`, by brute force.

    `delta = max (h_B - h_A)` over all lines parallel to n on which both bodies have a facet with
    |f.n| of at least 0.2 (f.n > 0 on B, < 0 on A). f is the normal of the base: of a geom's
    surface, or of a mesh's flat triangle, whatever its interpolated normals.

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
    region : (k, 3) array, optional
        Rows (a, b, c): only lines with `a u + b v <= c` count. (u, v) are the world's coordinates
        [m] along the first two rows of `frame_along(normal)`, 0 at the world's origin. The
        deepest point may lie on the region's border.
    depth_range : (lowest, highest), optional
        Only pairs of points whose base points overlap by so much count [m], (x_B - x_A).n
        without textures; below 0 is a gap. It leaves out far sheets, as the other arm of a hook.
    """
    pose_a, pose_b = (np.asarray(pose, dtype=np.float64) for pose in (pose_a, pose_b))
    n = np.asarray(normal, dtype=np.float64)
    if n.shape != (3,) or not abs(np.linalg.norm(n) - 1.0) < 1e-6:
        raise AsperityError(f"normal must be a vector of 3 numbers of length 1, got {normal!r}")
    frame = frame_along(n)
    limits = Limits.of(region, depth_range, (frame @ pose_a[:3])[:2])
    sides = (
        _side(body_a, pose_a, frame, pose_a[:3], -1.0),
        _side(body_b, pose_b, frame, pose_a[:3], 1.0),
    )
    candidates = _first_look(sides, (body_a, body_b), samples, limits)
    for zoom in range(zooms):
        if not candidates:
            nowhere = np.full(3, np.nan)
            return Reference(-np.inf, nowhere, nowhere, np.nan)
        count = _CANDIDATES[min(zoom, len(_CANDIDATES) - 1)]
        # What a line between two lines may add: slopes of A and B of up to 1 each.
        least = candidates[0].depth - 2.0 * candidates[0].spacing
        looked = [_look_closer(c, limits) for c in candidates[:count] if c.depth >= least]
        candidates = sorted(looked, key=lambda found: -found.depth)
    best = candidates[0]
    points = []
    for sheet, at in zip(best.sheets, best.parameters, strict=True):
        place = sheet.at(at[:1], at[1:])[0] * [1.0, 1.0, sheet.sense]
        points.append(place @ frame + pose_a[:3])
    return Reference(best.depth, points[0], points[1], best.spacing)


def _side(body: Body, pose: Array, frame: Array, origin: Array, sense: float) -> Side:
    look = sheets if body.mesh is None else mesh_surface
    return look(body, pose, frame, origin, sense)


def _first_look(
    sides: tuple[Side, Side], bodies: tuple[Body, Body], samples: int, limits: Limits
) -> list[Candidate]:
    """Return the best pixels of the first grid, best first; none where no line meets both."""
    textures = [body.texture for body in bodies if body.texture is not None]
    # A spline rises above its samples by a little.
    reach = sum(1.3 * max(abs(t.lowest), abs(t.highest)) for t in textures)
    region = _common_shadow(sides, reach, limits)
    if region is None:
        return []
    grid = Grid.over(region, 2.0 * np.max(region[1] - region[0]) / samples)
    region = _promising(_windows(sides, region, reach), grid, bodies, reach, limits)
    widest = np.max(region[1] - region[0])
    finest = min((t.shortest_wavelength for t in textures), default=np.inf)
    spacing = np.clip(finest / _LINES_PER_WAVE, widest / _FINEST_GRID, widest / samples)
    grid = Grid.over(region, float(spacing))
    a, b = envelopes(_windows(sides, region, reach), grid, limits)
    return peaks(a, b, grid, _CANDIDATES[0], limits)


def _windows(
    sides: tuple[Side, Side], region: Array, reach: float
) -> tuple[list[Window], list[Window]]:
    return windows_over(sides[0], region, reach), windows_over(sides[1], region, reach)


def _common_shadow(sides: tuple[Side, Side], reach: float, limits: Limits) -> Array | None:
    """Return low and high (u, v) [m] of where both shadows along n may overlap, or None."""
    region = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    for side in sides:
        low, high = shadow(side)
        region = np.array([np.maximum(region[0], low - reach), np.minimum(region[1], high + reach)])
    if np.any(np.isinf(region) & (region[1] > region[0])):
        raise AsperityError("the reference needs one bounded body: a plane cannot meet a plane")
    if not np.all(region[1] > region[0]):
        return None
    clipped = limits.clipped(region)
    return clipped if clipped is not None and np.all(clipped[1] > clipped[0]) else None


def _promising(
    windows: tuple[list[Window], list[Window]],
    grid: Grid,
    bodies: tuple[Body, Body],
    reach: float,
    limits: Limits,
) -> Array:
    """Return low and high (u, v) [m] of where textures can lift the overlap to what is reached."""
    smooth = sum(envelope_of(side, grid, displaced=False).rise for side in windows)
    if limits.overlap is not None:
        smooth = np.minimum(smooth, limits.overlap[1])
    inside = limits.inside(grid.places())
    rough = sum(envelope.rise for envelope in envelopes(windows, grid, limits))
    best = np.max(np.where(inside, rough, -np.inf))
    across = 2 * int(np.ceil(reach / grid.spacing)) + 3
    bound = ndimage.maximum_filter(smooth, across) + grid.spacing
    bound += sum(_highest_rise(body) for body in bodies)
    # A region's border runs between the lines.
    bound[~ndimage.binary_dilation(inside, np.ones((3, 3), dtype=np.bool_))] = -np.inf
    hits = np.argwhere(bound >= best) if np.isfinite(best) else np.argwhere(bound > -np.inf)
    if not hits.size:
        hits = np.array([[0, 0], grid.shape])
    low, high = hits.min(axis=0) - 1, hits.max(axis=0) + 1
    return grid.origin + grid.spacing * np.stack([low, high])


def _highest_rise(body: Body) -> float:
    """Return how far a texture lifts a body's points along n at most [m]."""
    field = body.texture
    if field is None:
        return 0.0
    if body.mesh is not None:
        # An interpolated normal may point anywhere, whatever its facet does.
        return 1.3 * max(abs(field.lowest), abs(field.highest))
    # A facet's texture counts in full where it is level, by STEEPEST where it is steep.
    return max(1.3 * field.highest, STEEPEST * field.highest)


def _look_closer(candidate: Candidate, limits: Limits) -> Candidate:
    """Return the deepest place of the window round a candidate, on a finer grid."""
    spacing = candidate.spacing / _FINER
    half = int((NEAR + 0.5) * _FINER)
    grid = Grid(candidate.place - half * spacing, spacing, (2 * half + 1, 2 * half + 1))
    a, b = envelopes(candidate.windows, grid, limits)
    found = peaks(a, b, grid, 1, limits)
    return found[0] if found else candidate._replace(spacing=spacing)
