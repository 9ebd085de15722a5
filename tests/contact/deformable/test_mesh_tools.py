"""Rigid meshes on deformable surfaces and elastic bodies: one energy, and the same as geoms."""

import numpy as np
import pytest
from soft_sheets import TURN, sheet, soft_slab, surface_on, wavy

from asperity.contact.deformable.elastic_contact import ElasticContact
from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.geometry.poses import rotated, rotation_of
from rough_maps import bumps
from solid_meshes import ball, ball_with_seams, body_of, box

HALF = (5e-3, 4e-3, 3e-3)
CENTRE = (1e-3, 2e-3, 3e-3)
TOOLS = {
    "hard edges": (body_of(box(HALF), bumps(3)), [0.0, 0.0, 4.1e-3, *TURN]),
    "smooth edges": (body_of(ball(), bumps(3)), [1e-3, -2e-3, 5.0e-3, *TURN]),
    "smooth": (body_of(ball()), [1e-3, -2e-3, 5.0e-3, *TURN]),
    "texture coordinates": (body_of(ball_with_seams(), bumps(3), "uv"), [0.0, 0.0, 5e-3, *TURN]),
}


@pytest.fixture(scope="module", params=TOOLS)
def pressed(request):
    """Return the contact of a mesh with a rough sheet, its vertices, and the pose of the mesh."""
    tool, pose = TOOLS[request.param]
    surface = surface_on(wavy(), texture=bumps())
    contact = SurfaceContact(surface, [tool], centres=[CENTRE])
    shift = np.random.default_rng(1).normal(size=(len(surface.mesh.vertices), 3))
    return contact, surface.mesh.vertices + 1e-4 * shift, np.array(pose)


def test_forces_on_vertices_are_minus_the_gradient(pressed):
    contact, vertices, pose = pressed
    contact.press(vertices, [pose])
    forces, step = contact.forces, 3e-9
    assert contact.out.pressed[-1] > 40
    for vertex in np.argsort(-np.linalg.norm(forces, axis=1))[:12]:
        for axis in range(3):
            ends = []
            for sign in (-step, step):
                moved = vertices.copy()
                moved[vertex, axis] += sign
                contact.press(moved, [pose])
                ends.append(contact.energy)
            found = -(ends[1] - ends[0]) / (2.0 * step)
            assert found == pytest.approx(forces[vertex, axis], abs=1e-6 * np.abs(forces).max())


def test_the_wrench_on_the_mesh_is_minus_the_gradient(pressed):
    contact, vertices, pose = pressed
    contact.press(vertices, [pose])
    wrench = contact.wrenches[0]
    for axis in range(6):
        ends, step = [], 3e-9 if axis < 3 else 6e-7
        for sign in (-step, step):
            moved = pose.copy()
            if axis < 3:
                moved[axis] += sign
            else:
                at = pose[:3] + rotation_of(pose[3:]) @ CENTRE
                moved[3:] = rotated(pose, np.eye(3)[axis - 3] * sign)[3:]
                moved[:3] = at - rotation_of(moved[3:]) @ CENTRE
            contact.press(vertices, [moved])
            ends.append(contact.energy)
        found = -(ends[1] - ends[0]) / (2.0 * step)
        assert found == pytest.approx(wrench[axis], abs=1e-6 * np.abs(wrench[:3]).max())


def test_forces_and_wrenches_balance(pressed):
    contact, vertices, pose = pressed
    contact.press(vertices, [pose])
    forces, wrench = contact.forces, contact.wrenches[0]
    centre = pose[:3] + rotation_of(pose[3:]) @ CENTRE
    total = np.concatenate([forces.sum(axis=0), np.cross(vertices - centre, forces).sum(axis=0)])
    np.testing.assert_allclose(total, -wrench, atol=1e-12 * np.abs(wrench).max())


def test_a_box_of_triangles_is_the_box():
    """With friction, under vertices and a body that move."""
    surface = surface_on(wavy(), texture=bumps(), friction=0.4)
    rng = np.random.default_rng(2)
    speeds, twist = 0.02 * rng.normal(size=(169, 3)), 0.05 * rng.normal(size=6)
    pose, found = [0.0, 0.0, 4.1e-3, *TURN], []
    geom = Body("box", [Geom("box", HALF)], bumps(3), "triplanar")
    for tool in (geom, body_of(box(HALF), bumps(3))):
        contact = SurfaceContact(surface, [tool])
        contact.press(surface.mesh.vertices, [pose], velocities=speeds, twists=[twist])
        found.append((contact.wrenches[0], contact.forces, contact.stiffness()))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(other, one, atol=1e-9 * np.abs(one).max())


def test_an_elastic_body_yields_to_a_mesh_as_to_a_box():
    body = soft_slab()
    surface, found = surface_on(body.mesh, texture=bumps()), []
    geom = Body("box", [Geom("box", HALF)])
    pose = [0.0, 0.0, 4.6e-3, *TURN]
    for tool in (geom, body_of(box(HALF))):
        contact = ElasticContact(body, surface, [tool])
        at_rest = contact.settle([pose])
        moved = [contact.step([[1e-5 * k, 0.0, *pose[2:]]], 1e-3) for k in range(5)]
        found.append(np.concatenate([at_rest, *moved]))
    assert found[0][0, 2] > 0.05
    np.testing.assert_allclose(found[1], found[0], atol=1e-6 * np.abs(found[0]).max())


def test_what_cannot_be_met_is_refused():
    with pytest.raises(AsperityError, match="rigid bodies, got a DeformableSurface"):
        SurfaceContact(surface_on(sheet(5)), [surface_on(sheet(5))])
    closed = box(HALF)
    opened = body_of(mesh_from_arrays(closed.vertices, closed.faces[1:]), name="bowl")
    with pytest.raises(AsperityError, match="'bowl' is open, with 3 border edges"):
        SurfaceContact(surface_on(sheet(5)), [opened])
