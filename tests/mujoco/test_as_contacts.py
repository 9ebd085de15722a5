"""Contacts with texture obey MuJoCo's mechanics and asperity's law at once."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured
from asperity.scene.builtin.probe_plate import probe_plate
from asperity.simulation.simulation import Simulation

WAVES = {"wavelength": 1.5e-3, "amplitude": 1e-4}
BALL = """<mujoco><option timestep="0.001" gravity="0 0 0" cone="{cone}" integrator="{integrator}"/>
<worldbody>
  <body name="plate" pos="0 0 -.004"><geom name="slab" type="box" size=".05 .02 .004" condim="1"/>
  </body>
  <body name="ball" pos="{x} 0 .0016">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <geom name="tip" size=".0015" mass=".05" condim="1"/>
  </body>
</worldbody>
<actuator><position joint="x" kp="500" kv="10"/><motor joint="z"/></actuator></mujoco>"""
PLATE = """<mujoco><option timestep="0.002" cone="elliptic" impratio="10"/>
<worldbody><geom name="plate" type="box" size=".1 .1 .005" pos="0 0 -.005"/>{bodies}</worldbody>
</mujoco>"""


def ball(x=0.0, cone="elliptic", integrator="Euler"):
    xml = BALL.format(x=x, cone=cone, integrator=integrator)
    model = mujoco.MjModel.from_xml_string(xml)
    return model, mujoco.MjData(model)


def dragged(steps=800, *, dissipation=5.0, push=-0.58, **options):
    """Drag the ball over waves; return what each step found."""
    model, data = ball(**options)
    surfaces = textured.attach(
        model, {"plate": textured.pattern("sinusoid", **WAVES)}, stiffness=2000.0,
        dissipation=dissipation,
    )  # fmt: skip
    rows = []
    data.ctrl[1] = push
    for i in range(steps):
        data.ctrl[0] = 83e-6 * max(0, i - 300)
        place = data.qpos.copy()
        surfaces.step(data)
        normal = data.contact.frame[0, :3].copy() if data.ncon else np.full(3, np.nan)
        depth = -float(data.contact.dist[0]) if data.ncon else 0.0
        rows.append((place, data.qfrc_constraint.copy(), normal, depth))
    return rows


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "implicit"])
def test_lateral_force_is_the_normal_force_times_the_slope(integrator):
    rows = [row for row in dragged(integrator=integrator) if row[3] > 0.0]
    assert len(rows) > 500
    steepest = 0.0
    for _, force, normal, _ in rows:
        assert abs(force[0] - force[1] * normal[0] / normal[2]) < 1e-9
        steepest = max(steepest, abs(normal[0] / normal[2]))
    assert 0.3 < steepest < 2.0 * np.pi * 1e-4 / 1.5e-3 * 1.01


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_at_rest_the_contact_is_f_over_k_deep(cone):
    _, _, _, depth = dragged(300, dissipation=50.0, cone=cone)[-1]
    assert depth == pytest.approx(0.58 / 2000.0, rel=0.01)


def test_the_same_path_in_asperity_has_the_same_force():
    rows = dragged(700, dissipation=0.0, push=-1.5, x=-0.03)
    scene = probe_plate({"kind": "sinusoid", **WAVES}).changed(
        force={"stiffness": 2000.0, "anti_alias": "off"}
    )
    simulation, worst, largest = Simulation(scene), 0.0, 0.0
    for place, force, _, _ in rows:
        pose = np.array([place[0] - 0.03, 0.0, place[1] + 0.0016, 1.0, 0.0, 0.0, 0.0])
        wanted = simulation.step(pose)[[0, 2]]
        largest = max(largest, float(np.linalg.norm(wanted)))
        worst = max(worst, float(np.linalg.norm(wanted - force)))
    assert largest > 1.0
    assert worst < 0.01 * largest


def test_energy_does_not_grow_on_a_closed_path():
    model = mujoco.MjModel.from_xml_string(BALL.format(x=0, cone="elliptic", integrator="Euler"))
    data = mujoco.MjData(model)
    surfaces = textured.attach(
        model, {"plate": textured.pattern("sin_product", **WAVES)}, stiffness=2000.0, dissipation=0
    )
    turns = np.linspace(0.0, 2.0 * np.pi, 4001)
    work, moved = 0.0, 0.0
    x, z = 1e-3 * np.cos(turns), -4e-4 + 5e-5 * np.sin(turns)
    for i in range(len(turns) - 1):
        data.qpos[:] = 0.5 * (x[i] + x[i + 1]), 0.5 * (z[i] + z[i + 1])
        surfaces.forward(data)
        step = np.array([x[i + 1] - x[i], z[i + 1] - z[i]])
        work += float(data.qfrc_constraint @ step)
        moved += float(np.abs(data.qfrc_constraint @ step))
    assert moved > 1e-5
    assert abs(work) < 2e-3 * moved


ROUGH = textured.pattern(
    "rough", size=0.0256, pixel_size=1e-4, hurst=0.8, rms_slope=0.2, cutoff=4e-4
)
WAVY = textured.pattern("sinusoid", wavelength=4e-3, amplitude=1e-4)
ON = {
    "waves": (WAVY, None, 0),
    "knurl on knurl": (textured.pattern("knurl", pitch=2e-3),) * 2 + (0,),
    "rough on rough": (ROUGH, ROUGH, 0),
    **{f"rough on rough, turned by {yaw}": (ROUGH, ROUGH, yaw) for yaw in (17, 27, 44, 65)},
    "dots": (textured.pattern("jittered_dots"), None, 45),
    "rough on stripes": (textured.pattern("stripes"), ROUGH, 0),
    "brushed on rough": (ROUGH, textured.pattern("brushed"), 0),
}


@pytest.mark.parametrize("pair", ON)
def test_a_cube_rests(pair):
    plate, own, yaw = ON[pair]
    cube = (
        f'<body name="cube" pos=".0007 0 .0206" euler="0 0 {yaw}"><freejoint/>'
        '<geom name="cube" type="box" size=".02 .02 .02" mass=".1"/></body>'
    )
    model = mujoco.MjModel.from_xml_string(PLATE.format(bodies=cube))
    data = mujoco.MjData(model)
    textures = {"plate": plate} if own is None else {"plate": plate, "geom:cube": own}
    surfaces = textured.attach(model, textures)
    surfaces.step(data, 2000)
    start, farthest = data.qpos.copy(), 0.0
    for _ in range(10):  # ten seconds
        surfaces.step(data, 500)
        farthest = max(farthest, float(np.linalg.norm(data.qpos[:2] - start[:2])))
    assert farthest < 1e-5
    assert np.abs(data.qpos[2:] - start[2:]).max() < 5e-3
    assert float(np.linalg.norm(data.qvel)) < 1e-4  # it does not rock


@pytest.mark.parametrize(
    ("pair", "yaw", "tilt"),
    [
        ("waves", 37, 0), ("knurl on knurl", 3, 0), ("knurl on knurl", 52, 35), ("dots", 37, 0),
        ("rough on stripes", 3, 35), ("brushed on rough", 52, 0),
    ],
)  # fmt: skip
def test_what_is_dropped_gains_no_energy(pair, yaw, tilt):
    plate, own, _ = ON[pair]
    slab = (
        f'<body name="slab" pos=".0007 0 .04" euler="{tilt} 20 {yaw}"><freejoint/>'
        '<geom name="cube" type="box" size=".03 .012 .006" mass=".1"/></body>'
    )
    model = mujoco.MjModel.from_xml_string(PLATE.format(bodies=slab))
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    surfaces = textured.attach(model, {"plate": plate} | ({"geom:cube": own} if own else {}))
    lowest, energies = 0.1 * 9.81 * 0.006, []  # it cannot be lower than flat on the plate
    for _ in range(400):
        surfaces.step(data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        energies.append(float(data.energy.sum()) - lowest)
    assert max(energies[60:]) < energies[0]  # it has met the plate by then


LEAPT = [
    [
        0.0003526982119538221, -0.0005864604330255437, 0.021338231446958192,
        0.9929737397583762, 0.01338856809656543, -0.008164208624414521, 0.11729127884086313,
    ],
    [
        0.0003526984327485792, -0.0005864603732071835, 0.021338231445508997,
        0.9929737397960338, 0.01338856742462453, -0.008164203891295107, 0.1172912789282146,
    ],
    [
        0.00035269909502977695, -0.0005864601939129747, 0.021338231441164656,
        0.9929737399089956, 0.013388565412274993, -0.008164189694589605, 0.11729127918977715,
    ],
]  # fmt: skip


def test_contacts_of_a_tilted_cube_do_not_leap():
    # Across an edge at the plate's rim the budget is spent: 0.01, 0.12 and 0.26 mm were found here.
    model = mujoco.MjModel.from_xml_string(
        PLATE.format(
            bodies='<body name="cube" pos="0 0 .0206"><freejoint/>'
            '<geom name="cube" type="box" size=".02 .02 .02" mass=".1"/></body>'
        )
    )
    found = []
    for pose in LEAPT:
        data = mujoco.MjData(model)
        data.qpos[:] = pose
        textured.attach(model, {"plate": ROUGH, "geom:cube": ROUGH}).forward(data)
        found.append(data.contact.dist.copy())
    assert len(found[0]) > 0
    assert all(len(dist) == len(found[0]) for dist in found)
    assert np.abs(np.array(found) - found[0]).max() < 1e-7


def test_what_rests_slides_when_it_is_pushed_and_rests_again():
    cube = (
        '<body name="cube" pos="0 0 .0206"><freejoint/>'
        '<geom name="cube" type="box" size=".02 .02 .02" mass=".1"/></body>'
    )
    model = mujoco.MjModel.from_xml_string(PLATE.format(bodies=cube))
    data = mujoco.MjData(model)
    surfaces = textured.attach(
        model, {"plate": WAVY, "geom:cube": textured.texture(WAVY, friction=0.4)}
    )
    surfaces.step(data, 1500)
    weight, start = 0.1 * 9.81, data.qpos.copy()
    data.xfrc_applied[1, 0] = 0.25 * weight
    surfaces.step(data, 1000)
    assert abs(data.qpos[0] - start[0]) < 2e-4  # it sticks
    data.xfrc_applied[1, 0] = 0.8 * weight
    surfaces.step(data, 40)
    assert data.qpos[0] - start[0] > 3e-3
    data.xfrc_applied[1, 0] = 0.0
    surfaces.step(data, 1500)
    start = data.qpos.copy()
    surfaces.step(data, 1000)
    assert np.abs(data.qpos - start)[:3].max() < 1e-6
    assert np.abs(data.qpos - start).max() < 5e-5
    # What is laid on it is borne.
    data.xfrc_applied[1, 2] = -2.0 * weight
    surfaces.step(data, 1000)
    force = np.zeros(6)
    total = np.zeros(3)
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, force)
        total += force[:3] @ data.contact.frame[i].reshape(3, 3)
    assert abs(total[2]) == pytest.approx(3.0 * weight, rel=1e-3)


SOLIDS = {
    "sphere": 'type="sphere" size=".01"',
    "capsule": 'type="capsule" size=".01 .02" euler="0 80 0"',
    "box": 'type="box" size=".01 .015 .02" euler="3 0 0"',
}


@pytest.mark.parametrize("solid", SOLIDS)
def test_without_amplitude_the_result_is_mujocos_own(solid):
    body = f'<body pos="0 0 .04"><freejoint/><geom name="solid" {SOLIDS[solid]} mass=".1"/></body>'
    states = []
    for with_texture in (False, True):
        model = mujoco.MjModel.from_xml_string(PLATE.format(bodies=body))
        data = mujoco.MjData(model)
        step = lambda d, m=model: mujoco.mj_step(m, d)  # noqa: E731
        if with_texture:
            flat = textured.pattern("sinusoid", wavelength=1e-3, amplitude=0.0)
            step = textured.attach(model, {"plate": flat}).step
        for _ in range(400):
            step(data)
        states.append(np.concatenate([data.qpos, data.qvel, data.qacc]))
    assert np.array_equal(*states)


@pytest.mark.parametrize("solid", SOLIDS)
def test_depth_and_place_of_a_smooth_pair_are_mujocos(solid):
    """A stiffness of its own makes a smooth surface asperity's: the geometry must agree."""
    kind = SOLIDS[solid].replace(' euler="3 0 0"', "").replace(' euler="0 80 0"', "")
    lower = {"sphere": 0.01, "capsule": 0.03, "box": 0.02}[solid]
    place = f'pos="0.003 0 {lower - 1e-4}"'
    body = f'<body {place}><freejoint/><geom name="solid" {kind} mass=".1"/></body>'
    model = mujoco.MjModel.from_xml_string(PLATE.format(bodies=body))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    own = data.contact.pos[:, :2].mean(axis=0)
    surfaces = textured.attach(model, {"solid": textured.texture(None, stiffness=1e4)})
    surfaces.forward(data)
    assert data.contact.dist.min() == pytest.approx(-1e-4, abs=1e-9)  # MuJoCo 3.3.0: -5e-5
    assert np.allclose(data.contact.pos[:, :2].mean(axis=0), own, atol=1e-6)
    assert np.allclose(data.contact.frame[:, :3], [0.0, 0.0, -1.0] if data.contact.geom[0, 0] else
                       [0.0, 0.0, 1.0], atol=1e-9)  # fmt: skip


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
def test_pairs_without_texture_are_untouched_to_the_bit(integrator):
    bodies = (
        '<body pos="0 0 .03"><freejoint/><geom name="one" size=".01" mass=".1"/></body>'
        '<body pos=".03 0 .05" euler="20 30 0"><freejoint/>'
        '<geom name="two" type="box" size=".01 .01 .01" mass=".1"/></body>'
        '<body pos=".5 0 1"><freejoint/><geom name="far" size=".01"/></body>'
    )
    states = []
    for with_texture in (False, True):
        xml = PLATE.format(bodies=bodies).replace("<option", f'<option integrator="{integrator}"')
        model = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(model)
        data.qvel[:6] = 0.1
        step = lambda d, m=model: mujoco.mj_step(m, d)  # noqa: E731
        if with_texture:
            step = textured.attach(model, {"far": "knurl:1mm"}).step
        for _ in range(400):
            step(data)
        states.append(np.concatenate([data.qpos, data.qvel, data.qacc_warmstart]))
    assert np.array_equal(*states)


