"""Scenes: built in, from folders, saved; wrong ones are refused in one line."""

import mujoco
import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.scene.builtin import SCENES, load_scene, probe_plate
from asperity.scene.document import read_toml, write_toml
from asperity.scene.scene import read_scene, scene_of
from asperity.scene.trajectory import ScriptedMotion, Trajectory


@pytest.fixture(scope="module")
def plain():
    return load_scene("probe-plate")


@pytest.mark.parametrize("name", SCENES)
def test_built_in_scenes_survive_a_folder(name, tmp_path):
    scene = load_scene(name)
    assert scene.name == name
    scene.save(tmp_path / "saved")
    again = load_scene(tmp_path / "saved")
    assert again.document == scene.document
    assert again.force == scene.force
    assert again.motion == scene.motion
    for old, new in zip(scene.bodies, again.bodies, strict=True):
        assert (old.name, old.geoms, old.mapping) == (new.name, new.geoms, new.mapping)
        assert (old.texture is None, old.mesh is None) == (new.texture is None, new.mesh is None)
        if old.texture is not None:
            np.testing.assert_array_equal(old.texture.samples, new.texture.samples)
        if old.mesh is not None:
            for part in ("vertices", "faces", "normals", "uv"):
                np.testing.assert_array_equal(getattr(old.mesh, part), getattr(new.mesh, part))
    # Any tool of MuJoCo opens it.
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "saved" / "scene.xml"))
    assert model.body(scene.tool).id > 0
    mujoco.mj_step(model, mujoco.MjData(model))


def test_the_paper_s_probe(plain):
    tip = next(body for body in plain.bodies if body.name == plain.tool).geoms[0]
    assert (tip.kind, tip.size[0]) == ("sphere", 1.5e-3)
    assert tip.position == (0.0, 0.0, 0.0)
    assert probe_plate(diameter=1e-3).start[2] == pytest.approx(0.6e-3)
    assert plain.shortest_wavelength == pytest.approx(2e-3)


def test_a_seed_reaches_the_textures():
    fields = [
        next(b for b in load_scene("probe-plate-dots", seed=seed).bodies if b.name == "plate")
        for seed in (0, 0, 5)
    ]
    first, same, other = (body.texture.samples for body in fields)
    np.testing.assert_array_equal(first, same)
    assert np.abs(first - other).max() > 1e-4
    assert load_scene("probe-plate", seed=3).document["bodies"]["plate"]["texture"].keys() == {
        "kind", "wavelength", "amplitude",
    }  # fmt: skip


def test_changed_checks_again(plain):
    scene = plain.changed(force={"stiffness": 900.0, "anti_alias": "band"})
    assert (scene.force.stiffness, scene.anti_alias) == (900.0, "band")
    assert plain.force.stiffness == 400.0
    with pytest.raises(AsperityError, match=r"force\.stifness.*did you mean force\.stiffness"):
        plain.changed(force={"stifness": 900.0})


def test_files_of_textures_and_poses_move_along(plain, tmp_path):
    heights = np.random.default_rng(1).random((12, 12)) * 1e-5
    (tmp_path / "scene").mkdir()
    np.save(tmp_path / "scene" / "map.npy", heights)
    (tmp_path / "scene" / "poses.csv").write_text("0,0,0,0.01,1,0,0,0\n1,0,0,0.02,1,0,0,0\n")
    (tmp_path / "scene" / "scene.xml").write_text(plain.xml)
    document = {
        "schema": 1,
        "tool": {"body": "probe"},
        "bodies": {"plate": {"texture": {
            "file": "map.npy", "pixel_size": 1e-4, "mapping": "triplanar", "offset": [1e-3, 0],
        }}},
        "trajectory": {"file": "poses.csv"},
    }  # fmt: skip
    (tmp_path / "scene" / "scene.toml").write_text(write_toml(document))
    scene = read_scene(tmp_path / "scene" / "scene.toml")
    scene.save(tmp_path / "copy")
    for found in (scene, load_scene(tmp_path / "copy")):
        plate = next(b for b in found.bodies if b.name == "plate")
        np.testing.assert_allclose(plate.texture.samples, heights)
        assert (plate.mapping, tuple(plate.offset)) == ("triplanar", (1e-3, 0.0))
        assert isinstance(found.motion, Trajectory)
        assert found.motion.seconds == 1.0


def texture(**table):
    return {"bodies": {"plate": {"texture": table}}}


