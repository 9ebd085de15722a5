"""What may be given a texture, and what is refused."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured
from asperity import AsperityError, HeightField

XML = """<mujoco><option cone="elliptic"/>
<asset>
  <material name="steel"/>
  <hfield name="hills" nrow="32" ncol="32" size=".1 .1 .004 .01"/>
  <mesh name="wedge" vertex="0 0 0  .04 0 0  0 .04 0  0 0 .04  .04 .04 .01"/>
</asset>
<worldbody>
  <geom name="table" type="box" size=".1 .1 .01" pos="0 0 -.01"/>
  <geom name="hills" type="hfield" hfield="hills" pos=".5 0 0"/>
  <geom name="seen" type="sphere" size=".01" pos="0 1 0" contype="0" conaffinity="0"/>
  <body name="tool" pos="0 0 .0099"><freejoint/>
    <geom name="tip" size=".01" mass=".05" material="steel"/>
    <geom type="capsule" fromto="0 0 .02 0 0 .06" size=".004" mass=".01" material="steel"/>
  </body>
  <body name="tip2" pos=".5 0 .02"><freejoint/><geom name="probe" size=".005" mass=".02"/></body>
  <body name="shard" pos="-.02 .05 .001" quat=".9 .1 0 0"><freejoint/>
    <geom name="shard" type="mesh" mesh="wedge" mass=".05"/></body>
  <body pos="0 0 2"><joint type="hinge"/><geom name="bob" size=".01"/><site name="s"/>
    <site name="t" pos="0 0 .1"/></body>
