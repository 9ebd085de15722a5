"""A soft skin on rigid meshes: the same as on geoms, one energy, and no cracks at hard edges."""

import itertools

import numpy as np
import pytest

from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.geometry.poses import rotated, rotation_of
from rough_maps import bumps
from solid_meshes import ball, ball_with_seams, body_of, box, cylinder, step

AT_REST = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
TURN = (0.9, 0.3, -0.2, np.sqrt(1.0 - 0.94))
HALF = (6e-3, 5e-3, 4e-3)


def flat_skin(**options):
    """Return a soft pad that faces up, its surface at z = 0."""
    pad = Body("pad", [Geom("box", (9e-3, 9e-3, 5e-3), (0.0, 0.0, -5e-3))])
    options = {"thickness": 3e-3, "modulus": 5e4, "taxels": (40, 40)} | options
    return SoftSkin(pad, **options)


def pressed(mesh, turn, depth=8e-4):
    """Return the pose at which a mesh reaches so far below z = 0, its lowest place over 0, 0."""
    low = mesh.vertices @ rotation_of(turn).T
    lowest = low[low[:, 2] < low[:, 2].min() + 1e-9].mean(axis=0)
    return np.array([1.3e-5 - lowest[0], 7e-6 - lowest[1], -lowest[2] - depth, *turn])


def turned(*angles):
    return rotated(np.array(AT_REST), angles)[3:]


def cases():
    """Return meshes and textures whose surface breaks in all ways, and how they are turned."""
    rough, flat = bumps(5, 6e-5), turned(0.0, 0.0, 0.3)
    yield "a smooth ball", body_of(ball(cuts=2)), TURN
    yield "a rough ball", body_of(ball(cuts=3), rough), TURN
    yield "a ball of facets", body_of(ball(cuts=2, hard_angle=0.0), bumps(5, 2e-5)), TURN
    yield "seams", body_of(ball_with_seams(), rough, "uv"), turned(0.5 * np.pi, 0.2, 0.1)
    yield "an edge", body_of(box(HALF), rough), turned(0.25 * np.pi, 0.0, 0.0)
    yield "an edge of a planar map", body_of(box(HALF), rough, "planar"), turned(0.6, 0.05, 0.1)
    yield "a corner", body_of(box(HALF), rough), turned(0.7, 0.6, 0.2)
    yield "a rim", body_of(cylinder(4e-3, 5e-3), rough), turned(0.8, 0.1, 0.0)
    yield "a groove", body_of(step(), rough), rotated(np.array([0, 0, 0, *flat]), (0, 2.4, 0))[3:]


CASES = [pytest.param(body, turn, id=name) for name, body, turn in cases()]


def at_case(body, turn):
    """Return the contact of a small skin with a body, and its pose."""
    pose = pressed(body.mesh, turn)
    return SkinContact(flat_skin(size=(5e-3, 5e-3)), [body], [pose]), pose


def energy_at(contact, pose):
    contact.place([pose])
    contact.wrench(AT_REST)
    return contact.energy


@pytest.mark.parametrize("mapping", ["smooth", "planar", "triplanar"])
def test_a_box_of_triangles_is_the_box(mapping):
    texture = None if mapping == "smooth" else bumps(1)
    mapping = "planar" if mapping == "smooth" else mapping
    solids = (
        Body("geom", [Geom("box", HALF)], texture, mapping),
        body_of(box(HALF), texture, mapping),
    )
    skin = flat_skin(friction=0.4, taxels=(48, 48), size=(7e-3, 6e-3))
    twist = [0.03, -0.02, 0.01, 1.0, 2.0, 0.5]
    for turn in (TURN, turned(0.02, 0.03, 0.4), turned(0.25 * np.pi, 0.0, 0.0), turned(2, 1, 0)):
        poses = [pressed(box(HALF), turn)]
        if abs(turn[0]) > 0.97:  # on the face: beside a side that rays enter geoms are not cut
            poses[0][:2] = 0.0
        one, other = (SkinContact(skin, [body], poses) for body in solids)
        force = one.wrench(AT_REST, twist)
        np.testing.assert_allclose(other.wrench(AT_REST, twist), force, atol=1e-9 * abs(force[2]))
        np.testing.assert_allclose(other.compression, one.compression, atol=1e-12)
        for name in ("stiffness", "damping"):
            matrix = getattr(one, name)()
            np.testing.assert_allclose(
                getattr(other, name)(), matrix, atol=1e-9 * np.abs(matrix).max()
            )


@pytest.mark.parametrize("depth", [1e-3, 3.5e-3, 5.5e-3, 7e-3])
@pytest.mark.parametrize("half", [4e-3, 5e-4])
def test_plates_deep_in_the_layer_are_as_geoms(depth, half):
    """Beyond the layer an exit counts up to twice its thickness, if the ray starts inside."""
    size, turn = (7e-3, 7e-3, half), turned(0.05, 0.02, 0.1)
    pose = [0.0, 0.0, half - depth, *turn]
    geom = SkinContact(flat_skin(), [Body("plate", [Geom("box", size)])], [pose])
    mesh = SkinContact(flat_skin(), [body_of(box(size))], [pose])
    geom.wrench(AT_REST)
    mesh.wrench(AT_REST)
    np.testing.assert_allclose(mesh.compression, geom.compression, atol=1e-12)