WAVES = {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4}


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"schema": 2}, ["schema must be 1", "2"]),
        ({"schema": None}, ["schema"]),
        ({"forces": {}}, ["forces", "did you mean force"]),
        ({"force": 3}, ["force must be a table", "3"]),
        ({"force": {"stifness": 1.0}}, ["force.stifness", "force.stiffness"]),
        ({"force": {"stiffness": -1.0}}, ["force", "stiffness", "-1"]),
        ({"force": {"stiffness": "400"}}, ["force.stiffness", "a number", "'400'"]),
        ({"force": {"stiffness": True}}, ["force.stiffness", "a number", "True"]),
        ({"force": {"stiffness": float("inf")}}, ["force.stiffness", "finite"]),
        ({"force": {"law": "coulomb"}}, ["law", "coulomb", "otaduy-lin"]),
        ({"force": {"anti_alias": "on"}}, ["force.anti_alias", "off, tick, band"]),
        ({"coupling": {"mode": "spring"}}, ["coupling.mode", "direct", "spring"]),
        ({"coupling": {"stifness": 1.0}}, ["coupling.stifness", "coupling.stiffness"]),
        ({"coupling": {"damping": -1.0}}, ["coupling", "damping", "-1"]),
        ({"coupling": {"mass_scale": "2"}}, ["coupling.mass_scale", "a number"]),
        ({"tool": {"body": "prob"}}, ["tool.body", "prob", "did you mean 'probe'"]),
        ({"tool": {"body": None}}, ["tool.body is missing"]),
        ({"tool": {"body": "plate"}}, ["'probe' has a joint"]),
        ({"bodies": {"plat": {}}}, ["bodies", "plat", "did you mean 'plate'"]),
        ({"bodies": {"plate": {"texure": {}}}}, ["bodies.plate.texure", "bodies.plate.texture"]),
        (texture(wavelnght=1.0), ["bodies.plate.texture.wavelnght", "wavelength"]),
        (texture(kind="sinusoids"), ["bodies.plate.texture.kind", "did you mean 'sinusoid'"]),
        (texture(kind=3), ["bodies.plate.texture.kind"]),
        (texture(kind=None), ["bodies.plate.texture", "kind", "file"]),
        (texture(amplitude=None), ["bodies.plate.texture.amplitude is missing"]),
        (texture(amplitude=-1e-4), ["bodies.plate.texture", "amplitude", "-0.0001"]),
        (texture(amplitude=2.5e-3), ["bodies.plate.texture", "plate", "half", "2 mm"]),
        (texture(samples=30.5), ["bodies.plate.texture.samples", "whole number"]),
        (texture(mapping="uv"), ["bodies.plate.texture", "mapping", "planar"]),
        (texture(offset=[1.0]), ["bodies.plate.texture", "offset"]),
        (texture(file="coin.png"), ["bodies.plate.texture.wavelength", "valid"]),
        ({"trajectory": {"speed": -0.1}}, ["trajectory", "speed", "-0.1"]),
        ({"trajectory": {"sped": 0.1}}, ["trajectory.sped", "trajectory.speed"]),
        ({"trajectory": {"kind": "slip"}}, ["trajectory.kind", "slip", "slide"]),
        ({"trajectory": {"start": [0.0, 1.0]}}, ["trajectory", "start"]),
    ],
)
def test_wrong_documents_are_refused(plain, change, names):
    def merged(old, new):
        out = dict(old)
        for key, value in new.items():
            out[key] = merged(out.get(key, {}), value) if isinstance(value, dict) else value
        return {key: value for key, value in out.items() if value is not None}

    with pytest.raises(AsperityError) as refused:
        scene_of(plain.xml, merged(plain.document, change))
    said = str(refused.value)
    assert "\n" not in said
    for name in names:
        assert name in said


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("<mujoco", "<mujco", ["not MJCF"]),
        ('<freejoint name="hand"/>', "", ["freejoint", "probe"]),
        ('<freejoint name="hand"/>', '<joint type="hinge"/>', ["probe", "no freejoint"]),
        ("</body>", '<joint type="slide"/></body>', ["joint", "plate"]),
        (
            '<freejoint name="hand"/>',
            '<freejoint/><body name="cap"><joint/><geom size="0.001"/></body>',
            ["cap", "has a joint; only the tool"],
        ),
    ],
)
def test_wrong_mjcf_is_refused(plain, old, new, names):
    with pytest.raises(AsperityError) as refused:
        scene_of(plain.xml.replace(old, new, 1), plain.document)
    for name in names:
        assert name in str(refused.value)
    assert "\n" not in str(refused.value)


def test_missing_and_broken_files_are_refused(plain, tmp_path):
    with pytest.raises(AsperityError, match="did you mean 'probe-plate'"):
        load_scene("probe-plat")
    with pytest.raises(AsperityError, match=r"no such file.*scene\.xml and scene\.toml"):
        load_scene(tmp_path)
    named = 'schema = 1\n[tool]\nbody = "probe"\n[bodies.plate.texture]\nfile = "none.png"\n'
    (tmp_path / "scene.toml").write_text(named)
    with pytest.raises(AsperityError, match=r"no such file.*scene\.xml"):
        load_scene(tmp_path)
    (tmp_path / "scene.xml").write_text(plain.xml)
    (tmp_path / "scene.toml").write_text("schema = = 1")
    with pytest.raises(AsperityError, match=r"is not TOML.*line 1"):
        load_scene(tmp_path)
    (tmp_path / "scene.toml").write_text(named)
    with pytest.raises(AsperityError, match=r"bodies\.plate\.texture\.file.*none\.png"):
        load_scene(tmp_path)


def test_toml_survives_odd_names(tmp_path):
    document = {"a": 1, "b": {"x y": {"s": 'q"\\\n\x7f', "n": [1.0, -2e-9], "t": True}}, "e": {}}
    (tmp_path / "t.toml").write_text(write_toml(document), "utf-8")
    assert read_toml(tmp_path / "t.toml") == document


def test_motion_of_the_document(plain):
    scene = plain.changed(trajectory={"kind": "circle", "radius": 0.004, "seconds": 1})
    assert isinstance(scene.motion, ScriptedMotion)
    assert (scene.motion.kind, scene.motion.radius, scene.motion.seconds) == ("circle", 0.004, 1.0)


def test_mjcf_in_several_files(plain, tmp_path):
    plain.save(tmp_path / "mine")
    path = tmp_path / "mine" / "scene.xml"
    text = path.read_text("utf-8")
    begin, end = text.index("<worldbody>"), text.index("</worldbody>") + len("</worldbody>")
    (tmp_path / "mine" / "parts.xml").write_text(f"<mujoco>{text[begin:end]}</mujoco>")
    path.write_text(text[:begin] + '<include file="parts.xml"/>' + text[end:])
    assert [b.name for b in load_scene(tmp_path / "mine").bodies] == ["plate", "probe"]
