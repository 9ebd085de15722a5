"""The wrench of a soft skin is minus the gradient of its energy, whatever it meets."""

import numpy as np
import pytest

from asperity.contact.body_pair import BodyPair
from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.poses import rotated, rotation_between, rotation_of
from asperity.texture.patterns.patterns import sinusoid
from rough_maps import bumps

AT_ORIGIN = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
TURN = (0.9, 0.3, -0.2, np.sqrt(1.0 - 0.94))


def targets():
    """Return solids of every kind and mapping, each with where a pad touches it from below."""
    whole = {
        "box": (6e-3, 5e-3, 4e-3), "sphere": (6e-3,), "capsule": (4e-3, 5e-3),
        "ellipsoid": (7e-3, 5e-3, 4e-3), "cylinder": (4e-3, 5e-3), "plane": (0.0, 0.0),
    }  # fmt: skip
    for kind, size in whole.items():
        mappings = ["planar", "triplanar"]
        mappings += ["cylindrical"] if kind in ("cylinder", "capsule") else []
        for mapping in mappings:
            yield pytest.param(kind, size, mapping, id=f"{kind}-{mapping}")


def flat_skin(**options):
    """Return a soft pad that faces up."""
    slab = Body("pad", [Geom("box", (9e-3, 9e-3, 5e-3), (0.0, 0.0, -5e-3))])
    options = {"thickness": 3e-3, "modulus": 5e4, "taxels": (40, 40)} | options
    return SoftSkin(slab, **options)


def solid(kind, size, mapping):
    """Return a textured solid with its lowest point near the origin."""
    if kind == "plane":
        turn, lift = (0.0, 1.0, 0.0, 0.0), 0.0
        return Body(kind, [Geom(kind, size, (0.0, 0.0, lift), turn)], bumps(), mapping)
    turn = TURN
    if kind in ("capsule", "cylinder"):  # lying
        turn = (np.cos(0.25 * np.pi), 0.0, np.sin(0.25 * np.pi), 0.0)
    elif kind == "box":
        turn = (1.0, 0.0, 0.0, 0.0)
    geom = Geom(kind, size, (0.0, 0.0, 0.0), turn)
    low = BodyPair(flat_skin().body, Body(kind, [geom])).depth(
        AT_ORIGIN, AT_ORIGIN, (0.0, 0.0, -1.0)
    )
    return Body(kind, [Geom(kind, size, (0.0, 0.0, low.depth), turn)], bumps(), mapping)


def differences(contact, pose, step=2e-8):
    """Return minus the central differences of the energy by translation and rotation."""
    out = np.empty(6)
    for axis in range(6):
        energy = []
        for sign in (1.0, -1.0):
            moved = np.array(pose)
            if axis < 3:
                moved[axis] += sign * step
            else:
                turn = np.zeros(3)
                turn[axis - 3] = sign * step * 100.0
                moved = rotated(moved, turn)
            contact.wrench(moved)
            energy.append(contact.energy)
        out[axis] = -(energy[0] - energy[1]) / (2.0 * step * (1.0 if axis < 3 else 100.0))
    return out


@pytest.mark.parametrize(("kind", "size", "mapping"), [*targets()])
def test_wrench_is_minus_the_gradient(kind, size, mapping):
    # Smaller than the box: along its walls the compression leaps.
    contact = SkinContact(flat_skin(size=(8e-3, 8e-3)), [solid(kind, size, mapping)])
    pose = rotated(np.array([2e-4, -3e-4, 8e-4, 1.0, 0.0, 0.0, 0.0]), (0.03, -0.05, 0.4))
    wrench = contact.wrench(pose)
    assert np.count_nonzero(contact.pressure) > 50
    found = differences(contact, pose)
    scale = np.linalg.norm(wrench[:3])
    np.testing.assert_allclose(found[:3], wrench[:3], atol=1e-6 * scale)
    np.testing.assert_allclose(found[3:], wrench[3:], atol=1e-6 * scale * 5e-3)


@pytest.mark.parametrize(("kind", "size", "mapping"), [*targets()])
def test_the_largest_compression_is_the_certified_depth(kind, size, mapping):
    """All rays of a flat skin are parallel: its largest compression is the rigid depth."""
    target = solid(kind, size, mapping)
    skin = flat_skin(taxels=(400, 400))
    contact = SkinContact(skin, [target])
    pose = np.array([0.0, 0.0, 6e-4, 1.0, 0.0, 0.0, 0.0])
    contact.wrench(pose)
    rigid = BodyPair(skin.body, target).depth(pose, AT_ORIGIN, (0.0, 0.0, -1.0))
    assert contact.compression.max() <= rigid.depth + 1e-9
    assert contact.compression.max() == pytest.approx(rigid.depth, abs=1e-6)


def finger(**options):
    """Return a ridged ellipsoid with a soft lower side."""
    ridges = sinusoid(wavelength=4.5e-4, amplitude=3e-5)
    tip = Body("tip", [Geom("ellipsoid", (10e-3, 8e-3, 7e-3))], ridges)
    options = {
        "thickness": 2e-3,
        "modulus": 5e4,
        "taxels": (48, 48),
        "facing": (0, 0, -1),
        "size": (12e-3, 12e-3),
    } | options
    return SoftSkin(tip, **options)


def plate():
    """Return a rough plate whose top is at z = 0."""
    return Body("plate", [Geom("box", (0.05, 0.02, 4e-3), (0.0, 0.0, -4e-3))], bumps(3))


