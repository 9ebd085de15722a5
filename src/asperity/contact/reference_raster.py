"""Drawing sheets of points onto lines parallel to n, for the brute-force reference.

A *window* is a part of a sheet. Its points, on a grid of the sheet's parameters, are joined to
triangles; every triangle is drawn onto the lines of a `Grid` that it crosses, and the highest point
on each line is kept, with its parameters: the *envelope*.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.reference_sheets import Sheet

NEAR = 2
"""A window reaches this many and a half pixels to each side of its pixel."""
_MOST_SAMPLES = 3000
_CHUNK = 60_000
"""Points drawn at a time."""

Array = NDArray[np.float64]


class Window(NamedTuple):
    """A rectangle of the parameters of a sheet, from `ends[0]` to `ends[1]`."""

    sheet: Sheet
    ends: Array

    def places(self, counts: Sequence[int], displaced: bool = True) -> Array:
        """Return u, v, rise [m] of a grid of (counts[0], counts[1]) points."""
        p, q = (np.linspace(self.ends[0, k], self.ends[1, k], counts[k]) for k in (0, 1))
        return self.sheet.at(p[:, None], q[None, :], displaced)


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


class Envelope(NamedTuple):
    """On each line the highest rise [m] (-inf: none), its window, and its parameters there."""

    rise: Array
    owner: NDArray[np.intp]
    parameters: Array
    windows: list[Window]
    steps: list[Array]


def shadow(sheet: Sheet) -> Array:
    """Return low and high (u, v) [m] of the shadow of a sheet's base, with something to spare."""
    places = Window(sheet, sheet.ends).places((33, 33), displaced=False)[..., :2]
    if sheet.unbounded and np.any(np.isfinite(places)):
        return np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    low = np.fmin.reduce(places, axis=(0, 1), initial=np.inf)
    high = np.fmax.reduce(places, axis=(0, 1), initial=-np.inf)
    spare = (high - low) / 16.0 if np.all(high > low) else 0.0
    return np.array([low - spare, high + spare])


def windows_over(side: list[Sheet], region: Array, reach: float) -> list[Window]:
    """Return the windows of the sheets outside of which no point lies over `region`."""
    found = (_narrowed(Window(sheet, sheet.ends), region, reach) for sheet in side)
    return [window for window in found if window is not None]


def _narrowed(window: Window, region: Array, reach: float) -> Window | None:
    """Return the part of a window whose points may lie over `region`, None if there is none."""
    count = 33
    while True:
        places = window.places((count, count), displaced=False)[..., :2]
        corners = [places[:-1, :-1], places[1:, :-1], places[:-1, 1:], places[1:, 1:]]
        low, high = np.fmin.reduce(corners, axis=0), np.fmax.reduce(corners, axis=0)
        spare = reach + 0.25 * (high - low)
        hit = np.all((high + spare >= region[0]) & (low - spare <= region[1]), axis=-1)
        if not hit.any():
            return None
        ends = np.empty((2, 2))
        for k in (0, 1):
            rows = np.flatnonzero(hit.any(axis=1 - k))
            marks = np.linspace(window.ends[0, k], window.ends[1, k], count)
            ends[:, k] = marks[rows[0]], marks[rows[-1] + 1]
        if np.all(ends[1] - ends[0] > 0.7 * (window.ends[1] - window.ends[0])):
            return Window(window.sheet, ends)
        window = Window(window.sheet, ends)


def windows_near(envelope: Envelope, line: Iterable[int]) -> list[Window]:
    """Return the windows that hold all points of an envelope near `line`."""
    near = tuple(slice(max(k - NEAR, 0), k + NEAR + 1) for k in line)
    owner, parameters = envelope.owner[near], envelope.parameters[near]
    found = []
    for index in np.unique(owner[owner >= 0]):
        sheet = envelope.windows[index].sheet
        held = parameters[owner == index]
        low, high = held.min(axis=0), held.max(axis=0)
        spare = 0.5 * (high - low) + 2.0 * envelope.steps[index]
        ends = np.clip(np.array([low - spare, high + spare]), *sheet.ends)
        found.append(Window(sheet, ends))
    return found


class Points(NamedTuple):
    """Points of an envelope's windows: (u, v, rise) [m], whose window, where in it."""

    places: Array
    owner: NDArray[np.intp]
    parameters: Array


def rims_of(windows: list[Window], spacing: float) -> Points:
    """Return points along the borders of the sheets, so far as they lie in the windows.

    The last line before a rim is up to a spacing away from it, here more and there less; seen on
    lines alone, a rim is a row of steps.
    """
    places, owner, parameters = [np.zeros((0, 3))], [np.zeros(0, np.intp)], [np.zeros((0, 2))]
    for index, window in enumerate(windows):
        counts = _counts(window, spacing)
        for k in (0, 1):
            along = np.linspace(window.ends[0, 1 - k], window.ends[1, 1 - k], counts[1 - k])
            for end in (0, 1):
                if window.ends[end, k] != window.sheet.ends[end, k]:
                    continue
                where = np.empty((along.size, 2))
                where[:, k], where[:, 1 - k] = window.ends[end, k], along
                found = window.sheet.at(where[:, 0], where[:, 1])
                shown = np.isfinite(found[:, 2])
                places.append(found[shown])
                parameters.append(where[shown])
                owner.append(np.full(np.count_nonzero(shown), index, dtype=np.intp))
    return Points(np.concatenate(places), np.concatenate(owner), np.concatenate(parameters))


