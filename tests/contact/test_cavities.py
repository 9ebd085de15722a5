"""In an empty cavity nothing is felt, whatever pose came before, and whatever MuJoCo collides."""

import numpy as np
import pytest
from naive_engine import pose, turn, waves

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from contact.naive_meshes import (
    STIFFNESS,
    ball_mesh,
    blocks,
    brick,
    engine_of,
    hook,
    thing,
    touch,
    with_uv,
)

R = 2e-3
"""Of the tools [m]."""
WALL, ROOM, FLOOR = 3e-3, 12e-3, 4e-3


def channel():
    y = [-ROOM - WALL, -ROOM, ROOM, ROOM + WALL]
    return [[-20e-3, 20e-3], y, [-FLOOR, 0.0, 15e-3]], [(0, 1, 1)]


def corner():
    """Return an L: a floor and one wall."""
    return [[-20e-3, 20e-3], [-ROOM, ROOM, ROOM + WALL], [-FLOOR, 0.0, 15e-3]], [(0, 0, 1)]


def ring():
    """Return a square ring on edge, its hole along x."""
    y = [-ROOM - WALL, -ROOM, ROOM, ROOM + WALL]
    return [[-8e-3, 8e-3], y, [-FLOOR, 0.0, 15e-3, 15e-3 + FLOOR]], [(0, 1, 1)]


def cup(hole):
    """Return a cup, with a hole in its bottom or without."""
    line = [-ROOM - WALL, -ROOM, -hole, hole, ROOM, ROOM + WALL]
    empty = [(i, j, 1) for i in (1, 2, 3) for j in (1, 2, 3)] + [(2, 2, 0)]
    return [line, line, [-FLOOR, 0.0, 15e-3]], empty


SHAPES = {
    "channel": channel, "corner": corner, "ring": ring, "cup": lambda: cup(5e-3),
}  # fmt: skip
TOOLS = {
    "ball": lambda name: Body(name, [Geom("sphere", (R,))]),
    "mesh": lambda name: thing(name, ball_mesh(R, 2)),
    "brick": lambda name: brick((R, R, R), name),
}


def solid(lines, empty):
    """Return the cells that are full: lowest and highest corners (n, 3)."""
    counts = [len(line) - 1 for line in lines]
    cells = [c for c in np.ndindex(*counts) if c not in empty]
    low = [[lines[k][c[k]] for k in range(3)] for c in cells]
    high = [[lines[k][c[k] + 1] for k in range(3)] for c in cells]
    return np.array(low), np.array(high)


def free_places(lines, empty, count, seed, reach=1.8 * R):
    """Return places within the hull of a shape farther from it than a tool reaches (n, 3)."""
    low, high = solid(lines, empty)
    rng = np.random.default_rng(seed)
    places = rng.uniform(low.min(axis=0), high.max(axis=0), (400 * count, 3))
    off = np.maximum(np.maximum(low[:, None] - places, places - high[:, None]), 0.0)
    free = np.linalg.norm(off, axis=2).min(axis=0) > reach
    assert free.sum() >= count
    return places[free][:count]


