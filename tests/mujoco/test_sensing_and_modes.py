"""Taxels, slip, textures that a model carries, explicit forces, many data at once."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured
from asperity import AsperityError

XML = """<mujoco><option timestep="{step}" cone="elliptic"/>
<custom><text name="texture:plate" data="sinusoid:2mm"/></custom>
<worldbody><geom name="plate" type="box" size=".1 .1 .01" pos="0 0 -.01"/>
<body name="finger" pos="0 0 .00995" euler="0 0 30"><freejoint/>
  <geom name="tip" type="{kind}" size=".01 .02 .01" mass=".1" euler="0 90 0" condim="4"/></body>
</worldbody></mujoco>"""
BUMPS = textured.pattern("sin_product", wavelength=2e-3, amplitude=5e-5)


def scene(kind="sphere", step=0.001):
    model = mujoco.MjModel.from_xml_string(XML.format(kind=kind, step=step))
    data = mujoco.MjData(model)
    data.qvel[:3] = 0.02, 0.01, -0.02
    return model, data


@pytest.mark.parametrize("kind", ["sphere", "capsule", "box", "cylinder", "ellipsoid"])
@pytest.mark.parametrize("shape", [(6, 8), (3, 3)])
def test_the_taxels_wrench_is_the_contacts(kind, shape):
    model, data = scene(kind)
    taxels = textured.Taxels(model, "tip", shape)
    surfaces = textured.attach(model, {"plate": BUMPS})
    surfaces.step(data, 20)
    surfaces.forward(data)
    assert data.ncon > 0
    wanted, body = np.zeros(6), model.body("finger").id
    turn, one = data.xmat[body].reshape(3, 3), np.zeros(6)
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, one)
        axes = data.contact.frame[i].reshape(3, 3)
        sign = 1.0 if data.contact.geom[i, 1] == model.geom("tip").id else -1.0
        force, moment = sign * axes.T @ one[:3], sign * axes.T @ one[3:]
        arm = data.contact.pos[i] - data.xpos[body]
        wanted[:3] += turn.T @ force
        wanted[3:] += turn.T @ (moment + np.cross(arm, force))
    assert np.linalg.norm(wanted[:3]) > 0.1
    assert np.allclose(taxels.wrench(data), wanted, rtol=0, atol=1e-12)
    assert len(taxels.forces(data)) == shape[0] * shape[1]
    size = np.linalg.norm(taxels.forces(data), axis=1)
    assert shape == (3, 3) or size.max() > 1.5 * size.mean()  # it is felt near the contact


def test_places_of_taxels_that_cannot_be_used():
    model, _ = scene()
    for places in (np.zeros((2, 3)), np.outer(np.arange(4.0), [1, 2, 3]), [[0, 0, np.nan]] * 4):
        with pytest.raises(AsperityError, match="places of taxels must be"):
            textured.Taxels(model, "tip", places)
    with pytest.raises(AsperityError, match="no geom or body or material or flex named 'palm'"):
        textured.Taxels(model, "palm", (3, 3))


def test_slip_is_the_velocity_across_the_contact():
    model, data = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    data.qvel[:] = 0.02, 0.01, 0.0, 0.0, 0.0, 0.0
    surfaces.forward(data)
    found = surfaces.contacts(data)
    assert found.numbers.tolist() == [0]
    sign = 1.0 if data.contact.geom[0, 1] == model.geom("tip").id else -1.0
    across = np.array([0.02, 0.01, 0.0])
    normal = data.contact.frame[0, :3]
    assert np.allclose(sign * found.slip[0], across - (across @ normal) * normal, atol=1e-9)
    assert found.push[0] > 0.0


def test_a_model_carries_its_textures():
    model, data = scene()
    waves = textured.pattern("sinusoid", wavelength=2e-3)
    states = []
    for given in (None, {"plate": waves}):
        data = mujoco.MjData(model)
        surfaces = textured.attach(model, given)
        surfaces.step(data, 50)
        surfaces.detach()
        states.append(data.qpos.copy())
    assert np.array_equal(*states)


def test_a_file_beside_the_model(tmp_path):
    model, data = scene()
    path = tmp_path / "textures.toml"
    path.write_text(
        '[textures.plate]\nfriction = 0.2\ntexture = {kind = "knurl", pitch = 1e-3, height = 1e-4}'
    )
    textured.attach(model, path).step(data, 20)
    assert data.ncon == 1
    assert data.contact.friction[0, 0] == 0.2
    path.write_text('[textures.plate]\ntexture = {kind = "knurled"}')
    with pytest.raises(AsperityError, match=r"textures\.plate\.texture"):
        textured.attach(model, path)
    # What belongs into `texture` is not left out in silence.
    path.write_text('[textures.plate]\nkind = "knurl"')
    with pytest.raises(AsperityError, match=r"unknown key textures\.plate\.kind.*texture"):
        textured.attach(model, path)
    path.write_text('[textures]\nplate = "knurl:1mm"')
    with pytest.raises(AsperityError, match=r"textures\.plate must be a table"):
        textured.attach(model, path)
    with pytest.raises(AsperityError, match=r"none\.toml"):
        textured.attach(model, str(tmp_path / "none.toml"))


def test_explicit_forces_carry_the_same_weight():
    model, data = scene(step=0.0005)
    surfaces = textured.attach(
        model, {"plate": textured.pattern("sinusoid", wavelength=1e-2, amplitude=1e-5)},
        stiffness=2e3, dissipation=20.0, mode="passive",
    )  # fmt: skip
    data.qvel[:] = 0.0
    surfaces.step(data, 4000)
    assert data.ncon == 0
    assert data.qfrc_passive[2] == pytest.approx(0.1 * 9.81, rel=1e-3)
    assert surfaces.contacts(data).push.sum() == pytest.approx(0.1 * 9.81, rel=1e-3)


def test_too_long_a_step_for_explicit_forces_is_told():
    model, data = scene(step=0.005)
    surfaces = textured.attach(model, {"plate": BUMPS}, stiffness=1e5, mode="passive")
    with pytest.warns(UserWarning, match="valid: at most 1, with a step of"):
        surfaces.step(data, 3)


def test_many_at_once_are_as_one_after_the_other():
    model, _ = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    datas = [mujoco.MjData(model) for _ in range(6)]
    alone = [mujoco.MjData(model) for _ in range(6)]
    for i, (one, other) in enumerate(zip(datas, alone, strict=True)):
        one.qvel[0] = other.qvel[0] = 0.01 * i
        surfaces.step(other, 40)
    surfaces.step_all(datas, 40, threads=3)
    for one, other in zip(datas, alone, strict=True):
        assert np.array_equal(one.qpos, other.qpos)