def _counts(window: Window, spacing: float) -> tuple[int, int]:
    """Return how many samples a window needs so that neighbours lie within `spacing`."""
    places = window.places((17, 17), displaced=False)[..., :2]
    counts = []
    for k in (0, 1):
        apart = np.linalg.norm(np.diff(places, axis=k), axis=-1)
        widest = np.fmax.reduce(apart, axis=None, initial=0.0)
        counts.append(int(np.clip(np.ceil(16.0 * widest / spacing), 2, _MOST_SAMPLES)) + 1)
    return counts[0], counts[1]


def envelope_of(windows: list[Window], grid: Grid, displaced: bool = True) -> Envelope:
    """Draw the facets of all windows onto the lines of `grid`; the highest rise wins."""
    lines = grid.shape[0] * grid.shape[1]
    rise = np.full(lines, -np.inf)
    owner = np.full(lines, -1, dtype=np.intp)
    parameters = np.zeros((lines, 2))
    steps = []
    for index, window in enumerate(windows):
        counts = _counts(window, grid.spacing)
        marks = np.linspace(window.ends[0, 0], window.ends[1, 0], counts[0])
        steps.append((window.ends[1] - window.ends[0]) / (np.array(counts) - 1))
        rows = max(2, _CHUNK // counts[1])
        for start in range(0, counts[0] - 1, rows - 1):
            part = marks[start : start + rows]
            strip = Window(
                window.sheet,
                np.array([[part[0], window.ends[0, 1]], [part[-1], window.ends[1, 1]]]),
            )
            vertices = np.empty((part.size, counts[1], 5))
            vertices[..., :3] = strip.places((part.size, counts[1]), displaced)
            vertices[..., 3] = part[:, None]
            vertices[..., 4] = np.linspace(window.ends[0, 1], window.ends[1, 1], counts[1])
            _draw(vertices, grid, index, rise, owner, parameters)
    shape = grid.shape
    return Envelope(
        rise.reshape(shape), owner.reshape(shape), parameters.reshape(*shape, 2), windows, steps
    )


def _draw(
    vertices: Array,
    grid: Grid,
    index: int,
    rise: Array,
    owner: NDArray[np.intp],
    parameters: Array,
) -> None:
    """Draw the triangles between `vertices` (n, m, 5): u, v, rise, p, q."""
    a, b = vertices[:-1, :-1], vertices[1:, :-1]
    c, d = vertices[:-1, 1:], vertices[1:, 1:]
    corners = np.stack([np.stack([a, b, c]), np.stack([d, c, b])], axis=1).reshape(3, -1, 5)
    corners = corners[:, np.isfinite(corners[0, :, 2] + corners[1, :, 2] + corners[2, :, 2])]
    at = (corners[..., :2] - grid.origin) / grid.spacing
    first = np.maximum(np.ceil(np.minimum(np.minimum(at[0], at[1]), at[2])), 0).astype(np.intp)
    last = np.minimum(
        np.floor(np.maximum(np.maximum(at[0], at[1]), at[2])), np.array(grid.shape) - 1
    ).astype(np.intp)
    extent = np.maximum(last - first + 1, 0)
    counts = extent[:, 0] * extent[:, 1]
    # One row for each line in each triangle's bounding box.
    who = np.repeat(np.arange(counts.size), counts)
    which = np.arange(who.size) - np.repeat(np.cumsum(counts) - counts, counts)
    line = first[who] + np.stack([which // extent[who, 1], which % extent[who, 1]], axis=-1)
    edge_1, edge_2, across = at[1] - at[0], at[2] - at[0], line - at[0, who]
    area = edge_1[:, 0] * edge_2[:, 1] - edge_1[:, 1] * edge_2[:, 0]
    area = np.where(area == 0.0, np.nan, area)[who]
    share_1 = (across[:, 0] * edge_2[who, 1] - across[:, 1] * edge_2[who, 0]) / area
    share_2 = (edge_1[who, 0] * across[:, 1] - edge_1[who, 1] * across[:, 0]) / area
    shares = np.stack([1.0 - share_1 - share_2, share_1, share_2])
    inside = np.minimum(np.minimum(shares[0], shares[1]), shares[2]) >= -1e-9
    who, shares = who[inside], shares[:, inside]
    pixel = line[inside, 0] * grid.shape[1] + line[inside, 1]
    height = np.sum(shares * corners[:, who, 2], axis=0)
    np.maximum.at(rise, pixel, height)
    wins = height == rise[pixel]
    who, shares, pixel = who[wins], shares[:, wins], pixel[wins]
    owner[pixel] = index
    parameters[pixel] = np.sum(shares[..., None] * corners[:, who, 3:], axis=0)