def test_a_ridged_finger_on_a_rough_plate():
    contact = SkinContact(finger(), [plate()], centre=(0.0, 0.0, 2e-3))
    pose = rotated(np.array([1e-3, 2e-3, 6.4e-3, 1.0, 0.0, 0.0, 0.0]), (0.1, 0.2, 0.5))
    wrench = contact.wrench(pose)
    # The torque is about the centre; the poses turn about the frame's origin.
    found = differences(contact, pose)
    arm = rotation_of(pose[3:]) @ np.array([0.0, 0.0, 2e-3])
    about_origin = wrench[3:] + np.cross(arm, wrench[:3])
    scale = np.linalg.norm(wrench[:3])
    np.testing.assert_allclose(found[:3], wrench[:3], atol=1e-6 * scale)
    np.testing.assert_allclose(found[3:], about_origin, atol=1e-6 * scale * 7e-3)


def test_tractions_add_up_to_the_wrench():
    skin = finger(friction=0.6)
    contact = SkinContact(skin, [plate()], centre=(0.0, 0.0, 2e-3))
    pose = rotated(np.array([1e-3, 2e-3, 6.4e-3, 1.0, 0.0, 0.0, 0.0]), (0.1, 0.2, 0.5))
    wrench = contact.wrench(pose, [0.05, -0.02, 0.0, 0.1, 0.0, 2.0])
    turn = rotation_of(pose[3:])
    area = skin.as_grid(skin.arrays.area)
    rays = skin.as_grid(skin.arrays.inwards) @ turn.T
    along = skin.as_grid(skin.arrays.along) @ turn.T
    force = contact.pressure[..., None] * rays
    force += (contact.shear[..., None] * along).sum(axis=-2)
    force *= area[..., None]
    origin = pose[:3] + turn @ np.array([0.0, 0.0, 2e-3])
    has = area > 0.0
    torque = np.cross(contact.points[has] - origin, force[has]).sum(axis=0)
    np.testing.assert_allclose(force[has].sum(axis=0), wrench[:3], atol=1e-9 * abs(wrench).max())
    np.testing.assert_allclose(torque, wrench[3:], atol=1e-9 * abs(wrench).max())


def test_a_closed_path_returns_its_work():
    contact = SkinContact(finger(), [plate()])
    angle = np.linspace(0.0, 2.0 * np.pi, 3001)
    poses = []
    for a in angle:
        pose = np.array([1e-3 * np.cos(a), 1e-3 * np.sin(2 * a), 6.3e-3 + 5e-4 * np.sin(a),
                         1.0, 0.0, 0.0, 0.0])  # fmt: skip
        poses.append(rotated(pose, (0.1 * np.sin(a), 0.1 * np.cos(3 * a), 0.0)))
    wrenches = np.array([contact.wrench(pose) for pose in poses])
    work = moved = 0.0
    for i in range(len(poses) - 1):
        step = np.concatenate(
            [poses[i + 1][:3] - poses[i][:3], rotation_between(poses[i], poses[i + 1])]
        )
        part = 0.5 * (wrenches[i] + wrenches[i + 1]) @ step
        work, moved = work + part, moved + abs(part)
    assert abs(work) < 1e-3 * moved


def test_friction_only_takes_energy():
    contact = SkinContact(finger(friction=0.5), [plate()])
    pose = [0.0, 0.0, 6.4e-3, 1.0, 0.0, 0.0, 0.0]
    rest = contact.wrench(pose)
    rng = np.random.default_rng(4)
    for _ in range(20):
        twist = rng.standard_normal(6) * [0.1, 0.1, 0.1, 5.0, 5.0, 5.0]
        drag = contact.wrench(pose, twist) - rest
        assert drag @ twist < 0.0
        np.testing.assert_allclose(contact.damping() @ twist, -drag, atol=1e-9 * abs(drag).max())
        assert np.linalg.eigvalsh(contact.damping()).min() > -1e-9
    # Fast sliding: the coefficient times the normal force, within what slopes add.
    drag = contact.wrench(pose, [10.0, 0, 0, 0, 0, 0]) - rest
    assert -drag[0] == pytest.approx(0.5 * rest[2], rel=0.05)


def test_stiffness_is_that_of_the_springs():
    """Over a flat plate, where nothing is left out, it is the derivative of the wrench."""
    flat = Body("plate", [Geom("plane", (0.0, 0.0))])
    contact = SkinContact(finger(), [flat])
    pose = np.array([0.0, 0.0, 6.3e-3, 1.0, 0.0, 0.0, 0.0])
    contact.wrench(pose)
    stiffness = contact.stiffness()
    step = 1e-8
    for axis in (0, 1, 2):
        moved = [contact.wrench(pose + s * np.eye(7)[axis]) for s in (step, -step)]
        slope = -(moved[0] - moved[1]) / (2.0 * step)
        np.testing.assert_allclose(slope, stiffness[:, axis], atol=1e-3 * stiffness[2, 2])
    assert np.linalg.eigvalsh(stiffness).min() > -1e-9 * stiffness[2, 2]


def test_many_bodies_count_once():
    """Two plates side by side are as one."""
    one = SkinContact(finger(), [Body("plate", [Geom("box", (0.02, 0.02, 4e-3))])])
    halves = [Geom("box", (0.01, 0.02, 4e-3), (x, 0.0, 0.0)) for x in (-0.01, 0.01)]
    two = SkinContact(finger(), [Body("left", halves[:1]), Body("right", halves[1:])])
    pose = [3e-4, 0.0, 10.4e-3, 1.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(two.wrench(pose), one.wrench(pose), atol=1e-12)


def test_far_away_there_is_nothing():
    contact = SkinContact(finger(), [plate()])
    wrench = contact.wrench([0.0, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0])
    assert not wrench.any()
    assert contact.energy == 0.0
    assert not contact.pressure.any()
    # Upside down the soft side looks away, also where the tool is in the plate.
    assert not contact.wrench([0.0, 0.0, 6.4e-3, 0.0, 1.0, 0.0, 0.0]).any()
