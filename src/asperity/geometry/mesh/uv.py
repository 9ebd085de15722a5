"""Notes on unusual texture coordinates of a mesh, with shares of its area.

None of these is an error: a mirrored chart shows the texture mirrored, overlapping charts show the
same piece of it twice, and a triangle whose corners are collinear on the texture has no slope along
one direction. The notes save a user from searching for the cause elsewhere.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.geometry.mesh.checks import count_of, joined
from asperity.geometry.mesh.topology import Edges, crosses, meeting_corners

_DEGENERATE = 1e-9
_SAME_UV = 1e-9
_TEXELS = 512
_MAX_CELLS = 2_000_000


def uv_notes(triangles: Array, uv: Array, at: Indices, edges: Edges) -> list[str]:
    """Return notes on the texture coordinates uv (m, 3, 2) of triangles (m, 3, 3)."""
    area = np.linalg.norm(crosses(triangles), axis=1)
    total = area.sum()
    sides = np.roll(uv, -1, axis=1) - uv
    twice = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    flat = np.abs(twice) <= _DEGENERATE * np.linalg.norm(sides, axis=2).max(axis=1)
    mirrored = (twice < 0.0) & ~flat
    outside = ((uv < -1e-6) | (uv > 1.0 + 1e-6)).any(axis=(1, 2))

    def share(which: Any) -> str:
        return f"{100 * area[which].sum() / total:.3g} % of the area"

    notes = []
    if mirrored.any():
        charts = charts_of(uv, at, edges)
        some, all_of = len(np.unique(charts[mirrored])), charts.max() + 1
        notes.append(f"texture mirrored on {share(mirrored)}, in {some} of {all_of} charts")
    if flat.any():
        count = count_of(flat.sum(), "triangle")
        notes.append(f"texture coordinates of {count} have no area: smooth there, {share(flat)}")
    if outside.any():
        beyond = "there the texture repeats, or is clamped"
        notes.append(f"texture coordinates leave 0..1 on {share(outside)}: {beyond}")
    if not flat.all():
        twice_used = overlap(uv[~flat])
        if twice_used > 0.0:
            notes.append(
                f"{100 * twice_used:.3g} % of the texture that is used is used more than once"
            )
    return notes


def charts_of(uv: Array, at: Indices, edges: Edges) -> Indices:
    """Return the chart of each triangle; neighbours with equal uv along their edge share one."""
    ends = np.stack(meeting_corners(at.ravel(), *edges.pairs.T), axis=1)
    off = np.ptp(uv.reshape(-1, 2)[ends], axis=2).max(axis=(1, 2))
    joint = edges.pairs[off <= _SAME_UV] // 3
    return joined(len(uv), *joint.T)


def overlap(uv: Array) -> float:
    """Return the share of the used texture that several triangles use, counted modulo repeats.

    Counted on a grid of 512 x 512, or coarser where triangles span many repeats: a triangle uses
    the samples inside it.
    """
    texels = _TEXELS
    while texels > 4 and _cells(uv * texels)[2].sum() > _MAX_CELLS:
        texels //= 2
    places = uv * texels
    low, span, cells = _cells(places)
    if cells.sum() > _MAX_CELLS:
        return 0.0
    which = np.repeat(np.arange(len(uv)), cells)
    within = np.arange(len(which)) - np.repeat(np.cumsum(cells) - cells, cells)
    u = low[which, 0] + within % span[which, 0]
    v = low[which, 1] + within // span[which, 0]
    inside = np.ones(len(which), dtype=bool)
    sides = np.roll(places, -1, axis=1) - places
    sign = np.sign(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    for c in range(3):
        du, dv = u + 0.5 - places[which, c, 0], v + 0.5 - places[which, c, 1]
        left = sides[which, c, 0] * dv - sides[which, c, 1] * du
        # Samples on a side belong to neither triangle.
        inside &= sign[which] * left > 1e-6 * np.linalg.norm(sides, axis=2)[which, c]
    texel = (v[inside] % texels).astype(np.int64) * texels + (u[inside] % texels).astype(np.int64)
    used = np.bincount(texel, minlength=texels * texels)
    return float((used > 1).sum() / max(int((used > 0).sum()), 1))


def _cells(places: Array) -> tuple[Array, Indices, Indices]:
    """Return the lowest sample of each triangle's box, its width and height, and its samples."""
    low = np.ceil(places.min(axis=1) - 0.5)
    high = np.floor(places.max(axis=1) - 0.5)
    span = np.maximum(high - low + 1.0, 0.0)
    return low, span.astype(np.int64), np.minimum(span.prod(axis=1), 1e9).astype(np.int64)
