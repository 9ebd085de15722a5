"""Forces on the vertices of a deformable surface are minus the gradient of one energy."""

import itertools

import numpy as np
import pytest
from soft_sheets import LAYER, TURN, sheet, surface_on, tool, wavy

from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.poses import rotated, rotation_of
from rough_maps import bumps

POSE = np.array([1e-3, -2e-3, 5.3e-3, *TURN])
CENTRE = (1e-3, 2e-3, 3e-3)


@pytest.fixture(scope="module")
def pressed():
    """Return the contact of a textured tool on a textured sheet with random displacements."""
    surface = surface_on(wavy(), texture=bumps())
    contact = SurfaceContact(surface, [tool()], centres=[CENTRE])
    shift = np.random.default_rng(1).normal(size=(len(surface.mesh.vertices), 3))
    vertices = surface.mesh.vertices + 2e-4 * shift
    contact.press(vertices, [POSE])
    return contact, vertices


def difference(energy, step):
    """Return the derivative of an even order of an energy of one number."""
    near, far = energy(step) - energy(-step), energy(2 * step) - energy(-2 * step)
    return (8.0 * near - far) / (12.0 * step)


def test_forces_on_vertices_are_minus_the_gradient(pressed):
    contact, vertices = pressed
    contact.press(vertices, [POSE])
    forces = contact.forces
    largest = np.abs(forces).max()
    assert contact.out.pressed[-1] > 100
    for vertex in np.argsort(-np.linalg.norm(forces, axis=1))[:25]:
        for axis in range(3):

            def energy(h, vertex=vertex, axis=axis):
                moved = vertices.copy()
                moved[vertex, axis] += h
                contact.press(moved, [POSE])
                return contact.energy

            assert abs(difference(energy, 2e-7) + forces[vertex, axis]) < 1e-6 * largest


def test_the_wrench_on_the_tool_is_minus_the_gradient(pressed):
    contact, vertices = pressed
    contact.press(vertices, [POSE])
    wrench = contact.wrenches[0]
    for axis in range(6):

        def energy(h, axis=axis):
            pose = POSE.copy()
            if axis < 3:
                pose[axis] += h
            else:
                turn = np.eye(3)[axis - 3] * h * 100.0
                at = POSE[:3] + rotation_of(POSE[3:]) @ CENTRE
                pose[3:] = rotated(POSE, turn)[3:]
                pose[:3] = at - rotation_of(pose[3:]) @ CENTRE
            contact.press(vertices, [pose])
            return contact.energy

        scale = 1.0 if axis < 3 else 100.0
        found = -difference(energy, 2e-7) / scale
        assert found == pytest.approx(wrench[axis], abs=1e-6 * np.abs(wrench[:3]).max())


def test_forces_and_wrenches_balance(pressed):
    contact, vertices = pressed
    contact.press(vertices, [POSE])
    forces, wrench = contact.forces, contact.wrenches[0]
    centre = POSE[:3] + rotation_of(POSE[3:]) @ CENTRE
    total = np.concatenate([forces.sum(axis=0), np.cross(vertices - centre, forces).sum(axis=0)])
    np.testing.assert_allclose(total, -wrench, atol=1e-12 * np.abs(wrench).max())
    per_taxel = contact.out.force.sum(axis=0)
    np.testing.assert_allclose(per_taxel, -wrench[:3], atol=1e-12)


def test_all_vertices_moved_rigidly_are_the_body_moved(pressed):
    contact, vertices = pressed
    turn = rotation_of(np.array([0.8, -0.4, 0.4, 0.2]))
    shift = np.array([0.02, -0.01, 0.03])
    contact.press(vertices, [POSE])
    forces, wrench, energy = contact.forces, contact.wrenches[0], contact.energy
    pose = np.concatenate([turn @ POSE[:3] + shift, _product((0.8, -0.4, 0.4, 0.2), POSE[3:])])
    contact.press(vertices @ turn.T + shift, [pose])
    assert contact.energy == pytest.approx(energy, rel=1e-9)
    scale = np.abs(forces).max()
    np.testing.assert_allclose(contact.forces, forces @ turn.T, atol=1e-9 * scale)
    np.testing.assert_allclose(contact.wrenches[0][:3], turn @ wrench[:3], atol=1e-9 * scale)


def _product(a, b):
    w, x, y, z = a
    return np.array([
        [w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]
    ]) @ np.asarray(b)  # fmt: skip


