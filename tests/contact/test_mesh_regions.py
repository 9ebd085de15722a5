"""Friction and stiffness of the materials or groups of a mesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from asperity import AsperityError, Simulation, make_scene
from asperity.contact.solver import ContactSolver
from asperity.geometry.poses import rotated
from asperity.scene.scene import scene_of

RADIUS, TOP = 0.004, 0.002
XML = """<mujoco><worldbody><body name="slab">{slab}</body>
<body name="tip" pos="0 0 0.01"><freejoint/>{tip}</body></worldbody>
<asset><mesh name="made" vertex="{vertices}"/></asset></mujoco>"""
MESH = '<geom type="mesh" mesh="made"/>'


def _xml(vertices, slab=MESH, tip='<geom type="sphere" size="0.004"/>'):
    numbers = " ".join(f"{x:.9g}" for x in np.asarray(vertices).ravel())
    return XML.format(slab=slab, tip=tip, vertices=numbers)


def _write_slab(path):
    """Write a slab of 40 x 20 x 4 mm as OBJ, its halves in two groups; no texture coordinates."""
    slab = trimesh.creation.box((0.04, 0.02, 0.004))
    for _ in range(3):
        slab = slab.subdivide()
    right = slab.triangles_center[:, 0] > 0.0
    lines = [f"v {x} {y} {z}" for x, y, z in slab.vertices.tolist()]
    for name, which in (("glass", ~right), ("rubber", right)):
        lines.append(f"g {name}")
        lines += ["f {} {} {}".format(*(face + 1)) for face in slab.faces[which]]
    path.write_text("\n".join(lines))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("regions")
    _write_slab(path / "slab.obj")
    return path


def _scene(folder, **more):
    table = {
        "mesh": {"file": "slab.obj", "unit": "m"},
        "materials": {
            "glass": {"friction": 0.1, "stiffness": 300.0},
            "rubber": {"friction": 0.8, "stiffness": 900.0},
        },
    } | more
    document = {"schema": 1, "tool": {"body": "tip"}, "bodies": {"slab": table}}
    corners = trimesh.creation.box((0.04, 0.02, 0.004)).vertices
    return scene_of(_xml(corners), document, folder=folder)


def _at(x, depth, y=0.001):
    return np.array([x, y, TOP + RADIUS - depth, 1.0, 0.0, 0.0, 0.0])


def test_each_half_has_its_own_stiffness(folder):
    scene = _scene(folder)
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    for x, stiffness in ((-0.01, 300.0), (0.01, 900.0)):
        wrench = solver.wrench(_at(x, 2e-4), 0.0)
        assert wrench[2] == pytest.approx(stiffness * 2e-4, rel=1e-3)
        assert solver.energy == pytest.approx(0.5 * stiffness * 4e-8, rel=2e-3)
    between = solver.wrench(_at(0.0, 2e-4), 0.0)[2] / 2e-4
    assert 500.0 < between < 700.0


@pytest.mark.parametrize("texture", [None, {"kind": "sin_product", "wavelength": 2e-3,
                                           "amplitude": 5e-5, "mapping": "triplanar"}])  # fmt: skip
def test_the_wrench_is_the_gradient_over_the_border(folder, texture):
    scene = _scene(folder, **({"texture": texture} if texture else {}))
    # The friction of the materials has no energy: they keep their stiffness alone.
    scene = scene.changed(bodies={"slab": {"materials": {
        name: {"friction": 0.0} for name in ("glass", "rubber")}}})  # fmt: skip
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)

    def energy(pose):
        solver.wrench(pose, 0.0)
        return solver.energy

    rng, step = np.random.default_rng(2), 2e-8
    for _ in range(12):
        pose = _at(rng.uniform(-8e-4, 8e-4), rng.uniform(1e-4, 4e-4), rng.uniform(-3e-3, 3e-3))
        pose = rotated(pose, rng.uniform(-0.3, 0.3, 3))
        wrench = np.array(solver.wrench(pose, 0.0))
        for axis in range(3):
            there, back = pose.copy(), pose.copy()
            there[axis] += step
            back[axis] -= step
            slope = (energy(there) - energy(back)) / (2.0 * step)
            assert -slope == pytest.approx(wrench[axis], abs=2e-6 * np.linalg.norm(wrench[:3]))


def test_crossing_the_border_and_back_takes_no_work(folder):
    scene = _scene(folder)
    scene = scene.changed(bodies={"slab": {"materials": {
        name: {"friction": 0.0} for name in ("glass", "rubber")}}})  # fmt: skip
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    t = np.linspace(0.0, 2.0 * np.pi, 2001)
    path = np.array(
        [_at(1e-3 * np.sin(a), 3e-4 + 1e-4 * np.cos(a), 1e-3 * np.sin(2 * a)) for a in t]
    )
    forces = np.array([solver.wrench(pose, 0.0)[:3].copy() for pose in path])
    moved = np.diff(path[:, :3], axis=0)
    work = np.sum(0.5 * (forces[1:] + forces[:-1]) * moved, axis=1)
    assert abs(work.sum()) < 1e-3 * np.abs(work).sum()


def test_each_half_has_its_own_friction(folder):
    scene = _scene(folder)
    for x, friction in ((-0.01, 0.1), (0.01, 0.8)):
        simulation = Simulation(scene)
        for i in range(60):
            wrench = simulation.step(_at(x + 1e-4 * i, 2e-4))
        assert -wrench[0] / wrench[2] == pytest.approx(friction, rel=2e-2)


def test_geoms_keep_their_own_friction_under_a_mesh(tmp_path):
    ball = trimesh.creation.icosphere(3, RADIUS)
    ball.export(tmp_path / "ball.stl")
    halves = "".join(
        f'<geom name="{name}" type="box" size=".01 .01 .002" pos="{x} 0 0"/>'
        for name, x in (("left", -0.01), ("right", 0.01))
    )
    xml = _xml(ball.vertices, slab=halves, tip=MESH)
    document = {
        "schema": 1, "tool": {"body": "tip"},
        "bodies": {
            "tip": {"mesh": {"file": "ball.stl", "unit": "m"}},
            "slab": {"geoms": {"left": {"friction": 0.1}, "right": {"friction": 0.6}}},
        },
    }  # fmt: skip
    scene = scene_of(xml, document, folder=tmp_path)
    for x, friction in ((-0.012, 0.1), (0.006, 0.6)):
        simulation = Simulation(scene)
        for i in range(40):
            wrench = simulation.step(_at(x + 1e-4 * i, 2e-4))
        assert -wrench[0] / wrench[2] == pytest.approx(friction, rel=2e-2)


def test_what_materials_cannot_have_is_refused(folder):
    with pytest.raises(AsperityError, match=r"no such material .did you mean 'rubber'"):
        _scene(folder, materials={"ruber": {"friction": 0.2}})
    with pytest.raises(
        AsperityError, match=r"materials.glass.*friction must lie between 0 and 100"
    ):
        _scene(folder, materials={"glass": {"friction": -0.2}})
    with pytest.raises(AsperityError, match=r"texture coordinates; without them: friction"):
        _scene(folder, materials={"glass": {"kind": "sinusoid"}})


def test_groups_of_an_obj_file_are_noted_as_its_regions(folder):
    scene = make_scene(tool="sphere:4mm", target=folder / "slab.obj", unit="m")
    body = next(body for body in scene.bodies if body.mesh is not None)
    assert [material.name for material in body.mesh.materials] == ["glass", "rubber"]
