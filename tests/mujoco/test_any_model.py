"""Joints, solvers and options that a model may have."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured

XML = """<mujoco><option timestep="0.001" solver="{solver}" cone="{cone}" jacobian="{jacobian}"
  noslip_iterations="{noslip}">{sleep}</option>
<worldbody>
  <geom name="floor" type="plane" size="1 1 .1"/>
  <body name="tray" mocap="true" pos="0 0 .1">
    <geom name="tray" type="box" size=".05 .05 .005"/></body>
  <body name="ball" pos="0 0 .1149"><freejoint/><geom name="ball" size=".01" mass=".05"/></body>
  <body name="arm" pos=".3 0 .05"><joint name="swing" type="hinge" axis="0 1 0" damping=".01"/>
    <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".1" contype="0" conaffinity="0"/>
    <body pos=".1 0 0"><joint type="ball" damping=".01"/>
      <geom name="hand" type="ellipsoid" size=".02 .015 .02" mass=".05"/></body></body>
  <body name="left" pos="-.3 0 .0195"><freejoint/><geom name="left" type="box" size=".02 .02 .02"/>
  </body>
  <body name="right" pos="-.3 .1 .0195"><freejoint/>
    <geom name="right" type="cylinder" size=".02 .02"/></body>
</worldbody>
<equality><weld body1="left" body2="right"/></equality>
<actuator><motor joint="swing" gear=".05"/></actuator></mujoco>"""
TEXTURES = {
    "tray": textured.pattern("sin_product", wavelength=2e-3, amplitude=5e-5),
    "hand": "knurl:2mm",
    "right": textured.pattern("ridges", pitch=3e-3),
}


def model(solver="Newton", cone="elliptic", jacobian="dense", noslip=0, sleep=""):
    return mujoco.MjModel.from_xml_string(
        XML.format(solver=solver, cone=cone, jacobian=jacobian, noslip=noslip, sleep=sleep)
    )


@pytest.mark.filterwarnings("ignore:a step of")
@pytest.mark.parametrize(
    ("solver", "cone", "jacobian"),
    itertools.product(["Newton", "CG", "PGS"], ["elliptic", "pyramidal"], ["dense", "sparse"]),
)
def test_all_solvers(solver, cone, jacobian):
    scene = model(solver, cone, jacobian, noslip=3 if solver == "PGS" else 0)
    data = mujoco.MjData(scene)
    surfaces = textured.attach(scene, TEXTURES)
    data.ctrl[:] = -0.5
    for i in range(150):
        data.mocap_pos[0, 0] = 1e-5 * i
        surfaces.step(data)
    assert np.isfinite(data.qpos).all()
    assert all(warning.number == 0 for warning in data.warning)
    touching = {frozenset(scene.geom(int(g)).name for g in pair) for pair in data.contact.geom}
    assert {frozenset(("floor", "right"))} <= touching
    assert data.body("ball").xpos[2] > 0.11
    assert data.body("right").xpos[2] == pytest.approx(0.02, abs=1e-3)


@pytest.mark.filterwarnings("ignore:a step of")
@pytest.mark.skipif(
    not hasattr(mujoco.mjtEnableBit, "mjENBL_SLEEP"), reason="in this MuJoCo no body sleeps"
)
def test_bodies_that_sleep():
    scene = model(sleep='<flag sleep="enable"/>')
    data = mujoco.MjData(scene)
    surfaces = textured.attach(scene, {"right": TEXTURES["right"]})
    surfaces.step(data, 3000)
    assert np.isfinite(data.qpos).all()
    assert data.body("right").xpos[2] == pytest.approx(0.02, abs=1e-3)


@pytest.mark.filterwarnings("ignore:a step of")
def test_friction_of_a_moving_tray_carries_the_ball():
    scene = model()
    data = mujoco.MjData(scene)
    surfaces = textured.attach(scene, {"tray": textured.texture(TEXTURES["tray"], friction=0.8)})
    surfaces.step(data, 300)
    start = data.body("ball").xpos.copy()
    for _ in range(500):
        data.mocap_pos[0, 2] += 2e-5
        surfaces.step(data)
    assert data.body("ball").xpos[2] - start[2] == pytest.approx(0.01, abs=1e-3)
