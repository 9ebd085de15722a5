"""A map of stiffness in `scene.toml`: read, saved, changed, laid as the texture is, refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image

from asperity import AsperityError, Simulation, StiffnessMap
from asperity.scene.scene import read_scene
from asperity.texture.height_field import HeightField
from asperity.viewer.changes import with_texture
from asperity.viewer.session_config import SessionConfig
from scene.test_friction_table import MESH, MU, WAVES, _made_of_a_box, scene

SOFT = {"file": "k.png", "low": 500.0, "high": 2000.0, "pixel_size": 1e-3}


@pytest.fixture
def folder(tmp_path):
    """Return a folder of maps of two halves, 500 and 2000 N/m."""
    grey = np.zeros((8, 40), np.uint8)
    grey[:, 20:] = 255
    for name in ("k.png", "mu.png"):
        Image.fromarray(grey).save(tmp_path / name)
    np.save(tmp_path / "k.npy", np.where(grey, 2000.0, 500.0))
    return tmp_path


def push(made, x: float, z: float = 2e-3 - 5e-5) -> float:
    return float(Simulation(made).step([x, 1e-3, z, 1, 0, 0, 0])[2])


@pytest.mark.parametrize(
    "table", [SOFT, {"file": "k.npy", "pixel_size": 1e-3}, {"file": "k.npy", "size": [0.04, 8e-3]}]
)
def test_a_map_from_a_file_is_felt(folder, table):
    made = scene(folder, {"stiffness": table})
    found = made.bodies[0].stiffness
    assert isinstance(found, StiffnessMap)
    assert any(
        "plate: stiffness 500 to 2000" in note and "40 x 8 mm" in note for note in made.notes
    )
    assert push(made, -0.01) == pytest.approx(500.0 * 5e-5, rel=1e-9)
    assert push(made, 0.01) == pytest.approx(2000.0 * 5e-5, rel=1e-9)


def test_a_scene_with_maps_is_saved_and_changed(folder, tmp_path):
    own = {"stiffness": {"file": "k.npy", "size": [1, 1]}}
    made = scene(folder, {"stiffness": SOFT, "geoms": {"right": own}})
    assert set(made.files) == {"k.png", "k.npy"}
    made.save(tmp_path / "out")
    again = read_scene(tmp_path / "out")
    assert again.document["bodies"]["plate"]["stiffness"] == SOFT
    for one, two in zip(again.bodies[0].stiffness_maps, made.bodies[0].stiffness_maps, strict=True):
        np.testing.assert_array_equal(one.samples, two.samples)
        assert one.pixel_size == two.pixel_size
    harder = again.changed(bodies={"plate": {"stiffness": {"high": 3000.0}}})
    assert harder.bodies[0].stiffness.highest == pytest.approx(3000.0)
    plain = again.changed(bodies={"plate": {"stiffness": 800.0, "geoms": None}})
    assert push(plain, 0.01) == pytest.approx(800.0 * 5e-5)
    back = plain.changed(bodies={"plate": {"stiffness": SOFT}})
    assert push(back, 0.01) == pytest.approx(2000.0 * 5e-5)


@pytest.mark.parametrize("by_geom", [False, True])
def test_it_lies_as_the_texture_and_stays_without_it(folder, by_geom):
    given = {k: v for k, v in SOFT.items() if k != "pixel_size"}
    own = {
        "texture": {**WAVES, "mapping": "triplanar", "offset": [1e-3, 2e-3]},
        "stiffness": given, "friction": MU,
    }  # fmt: skip
    made = scene(folder, {"geoms": {"right": own}} if by_geom else own)
    surface, smooth = made.bodies[0].surfaces[1], made.smooth().bodies[0].surfaces[1]
    assert surface.stiffness.size == pytest.approx(surface.texture.size)
    assert surface.stiffness.border == surface.texture.border
    assert (surface.mapping, surface.offset) == ("triplanar", (1e-3, 2e-3))
    assert smooth.texture is None
    assert (smooth.mapping, smooth.offset) == (surface.mapping, surface.offset)
    assert smooth.stiffness.size == pytest.approx(surface.stiffness.size)
    assert smooth.friction.size == pytest.approx((0.04, 8e-3))


def test_the_page_takes_the_texture_away(folder):
    given = {k: v for k, v in SOFT.items() if k != "pixel_size"}
    config = SessionConfig(scene(folder, {"texture": WAVES, "stiffness": given}))
    body = with_texture(config, "plate", "smooth").scene.bodies[0]
    assert body.texture is None
    assert body.stiffness.size == pytest.approx(config.scene.bodies[0].texture.size)
    with pytest.raises(AsperityError, match="as large"):
        with_texture(config, "plate", "knurl")


def test_a_map_of_friction_lies_as_that_of_stiffness(folder):
    soft = {**SOFT, "mapping": "triplanar", "offset": [1e-3, 0.0]}
    made = scene(folder, {"stiffness": soft, "friction": MU})
    assert (made.bodies[0].mapping, made.bodies[0].offset) == ("triplanar", (1e-3, 0.0))
    with pytest.raises(AsperityError, match="as the map of stiffness does"):
        scene(folder, {"stiffness": soft, "friction": {**MU, "mapping": "planar"}})


def test_terrain_of_the_model_may_have_one(folder):
    assets = (
        '<hfield name="h" nrow="6" ncol="6" size=".02 .02 .001 .001" elevation="'
        + " ".join(["0 .1 .2 .2 .1 0"] * 6) + '"/>'
    )  # fmt: skip
    terrain = '<geom type="hfield" hfield="h" pos="3e-3 0 0"/>'
    size = list(scene(folder, {}, terrain, assets).bodies[0].texture.size)
    soft = {"file": "k.npy", "size": size}
    assert scene(folder, {"stiffness": soft}, terrain, assets).bodies[0].stiffness_maps
    for more, word in (({"size": [1, 1]}, "as large"), ({"mapping": "triplanar"}, "height field")):
        with pytest.raises(AsperityError, match=word):
            scene(folder, {"stiffness": {**soft, **more}}, terrain, assets)


REFUSED = {
    "no file": ({"low": 0.1}, ["bodies.plate.stiffness", "number", "file"]),
    "no high": ({k: v for k, v in SOFT.items() if k != "high"}, ["k.png", "missing: high"]),
    "negative": ({**SOFT, "low": -5.0}, ["low must lie between 1e-06 and 1000000000", "-5"]),
    "nothing": ({**SOFT, "low": 0.0}, ["low must lie between 1e-06"]),
    "too large": ({**SOFT, "high": 2e9}, ["high must lie between", "2000000000"]),
    "order": ({**SOFT, "low": 3000.0}, ["low must not be above high"]),
    "key": ({**SOFT, "hihg": 1}, ["stiffness.hihg", "did you mean", "high"]),
    "no extent": ({"file": "k.npy"}, ["k.npy", "choose pixel_size or size"]),
    "not there": ({**SOFT, "file": "no.png"}, ["stiffness.file", "no such file"]),
    "low of an array": ({**SOFT, "file": "k.npy"}, ["low and high are for images"]),
    "mapping": ({**SOFT, "mapping": "uv"}, ["texture coordinates"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_maps_that_cannot_be(folder, name):
    table, words = REFUSED[name]
    with pytest.raises(AsperityError) as caught:
        scene(folder, {"stiffness": table})
    for word in words:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)


def test_another_size_than_that_of_the_texture_is_refused(folder):
    words = r"plate.stiffness: a map of stiffness.*got 40 x 8 mm.*valid: .* mm, border 'wrap'"
    with pytest.raises(AsperityError, match=words):
        scene(folder, {"texture": WAVES, "stiffness": SOFT})


def test_heights_are_no_stiffness(folder):
    np.savez(folder / "heights.npz", map_um=np.full((4, 4), 0.3), pixel_size=1e-3)
    with pytest.raises(AsperityError, match="heights"):
        StiffnessMap.from_file(folder / "heights.npz")
    np.save(folder / "bad.npy", np.full((4, 4), -3.0))
    with pytest.raises(AsperityError, match=r"bad.npy: stiffnesses must lie between 1e-06.*-3"):
        StiffnessMap.from_file(folder / "bad.npy", pixel_size=1e-3)


def test_a_soft_skin_and_mujoco_take_numbers_alone(folder):
    skin = {"thickness": 3e-3, "modulus": 1e4}
    with pytest.raises(AsperityError, match=r"tool.skin.*stiffness of body 'plate' is a map"):
        scene(folder, {"stiffness": SOFT}, tool={"body": "tool", "skin": skin})
    mujoco = pytest.importorskip("asperity.mujoco")
    found = StiffnessMap.from_file(folder / "k.npy", pixel_size=1e-3)
    field = HeightField(np.zeros((8, 40)), 1e-3)
    with pytest.raises(AsperityError, match=r"geom 'left'.*stiffness is one number"):
        mujoco.attach(
            scene(folder, {}).model, {"geom:left": mujoco.texture(field, stiffness=found)}
        )


def test_a_mesh_has_a_map_too(folder):
    trimesh.creation.box((0.04, 0.02, 0.004)).export(folder / "slab.stl")
    soft = {**SOFT, "mapping": "triplanar"}
    table = {"mesh": {"file": "slab.stl", "unit": "m"}, "stiffness": soft}
    made = scene(folder, table, MESH, _made_of_a_box())
    for x, k in ((-0.01, 500.0), (0.01, 2000.0)):
        assert push(made, x, 4e-3 - 5e-5) == pytest.approx(k * 5e-5, rel=1e-5)
