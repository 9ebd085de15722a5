"""Edges of triangle meshes, consistent winding, and orientation of closed parts.

All functions work on *places*, not vertices: coincident vertices, as at the seams of a texture or
everywhere in STL, are one place. A *half-edge* h = 3 f + c runs from corner c of triangle f to the
next; an edge has one half-edge (a border), two, or more.
"""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity.geometry.mesh.checks import Corners, count_of, joined


class Edges(NamedTuple):
    """The edges of triangles.

    Attributes
    ----------
    of_half : (3 m,) array
        Edge of each half-edge.
    size : (e,) array
        Number of half-edges of each edge.
    pairs : (p, 2) array
        Half-edges that share an edge; of an edge with more than two, all their pairs.
    """

    of_half: Indices
    size: Indices
    pairs: Indices

    @property
    def borders(self) -> Mask:
        """Which half-edges are the only one of their edge, (3 m,)."""
        return self.size[self.of_half] == 1


def edges_of(at: Indices) -> Edges:
    """Return the edges of triangles whose corners are at the places `at` (m, 3)."""
    start, end = at.ravel(), np.roll(at, -1, axis=1).ravel()
    keys = np.minimum(start, end) * (int(at.max()) + 1) + np.maximum(start, end)
    _, of_half, count = np.unique(keys, return_inverse=True, return_counts=True)
    order = np.argsort(of_half, kind="stable")
    begin = np.cumsum(count) - count
    pairs = [np.stack([order[begin[count == 2] + k] for k in (0, 1)], axis=1)]
    for edge in np.flatnonzero(count > 2):
        halves = order[begin[edge] : begin[edge] + count[edge]]
        # An edge of very many triangles has too many pairs; consecutive ones suffice.
        few = combinations(halves, 2) if count[edge] <= 16 else pairwise(halves)
        pairs.append(np.array(list(few)))
    return Edges(of_half.astype(np.int64), count.astype(np.int64), np.concatenate(pairs))


def next_corner(half: Indices) -> Indices:
    """Return the half-edge that starts where half-edges end."""
    return half - half % 3 + (half + 1) % 3


def meeting_corners(places: Indices, h: Indices, g: Indices) -> tuple[Indices, Indices]:
    """Return the pairs of corners (n, 2) that meet at the start and at the end of half-edges h.

    `h` and `g` (n,) are pairs of half-edges that share an edge, `places` (3 m,) of all corners.
    """
    to_h, to_g = next_corner(h), next_corner(g)
    same_way = places[h] == places[g]
    start = np.stack([h, np.where(same_way, g, to_g)], axis=1)
    return start, np.stack([to_h, np.where(same_way, to_g, g)], axis=1)


