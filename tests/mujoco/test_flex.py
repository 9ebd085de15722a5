"""Flexes with a texture: forces of the layer's energy, equal and opposite, stable."""

from __future__ import annotations

import re
import warnings

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured
from asperity import AsperityError
from asperity.mujoco.flex_material import flex_material

XML = """<mujoco><option timestep="{step}" cone="{cone}" gravity="0 0 {gravity}" integrator="{by}"/>
<asset><mesh name="wedge" vertex="0 0 0  .02 0 0  0 .02 0  0 0 .02"/></asset>
<worldbody>
  <geom name="floor" type="plane" size="1 1 .1" pos="0 0 {floor}"/>
  <geom name="shard" type="mesh" mesh="wedge" pos="0 .3 0"/>
  <body name="ball" pos=".003 .002 {height}"><freejoint/>
    <geom name="{tip}" type="{kind}" size=".02 .016 .024" mass=".05"/></body>
  <flexcomp name="pad" type="grid" dim="{dim}" count="{count}" spacing=".02 .02 .02"
    pos="0 0 .03" radius=".004" mass=".2" dof="{dof}">
    {elasticity}<contact selfcollide="none" {contact}/></flexcomp>
</worldbody></mujoco>"""
SOLID = '<elasticity young="2e4" poisson=".2" damping=".004"/>'
EDGES = '<edge equality="true"/>'
WAVES = textured.pattern("sin_product", wavelength=1e-2, amplitude=3e-4)
VERSION = tuple(int(part) for part in mujoco.__version__.split(".")[:2])
BUMPS = textured.pattern("sin_product", wavelength=5e-3, amplitude=1e-4)


def scene(**given):
    usual = {
        "step": 0.001, "cone": "elliptic", "gravity": -9.81, "by": "Euler", "floor": 0.0,
        "height": 0.075, "kind": "sphere", "dim": 3, "dof": "full", "count": "4 4 2",
        "elasticity": EDGES, "contact": "", "tip": "tip",
    }  # fmt: skip
    model = mujoco.MjModel.from_xml_string(XML.format(**{**usual, **given}))
    if hasattr(model, "flex_internal"):  # MuJoCo's own contacts within elements keep no momentum
        model.flex_internal[:] = 0
    return model, mujoco.MjData(model)


def pressed(kind="sphere", **given):
    """Return a free pad that is pressed askew by a turned ball, and its textures."""
    model, data = scene(gravity=0, floor=-1, kind=kind, **given)
    height = 0.0605 if kind == "sphere" else 0.0735
    data.qpos[:7] = .004, .003, height, .9, .2, -.3, .1  # fmt: skip
    mujoco.mju_normalize4(data.qpos[3:7])
    shift = np.random.default_rng(4).normal(0.0, 3e-4, model.nq - 7)
    data.qpos[7:] += shift
    layer = textured.Layer(WAVES, modulus=2e4, pitch=1.5e-3)
    return model, data, textured.attach(model, {"pad": layer, "tip": BUMPS})


