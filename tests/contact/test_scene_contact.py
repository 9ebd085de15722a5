"""The two hard scenes as they are: their own meshes and textures, against brute force."""

import sys
from pathlib import Path

import numpy as np
import pytest
from naive_engine import pose
from scipy.spatial.transform import Rotation

from asperity.scene.builtin import load_scene
from asperity.simulation.press import touching_pose
from asperity.simulation.simulation import Simulation
from contact.naive_meshes import STIFFNESS, Thing, engine_of, roller, thing, touch
from oracle.depth import reference_depth
from tools.shapes.cad_part import (
    BOLT_CORNERS,
    BOLT_RADIUS,
    BOLT_X,
    BORE_CORNERS,
    BORE_RADIUS,
    BOSS_TOP,
    THICKNESS,
    cad_part,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from mesh_cases import about, pressed

SCENES = ("hammer-blocks", "file-cad")


def pose_of(placed):
    """Return the pose (7,) of a rotation and a place (3, 4)."""
    quaternion = np.roll(Rotation.from_matrix(placed[:, :3]).as_quat(), 1)
    return np.append(placed[:, 3], quaternion)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(
    "tilt", [10.0, *(pytest.param(tilt, marks=pytest.mark.slow) for tilt in (0.0, 30.0))]
)
def test_depth_is_that_of_brute_force_with_the_scenes_own_textures(name, tilt):
    """Of a whole tick, 0.3 mm deep: to 0.5 % of the finer texture's amplitude, and as certified."""
    scene = load_scene(name).changed(force={"anti_alias": "off"})
    simulation = Simulation(scene)
    engine, path = simulation.stage.engine, simulation.trajectory().poses
    here, azimuth = path[len(path) // 3], 0.7
    pivot = here[:3] if name == "hammer-blocks" else np.array([0.0, 0.0, BOSS_TOP])
    turn = np.radians(tilt) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    at = pressed(engine, about(here, pivot, turn)[None].repeat(2, 0), np.full(2, 3e-4))[0]
    engine.reset()
    for above in (1e-3, 7.5e-4, 5e-4, 2.5e-4, 0.0):
        engine.wrench(at + above * np.eye(7)[2], 1e-3)
    found = engine.contacts
    count = int(found.count[0])
    assert count > 0
    tool = next(body for body in scene.bodies if body.name == scene.tool)
    directions = {(int(found.body[i]), tuple(found.normal[i].round(9))) for i in range(count)}
    for number, normal in directions:
        same = [
            i for i in range(count)
            if found.body[i] == number and np.allclose(found.normal[i], normal, atol=1e-8)
        ]  # fmt: skip
        deepest = max(same, key=lambda i: found.depth[i])
        ground = scene.bodies[number]
        exact = reference_depth(
            tool, at, ground, pose_of(engine._collider.frames[number]), found.normal[deepest],
            samples=160, zooms=5, depth_range=(-1.5e-3, 3e-3),
        ).depth  # fmt: skip
        depth, gap = found.depth[deepest], max(found.gap[i] for i in same)
        reliefs = [b.texture.relief for b in (tool, ground) if b.texture is not None]
        assert abs(depth - exact) < 0.005 * 0.5 * min(reliefs)
        assert found.status[deepest] == 0
        assert depth - 1e-9 <= exact + 5e-9  # on a rim the reference is a little low
        assert exact <= depth + gap + 1e-9


def forces_along(name, direction, length):
    """Return the forces of a slide of the smooth tool at 50 mm/s, 0.3 mm deep (n, 3)."""
    scene = load_scene(name)
    smooth = {body.name: {"texture": None} for body in scene.bodies if body.texture is not None}
    scene = scene.changed(force={"anti_alias": "off", "friction": 0.0}, bodies=smooth)
    engine = Simulation(scene).stage.engine
    at = touching_pose(engine, scene.start.copy())
    at[2] -= 3e-4
    engine.reset()
    for above in (4e-4, 2e-4, 0.0):
        engine.wrench(at + above * np.eye(7)[2], 1e-3)
    steps = np.arange(0.0, length, 5e-5)[:, None] * np.append(direction, np.zeros(5))
    return np.array([engine.wrench(at + step, 1e-3)[:3].copy() for step in steps])


@pytest.mark.parametrize("direction", [(0.0, 1.0), (1.0, 0.0), (0.8, 0.6)])
def test_the_hammer_slides_off_a_block_without_a_jolt(direction):
    """Its face is crowned: where the middle leaves the block the force begins to lean, by 3.3 %.

    By the face's rim, which rises by an eighth, the depth falls by 2 % of its largest a tick.
    """
    forces = forces_along("hammer-blocks", direction, 0.06)
    size = np.linalg.norm(forces, axis=1)
    assert size[0] > 0.1
    assert size[-1] == 0.0
    assert np.abs(np.diff(size)).max() < 0.025 * size.max()
    assert np.linalg.norm(np.diff(forces[:, :2], axis=0), axis=1).max() < 0.035 * size.max()


def test_the_file_slides_off_the_boss_by_its_chamfer():
    """At a fixed height: over 45 degrees the depth falls by as much as the file goes sideways."""
    scene = load_scene("file-cad")
    sideways = Rotation.from_quat(np.roll(scene.start[3:], -1)).apply([0.0, 1.0, 0.0])[:2]
    forces = forces_along("file-cad", sideways, 0.03)
    size = np.linalg.norm(forces, axis=1)
    assert size[0] > 0.1
    assert size[-1] == 0.0
    stiffness = scene.force.stiffness
    assert np.abs(np.diff(size)).max() < 1.1 * stiffness * 5e-5
    # The force turns sideways over the last part of the way, about as far as the file is deep.
    change = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    print(100 * change.max() / size.max())
    assert change.max() < 4.0 * stiffness * 5e-5
    over = int(np.argmax(np.abs(forces[:, :2]).max(axis=1) > 0.1 * size.max()))
    assert np.count_nonzero(size[over:]) < 20


@pytest.fixture(scope="module")
def part():
    """Return the machined part with its texture and its convex pieces."""
    scene = load_scene("file-cad")
    body = next(body for body in scene.bodies if body.name == "part")
    return Thing(body, tuple(cad_part().pieces))


@pytest.mark.parametrize(
    ("x", "radius", "corners", "top"),
    [
        (BOLT_X, BOLT_RADIUS, BOLT_CORNERS, THICKNESS),
        (0.0, BORE_RADIUS, BORE_CORNERS, BOSS_TOP),
    ],
)
def test_a_peg_in_the_machined_part_touches_the_hole_and_not_its_hull(
    part, x, radius, corners, top
):
    room, half = 5e-4, 8e-3
    # How far the hole's polygon is within its circle, and how deep machining goes.
    stray = radius * (1.0 - np.cos(np.pi / corners)) + 3e-5
    engine = engine_of(thing("tool", roller(radius - room, half, 48)), part)
    for z in np.arange(top + half + 1e-3, 0.5 * top, -2e-4):
        found = touch(engine, pose(x, 0.0, z))
        assert not found.wrench.any(), z
        assert len(found.depth) == 0
    for angle in np.radians([0.0, 40.0, 100.0, 170.0, 250.0]):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        # From the middle to the wall, a tick each 50 um, and 0.3 mm into it.
        for way in np.arange(0.0, room + 3.01e-4, 5e-5):
            found = touch(engine, pose(x + way * out[0], way * out[1], 0.5 * top))
            if way < room - stray:
                assert not found.wrench.any(), way
        inwards = -(found.wrench[:3] @ out)
        # Sides of the polygon that turn towards each other are a little stiffer than one.
        assert STIFFNESS * (3e-4 - stray) < inwards < 1.2 * STIFFNESS * (3e-4 + stray)
        across = found.wrench[:3] + inwards * out
        # The sides of the polygon that it touches are turned from the way there.
        assert np.linalg.norm(across) < np.tan(2.0 * np.pi / corners) * inwards
        for way in np.arange(room, -1e-5, -5e-5):
            found = touch(engine, pose(x + way * out[0], way * out[1], 0.5 * top))
        assert not found.wrench.any()
