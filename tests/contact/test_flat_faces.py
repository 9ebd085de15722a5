"""Flat faces are flat without any option, however they are meshed."""

import numpy as np
import pytest
from naive_engine import pose, waves

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from contact.naive_meshes import blocks, engine_of, thing, touch

HALF, THICK, R = 6e-3, 3e-3, 1.5e-3
SAME = 1e-5
"""Largest difference of forces [N]: of searches that are certified to the tolerance."""


def prism(n, turns):
    """Return a slab with `n` x `n` cells on top, seen from above a polygon of `turns` sides.

    Of four sides it is a box. The rims have as many vertices as the cells ask for.
    """
    if turns == 4:
        line = np.linspace(-HALF, HALF, n + 1)
        return plain(blocks(line, line, [-THICK, 0.0]))
    corners = 2 * np.pi * np.arange(turns) / turns
    corners = HALF * np.stack([np.cos(corners), np.sin(corners)], axis=1)
    flat, faces = [], []
    for k in range(turns):  # wedges of n^2 triangles each
        a, b = corners[k], corners[(k + 1) % turns]
        number = {}
        for i in range(n + 1):
            for j in range(n + 1 - i):
                number[i, j] = len(flat)
                flat.append((i * a + j * b) / n)
        for i in range(n):
            for j in range(n - i):
                faces.append((number[i, j], number[i + 1, j], number[i, j + 1]))
                if j < n - i - 1:
                    faces.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    flat, faces = np.array(flat), np.array(faces)
    top = np.column_stack([flat, np.zeros(len(flat))])
    sides, count = [], 2 * len(flat)
    points = [top, top - [0, 0, THICK]]
    for k in range(turns):
        a, b = corners[k], corners[(k + 1) % turns]
        line = a + np.linspace(0, 1, n + 1)[:, None] * (b - a)
        points += [np.column_stack([line, np.full(n + 1, z)]) for z in (0.0, -THICK)]
        for i in range(n):
            p, q, low = count + i, count + i + 1, n + 1
            sides += [(p, p + low, q + low), (p, q + low, q)]
        count += 2 * (n + 1)
    faces = np.concatenate([faces, faces[:, ::-1] + len(flat), sides])
    return mesh_from_arrays(np.concatenate(points), faces)


def uneven(seed):
    """Return the box with its top in triangles round a vertex that is far out of the middle."""
    x, y = np.random.default_rng(seed).uniform(-0.8, 0.8, 2) * HALF
    line = [-HALF, HALF]
    mesh = blocks(line, line, [-THICK, 0.0])
    points = mesh.vertices[mesh.faces]
    up = (points[:, :, 2] == 0.0).all(axis=1)
    rim = [(-HALF, -HALF, 0.0), (0.9 * HALF, -HALF, 0.0), (HALF, -HALF, 0.0), (HALF, HALF, 0.0),
           (-HALF, HALF, 0.0)]  # fmt: skip
    fan = [[rim[k], rim[(k + 1) % 5], (x, y, 0.0)] for k in range(5)]
    triangles = np.concatenate([points[~up], fan])
    return mesh_from_arrays(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def plain(mesh):
    return mesh_from_arrays(mesh.vertices, mesh.faces)


def laid(mesh, texture):
    """Return the mesh with texture coordinates that are x and y."""
    uv = mesh.vertices[mesh.faces][:, :, :2] / np.array(texture.size)
    return mesh_from_arrays(mesh.vertices, mesh.faces, uv=uv)


def forces(mesh, mapping):
    texture = waves(60e-6, 1.3e-3)
    mesh = laid(mesh, texture) if mapping == "uv" else mesh
    plate = thing("plate", mesh, texture, mapping)
    engine = engine_of(Body("tool", [Geom("sphere", (R,))]), plate)
    found = []
    for x in np.linspace(-0.55 * HALF, 0.5 * HALF, 25):
        engine.reset()
        found.append(touch(engine, pose(x, 0.13 * HALF, R - 3e-5)).wrench[:3])
    return np.array(found)


@pytest.mark.parametrize("mapping", ["planar", "triplanar", "uv"])
def test_how_a_box_is_meshed_does_not_count(mapping):
    fine = forces(prism(16, 4), mapping)
    assert np.abs(fine[:, 0]).max() > 1e-3
    for mesh in (prism(1, 4), prism(3, 4), uneven(1), uneven(2)):
        assert np.abs(forces(mesh, mapping) - fine).max() < SAME


@pytest.mark.parametrize("turns", [3, 6, 8])
def test_how_a_prism_is_meshed_does_not_count(turns):
    fine = forces(prism(9, turns), "planar")
    assert np.abs(fine[:, 0]).max() > 1e-3
    for n in (1, 4):
        assert np.abs(forces(prism(n, turns), "planar") - fine).max() < SAME


def test_a_chamfer_leaves_the_top_flat():
    """The top of a box with a chamfer of 45 degrees, and with one of 30, feels as the box does."""
    right = forces(prism(8, 4), "planar")
    for drop in (1.0, np.tan(np.radians(30.0))):
        for n in (1, 8):
            line = np.linspace(-HALF, HALF, n + 1)
            box = blocks(line, line, [-THICK, -5e-4 * drop, 0.0])
            points = box.vertices.copy()
            below = points[:, 2] < -1e-9
            points[below, :2] *= 1.0 + 5e-4 / HALF
            found = forces(mesh_from_arrays(points, box.faces), "planar")
            assert np.abs(found - right).max() < SAME