@pytest.mark.parametrize("kind", ["sphere", "box"])
def test_forces_are_minus_the_energys_slope(kind):
    model, data, surfaces = pressed(kind)
    surfaces.forward(data)
    found = surfaces.flex_contact(data, "pad")
    size = np.linalg.norm(found.forces, axis=1)
    assert (size > 0.01 * size.max()).sum() > 2
    places, middle = data.flexvert_xpos.copy(), data.xpos[model.body("ball").id].copy()
    start, step = data.qpos.copy(), 1e-7

    def slope(dof):
        energies = []
        for sign in (1.0, -1.0):
            way = np.zeros(model.nv)
            way[dof] = sign
            data.qpos[:] = start
            mujoco.mj_integratePos(model, data.qpos, way, step)
            surfaces.forward(data)
            energies.append(surfaces.flex_contact(data, "pad").energy)
        return (energies[0] - energies[1]) / (2.0 * step)

    # The pad's vertices have three slides each, along the world's axes.
    for vertex in np.argsort(size)[-4:]:
        want = [-slope(6 + 3 * vertex + axis) for axis in range(3)]
        assert np.allclose(found.forces[vertex], want, rtol=0, atol=1e-4 * size.max())
    force = np.array([-slope(axis) for axis in range(3)])
    assert np.allclose(force, -found.forces.sum(axis=0), rtol=0, atol=1e-4 * size.max())
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, start[3:7])
    torque = turn.reshape(3, 3) @ [-slope(3 + axis) for axis in range(3)]
    moment = np.cross(places - middle, found.forces).sum(axis=0)
    assert np.allclose(torque, -moment, rtol=0, atol=1e-5 * size.max())


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_forces_are_equal_and_opposite(cone):
    model, data, surfaces = pressed(cone=cone, elasticity="")
    data.qvel[:6] = 0.05, -0.1, -0.2, 1.0, 2.0, 3.0
    momenta = []
    for _ in range(40):
        surfaces.forward(data)
        numbers = surfaces.flex_contact(data, "pad").numbers
        is_felt = (data.contact.efc_address >= 0) & (data.contact.geom.max(axis=1) >= 0)
        assert np.array_equal(np.flatnonzero(is_felt), numbers)
        force = data.qfrc_constraint[6:].reshape(-1, 3)
        size = np.linalg.norm(force, axis=1).sum()
        ball = model.body("ball").id
        turn, at = data.xmat[ball].reshape(3, 3), data.xpos[ball]
        moment = np.cross(data.flexvert_xpos, force).sum(axis=0) + turn @ data.qfrc_constraint[3:6]
        moment += np.cross(at, data.qfrc_constraint[:3])
        assert np.allclose(force.sum(axis=0), -data.qfrc_constraint[:3], rtol=0, atol=1e-9 * size)
        assert np.allclose(moment, 0.0, atol=1e-10 * size)
        share = np.full((model.nv - 6) // 3, 0.2 / ((model.nv - 6) // 3))
        momenta.append(0.05 * data.qvel[:3] + share @ data.qvel[6:].reshape(-1, 3))
        surfaces.step(data)
    assert np.abs(data.qvel[6:]).max() > 0.01
    assert np.allclose(momenta, momenta[0], rtol=0, atol=1e-12)


@pytest.mark.skipif(VERSION < (3, 4), reason="trilinear flexes collide with themselves there")
@pytest.mark.parametrize("step", [0.001, 0.002])
def test_a_textured_ball_comes_to_rest_on_a_sponge(step):
    model, data = scene(
        step=step, dof="trilinear", count="5 5 3", elasticity=SOLID, height=0.09,
    )  # fmt: skip
    surfaces = textured.attach(model, {"flex:pad": WAVES, "tip": BUMPS})
    surfaces.step(data, round(2.0 / step))
    place = data.xpos[model.body("ball").id].copy()
    surfaces.step(data, round(1.0 / step))
    assert np.linalg.norm(data.xpos[model.body("ball").id] - place) < 1e-4
    assert np.linalg.norm(data.qvel[:3]) < 1e-3
    assert all(warning.number == 0 for warning in data.warning)
    surfaces.forward(data)
    found, one = surfaces.flex_contact(data, "pad"), np.zeros(6)
    assert found.forces.sum(axis=0) == pytest.approx([0.0, 0.0, 0.2 * 9.81], abs=0.01)
    for i in found.numbers:
        mujoco.mj_contactForce(model, data, i, one)
        want = np.linalg.norm(found.forces[data.contact.vert[i, 1]])
        assert one[0] == pytest.approx(want, abs=2e-3)
    taxels = textured.Taxels(model, "tip", (4, 6))
    lifted = data.xmat[model.body("ball").id].reshape(3, 3) @ taxels.wrench(data)[:3]
    assert lifted == pytest.approx([0.0, 0.0, 0.05 * 9.81], abs=0.01)


def test_light_vertices_under_a_stiff_layer_are_stable():
    model, data = scene(step=0.002, height=0.076)
    data.qvel[2] = -0.5
    surfaces = textured.attach(model, {"pad": textured.Layer(WAVES, modulus=1e7)})
    fastest = 0.0
    for _ in range(500):
        surfaces.step(data)
        fastest = max(fastest, np.abs(data.qvel).max())
    assert fastest < 60.0
    assert np.linalg.norm(data.qvel[:3]) < 0.05
    assert data.xpos[model.body("ball").id, 2] > 0.04


def test_a_flex_without_texture_is_mujocos_own():
    for textures in ({"tip": BUMPS}, {"floor": BUMPS, "tip": BUMPS}):
        model, data = scene()
        for _ in range(200):
            mujoco.mj_step(model, data)
        assert data.ncon > 8
        plain = data.qpos.copy(), data.qvel.copy()
        surfaces = textured.attach(model, textures)
        mujoco.mj_resetData(model, data)
        surfaces.step(data, 200)
        # Up to MuJoCo 3.9 a textured geom has a wider margin, which changes the last digits of
        # MuJoCo's distances between it and a flex.
        near = 0.0 if VERSION >= (4, 0) else 1e-4
        assert np.allclose(data.qpos, plain[0], rtol=0, atol=near)
        assert np.allclose(data.qvel, plain[1], rtol=0, atol=100.0 * near)
        with pytest.raises(AsperityError, match="flex"):
            surfaces.flex_contact(data, "pad")


def test_a_sheet_is_felt_on_both_sides():
    for height, sign in ((0.0525, -1.0), (0.0075, 1.0)):
        model, data = scene(
            dim=2, count="5 5 1", gravity=0, floor=-1, height=height, elasticity=EDGES
        )
        surfaces = textured.attach(model, {"pad": WAVES})
        surfaces.forward(data)
        force = surfaces.flex_contact(data, "pad").forces.sum(axis=0)
        assert np.sign(force[2]) == sign
        assert np.linalg.norm(force[:2]) < 0.1 * abs(force[2])


def test_peaks_touch_before_mujocos_radius_does():
    # The pad's top is at 44 mm with its radius, and 44.3 mm with the peaks of the texture.
    model, data = scene(gravity=0, floor=-1, height=0.0642)
    energies = []
    surfaces = textured.attach(model, {"pad": WAVES})
    for shift in np.linspace(-5e-3, 5e-3, 11):
        data.qpos[0] = shift
        surfaces.forward(data)
        energies.append(surfaces.flex_contact(data, "pad").energy)
        numbers = surfaces.flex_contact(data, "pad").numbers
        assert (len(numbers) > 0) == (energies[-1] > 0.0) == (data.ncon > 0)
    assert max(energies) > 0.0
    assert min(energies) == 0.0


def test_friction_is_that_of_the_pair_or_given():
    model, data, _ = pressed()
    given = textured.texture(WAVES, friction=1.3)
    for texture, want in ((WAVES, 1.0), (given, 1.3)):
        surfaces = textured.attach(model, {"pad": texture})
        surfaces.forward(data)
        assert data.ncon > 2
        assert np.allclose(data.contact.friction[:, 0], want)
        surfaces.detach()


def test_the_layer_is_the_flexs_own_unless_given():
    kinds = [(5e4, 0.2, 3), (3e6, 0.0, 3), (1e5, 0.3, 2)]
    for young, poisson, dim in kinds[: 3 if VERSION >= (3, 4) else 2]:
        sheet = 'thickness=".008" elastic2d="stretch"' if dim == 2 else ""
        elastic = f'<elasticity young="{young}" poisson="{poisson}" {sheet}/>'
        model, data = scene(elasticity=elastic, dim=dim, count="3 4 2" if dim == 3 else "3 4 1")
        mujoco.mj_fwdPosition(model, data)
        found = flex_material(model, 0, data.flexvert_xpos)
        if VERSION >= (4, 0):  # older ones took other constants for the same parameters
            assert found == pytest.approx((young, poisson), rel=1e-9, abs=1e-12)
    notes = textured.attach(model, {"pad": None}).notes
    assert any(re.search(r"layer of 4 mm, .* Pa \(the flex's own\)", note) for note in notes)
    given = textured.Layer(None, thickness=2e-3, modulus=3e5, poisson=0.1, pitch=2e-3)
    notes = textured.attach(model, {"pad": given}).notes
    assert any(re.search(r"layer of 2 mm, 3e\+05 Pa \(given\).* 2 mm apart", n) for n in notes)
    assert any("geom 'shard' in MuJoCo's own contacts" in note for note in notes)
    model, _ = scene()
    assert any("1e+05 Pa (assumed)" in n for n in textured.attach(model, {"pad": WAVES}).notes)


@pytest.mark.parametrize(("bits", "count"), [("1", 1), ("2", 0)])
def test_a_flex_that_meets_another_one_is_told_of(bits, count):
    """Their contacts are MuJoCo's own: two surfaces that both yield do not meet each other."""
    second = f"""<flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".01 .01 .01"
      pos="0 .2 .1" mass=".01"><edge equality="true"/>
      <contact selfcollide="none" contype="{bits}" conaffinity="{bits}"/></flexcomp></worldbody>"""
    usual = {
        "step": 0.001, "cone": "elliptic", "gravity": 0, "by": "Euler", "floor": -1.0,
        "height": 0.075, "kind": "sphere", "dim": 3, "dof": "full", "count": "4 4 2",
        "elasticity": EDGES, "contact": "", "tip": "tip",
    }  # fmt: skip
    model = mujoco.MjModel.from_xml_string(XML.replace("</worldbody>", second).format(**usual))
    found = [n for n in textured.attach(model, {"pad": WAVES}).notes if "meets flex 'cloth'" in n]
    assert len(found) == count
    assert all("\n" not in note for note in found)


def test_what_is_too_deep_for_the_layer_stays_mujocos_own():
    model, data = scene(height=0.06)
    surfaces = textured.attach(model, {"pad": textured.Layer(WAVES, thickness=3e-4)})
    with pytest.warns(UserWarning, match="is deeper in flex 'pad' than its layer of 0.3 mm allows"):
        surfaces.step(data, 5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        surfaces.step(data, 300)
    assert data.xpos[model.body("ball").id, 2] > 0.04


@pytest.mark.parametrize(
    ("given", "textures", "message"),
    [
        ({}, {"flex:pod": WAVES}, "no flex named 'pod'.*did you mean 'pad'"),
        ({}, {"pad": textured.texture(WAVES, stiffness=10.0)}, "flex 'pad': .*no stiffness.*Layer"),
        ({}, {"tip": textured.Layer(WAVES)}, "geom 'tip': a Layer is for flexes"),
        ({}, {"pad": textured.texture(WAVES, mapping="uv")}, "flex 'pad': .*texture coordinates"),
        ({}, {"pad": textured.Layer(WAVES, modulus=-1.0)}, "flex 'pad': modulus must lie between"),
        ({"dim": 2, "count": "4 4 1"}, {"pad": textured.Layer(WAVES, thickness=0.02)},
         "flex 'pad': thickness must lie between 1e-06 and 0.004"),
        ({"dim": 1, "count": "4 1 1"}, {"pad": WAVES}, "flex 'pad': it is a line"),
    ],
)  # fmt: skip
def test_what_is_refused(given, textures, message):
    model, _ = scene(**given)
    with pytest.raises(AsperityError, match=message) as error:
        textured.attach(model, textures)
    assert "\n" not in str(error.value)


def test_modes_and_integrators_without_flexes():
    model, data = scene()
    model.flex_contype[:] = model.flex_conaffinity[:] = 0
    with pytest.raises(AsperityError, match="flex 'pad' can not be touched"):
        textured.attach(model, {"pad": WAVES})
    model, data = scene()
    with pytest.raises(AsperityError, match="mode 'passive' has no textures for flexes"):
        textured.attach(model, {"pad": WAVES}, mode="passive")
    with pytest.raises(AsperityError, match="'pad' is a flex; taxels lie on"):
        textured.Taxels(model, "pad", (3, 3))
    if hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
        model, data = scene(by="discrete")
        surfaces = textured.attach(model, {"pad": WAVES})
        with pytest.raises(AsperityError, match="the integrator 'discrete' leaves no room"):
            surfaces.step(data)


def test_a_name_that_a_flex_shares_is_asked_for():
    model, _ = scene(tip="pad")
    with pytest.raises(AsperityError, match="'pad' names a geom and a flex; say 'geom:pad' or 'f"):
        textured.attach(model, {"pad": WAVES})
    assert textured.attach(model, {"flex:pad": WAVES}).notes
