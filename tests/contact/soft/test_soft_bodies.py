"""Soft bodies of a scene under a rigid tool, and rigid lumps within a skin."""

import numpy as np
import pytest

from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.poses import rotated, rotation_of
from asperity.scene.builtin import load_scene
from asperity.scene.scene import scene_of
from asperity.simulation.simulation import Simulation
from asperity.simulation.skin_engine import SkinEngine
from asperity.studies.comparison.compare import compare
from asperity.studies.stability.measure import measure_stability

SLAB = Body("slab", [Geom("box", (0.02, 0.02, 0.005))])
BALL = Body("ball", [Geom("sphere", (0.006,))])
H = 0.008
LUMP = (0.003, -0.002, 0.001, 0.0025)


def pressed(lumps=(), depth=5e-4):
    """Return the contact of a slab's soft top with a wide plate that presses it flat."""
    skin = SoftSkin(SLAB, H, 2e4, 0.3, taxels=(40, 40), lumps=lumps)
    plate = Body("plate", [Geom("box", (0.03, 0.03, 0.002))])
    contact = SkinContact(skin, [plate], [(0.0, 0.0, 0.007 - depth, 1.0, 0.0, 0.0, 0.0)])
    contact.wrench((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    return contact


def test_pressure_over_a_lump_is_that_of_a_thinner_layer():
    plain, over = pressed(), pressed([LUMP])
    x, y, z, radius = LUMP
    at = over.points
    square = (at[..., 0] - x) ** 2 + (at[..., 1] - y) ** 2
    left = 0.005 - (z + np.sqrt(np.maximum(radius**2 - square, 0.0)))
    local = np.where(square < radius**2, left, H)
    np.testing.assert_allclose(over.pressure, plain.pressure * H / local, rtol=1e-9)
    assert over.pressure.max() > 3.0 * plain.pressure.max()


@pytest.mark.parametrize(
    ("lump", "words"),
    [
        ((0.0, 0.0, 0.004, 0.0011), "below the surface"),
        ((0.0, 0.0, -0.02, 0.002), "lies under no taxel"),
        ((0.0, 0.0, 0.0, -0.002), "radius of lump 0"),
        ((0.0, 0.0, 0.0), "lump 0"),
        ((0.0, 0.0, float("nan"), 0.002), "lump 0"),
    ],
)
def test_impossible_lumps_are_refused(lump, words):
    with pytest.raises(AsperityError, match=words) as refused:
        SoftSkin(SLAB, H, 2e4, lumps=[lump])
    assert "\n" not in str(refused.value)


def engine(name="palpation", **skin):
    body = "tissue" if name == "palpation" else "sponge"
    table = {"friction": 0.0, "taxels": [48, 64]} | skin
    scene = load_scene(name).changed(bodies={body: {"skin": table}})
    return scene, SkinEngine(scene, scene.skin)


def poses(scene, count=6):
    draw = np.random.default_rng(0)
    for _ in range(count):
        pose = scene.start.copy()
        pose[:3] += draw.uniform((-5e-3, -5e-3, -3e-3), (0.02, 5e-3, -1e-3))
        yield rotated(pose, draw.normal(size=3))


@pytest.mark.parametrize("name", ["palpation", "sponge"])
def test_force_on_the_tool_is_the_gradient_of_the_energy(name):
    scene, contact = engine(name)
    for pose in poses(scene):
        wrench, numeric = contact.wrench(pose, 0.0), np.zeros(6)
        assert wrench[2] > 0.0
        turn = rotation_of(pose[3:])
        for i in range(6):
            step, energies = (1e-8 if i < 3 else 1e-6), []
            for sign in (1.0, -1.0):
                moved, axis = pose.copy(), np.eye(3)[i % 3] * sign * step
                if i < 3:
                    moved[:3] += axis
                else:  # about the centre of mass
                    moved = rotated(pose, axis)
                    moved[:3] += (turn - rotation_of(moved[3:])) @ contact.centre
                contact.wrench(moved, 0.0)
                energies.append(contact.energy)
            numeric[i] = (energies[1] - energies[0]) / (2.0 * step)
        np.testing.assert_allclose(wrench[:3], numeric[:3], atol=2e-6 * np.abs(wrench[:3]).max())
        np.testing.assert_allclose(wrench[3:], numeric[3:], atol=2e-6 * np.abs(wrench[3:]).max())


def test_taxels_far_from_the_tool_are_rightly_left_out():
    scene, contact = engine()
    for pose in poses(scene):
        found = contact.wrench(pose, 0.0).copy()
        pressure = contact.skin.pressure
        bound = contact.skin._solids.bound
        kept = bound.copy()
        bound[:] = np.inf
        np.testing.assert_allclose(contact.wrench(pose, 0.0), found, rtol=1e-12, atol=1e-15)
        np.testing.assert_array_equal(contact.skin.pressure, pressure)
        bound[:] = kept


def test_a_soft_body_is_the_soft_tool_turned_round():
    scene, contact = engine()
    other = SkinContact(scene.skin, [body for body in scene.bodies if body.name == scene.tool])
    for pose in poses(scene, 3):
        force = contact.wrench(pose, 0.0)[:3]
        # The slab is moved in the tool's frame.
        turn = rotation_of(pose[3:]).T
        quaternion = pose[3:] * [1.0, -1.0, -1.0, -1.0]
        home = contact._home
        at = np.concatenate([turn @ (home[:3] - pose[:3]), quaternion])
        np.testing.assert_allclose(-turn.T @ other.wrench(at)[:3], force, rtol=1e-9, atol=1e-12)


def test_friction_on_a_soft_body_holds_the_tool_back():
    scene, contact = engine(friction=0.5)
    first = scene.start.copy()
    first[2] -= 2e-3
    contact.wrench(first, 1e-3)
    first[0] += 5e-5  # 50 mm/s
    wrench = contact.wrench(first, 1e-3)
    damped = contact.derivatives().damped
    assert damped[0] == pytest.approx(-0.5 * wrench[2], rel=0.1)
    assert wrench[0] < -0.3 * wrench[2]


def test_the_lump_is_felt_where_it_is():
    scene = load_scene("palpation").changed(coupling={"mode": "direct"})
    simulation = Simulation(scene)
    simulation.step(simulation.trajectory().poses[0])
    rollout = simulation.rollout()
    at = rollout.tool_pose[np.argmax(rollout.contact_wrench[:, 2]), :2]
    np.testing.assert_allclose(at, scene.skin.lumps[0][:2], atol=1.5e-3)
    assert rollout.contact_wrench[:, 2].max() > 2.0 * np.median(rollout.contact_wrench[:, 2])


def test_scenes_with_soft_bodies_survive_a_folder(tmp_path):
    for name in ("sponge", "palpation", "tactile-map"):
        scene = load_scene(name)
        scene.save(tmp_path / name)
        again = load_scene(tmp_path / name)
        np.testing.assert_array_equal(again.skin.arrays.modulus, scene.skin.arrays.modulus)
        assert again.skin.body.name == scene.skin.body.name


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"tool": {"skin": {"thickness": 1e-3, "modulus": 1e4}}}, "a scene has one soft skin"),
        ({"bodies": {"probe": {"skin": {"thickness": 1e-3, "modulus": 1e4}}}}, "one soft skin"),
        ({"bodies": {"tissue": {"skin": {"lumps": 3}}}}, r"lumps must be a list of lists"),
        (
            {"bodies": {"tissue": {"skin": {"lump": 3}}}},
            r"did you mean bodies\.tissue\.skin\.lumps",
        ),
        ({"bodies": {"tissue": {"skin": {"modulus": -1.0}}}}, r"bodies\.tissue\.skin: modulus"),
    ],
)
def test_wrong_tables_are_named(changed, words):
    with pytest.raises(AsperityError, match=words) as refused:
        load_scene("palpation").changed(**changed)
    assert "\n" not in str(refused.value)


def test_the_tools_own_skin_has_its_own_table():
    table = {"thickness": 1e-3, "modulus": 1e4}
    with pytest.raises(AsperityError, match=r"its skin is \[tool\.skin\]"):
        load_scene("finger-plate").changed(tool={"skin": None}, bodies={"finger": {"skin": table}})


def test_a_third_body_is_refused():
    plate = load_scene("probe-plate")
    more = '<worldbody><body name="post" pos="0 0.015 0"><geom size="0.002"/></body>'
    document = {
        "schema": 1, "tool": {"body": "probe"},
        "bodies": {"plate": {"skin": {"thickness": 1e-3, "modulus": 1e4}}},
    }  # fmt: skip
    assert scene_of(plate.xml, document).skin.body.name == "plate"
    with pytest.raises(AsperityError, match="there is 'post'; leave it out, or have it only seen"):
        scene_of(plate.xml.replace("<worldbody>", more), document)


@pytest.mark.parametrize("measure", [measure_stability, lambda scene: compare(scene, [])])
def test_what_has_no_skin_refuses_one(measure):
    with pytest.raises(AsperityError, match="palpation has a soft skin") as refused:
        measure(load_scene("palpation"))
    assert "\n" not in str(refused.value)
