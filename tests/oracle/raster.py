"""Drawing windows of sheets onto lines parallel to n, for the brute-force reference.

The samples of a window, on a grid of the sheet's parameters, are joined to triangles; every
triangle is drawn onto the lines of a `Grid` that it crosses, and the highest point on each line is
kept, with its parameters: the *envelope*.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from oracle.meshes import MeshSheet, MeshSurface
from oracle.windows import AnySheet, Batch, Window, batches, windows_over

NEAR = 2
"""A window reaches this many and a half pixels to each side of its pixel."""

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Grid(NamedTuple):
    """Lines parallel to n, at (u, v) = `origin + spacing * (i, j)`."""

    origin: Array
    spacing: float
    shape: tuple[int, int]

    @classmethod
    def over(cls, region: Array, spacing: float) -> Grid:
        """Return the grid that covers a region: low and high (u, v) [m]."""
        counts = np.floor((region[1] - region[0]) / spacing).astype(int) + 2
        return cls(region[0], spacing, (int(counts[0]), int(counts[1])))

    def places(self) -> Array:
        """Return (u, v) [m] of all lines, (*shape, 2)."""
        return self.origin + self.spacing * np.moveaxis(np.indices(self.shape), 0, -1)


class Envelope(NamedTuple):
    """On each line the highest rise [m] (-inf: none), its window, and its parameters there.

    `base` is the rise of the point's base [m], where it was asked for; `steps` (windows, 2) are
    the distances between samples in the parameters.
    """

    rise: Array
    owner: Indices
    parameters: Array
    windows: list[Window]
    steps: Array
    base: Array


def windows_near(
    envelope: Envelope, grid: Grid, place: Array, owner: int, parameters: Array
) -> list[Window]:
    """Return the windows that hold all points of an envelope near `place` (u, v) [m].

    The point that was found there, `parameters` of window `owner`, may lie on a sliver between
    the lines, of whose sheet the envelope shows nothing else.
    """
    line = np.rint((place - grid.origin) / grid.spacing).astype(int)
    near = tuple(slice(max(k - NEAR, 0), k + NEAR + 1) for k in line)
    owners = np.append(envelope.owner[near].reshape(-1), owner)
    held = np.vstack([envelope.parameters[near].reshape(-1, 2), parameters])
    found = []
    boxes: dict[MeshSurface, list[Array]] = {}
    for index in np.unique(owners[owners >= 0]):
        sheet, mine = envelope.windows[index].sheet, held[owners == index]
        if isinstance(sheet, MeshSheet):
            # Other triangles are near too. What is near is told by places: how far the texture
            # moves points aside is known, and changes little in so small a window.
            aside = _aside(sheet, mine)
            box = place + _widened(aside, (NEAR + 1.5) * grid.spacing)
            boxes.setdefault(sheet.surface, []).append(box)
        else:
            ends = _widened(mine, 2.0 * envelope.steps[index])
            found.append(Window(sheet, np.clip(ends, *sheet.ends)))
    for surface, parts in boxes.items():
        for box in _united(parts):
            found += windows_over(surface, box, 0.0)
    return found


def _aside(sheet: AnySheet, parameters: Array) -> Array:
    """Return by how much (u, v) [m] base points lie beside the displaced ones."""
    base, displaced = (sheet.at(parameters[:, 0], parameters[:, 1], d) for d in (False, True))
    return (base - displaced)[:, :2]


def _widened(points: Array, spare: float | Array) -> Array:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([low - 0.5 * (high - low) - spare, high + 0.5 * (high - low) + spare])


def _united(boxes: list[Array]) -> list[Array]:
    """Return boxes that do not overlap and hold all those given, each of low and high (u, v)."""
    apart: list[Array] = []
    for box in boxes:
        rest = []
        for other in apart:
            if np.all((box[0] <= other[1]) & (other[0] <= box[1])):
                box = np.array([np.minimum(box[0], other[0]), np.maximum(box[1], other[1])])
            else:
                rest.append(other)
        apart = [*rest, box]
    return apart if len(apart) == len(boxes) else _united(apart)


class Points(NamedTuple):
    """Points of an envelope's windows: (u, v, rise) [m], rise of the base, whose window, where."""

    places: Array
    base: Array
    owner: Indices
    parameters: Array


def rims_of(windows: list[Window], spacing: float) -> Points:
    """Return points along the borders of the sheets, so far as they lie in the windows.

    The last line before a rim is up to a spacing away from it, here more and there less; seen on
    lines alone, a rim is a row of steps. So is a crease: all edges of a mesh's triangles count.
    """
    empty = np.zeros(0, np.intp)
    found = [Points(np.zeros((0, 3)), np.zeros(0), empty, np.zeros((0, 2)))]
    for batch in batches(windows, spacing):
        for k in (0, 1):
            for end in (0, 1):
                on_it = batch.ends[:, end, k] == batch.borders[end, k]
                if on_it.any():
                    found.append(_rim(batch.part(on_it), k, end))
    return Points(*(np.concatenate(part) for part in zip(*found, strict=True)))


def _rim(batch: Batch, k: int, end: int) -> Points:
    """Return points of the borders of all windows of a batch where parameter k ends."""
    where = np.empty((batch.owner.size, batch.counts[1 - k], 1, 2))
    where[..., k] = batch.ends[:, end, k, None, None]
    low, high = batch.ends[:, 0, 1 - k], batch.ends[:, 1, 1 - k]
    where[..., 0, 1 - k] = np.linspace(low, high, batch.counts[1 - k], axis=-1)
    places, base = (batch.at(where[..., 0], where[..., 1], d)[:, :, 0] for d in (True, False))
    shown = np.isfinite(places[..., 2])
    owner = np.broadcast_to(batch.owner[:, None], shown.shape)
    return Points(places[shown], base[shown][:, 2], owner[shown], where[:, :, 0][shown])