@pytest.mark.parametrize("kind", TOOLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_nothing_is_felt_in_an_empty_cavity(shape, kind):
    """MuJoCo is given the hull: first poses, jumps, and steps of up to 10 mm a tick."""
    lines, empty = SHAPES[shape]()
    engine = engine_of(TOOLS[kind]("tool"), thing("body", blocks(*lines, empty=empty)))
    places = free_places(lines, empty, 30, seed=1)
    for place in places:
        engine.reset()
        assert not touch(engine, pose(*place)).wrench.any(), place
        assert not touch(engine, pose(*place)).wrench.any(), place
    engine.reset()
    for place in places:
        found = touch(engine, pose(*place))
        assert not found.wrench.any(), place
        assert len(found.depth) == 0
    for place in places:  # from elsewhere
        touch(engine, pose(0, 0, 0.2))
        assert not touch(engine, pose(*place, turn((1, 2, 3), 0.4))).wrench.any(), place


@pytest.mark.parametrize("kind", TOOLS)
@pytest.mark.parametrize("shape", ["channel", "corner", "ring", "cup"])
def test_the_floor_of_a_cavity_pushes_up_from_the_first_pose_on(shape, kind):
    lines, empty = SHAPES[shape]()
    engine = engine_of(TOOLS[kind]("tool"), thing("body", blocks(*lines, empty=empty)))
    lowest = R if kind != "mesh" else -ball_mesh(R, 2).vertices[:, 2].min()
    x = 8.5e-3 if shape == "cup" else 1e-3
    for depth in (-1e-4, 1e-5, 1e-4, 5e-4, 1.5e-3):
        engine.reset()
        for _ in range(2):
            found = touch(engine, pose(x, -3e-3, lowest - depth))
            right = [0, 0, STIFFNESS * max(depth, 0.0)]
            assert found.wrench[:3] == pytest.approx(right, abs=1e-6), depth


@pytest.mark.parametrize("shape", ["channel", "ring"])
def test_nothing_is_felt_in_the_cavity_of_a_tool(shape):
    lines, empty = SHAPES[shape]()
    tool = thing("tool", blocks(*lines, empty=empty))
    engine = engine_of(tool, TOOLS["mesh"]("body"))
    for place in free_places(lines, empty, 20, seed=2):
        engine.reset()
        for _ in range(2):
            assert not touch(engine, pose(*-place)).wrench.any(), place


@pytest.mark.parametrize("mapping", ["uv", "triplanar"])
def test_a_texture_changes_nothing_of_it(mapping):
    texture = waves(60e-6, 1.1e-3)
    lines, empty = channel()
    mesh = with_uv(blocks(*lines, empty=empty), texture, 3)
    engine = engine_of(TOOLS["ball"]("tool"), thing("body", mesh, texture, mapping))
    for place in free_places(lines, empty, 20, seed=3):
        engine.reset()
        for _ in range(2):
            assert not touch(engine, pose(*place)).wrench.any(), place
    # First poses on the floor are those that a slow approach arrives at.
    for x, y in [(1e-3, -3e-3), (-2.2e-3, 4e-3), (6e-3, 0.5e-3)]:
        for height in (3e-5, -3e-5, -3e-4):
            engine.reset()
            first = touch(engine, pose(x, y, R + height)).wrench
            engine.reset()
            for step in np.arange(5e-4, height, -2e-5):
                touch(engine, pose(x, y, R + step))
            slow = touch(engine, pose(x, y, R + height)).wrench
            assert first[:3] == pytest.approx(slow[:3], abs=2e-4)
            assert first[2] >= 0.0


def test_in_the_mouth_of_a_hook_that_mujoco_fills():
    body = hook()
    engine = engine_of(brick((1e-3,) * 3), thing("plate", body.body.mesh))
    for z in (-3.5e-3, -3.2e-3, -3.9e-3):
        for x in (0.0, 5e-3, 9e-3):
            engine.reset()
            assert not touch(engine, pose(x, 0, z)).wrench.any()
    for depth in (1e-4, 4e-4):
        engine.reset()
        up = touch(engine, pose(5e-3, 0, -3e-3 + depth))
        assert up.wrench[2] == pytest.approx(-STIFFNESS * depth)


def torus(radius, thick, around, across):
    """Return a torus of triangles round z, and the corners of its convex pieces."""
    u, v = np.meshgrid(*(np.arange(n) * 2.0 * np.pi / n for n in (around, across)), indexing="ij")
    far = radius + thick * np.cos(v)
    corners = np.stack([far * np.cos(u), far * np.sin(u), thick * np.sin(v)], axis=-1)
    i, j = (index.ravel() for index in np.indices((around, across)))
    a, b = i * across + j, (i + 1) % around * across + j
    c, d = (i + 1) % around * across + (j + 1) % across, i * across + (j + 1) % across
    faces = np.concatenate([np.column_stack([a, b, d]), np.column_stack([d, b, c])])
    mesh = mesh_from_arrays(corners.reshape(-1, 3), faces, hard_angle=44.0)
    return mesh, [np.concatenate([corners[k - 1], corners[k]]) for k in range(around)]


def test_a_sharp_edge_beside_a_ring_is_not_behind_it():
    """A tetrahedron's edge over a torus, a hair apart: the far flank lies behind its faces.

    A facet of it is less deep behind the one end of a face than counts as deep, and far deeper
    behind the other.
    """
    corners = 2e-3 * np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    sides = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    tool = thing("tool", mesh_from_arrays(corners, sides, hard_angle=20.0))
    mesh, pieces = torus(6e-3, 2e-3, 24, 12)
    engine = engine_of(tool, thing("plate", mesh, pieces=pieces))
    at = np.array([-0.006104824, 0.003715118, 0.003351773,
                   -0.74964277, -0.15120122, 0.61224678, -0.20081781])  # fmt: skip
    for up in (0.0, 1e-6, 1e-5, 1e-4):
        engine.reset()
        assert not engine.wrench(at + np.array([0, 0, up, 0, 0, 0, 0]), 0.0).any()


@pytest.mark.parametrize("gap", [0.02e-3, 0.1e-3])
def test_nothing_is_felt_between_thin_walls(gap):
    """A thin plate's far side lies behind a fin's far side, less than a twentieth of them apart."""
    half, fin = (0.075e-3, 8e-3, 8e-3), 0.1e-3
    lines = [[-10e-3, 0.0, fin, 10e-3], [-10e-3, 10e-3], [-4e-3, 0.0, 12e-3]]
    body = thing("body", blocks(*lines, empty=[(0, 0, 1), (2, 0, 1)]))
    engine = engine_of(brick(half), body)
    for side in (-gap - half[0], fin + gap + half[0]):
        engine.reset()
        for _ in range(2):
            assert not touch(engine, pose(side, 0, 10e-3)).wrench.any()
    found = touch(engine, pose(-half[0] + 0.03e-3, 0, 10e-3))
    assert found.wrench[0] == pytest.approx(-STIFFNESS * 0.03e-3, rel=1e-6)
