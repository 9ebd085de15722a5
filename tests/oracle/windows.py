"""Windows: parts of the sheets of a body, for the brute-force reference.

A *window* is a rectangle of the parameters of a sheet. Windows of one mesh that need as many
samples make a *batch*, so that a mesh of thousands of triangles costs a few calls.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from oracle.meshes import MeshSheet, MeshSurface
from oracle.sheets import Sheet

_MOST_SAMPLES = 3000
_CHUNK = 60_000
"""Points placed at a time."""

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
AnySheet = Sheet | MeshSheet
Side = list[Sheet] | MeshSurface
"""What of a body faces the other one."""


class Window(NamedTuple):
    """A rectangle of the parameters of a sheet, from `ends[0]` to `ends[1]`."""

    sheet: AnySheet
    ends: Array

    def places(self, counts: Sequence[int], displaced: bool = True) -> Array:
        """Return u, v, rise [m] of a grid of (counts[0], counts[1]) points."""
        p, q = (np.linspace(self.ends[0, k], self.ends[1, k], counts[k]) for k in (0, 1))
        return self.sheet.at(p[:, None], q[None, :], displaced)


def shadow(side: Side) -> Array:
    """Return low and high (u, v) [m] of the shadow of a side's base, with something to spare."""
    if isinstance(side, MeshSurface):
        return side.shadow()
    ends = [_shadow(sheet) for sheet in side]
    return np.array([np.min([e[0] for e in ends], axis=0), np.max([e[1] for e in ends], axis=0)])


def _shadow(sheet: Sheet) -> Array:
    places = Window(sheet, sheet.ends).places((33, 33), displaced=False)[..., :2]
    if sheet.unbounded and np.any(np.isfinite(places)):
        return np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    low = np.fmin.reduce(places, axis=(0, 1), initial=np.inf)
    high = np.fmax.reduce(places, axis=(0, 1), initial=-np.inf)
    spare = (high - low) / 16.0 if np.all(high > low) else 0.0
    return np.array([low - spare, high + spare])


def windows_over(side: Side, region: Array, reach: float) -> list[Window]:
    """Return the windows of a side outside of which no point lies over `region`."""
    if isinstance(side, MeshSurface):
        faces, ends = side.over(region, reach)
        return [Window(MeshSheet(side, f), e) for f, e in zip(faces.tolist(), ends, strict=True)]
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


class Batch(NamedTuple):
    """Windows with equally many samples along p and along q.

    `place(which, p, q, displaced)` gives the places of points of windows `which`; where an end of
    a window equals one of `borders`, it is an edge of the surface.
    """

    owner: Indices
    ends: Array
    counts: tuple[int, int]
    borders: Array
    faces: Indices
    place: Callable[[Indices, Array, Array, bool], Array]

    def part(self, which: NDArray[np.bool_] | slice) -> Batch:
        """Return the batch of some of its windows."""
        return self._replace(
            owner=self.owner[which], ends=self.ends[which], faces=self.faces[which]
        )

    def at(self, p: Array, q: Array, displaced: bool = True) -> Array:
        """Return the places (k, n, m, 3) at parameters whose first axis is the windows."""
        return self.place(self.faces[:, None, None], p, q, displaced)

    def chunks(self) -> Iterator[Batch]:
        """Yield batches of `_CHUNK` points or not many more."""
        n, m = self.counts
        several = max(1, _CHUNK // (n * m))
        rows = max(2, min(n, _CHUNK // m))
        for start in range(0, self.owner.size, several):
            group = self.part(slice(start, start + several))
            marks = np.linspace(group.ends[:, 0, 0], group.ends[:, 1, 0], n)
            for first in range(0, n - 1, rows - 1):
                last = min(first + rows, n) - 1
                ends = group.ends.copy()
                ends[:, 0, 0], ends[:, 1, 0] = marks[first], marks[last]
                yield group._replace(ends=ends, counts=(last - first + 1, m))

    def vertices(self, displaced: bool, with_base: bool) -> Array:
        """Return (k, n, m, 6): u, v, rise, rise of the base, p, q."""
        out = np.empty((self.owner.size, *self.counts, 6))
        p, q = (
            np.linspace(self.ends[:, 0, k], self.ends[:, 1, k], self.counts[k], axis=-1)
            for k in (0, 1)
        )
        out[..., 4], out[..., 5] = p[:, :, None], q[:, None, :]
        out[..., :3] = self.at(p[:, :, None], q[:, None, :], displaced)
        out[..., 3] = out[..., 2]
        if with_base and displaced:
            out[..., 3] = self.at(p[:, :, None], q[:, None, :], False)[..., 2]
        return out


def batches(windows: list[Window], spacing: float) -> Iterator[Batch]:
    """Yield all windows in batches, sampled so that neighbours lie within `spacing`."""
    meshes: dict[MeshSurface, list[int]] = {}
    for index, (sheet, ends) in enumerate(windows):
        if isinstance(sheet, MeshSheet):
            meshes.setdefault(sheet.surface, []).append(index)
        else:
            counts, place = _counts(windows[index], spacing), partial(_of_sheet, sheet)
            one = np.array([index])
            yield Batch(one, ends[None], counts, sheet.ends, one, place)
    for surface, indices in meshes.items():
        owner = np.array(indices)
        faces = np.array([windows[k].sheet.face for k in indices])  # type: ignore[union-attr]
        yield from _of_mesh(
            surface, owner, faces, np.array([windows[k].ends for k in indices]), spacing
        )


def _of_sheet(sheet: Sheet, _: Indices, p: Array, q: Array, displaced: bool) -> Array:
    return sheet.at(p, q, displaced)


def _of_mesh(
    surface: MeshSurface, owner: Indices, faces: Indices, ends: Array, spacing: float
) -> Iterator[Batch]:
    counts = np.minimum(surface.counts(faces, ends, spacing), _MOST_SAMPLES)
    # Where p or q is 1, a kite goes on in another one of its triangle.
    borders = np.array([[0.0, 0.0], [np.nan, np.nan]])
    for n, m in np.unique(counts, axis=0).tolist():
        k = np.all(counts == (n, m), axis=-1)
        yield Batch(owner[k], ends[k], (n, m), borders, faces[k], surface.at)


def _counts(window: Window, spacing: float) -> tuple[int, int]:
    """Return how many samples a window needs so that neighbours lie within `spacing`."""
    places = window.places((17, 17), displaced=False)[..., :2]
    counts = []
    for k in (0, 1):
        apart = np.linalg.norm(np.diff(places, axis=k), axis=-1)
        widest = np.fmax.reduce(apart, axis=None, initial=0.0)
        counts.append(int(np.clip(np.ceil(16.0 * widest / spacing), 2, _MOST_SAMPLES)) + 1)
    return counts[0], counts[1]
