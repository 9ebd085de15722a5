"""Concave meshes of one's own, textured and turned any way: the energy is one of the pose alone."""

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from asperity.contact.solver import ContactSolver
from asperity.scene.builtin import load_scene
from asperity.scene.from_files import make_scene
from contact.test_mesh_potential import first_pose
from contact.test_steep_edges import PATTERNS, solid

STEPS = 300


def extruded(outline, height):
    """Return a prism over an outline (n, 2) that is seen whole from its origin [mm]."""
    n = len(outline)
    ends = [np.c_[outline, np.full(n, z)] for z in (-height / 2, height / 2)]
    vertices = np.vstack([*ends, [[0, 0, -height / 2], [0, 0, height / 2]]])
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces += [[i, j, n + j], [i, n + j, n + i], [2 * n, j, i], [2 * n + 1, n + i, n + j]]
    return trimesh.Trimesh(vertices, faces)


def concave(rng):
    """Return a ring, a gear, an L, a cup or a waisted solid, 6 to 14 mm in size [mm]."""
    kind = rng.integers(5)
    if kind == 0:
        inner, outer, height = rng.uniform(2, 3.5), rng.uniform(4.5, 7), rng.uniform(2, 8)
        sides = int(rng.integers(16, 48))
        return trimesh.creation.annulus(inner, outer, height, sections=sides)
    if kind == 1:
        corners = np.arange(4 * rng.integers(6, 14))
        angle = corners * 2.0 * np.pi / len(corners)
        radius = np.where((corners // 2) % 2, rng.uniform(3.5, 4.5), rng.uniform(5, 6.5))
        outline = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        return extruded(outline, rng.uniform(2, 8))
    if kind == 2:
        w, h, x, y = rng.uniform(6, 11), rng.uniform(6, 11), rng.uniform(2, 4), rng.uniform(2, 4)
        outline = np.array([[0, 0], [w, 0], [w, y], [x, y], [x, h], [0, h]])
        return extruded(outline - [x, y], rng.uniform(3, 9))
    if kind == 3:
        radius, wall, height = rng.uniform(4, 6), rng.uniform(1, 2), rng.uniform(4, 8)
        inside = [[radius - wall, height], [radius - wall, wall], [0, wall]]
        profile = [[0, 0], [radius, 0], [radius, height], *inside]
        return trimesh.creation.revolve(profile, sections=int(rng.integers(12, 40)))
    radius, height = rng.uniform(4, 6), rng.uniform(5, 9)
    waist, top = radius * rng.uniform(0.4, 0.7), radius * rng.uniform(0.7, 1.1)
    profile = [[0, 0], [radius, 0], [waist, height / 2], [top, height], [0, height]]
    return trimesh.creation.revolve(profile, sections=int(rng.integers(12, 40)))


def closed_path(seed, folder):
    """Return the solver of a pair that touches, and poses (n, 7) of its tool on a closed path.

    The second result is the tool's centre of mass in its frame (3,) [m].
    """
    rng = np.random.default_rng(seed)
    tool = concave(rng) if rng.random() < 0.65 else solid(rng)
    files = [str(folder / name) for name in ("tool.stl", "target.stl")]
    tool.export(files[0])
    concave(rng).export(files[1])
    textures = PATTERNS[rng.integers(4)], PATTERNS[rng.integers(3)]
    scene = make_scene(
        tool=files[0], target=files[1], tool_texture=textures[0], target_texture=textures[1],
        unit="mm",
    )  # fmt: skip
    engine = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    data = mujoco.MjData(scene.model)
    mujoco.mj_forward(scene.model, data)
    base, turn = data.body("target").xpos.copy(), Rotation.random(random_state=seed)
    away = rng.normal(size=3)
    away /= np.linalg.norm(away)

    def pose(place, more):
        return np.append(place, np.roll((more * turn).as_quat(), 1))

    low, high = 0.0, 0.03
    for _ in range(40):
        middle = 0.5 * (low + high)
        first_pose(engine, pose(base + away * middle, Rotation.identity()))
        low, high = (middle, high) if engine.contacts.count[0] else (low, middle)
    start = base + away * (low - rng.uniform(0.5e-4, 3e-4))
    moves, turns = rng.normal(size=(2, 3)) * 4e-5, rng.normal(size=(2, 3)) * 5e-3
    angle = np.linspace(0.0, 2.0 * np.pi, STEPS + 1)
    wave = np.column_stack([np.cos(angle), np.sin(angle)])
    path = [
        pose(start + at @ moves, Rotation.from_rotvec(by))
        for at, by in zip(wave, wave @ turns, strict=True)
    ]
    return engine, np.array(path), scene.model.body("tool").ipos.copy()


def work_and_moved(path, centre, wrenches):
    """Return the work round a closed path over the work moved there, by the trapezoidal rule."""
    turns = Rotation.from_quat(np.roll(path[:, 3:], -1, axis=1))
    places = path[:, :3] + turns.apply(centre)
    twists = np.hstack([np.diff(places, axis=0), (turns[1:] * turns[:-1].inv()).as_rotvec()])
    work = np.sum(0.5 * (wrenches[1:] + wrenches[:-1]) * twists, axis=1)
    return work.sum() / np.abs(work).sum()


@pytest.mark.parametrize("seed", [1, 16, 89, 95, 97])
def test_no_work_is_done_round_a_closed_path(seed, tmp_path):
    """Directions that only began counted fully: the work was 0.009 to 0.61 of that moved."""
    engine, path, centre = closed_path(seed, tmp_path)
    engine.reset()
    wrenches = np.array([engine.wrench(at, 1e-3).copy() for at in path])
    assert abs(work_and_moved(path, centre, wrenches)) < 5e-4
    assert np.linalg.norm(wrenches[:, :3], axis=1).max() > 0.02


@pytest.mark.parametrize("seed", [79, 97])
def test_the_way_to_a_pose_does_not_matter(seed, tmp_path):
    """Facets listed for a motion yet to come were searched: a force was 131 um times k, or 109."""
    engine, path, _ = closed_path(seed, tmp_path)
    engine.reset()
    wrenches = [engine.wrench(at, 1e-3).copy() for at in path]
    for i in range(0, STEPS, 10):
        first = first_pose(engine, path[i])
        assert wrenches[i] == pytest.approx(first, abs=1e-9 * np.linalg.norm(first[:3]))


@pytest.mark.parametrize("name", ["hammer-blocks", "file-cad"])
def test_deep_poses_have_the_force_of_all_directions(name):
    """Directions that are not searched change nothing: those in contact before are searched."""
    scene = load_scene(name)
    engine = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    start = Rotation.from_quat(np.roll(scene.start[3:], -1))
    rng, several = np.random.default_rng(3), 0
    for _ in range(40):
        at = scene.start.copy()
        at[:3] += rng.uniform([-0.03, -0.03, -0.004], [0.03, 0.03, 0.0])
        axis, angle = rng.normal(size=3), rng.uniform(0.0, 0.3)
        turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
        at[3:] = np.roll((turn * start).as_quat(), 1)
        first_pose(engine, at)
        energy, beside = engine.energy, at.copy()
        beside[:3] += rng.normal(size=3) * 2e-4
        engine.reset()
        for pose in (beside, at):
            engine.wrench(pose, 1e-3)
        several += engine.contacts.count[0] > 1
        if not np.any(engine.contacts.status[: engine.contacts.count[0]]):
            assert engine.energy == pytest.approx(energy, rel=1e-9)
    assert several >= 10