</worldbody>
<tendon><spatial name="rope"><site site="s"/><site site="t"/></spatial></tendon>
</mujoco>"""
BUMPS = textured.pattern("sin_product", wavelength=2e-3, amplitude=5e-5)


@pytest.fixture
def model():
    out = mujoco.MjModel.from_xml_string(XML)
    at = np.linspace(0.0, 1.0, 32)
    out.hfield_data[:] = (0.5 + 0.5 * np.sin(9.0 * at) * np.cos(7.0 * at[:, None])).ravel()
    return out


def settled(model, textures, steps=300, **options):
    data = mujoco.MjData(model)
    surfaces = textured.attach(model, textures, **options)
    surfaces.step(data, steps)
    assert np.isfinite(data.qpos).all()
    assert all(warning.number == 0 for warning in data.warning)
    return surfaces, data


def pairs_in_contact(model, data):
    geoms = data.contact.geom[:, :]
    return {tuple(sorted((model.geom(a).name, model.geom(b).name))) for a, b in geoms}


@pytest.mark.parametrize("name", ["table", "geom:table", "body:tool", "steel", "material:steel"])
def test_by_geom_body_and_material(model, name):
    _, data = settled(model, {name: BUMPS}, 30)
    assert ("table", "tip") in pairs_in_contact(model, data)


def test_every_kind_of_source(model, tmp_path):
    heights = 1e-5 * np.sin(np.arange(64) / 4.0) * np.ones((64, 1))
    np.save(tmp_path / "heights.npy", heights)
    for value in (
        BUMPS,
        HeightField(heights, 1e-5, "wrap"),
        (heights, 1e-5),
        textured.texture(heights, pixel_size=1e-5, border="wrap", friction=0.3),
        textured.texture(tmp_path / "heights.npy", pixel_size=1e-5, mapping="triplanar"),
        "knurl:0.8mm",
        "ridges",
    ):
        textured.attach(model, {"table": value}).detach()


def test_a_name_for_ridges_with_usual_proportions():
    ridges = textured.pattern("ridges", pitch=0.5e-3)
    assert ridges.relief == pytest.approx(0.08e-3, rel=0.03)


def test_a_textured_mesh_lies_on_a_textured_table():
    # Alone: the tool would topple and push it. It falls on a corner and rocks for a second.
    alone = re.sub('<body name="tool".*?</body>', "", XML, flags=re.DOTALL)
    model = mujoco.MjModel.from_xml_string(alone)
    surfaces, data = settled(model, {"table": BUMPS, "shard": BUMPS}, 2500)
    for _ in range(50):
        surfaces.step(data)
        assert ("shard", "table") in pairs_in_contact(model, data)
        assert abs(data.body("shard").xpos[2]) < 2e-4


def test_a_ball_rolls_over_a_textured_height_field(model):
    data = mujoco.MjData(model)
    surfaces, touched = textured.attach(model, {"hills": BUMPS}), 0
    heights = 0.004 * np.array(model.hfield_data).reshape(32, 32)
    smooth = HeightField(heights, 0.2 / 31.0)
    for _ in range(300):
        surfaces.step(data)
        place = data.body("tip2").xpos - [0.5, 0.0, 0.0]
        middle = 0.5 * np.array(smooth.size)
        ground = float(smooth.heights(place[0] + middle[0], place[1] + middle[1]))
        assert place[2] > ground
        touched += ("hills", "probe") in pairs_in_contact(model, data)
    assert touched > 10


def test_detach_gives_the_margins_back(model):
    before = np.concatenate([model.geom_margin, model.geom_gap])
    surfaces = textured.attach(model, {"table": BUMPS})
    assert not np.array_equal(np.concatenate([model.geom_margin, model.geom_gap]), before)
    surfaces.detach()
    assert np.array_equal(np.concatenate([model.geom_margin, model.geom_gap]), before)


def test_friction_of_a_surface_replaces_mujocos(model):
    _, data = settled(model, {"table": textured.texture(BUMPS, friction=0.25)}, 50)
    own = [c for c, g in enumerate(data.contact.geom) if model.geom("tip").id in g]
    assert np.allclose(data.contact.friction[own, 0], 0.25)


@pytest.mark.parametrize(
    ("textures", "message"),
    [
        ({"tabel": BUMPS}, "no geom or .* flex named 'tabel' .*did you mean 'table'"),
        ({"geom:tool": BUMPS}, "no geom named 'tool'"),
        ({"rope": BUMPS}, "'rope' is a tendon: a tendon has no surface"),
        ({"seen": BUMPS}, "can be touched"),
        (
            {"tip": textured.pattern("waves", wavelength=0.1, amplitude=8e-3)},
            "its texture reaches 7.99 mm .* valid: at most",
        ),
        ({"table": np.zeros((8, 8))}, "needs a pixel_size"),
        ({"table": "sandpaper.png"}, "neither a file nor a pattern"),
        ({"table": (np.zeros((9, 9)),)}, r"no texture: \(array[^\n]*\.\.\.; valid"),
        ({"table": 3}, "no texture: 3"),
        ({"table": textured.texture(BUMPS, mapping="uv")}, "texture coordinates"),
        ([], "must be a mapping"),
    ],
)
def test_refused_in_one_line(model, textures, message):
    with pytest.raises(AsperityError, match=message) as caught:
        textured.attach(model, textures)
    assert "\n" not in str(caught.value)


def test_unknown_patterns_and_parameters_are_named():
    with pytest.raises(AsperityError, match="did you mean 'grating'"):
        textured.pattern("gratin")
    with pytest.raises(AsperityError, match=r"parameter of grating 'pich'.*did you mean 'pitch'"):
        textured.pattern("ridges", pich=1e-3)


def test_a_model_changed_afterwards_is_refused(model):
    surfaces = textured.attach(model, {"table": BUMPS})
    model.geom("table").size[0] = 0.05
    with pytest.raises(AsperityError, match="geom_size of geom 'table' was changed"):
        surfaces.step(mujoco.MjData(model))


def test_a_step_too_long_for_the_stiffness_is_told_once(model):
    with pytest.warns(UserWarning, match="a step of 2 ms is long for the stiffness") as caught:
        settled(model, {"table": BUMPS}, 100, stiffness=1e6)
    assert len([w for w in caught if "'tip'" in str(w.message)]) == 1


def test_without_passive_forces_there_is_no_way_in(model):
    flags, bits = mujoco.mjtDisableBit, 0
    for name in ("SPRING", "DAMPER", "PASSIVE"):  # as its version calls them
        bits |= int(getattr(flags, f"mjDSBL_{name}", 0))
    model.opt.disableflags = bits
    with pytest.raises(AsperityError, match="enable one of them"):
        textured.attach(model, {"table": BUMPS}).step(mujoco.MjData(model))


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "stiff"])
def test_stiffness_out_of_range(model, value):
    with pytest.raises(AsperityError, match="stiffness must be"):
        textured.attach(model, {"table": BUMPS}, stiffness=value)
