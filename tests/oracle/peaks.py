"""The deepest places that two envelopes show: on lines, on rims, on the region's border."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from oracle.limits import Limits
from oracle.raster import Envelope, Grid, rims_of, windows_near
from oracle.windows import AnySheet, Window

_BLOCK = 8
"""Of a block of so many lines per side, one peak is followed: rims make rows of false ones."""

Array = NDArray[np.float64]


class Candidate(NamedTuple):
    """A deep place (u, v) [m], the windows round it, its parameters on its sheets of A and B."""

    depth: float
    place: Array
    windows: tuple[list[Window], list[Window]]
    parameters: Array
    sheets: tuple[AnySheet, AnySheet]
    spacing: float


def peaks(a: Envelope, b: Envelope, grid: Grid, most: int, limits: Limits) -> list[Candidate]:
    """Return the deepest places, on lines and on rims, best first, one per block of lines.

    What a line between two lines may add, for slopes of A and B of up to 1 each, is 2 spacings:
    places that are less deep by more are none.
    """
    found = [_on_lines(a, b, grid, limits), _on_border(a, b, grid, limits)]
    found += [_on_rim(a, b, grid, of_a, limits) for of_a in (True, False)]
    depth, places, owner, parameters = (np.concatenate(part) for part in zip(*found, strict=True))
    lines = np.rint((places - grid.origin) / grid.spacing).astype(int)
    taken: set[tuple[int, ...]] = set()
    deepest: list[Candidate] = []
    for k in np.argsort(-depth, kind="stable"):
        block = tuple(lines[k] // _BLOCK)
        if block in taken:
            continue
        if deepest and depth[k] < deepest[0].depth - 2.0 * grid.spacing:
            break
        taken.add(block)
        windows = (
            windows_near(a, grid, places[k], owner[k, 0], parameters[k, 0]),
            windows_near(b, grid, places[k], owner[k, 1], parameters[k, 1]),
        )
        sheets = a.windows[owner[k, 0]].sheet, b.windows[owner[k, 1]].sheet
        deepest.append(Candidate(depth[k], places[k], windows, parameters[k], sheets, grid.spacing))
        if len(deepest) == most:
            break
    return deepest


_Found = tuple[Array, Array, NDArray[np.intp], Array]


def _on_lines(a: Envelope, b: Envelope, grid: Grid, limits: Limits) -> _Found:
    """Return depth, place, owners and parameters of the local maxima among the lines."""
    depth = a.rise + b.rise
    if len(limits.half_planes):
        depth[~limits.inside(grid.places())] = -np.inf
    hits = np.isfinite(depth) & (depth == ndimage.maximum_filter(depth, 3))
    owner = np.stack([a.owner[hits], b.owner[hits]], axis=-1)
    parameters = np.stack([a.parameters[hits], b.parameters[hits]], axis=1)
    return depth[hits], grid.origin + grid.spacing * np.argwhere(hits), owner, parameters


def _on_border(a: Envelope, b: Envelope, grid: Grid, limits: Limits) -> _Found:
    """Return the same of points along the border of the region."""
    places = limits.border(grid)
    rises = [_between(side, places, grid) for side in (a, b)]
    hits = np.isfinite(rises[0] + rises[1])
    line = _nearest(places[hits], grid)
    owner = np.stack([a.owner[line], b.owner[line]], axis=-1)
    parameters = np.stack([a.parameters[line], b.parameters[line]], axis=1)
    return (rises[0] + rises[1])[hits], places[hits], owner, parameters


def _on_rim(a: Envelope, b: Envelope, grid: Grid, of_a: bool, limits: Limits) -> _Found:
    """Return the same of points on the rims of one body, over or under the other's surface."""
    mine, other = (a, b) if of_a else (b, a)
    rim = rims_of(mine.windows, grid.spacing)
    across = _between(other, rim.places[:, :2], grid)
    hits = np.isfinite(across) & limits.inside(rim.places[:, :2])
    if limits.overlap is not None:
        hits[hits] &= limits.allows(rim.base[hits] + other.base[_nearest(rim.places[hits], grid)])
    line = _nearest(rim.places[hits], grid)
    owner = np.stack([rim.owner[hits], other.owner[line]], axis=-1)
    parameters = np.stack([rim.parameters[hits], other.parameters[line]], axis=1)
    if not of_a:
        owner, parameters = owner[:, ::-1], parameters[:, ::-1]
    return rim.places[hits, 2] + across[hits], rim.places[hits, :2], owner, parameters


def _between(envelope: Envelope, places: Array, grid: Grid) -> Array:
    """Return an envelope's rise [m] at places between the lines, -inf next to an empty line."""
    nowhere = -1e6
    filled = np.where(np.isfinite(envelope.rise), envelope.rise, nowhere)
    at = ((places - grid.origin) / grid.spacing).T
    across = ndimage.map_coordinates(filled, at, order=1, cval=nowhere)
    # A rise that is mixed with that of an empty line is none.
    return np.where(across > -1e3, across, -np.inf)


def _nearest(places: Array, grid: Grid) -> tuple[NDArray[np.intp], ...]:
    at = np.rint((places[:, :2] - grid.origin) / grid.spacing)
    return tuple(at.astype(np.intp).T)