def test_forward_inverse_and_sensors_agree():
    xml = PLATE.format(
        bodies='<body pos="0 0 .0099"><freejoint/><geom name="solid" size=".01" mass=".1"/>'
        '<site name="skin" size=".011"/></body>'
    ).replace("</mujoco>", '<sensor><touch site="skin"/></sensor></mujoco>')
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    surfaces = textured.attach(model, {"plate": textured.pattern("sinusoid", **WAVES)})
    data.qvel[:3] = 0.02, 0.01, -0.01
    surfaces.forward(data)
    force, acceleration = np.zeros(6), data.qacc.copy()
    mujoco.mj_contactForce(model, data, 0, force)
    assert force[0] > 0.1
    assert data.sensordata[0] == pytest.approx(force[0], rel=1e-9)
    across = np.linalg.norm(force[1:3])
    assert 0.0 < across <= data.contact.friction[0, 0] * force[0] * (1.0 + 1e-6)
    surfaces.inverse(data)
    assert np.abs(data.qfrc_inverse).max() < 1e-4 * np.abs(data.qfrc_constraint).max()
    assert np.array_equal(data.qacc, acceleration)


def test_both_bodies_may_move_and_forces_are_opposite():
    xml = """<mujoco><option gravity="0 0 0" timestep=".001"/><worldbody>
      <body pos="0 0 0"><freejoint/><geom name="one" size=".01" mass=".1"/></body>
      <body pos=".0005 .0002 .0199"><freejoint/><geom name="two" size=".01" mass=".2"/></body>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    bumps = textured.pattern("sin_product", wavelength=1e-3, amplitude=5e-5)
    surfaces = textured.attach(model, {"one": bumps, "two": bumps}, stiffness=5e3)
    surfaces.step(data)
    assert data.ncon == 1
    assert np.linalg.norm(data.qfrc_constraint[:3]) > 0.05
    assert np.allclose(data.qfrc_constraint[:3], -data.qfrc_constraint[6:9], atol=1e-12)
    surfaces.step(data, 100)
    momentum = 0.1 * data.qvel[:3] + 0.2 * data.qvel[6:9]
    assert np.abs(momentum).max() < 1e-12