def wound_alike(corners: Corners, places: Indices, notes: list[str]) -> Corners:
    """Return the mesh with neighbouring triangles wound alike and closed parts facing outwards.

    Where triangles disagree the smaller area is flipped. A closed part with a negative volume is
    inverted unless it is a cavity in another.
    """
    at = places[corners.faces]
    edges = edges_of(at)
    many = np.count_nonzero(edges.size > 2)
    if many:
        notes.append(f"{count_of(many, 'edge')} shared by more than two triangles: kept")
    pairs = edges.pairs[edges.size[edges.of_half[edges.pairs[:, 0]]] == 2]
    part = joined(len(at), pairs[:, 0] // 3, pairs[:, 1] // 3)
    turn = _disagreeing(corners, at, pairs, part, notes)
    corners = corners.turned(turn)
    closed = np.ones(part.max() + 1, dtype=bool)
    closed[part[np.flatnonzero(edges.borders) // 3]] = False
    inside_out = _inside_out(corners, part, closed)
    if inside_out.any():
        area = f"{np.count_nonzero(inside_out)} of {len(at)} triangles"
        notes.append(f"inside out (negative volume): turned round, {area}")
    open_edges = np.count_nonzero(edges.size == 1)
    if open_edges:
        notes.append(f"it is open: {count_of(open_edges, 'border edge')}")
    return corners.turned(inside_out)


def _disagreeing(
    corners: Corners, at: Indices, pairs: Indices, part: Indices, notes: list[str]
) -> Mask:
    """Return which triangles to flip so that all triangles of a part are wound consistently."""
    m = len(at)
    start = at.ravel()
    same_way = start[pairs[:, 0]] == start[pairs[:, 1]]
    f, g = pairs[:, 0] // 3, pairs[:, 1] // 3
    # Node f is triangle f as it is, node f + m the flipped one: consistent ones are joined.
    first = np.concatenate([f, f + m])
    second = np.concatenate([np.where(same_way, g + m, g), np.where(same_way, g, g + m)])
    label = joined(2 * m, first, second)
    one_sided = label[:m] == label[m:]
    if one_sided.any():
        strips = len(np.unique(part[one_sided]))
        notes.append(f"{count_of(strips, 'part')} with one side only, like a Moebius strip")
    area = np.linalg.norm(crosses(corners.vertices[corners.faces]), axis=1)
    total = np.bincount(label[:m], area, label.max() + 1)
    turn = (total[label[:m]] < total[label[m:]]) & ~one_sided
    # Of two equal halves the one with the first triangle stays.
    equal = (total[label[:m]] == total[label[m:]]) & ~one_sided
    turn |= equal & (label[:m] > label[m:])
    if turn.any():
        notes.append(f"winding was inconsistent: {count_of(turn.sum(), 'triangle')} turned round")
    return turn


def crosses(triangles: Array) -> Array:
    """Return the cross products of the sides of triangles: their normals, twice their area long."""
    a, b, c = triangles.swapaxes(0, 1)
    return np.cross(b - a, c - a)


def gradients(triangles: Array, values: Array) -> Array:
    """Return the gradients (m, k, 3) of functions that are linear on each triangle (m, 3, 3).

    `values` (m, 3, k) are those at the corners.
    """
    p, q = (triangles[:, i] - triangles[:, 0] for i in (1, 2))
    normal = np.cross(p, q)
    square = np.maximum(np.sum(normal**2, axis=1), 1e-300)[:, None]
    dual = np.stack([np.cross(q, normal) / square, np.cross(normal, p) / square], axis=1)
    steps = values[:, 1:] - values[:, :1]  # along p and q
    return np.asarray(np.swapaxes(steps, 1, 2) @ dual)


def _inside_out(corners: Corners, part: Indices, closed: Mask) -> Mask:
    """Return which triangles belong to closed parts that are inside out."""
    triangles = corners.vertices[corners.faces]
    triangles = triangles - corners.vertices.mean(axis=0)
    sixfold = np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))
    volume = np.where(closed, np.bincount(part, sixfold, len(closed)), 0.0)
    # The sign of a negligible volume is rounding: compare with the bounding box.
    low, high = (np.full((len(closed), 3), s * np.inf) for s in (1, -1))
    np.minimum.at(low, part, triangles.min(axis=1))
    np.maximum.at(high, part, triangles.max(axis=1))
    volume[np.abs(volume) < 1e-9 * (high - low).max(axis=1) ** 3] = 0.0
    turned = closed & (volume.sum() < 0.0)
    volume[turned] *= -1.0
    for k in np.flatnonzero(volume < 0.0):
        point = triangles[np.argmax(part == k), 0]
        round_it = closed & ((low <= point) & (point <= high)).all(axis=1)
        round_it[k] = False
        others = triangles[round_it[part]]
        if len(others) == 0 or abs(_winding_number(point, others)) < 0.5:
            turned[k] = ~turned[k]
    return np.asarray(turned[part])


def _winding_number(point: Array, triangles: Array) -> float:
    """Return the winding number of closed triangles around a point.

    Solid angles by van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 125 (1983).
    """
    a, b, c = (triangles - point).swapaxes(0, 1)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", s, t) for s, t in ((a, b), (b, c), (c, a)))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    return float(
        2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum() / (4.0 * np.pi)
    )