def test_a_flat_sheet_at_rest_is_the_soft_skin():
    """The same taxels give the same wrench, to rounding."""
    side, n = 24e-3, 60
    squares = sheet(n + 1, half=0.5 * side)
    surface = surface_on(squares, pitch=1.0, friction=0.3)  # one taxel for each triangle
    ball = Body("ball", [Geom("sphere", (6e-3,))], bumps(2), "triplanar")
    contact = SurfaceContact(surface, [ball])
    pose = np.array([0.3e-3, 0.2e-3, 5e-3, *TURN])
    twist = np.array([0.03, -0.02, 0.01, 1.0, 2.0, 0.5])
    contact.press(squares.vertices, [pose], twists=[twist])
    pad = Body("pad", [Geom("box", (12e-3, 12e-3, 5e-3), (0.0, 0.0, -5e-3))])
    layer = {key: LAYER[key] for key in ("thickness", "modulus")}
    total = np.zeros(6)
    # The middles of triangles are two grids of squares, moved by a sixth of a square.
    for sign in (1.0, -1.0):
        shift = sign * side / n / 6.0
        skin = SoftSkin(
            pad, **layer, taxels=(n, n), size=(side, side), middle=(shift, -shift, 0.0),
            friction=0.3,
        )  # fmt: skip
        found = SkinContact(skin, [ball], [pose])
        total -= 0.5 * found.wrench((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), -_at(twist, -pose[:3]))
        total[3:] += 0.5 * np.cross(
            pose[:3], found.wrench((0, 0, 0, 1, 0, 0, 0), -_at(twist, -pose[:3]))[:3]
        )
    np.testing.assert_allclose(contact.wrenches[0], total, atol=1e-12 * np.abs(total).max())


def _at(twist, arm):
    """Return a twist at a point `arm` further."""
    return np.concatenate([twist[:3] + np.cross(twist[3:], arm), twist[3:]])


def test_more_taxels_converge():
    """The wrench on a smooth sheet changes by a quarter where the pitch is halved."""
    ball = Body("ball", [Geom("sphere", (6e-3,))])
    wrenches = []
    for pitch in (8e-4, 4e-4, 2e-4, 1e-4):
        contact = SurfaceContact(surface_on(wavy(), pitch=pitch), [ball])
        contact.press(wavy().vertices, [(1e-3, 0.0, 6.3e-3, 1.0, 0.0, 0.0, 0.0)])
        wrenches.append(contact.wrenches[0])
    changes = [np.abs(b - a).max() for a, b in itertools.pairwise(wrenches)]
    assert changes[-1] < 1e-3 * np.abs(wrenches[-1]).max()
    assert changes[-1] < 0.5 * changes[0]


def test_a_ball_on_a_flat_layer_has_the_closed_form():
    """Johnson 1985, section 4.3: F = pi K R d^2, contact radius sqrt(2 R d), to 1 %."""
    flat, radius, depth = sheet(25, half=8e-3), 20e-3, 2e-4
    surface = surface_on(flat, pitch=5e-5)
    contact = SurfaceContact(surface, [Body("ball", [Geom("sphere", (radius,))])])
    contact.press(flat.vertices, [(2e-5, 1e-5, radius - depth, 1.0, 0.0, 0.0, 0.0)])
    force = np.pi * surface.stiffness_per_area * radius * depth**2
    assert contact.wrenches[0][2] == pytest.approx(force, rel=0.01)
    found = np.sqrt(contact.contact_area / np.pi)
    assert found == pytest.approx(np.sqrt(2.0 * radius * depth), rel=0.01)


def test_pressure_of_a_flat_punch_is_flat():
    flat = sheet(9)
    contact = SurfaceContact(surface_on(flat), [Body("punch", [Geom("cylinder", (5e-3, 5e-3))])])
    contact.press(flat.vertices, [(0.0, 0.0, 5e-3 - 1e-4, 1.0, 0.0, 0.0, 0.0)])
    pressure = contact.pressure[contact.pressure > 0.0]
    expected = contact.surface.stiffness_per_area * 1e-4
    np.testing.assert_allclose(pressure, expected, rtol=1e-9)


def test_friction_holds_against_motion_and_takes_energy(pressed):
    contact, vertices = pressed
    surface = surface_on(contact.surface.mesh, texture=bumps(), friction=0.5)
    rough = SurfaceContact(surface, [tool()])
    for seed in range(5):
        rng = np.random.default_rng(seed)
        twist, speeds = 0.05 * rng.normal(size=6), 0.02 * rng.normal(size=vertices.shape)
        rough.press(vertices, [POSE])
        still, on_tool = rough.forces, rough.wrenches[0]
        rough.press(vertices, [POSE], velocities=speeds, twists=[twist])
        power = ((rough.forces - still) * speeds).sum()
        power += (rough.wrenches[0] - on_tool) @ twist
        assert power < 0.0