class Crossings(NamedTuple):
    """Where facets cross lines: on which line, how high [m] (point, base), whose, parameters."""

    line: Indices
    rise: Array
    base: Array
    owner: Indices
    parameters: Array

    def kept(self, which: NDArray[np.bool_] | Indices) -> Crossings:
        """Return some of them."""
        return Crossings(
            self.line[which],
            self.rise[which],
            self.base[which],
            self.owner[which],
            self.parameters[which],
        )


def envelope_of(windows: list[Window], grid: Grid, displaced: bool = True) -> Envelope:
    """Draw the facets of all windows onto the lines of `grid`; the highest rise wins."""
    envelope = no_envelope(windows, grid)
    for crossings in crossings_of(envelope, grid, displaced, with_base=False):
        keep_highest(envelope, crossings)
    return envelope


def no_envelope(windows: list[Window], grid: Grid) -> Envelope:
    """Return an envelope that is empty on all lines."""
    rise, base = np.full(grid.shape, -np.inf), np.full(grid.shape, -np.inf)
    owner = np.full(grid.shape, -1, dtype=np.intp)
    steps = np.zeros((len(windows), 2))
    return Envelope(rise, owner, np.zeros((*grid.shape, 2)), windows, steps, base)


def keep_highest(envelope: Envelope, new: Crossings) -> None:
    """Put crossings into an envelope where they are its highest."""
    rise = envelope.rise.reshape(-1)
    np.maximum.at(rise, new.line, new.rise)
    wins = new.kept(new.rise == rise[new.line])
    envelope.base.reshape(-1)[wins.line] = wins.base
    envelope.owner.reshape(-1)[wins.line] = wins.owner
    envelope.parameters.reshape(-1, 2)[wins.line] = wins.parameters


def crossings_of(
    envelope: Envelope, grid: Grid, displaced: bool, with_base: bool
) -> Iterator[Crossings]:
    """Yield the crossings of all windows of an envelope, and fill its `steps`."""
    for batch in batches(envelope.windows, grid.spacing):
        steps = (batch.ends[:, 1] - batch.ends[:, 0]) / (np.array(batch.counts) - 1)
        envelope.steps[batch.owner] = steps
        for chunk in batch.chunks():
            yield _crossings(chunk.vertices(displaced, with_base), chunk.owner, grid)


def _crossings(vertices: Array, owner: Indices, grid: Grid) -> Crossings:
    """Return where the triangles between `vertices` (k, n, m, 6) of windows `owner` cross lines."""
    a, b = vertices[:, :-1, :-1], vertices[:, 1:, :-1]
    c, d = vertices[:, :-1, 1:], vertices[:, 1:, 1:]
    corners = np.stack([np.stack([a, b, c]), np.stack([d, c, b])], axis=1).reshape(3, -1, 6)
    whose = np.tile(np.repeat(owner, a.shape[1] * a.shape[2]), 2)
    shown = np.isfinite(corners[0, :, 2] + corners[1, :, 2] + corners[2, :, 2])
    at = (corners[..., :2] - grid.origin) / grid.spacing
    shown &= np.all((at.max(axis=0) >= 0.0) & (at.min(axis=0) <= np.array(grid.shape) - 1), axis=-1)
    corners, whose, at = corners[:, shown], whose[shown], at[:, shown]
    who, line = _boxes(at, grid.shape)
    edge_1, edge_2, across = at[1] - at[0], at[2] - at[0], line - at[0, who]
    area = edge_1[:, 0] * edge_2[:, 1] - edge_1[:, 1] * edge_2[:, 0]
    area = np.where(area == 0.0, np.nan, area)[who]
    share_1 = (across[:, 0] * edge_2[who, 1] - across[:, 1] * edge_2[who, 0]) / area
    share_2 = (edge_1[who, 0] * across[:, 1] - edge_1[who, 1] * across[:, 0]) / area
    shares = np.stack([1.0 - share_1 - share_2, share_1, share_2])
    inside = np.minimum(np.minimum(shares[0], shares[1]), shares[2]) >= -1e-9
    who, shares, line = who[inside], shares[:, inside], line[inside]
    mixed = np.sum(shares[..., None] * corners[:, who, 2:], axis=0)
    pixel = line[:, 0] * grid.shape[1] + line[:, 1]
    return Crossings(pixel, mixed[:, 0], mixed[:, 1], whose[who], mixed[:, 2:])


def _boxes(at: Array, shape: tuple[int, int]) -> tuple[Indices, Indices]:
    """Return each line in the bounding box of each triangle `at` (3, k, 2): whose, and (i, j)."""
    first = np.ceil(np.minimum(np.minimum(at[0], at[1]), at[2]))
    last = np.floor(np.maximum(np.maximum(at[0], at[1]), at[2]))
    first = np.clip(first, 0, shape).astype(np.intp)
    last = np.clip(last, -1, np.array(shape) - 1).astype(np.intp)
    extent = np.maximum(last - first + 1, 0)
    counts = extent[:, 0] * extent[:, 1]
    who = np.repeat(np.arange(counts.size), counts)
    which = np.arange(who.size) - np.repeat(np.cumsum(counts) - counts, counts)
    line = first[who] + np.stack([which // extent[who, 1], which % extent[who, 1]], axis=-1)
    return who, line
