"""A map of friction in `scene.toml`: read, saved, changed, and laid as the texture is."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image

from asperity import AsperityError, FrictionMap, Scene, Simulation
from asperity.scene.scene import read_scene, scene_of
from asperity.viewer.changes import with_texture
from asperity.viewer.session_config import SessionConfig

WAVES = {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 2e-5}
PLATE = (
    '<geom name="left" type="box" size="0.02 0.02 0.005" pos="-0.02 0 -0.005"/>'
    '<geom name="right" type="box" size="0.02 0.02 0.005" pos="0.02 0 -0.005"/>'
)
MESH = '<geom type="mesh" mesh="made"/>'


@pytest.fixture
def folder(tmp_path):
    """Return a folder of maps of two halves, 0.1 and 0.6."""
    grey = np.zeros((8, 40), np.uint8)
    grey[:, 20:] = 255
    Image.fromarray(grey).save(tmp_path / "mu.png")
    fine = np.full((8, 40), 13107, np.uint16)
    fine[:, 20:] = 65535
    Image.fromarray(fine).save(tmp_path / "fine.png")
    samples = np.where(grey, 0.6, 0.1)
    np.save(tmp_path / "mu.npy", samples)
    np.savez(tmp_path / "mu.npz", friction=samples, pixel_size_mm=1.0)
    np.savetxt(tmp_path / "mu.csv", samples, delimiter=",")
    trimesh.creation.box((0.04, 0.02, 0.004)).export(tmp_path / "slab.stl")
    return tmp_path


MU = {"file": "mu.png", "low": 0.1, "high": 0.6, "pixel_size": 1e-3}


def scene(folder, table, plate=PLATE, assets="", **more) -> Scene:
    xml = (
        f'<mujoco><asset>{assets}</asset><worldbody><body name="plate">{plate}</body><body '
        'name="tool" pos="0 0 0.05"><freejoint/><geom type="sphere" size="0.002"/></body>'
        "</worldbody></mujoco>"
    )
    document = {"schema": 1, "tool": {"body": "tool"}, "bodies": {"plate": table}, **more}
    return scene_of(xml, document, folder=folder)


def ratio(made: Scene, x: float, depth: float = 5e-5) -> float:
    """Return the tangential over the normal force of the tool that slides from x."""
    simulation = Simulation(made)
    for i in range(60):
        wrench = simulation.step([x + 1e-5 * i, 1e-3, 2e-3 - depth, 1, 0, 0, 0])
    return -wrench[0] / wrench[2]


@pytest.mark.parametrize(
    ("table", "low"),
    [(MU, 0.1), ({**MU, "file": "fine.png", "low": 0.0, "high": 0.6}, 0.12),
     ({"file": "mu.npy", "pixel_size": 1e-3}, 0.1), ({"file": "mu.npz"}, 0.1),
     ({"file": "mu.csv", "size": [0.04, 8e-3]}, 0.1)],
)  # fmt: skip
def test_a_map_from_a_file_is_felt(folder, table, low):
    made = scene(folder, {"friction": table})
    found = made.bodies[0].friction
    assert isinstance(found, FrictionMap)
    assert found.size == pytest.approx((0.04, 8e-3))
    assert any("plate: friction 0.1" in note and "40 x 8 mm" in note for note in made.notes)
    assert not any("grey levels" in note or "heights" in note for note in made.notes)
    assert ratio(made, -0.01) == pytest.approx(low, rel=1e-6)
    assert ratio(made, 0.01) == pytest.approx(0.6, rel=1e-6)


def test_the_bottom_of_a_picture_is_its_beginning(folder):
    grey = np.zeros((6, 5), np.uint8)
    grey[-1] = 255
    Image.fromarray(grey).save(folder / "up.png")
    found = FrictionMap.from_file(folder / "up.png", pixel_size=1e-3, low=0.2, high=0.7)
    assert found.samples[0] == pytest.approx(np.full(5, 0.7))
    assert found.samples[1:] == pytest.approx(np.full((5, 5), 0.2))


def test_a_scene_with_maps_is_saved_and_changed(folder, tmp_path):
    table = {"friction": MU, "geoms": {"right": {"friction": {"file": "mu.npy", "size": [1, 1]}}}}
    made = scene(folder, table)
    assert set(made.files) == {"mu.png", "mu.npy"}
    made.save(tmp_path / "out")
    again = read_scene(tmp_path / "out")
    assert again.document["bodies"]["plate"]["friction"] == MU
    for one, two in zip(again.bodies[0].friction_maps, made.bodies[0].friction_maps, strict=True):
        np.testing.assert_array_equal(one.samples, two.samples)
        assert one.pixel_size == two.pixel_size
    assert again.bodies[0].largest_friction == 0.6
    rougher = again.changed(bodies={"plate": {"friction": {"high": 0.9}}})
    assert rougher.bodies[0].friction.highest == pytest.approx(0.9)
    plain = again.changed(bodies={"plate": {"friction": 0.3, "geoms": None}})
    assert plain.bodies[0].friction == 0.3
    back = plain.changed(bodies={"plate": {"friction": MU}})
    np.testing.assert_array_equal(back.bodies[0].friction.samples, made.bodies[0].friction.samples)


def test_a_map_without_an_extent_covers_what_the_texture_does(folder):
    texture = {**WAVES, "mapping": "triplanar", "offset": [1e-3, 2e-3]}
    friction = {k: v for k, v in MU.items() if k != "pixel_size"}
    made = scene(folder, {"texture": texture, "friction": friction})
    body = made.bodies[0]
    assert body.friction.size == pytest.approx(body.texture.size)
    assert (body.mapping, body.offset) == ("triplanar", (1e-3, 2e-3))


@pytest.mark.parametrize("by_geom", [False, True])
def test_without_its_texture_the_map_stays_where_it_is(folder, by_geom):
    own = {
        "texture": {**WAVES, "mapping": "triplanar", "offset": [1e-3, 0.0]},
        "friction": {k: v for k, v in MU.items() if k != "pixel_size"},
    }
    rough = scene(folder, {"geoms": {"right": own}} if by_geom else own)
    surface, smooth = rough.bodies[0].surfaces[1], rough.smooth().bodies[0].surfaces[1]
    assert smooth.texture is None
    assert (smooth.mapping, smooth.offset) == (surface.mapping, surface.offset)
    assert smooth.friction.size == pytest.approx(surface.friction.size)


def test_the_page_changes_the_texture_alone(folder):
    texture = {**WAVES, "mapping": "triplanar", "offset": [1e-3, 0.0]}
    config = SessionConfig(scene(folder, {"texture": texture, "friction": MU}))
    for kind in ("smooth", "knurl"):
        config = with_texture(config, "plate", kind)
        body = config.scene.bodies[0]
        assert (body.texture is None) == (kind == "smooth")
        assert (body.mapping, body.offset) == ("triplanar", (1e-3, 0.0))
        assert body.friction.size == pytest.approx((0.04, 8e-3))


def test_a_map_lies_as_the_terrain_of_the_model(folder):
    assets = (
        '<hfield name="h" nrow="6" ncol="6" size=".02 .02 .001 .001" elevation="'
        + " ".join(["0 .1 .2 .2 .1 0"] * 6) + '"/>'
    )  # fmt: skip
    terrain = '<geom type="hfield" hfield="h" pos="3e-3 0 0"/>'
    made = scene(folder, {"friction": MU}, terrain, assets)
    assert made.bodies[0].texture is not None
    assert made.bodies[0].offset == pytest.approx((3e-3, 0.0))
    smooth = made.smooth().bodies[0]
    assert (smooth.texture, smooth.offset) == (None, made.bodies[0].offset)
    with pytest.raises(AsperityError, match="lies as the height field"):
        scene(folder, {"friction": {**MU, "offset": [0.0, 1e-3]}}, terrain, assets)


def _made_of_a_box() -> str:
    corners = trimesh.creation.box((0.04, 0.02, 0.004)).vertices
    return f'<mesh name="made" vertex="{" ".join(str(x) for x in corners.ravel())}"/>'


def test_a_mesh_has_a_map_too(folder):
    mesh = {"file": "slab.stl", "unit": "m"}
    made = scene(
        folder, {"mesh": mesh, "friction": {**MU, "mapping": "triplanar"}}, MESH, _made_of_a_box()
    )
    assert made.bodies[0].mapping == "triplanar"
    simulation = Simulation(made)
    for x, wanted in ((-0.01, 0.1), (0.01, 0.6)):
        simulation.reset()
        for i in range(60):
            wrench = simulation.step([x + 1e-5 * i, 1e-3, 4e-3 - 5e-5, 1, 0, 0, 0])
        assert -wrench[0] / wrench[2] == pytest.approx(wanted, rel=1e-6)


REFUSED = {
    "no file": ({"friction": {"low": 0.1}}, ["bodies.plate.friction", "number", "file"]),
    "no high": (
        {"friction": {"file": "mu.png", "low": 0.1, "pixel_size": 1e-3}},
        ["mu.png", "low and high", "missing: high"],
    ),
    "neither": ({"friction": {"file": "mu.png", "pixel_size": 1e-3}}, ["missing: low and high"]),
    "negative": ({"friction": {**MU, "low": -0.1}}, ["low must lie between 0 and 100", "-0.1"]),
    "too large": ({"friction": {**MU, "high": 101.0}}, ["high must lie between", "101"]),
    "not finite": ({"friction": {**MU, "high": float("inf")}}, ["friction.high", "finite"]),
    "order": ({"friction": {**MU, "low": 0.7}}, ["low must not be above high"]),
    "text": ({"friction": {**MU, "low": "0.1"}}, ["friction.low", "a number"]),
    "key": ({"friction": {**MU, "hihg": 1}}, ["friction.hihg", "did you mean", "high"]),
    "no extent": ({"friction": {"file": "mu.npy"}}, ["mu.npy", "choose pixel_size or size"]),
    "two extents": ({"friction": {**MU, "size": [1, 1]}}, ["size and pixel_size"]),
    "pixels": ({"friction": {**MU, "pixel_size": 0.0}}, ["pixel_size", "1e-09"]),
    "not there": ({"friction": {**MU, "file": "no.png"}}, ["friction.file", "no such file"]),
    "kind": ({"friction": {**MU, "file": "slab.stl"}}, ["slab.stl", "unknown kind", ".png"]),
    "low of an array": ({"friction": {**MU, "file": "mu.npy"}}, ["low and high are for images"]),
    "placed apart": (
        {"texture": WAVES, "friction": {**MU, "mapping": "triplanar"}},
        ["friction.mapping", "'planar'", "leave it out"],
    ),
    "mapping": ({"friction": {**MU, "mapping": "uv"}}, ["texture coordinates"]),
    "round": ({"friction": {**MU, "mapping": "cylindrical"}}, ["no cylindrical mapping"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_maps_that_cannot_be(folder, name):
    table, words = REFUSED[name]
    with pytest.raises(AsperityError) as caught:
        scene(folder, table)
    for word in words:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)


def test_materials_have_numbers_beside_the_map_of_their_body(folder):
    box = trimesh.creation.box((0.04, 0.02, 0.004))
    lines = [f"v {x} {y} {z}" for x, y, z in box.vertices.tolist()] + ["vt 0 0", "vt 1 0", "vt 0 1"]
    for name, faces in (("glass", box.faces[:6]), ("rest", box.faces[6:])):
        lines.append(f"g {name}")
        lines += ["f {}/1 {}/2 {}/3".format(*(face + 1)) for face in faces]
    (folder / "slab.obj").write_text("\n".join(lines))
    table = {"mesh": {"file": "slab.obj", "unit": "m"}, "friction": MU}

    def made(glass):
        return scene(folder, {**table, "materials": {"glass": glass}}, MESH, _made_of_a_box())

    assert made({"friction": 0.3}).bodies[0].largest_friction == 0.6
    with pytest.raises(AsperityError, match=r"materials.glass.friction must be a number"):
        made({"friction": MU})
    with pytest.raises(AsperityError, match=r"plate.materials: valid without a map of friction"):
        made(WAVES)


@pytest.mark.parametrize(
    ("values", "word"),
    [(np.full((4, 4), -0.2), "-0.2"), (np.full((4, 4), 120.0), "120"),
     (np.full((4, 4), np.inf), "NaN or infinite"), (np.full(9, 0.2), "shape"),
     (np.full((4, 4), 0.2 + 1j), "real numbers")],
)  # fmt: skip
def test_arrays_that_are_no_friction(folder, values, word):
    np.save(folder / "bad.npy", values)
    with pytest.raises(AsperityError, match=word) as caught:
        FrictionMap.from_file(folder / "bad.npy", pixel_size=1e-3)
    assert "bad.npy" in str(caught.value)
    assert str(caught.value).count("bad.npy") == 1


def test_arrays_and_images_of_heights_or_colours_are_refused(folder):
    np.savez(folder / "heights.npz", map_um=np.full((4, 4), 0.3), pixel_size=1e-3)
    with pytest.raises(AsperityError, match="heights"):
        FrictionMap.from_file(folder / "heights.npz")
    colours = np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8)
    Image.fromarray(colours).save(folder / "colours.png")
    with pytest.raises(AsperityError, match="colours"):
        FrictionMap.from_file(folder / "colours.png", pixel_size=1e-3, low=0.1, high=0.6)
    Image.fromarray(np.full((6, 6), 0.25, np.float32)).save(folder / "float.tif")
    found = FrictionMap.from_file(folder / "float.tif", pixel_size=1e-3)
    assert (found.lowest, found.highest) == (0.25, 0.25)


def test_a_soft_skin_and_mujoco_take_numbers_alone(folder):
    skin = {"thickness": 3e-3, "modulus": 1e4}
    document = {"tool": {"body": "tool", "skin": skin}}
    with pytest.raises(AsperityError, match=r"tool.skin.*'plate' is a map"):
        scene(folder, {"friction": MU}, **document)
    mujoco = pytest.importorskip("asperity.mujoco")
    made = scene(folder, {})
    found = FrictionMap.from_file(folder / "mu.npy", pixel_size=1e-3)
    with pytest.raises(AsperityError, match=r"geom 'left'.*a number"):
        mujoco.attach(made.model, {"geom:left": mujoco.texture(None, friction=found)})
