"""Directions of contact between meshes: which are searched, and that the others are not."""

import numpy as np
import pytest
from naive_engine import pose, waves

from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.scene.builtin import load_scene
from asperity.simulation.tool_contact import ToolContact
from contact.naive_meshes import STIFFNESS, ball_mesh, engine_of, hull_mesh, slab, thing, touch

DT = 1e-3
BOSS = 0.022
"""Where the top of the machined part's boss is [m]."""


def chamfered(cut=4e-3, half=10e-3):
    """Return a block, top at z = 0, whose edge at x = half is cut off at 45 degrees."""
    profile = [(-half, -half), (half, -half), (half, -cut), (half - cut, 0.0), (-half, 0.0)]
    vertices = np.array([(x, y, z) for y in (-half, half) for x, z in profile])
    around = [(i, (i + 1) % 5) for i in range(5)]
    faces = [t for i, j in around for t in ((i, j, j + 5), (i, j + 5, i + 5))]
    faces += [(0, i + 1, i) for i in (1, 2, 3)] + [(5, 5 + i, 6 + i) for i in (1, 2, 3)]
    points = vertices[np.array(faces)]
    volume = np.einsum("ij,ij->", points[:, 0], np.cross(points[:, 1], points[:, 2]))
    faces = np.array(faces)[:, ::-1] if volume < 0.0 else np.array(faces)
    return thing("plate", mesh_from_arrays(vertices, faces, hard_angle=30.0))


@pytest.mark.parametrize("back", [False, True])
def test_a_ball_is_handed_over_from_a_face_to_its_chamfer(back):
    """Contact on the chamfer begins while the face still has it, and there is no gap between."""
    radius, depth, corner = 2e-3, 1e-4, 6e-3
    engine = engine_of(thing("tool", ball_mesh(radius, 4)), chamfered())
    out, turns = radius - depth, np.linspace(0.0, np.pi / 4, 40)
    path = [(x, out) for x in np.arange(4e-3, corner, 5e-5)]
    path += [(corner + out * np.sin(t), out * np.cos(t)) for t in turns]
    far = np.arange(0.0, 2.5e-3, 5e-5)[:, None] * [np.sqrt(0.5), -np.sqrt(0.5)]
    path += [tuple(p) for p in path[-1] + far]
    path = path[::-1] if back else path
    for x, z in (path[0] + np.array([0.0, high]) for high in (3e-4, 2e-4, 1e-4)):
        engine.wrench(pose(x, 1e-3, z), DT)
    forces = np.array([engine.wrench(pose(x, 1e-3, z), DT)[:3].copy() for x, z in path])
    size = np.linalg.norm(forces, axis=1)
    assert size.min() > 0.85 * STIFFNESS * depth
    assert size.max() < 1.1 * STIFFNESS * depth
    # The force turns by 45 degrees over the 40 ticks on the edge.
    change = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    assert change.max() < 0.12 * STIFFNESS * depth
    on_face, on_chamfer = (forces[-1], forces[0]) if back else (forces[0], forces[-1])
    assert abs(on_face[0]) < 0.03 * on_face[2]
    assert on_chamfer[0] == pytest.approx(on_chamfer[2], rel=0.03)


def test_a_file_that_lies_on_a_boss_touches_its_top_alone():
    """From the first touch on, the overlap of its rounded rim is accounted for by the top."""
    scene = load_scene("file-cad").changed(force={"anti_alias": "off"})
    engine = ToolContact(scene).engine
    here, searched = scene.start.copy(), []
    here[2] = BOSS + 3.5e-3
    for _ in range(60):
        here[2] -= 2.5e-5
        here[0] += 5e-5
        engine.wrench(here, DT)
        contacts = engine.contacts
        count = contacts.count[0]
        directions = engine._mesh.space.directions
        searched.append(int(np.sum(directions["patches"] > 0)))
        if count:
            assert (contacts.normal[:count, 2] > 0.99).all()
    assert count >= 3  # parts with the same deepest point are one contact
    assert contacts.weight[:count].sum() == pytest.approx(1.0, abs=1e-9)
    assert max(searched) == 1


def test_mujoco_is_queried_only_for_bodies_that_are_not_in_contact():
    """The wrenches are the same to the bit, also where the tool leaps away and back."""
    scene = load_scene("file-cad").changed(force={"anti_alias": "off"})
    one, two = ToolContact(scene).engine, ToolContact(scene).engine
    queried, query = [], one._collider.query

    def counted(without=None):
        queried.append(without is None or not without.any())
        return query(without)

    one._collider.query = counted
    steps = np.arange(40)[:, None] * [5e-5, 0, -1e-4, 0, 0, 0, 0]
    path = list(scene.start + np.array([0, 0, 3e-3, 0, 0, 0, 0]) + steps)
    path += [scene.start + np.array([30e-3, 0, 0, 0, 0, 0, 0]), *path[-5:], path[0]]
    for here in path:
        first = one.wrench(here, DT).copy()
        two._mesh.memory.in_contact[:] = False
        assert (two.wrench(here, DT) == first).all()
    assert 10 < sum(queried) < len(queried) - 10
    plate = engine_of(thing("tool", ball_mesh(2e-3, 3)), slab())
    plate.wrench(pose(0, 0, 1.9e-3), DT)
    assert plate._mesh.memory.in_contact.any()
    plate.reset()
    assert not plate._mesh.memory.in_contact.any()


@pytest.mark.parametrize("texture", [None, waves(1e-5, 1e-3)])
@pytest.mark.parametrize("sides", [6, 100])
def test_the_tip_of_a_needle_is_felt(sides, texture):
    """Its sides are 87 degrees from the plate's normal: upright it was not felt at all."""
    turn, depth = np.linspace(0, 2 * np.pi, sides, endpoint=False), 1e-4
    rim = np.column_stack([5e-4 * np.cos(turn), 5e-4 * np.sin(turn), np.full(sides, 1e-2)])
    needle = hull_mesh(np.vstack([[0.0, 0.0, 0.0], rim]))
    engine = engine_of(thing("tool", needle), slab(texture=texture))
    for tilt in (0.0, 0.1, 0.4):
        at = pose(1e-3, 1e-3, -depth, (np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0))
        force = touch(engine, at).wrench[:3]
        assert force[2] == pytest.approx(STIFFNESS * depth, rel=0.05)
        assert engine.contacts.count[1] == 0
        assert (engine.contacts.status[: engine.contacts.count[0]] == 0).all()