def test_a_mesh_that_is_not_convex_is_its_blocks():
    blocks = [
        Geom("box", (4e-3, 8e-3, 2e-3), (-4e-3, 0.0, -2e-3)),
        Geom("box", (4e-3, 8e-3, 4e-3), (4e-3, 0.0, 0.0)),
    ]
    for angle in (2.4, np.pi - 0.05, 0.3):
        pose = pressed(step(), turned(0.03, angle, 0.1), 2e-3)
        one = SkinContact(flat_skin(), [Body("blocks", blocks)], [pose])
        other = SkinContact(flat_skin(), [body_of(step())], [pose])
        np.testing.assert_allclose(
            other.wrench(AT_REST), one.wrench(AT_REST), atol=1e-9 * abs(one.wrench(AT_REST)[2])
        )


@pytest.mark.parametrize("texture", [None, bumps(2)], ids=["smooth", "rough"])
def test_a_ball_of_triangles_tends_to_the_ball(texture):
    """The error is a quarter where the triangles are half as large."""
    skin, pose = flat_skin(taxels=(64, 64)), [0.3e-3, 0.2e-3, 5.2e-3, *TURN]
    true = SkinContact(
        skin, [Body("ball", [Geom("sphere", (6e-3,))], texture, "triplanar")], [pose]
    )
    force, off = true.wrench(AT_REST)[2], []
    for cuts in (2, 3, 4):
        found = SkinContact(skin, [body_of(ball(cuts=cuts), texture)], [pose])
        off.append(abs(found.wrench(AT_REST)[2] / force - 1.0))
    assert off[0] > 3.0 * off[1] > 9.0 * off[2]
    assert off[2] < 0.02


@pytest.mark.parametrize(("body", "turn"), CASES)
def test_wrench_is_minus_the_gradient(body, turn):
    contact, pose = at_case(body, turn)
    wrench = -contact.wrench(AT_REST)
    assert np.count_nonzero(contact.compression) > 40
    # On the body, about the origin of the world.
    for axis in range(6):
        ends, step = [], 2e-9 if axis < 3 else 5e-7
        for sign in (-step, step):
            moved = pose.copy()
            if axis < 3:
                moved[axis] += sign
            else:
                turn_by = np.eye(3)[axis - 3] * sign
                moved = rotated(pose, turn_by)
                moved[:3] = rotation_of(rotated(np.array(AT_REST), turn_by)[3:]) @ pose[:3]
            ends.append(energy_at(contact, moved))
        found = -(ends[1] - ends[0]) / (2.0 * step)
        assert found == pytest.approx(
            wrench[axis], abs=1e-6 * np.abs(wrench[:3]).max() * (1.0 if axis < 3 else 6e-3)
        )


@pytest.mark.parametrize(("body", "turn"), CASES)
def test_the_energy_does_not_leap_along_a_path(body, turn):
    """What is left of its change when the work of the wrench is taken off falls with the way."""
    contact, pose = at_case(body, turn)
    way = np.array([9e-4, 1.3e-3, 1e-4])
    pose[:3] -= 0.5 * way

    def at(s):
        contact.place([np.concatenate([pose[:3] + s * way, pose[3:]])])
        return s, contact.wrench(AT_REST)[:3] @ way, contact.energy

    def left(one, two):
        return abs(two[2] - one[2] - 0.5 * (one[1] + two[1]) * (two[0] - one[0]))

    places = [at(s) for s in np.linspace(0.0, 1.0, 121)]
    most = max(place[2] for place in places)
    leaps = [left(*pair) for pair in itertools.pairwise(places)]
    for k in np.argsort(leaps)[-4:]:
        one, two = places[k], places[k + 1]
        for _ in range(16):
            middle = at(0.5 * (one[0] + two[0]))
            if left(one, middle) > left(middle, two):
                two = middle
            else:
                one = middle
        # 0.2 nm of way.
        assert abs(two[2] - one[2]) < 1e-6 * most


def test_tractions_add_up_to_the_wrench():
    skin = flat_skin(friction=0.6)
    pose = pressed(box(HALF), TURN)
    contact = SkinContact(skin, [body_of(box(HALF), bumps())], [pose])
    wrench = contact.wrench(AT_REST, [0.05, -0.02, 0.0, 0.1, 0.0, 2.0])
    force, points = contact.forces, contact.points
    close = {"atol": 1e-12 * np.abs(wrench).max()}
    np.testing.assert_allclose(force.sum(axis=(0, 1)), wrench[:3], **close)
    np.testing.assert_allclose(np.cross(points, force).sum(axis=(0, 1)), wrench[3:], **close)


def test_meshes_and_geoms_are_met_together():
    """What is deepest counts; a mesh that is far away changes nothing."""
    skin = flat_skin()
    sphere = Body("ball", [Geom("sphere", (3e-3,))], bumps(), "triplanar")
    solid = body_of(box((2e-3, 2e-3, 2e-3)), bumps())
    at, beside, far = ([x, 0.0, 2e-3, *TURN] for x in (-4e-3, 4e-3, 1.0))
    alone = SkinContact(skin, [sphere], [at]).wrench(AT_REST)
    other = SkinContact(skin, [solid], [beside]).wrench(AT_REST)
    np.testing.assert_array_equal(
        SkinContact(skin, [solid, sphere], [far, at]).wrench(AT_REST), alone
    )
    both = SkinContact(skin, [solid, sphere, solid], [beside, at, far])
    np.testing.assert_allclose(both.wrench(AT_REST), alone + other, atol=1e-12)


def test_what_is_refused_is_named_in_one_line():
    closed = box(HALF)
    opened = mesh_from_arrays(closed.vertices, closed.faces[:-2])
    with pytest.raises(AsperityError, match=r"'lid' is open, with 4 border edges.*closed") as one:
        SkinContact(flat_skin(), [body_of(opened, name="lid")])
    with pytest.raises(AsperityError, match=r"'lid' is a mesh.*DeformableSurface") as other:
        SoftSkin(body_of(closed, name="lid"), 1e-3, 1e5)
    assert "\n" not in str(one.value) + str(other.value)
