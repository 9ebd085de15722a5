"""The table [bodies.NAME.elastic], and the built-in scene of an elastic block."""

import pickle
import sys

import numpy as np
import pytest

from asperity.contact.deformable import elastic_solid
from asperity.contact.deformable.elastic_body import elastic_body
from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.scene.mjcf import MODEL
from asperity.scene.scene import read_scene, scene_of
from asperity.studies.comparison.compare import compare
from asperity.studies.stability.measure import measure_stability


def block(**elastic):
    """Return the built-in block, coarse, with some keys changed."""
    table = {"spacing": 7e-3, "modes": 8} | elastic
    return load_scene("elastic-block").changed(bodies={"block": {"elastic": table}})


KEY = r"^bodies\.block\.elastic"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"modulus": -1.0}, r"\.modulus must lie between"),
        ({"modulus": None}, r"\.modulus is missing"),
        ({"modulus": "soft"}, r"\.modulus must be a number"),
        ({"poisson": 0.5}, r"\.poisson must be 0 or above and below 0\.5"),
        ({"poisson": -0.1}, r"\.poisson must be"),
        ({"density": 0.0}, r"\.density must be"),
        ({"damping": 11.0}, r"\.damping must lie"),
        ({"modes": 0}, r"\.modes must lie"),
        ({"modes": 2.5}, r"\.modes must be a whole number"),
        ({"modes": 1000, "spacing": 0.03}, r"\.modes must be 1 to \d+, got 1000"),
        ({"fixed": "botom"}, r"\.fixed must be one of bottom, top.*did you mean 'bottom'"),
        ({"fixed_depth": 1.0}, r"\.fixed_depth 1 m holds all of the body"),
        ({"spacing": 0.0}, r"\.spacing must lie"),
        ({"spacing": 1e-3}, r"\.spacing 0\.001 m divides the box into \d+ tetrahedra"),
        ({"friction": -1.0}, r"\.friction must lie"),
        ({"layer_thickness": 0.0}, r"\.layer_thickness must lie"),
        ({"layer_modulus": 0.1}, r"\.layer_modulus must lie"),
        ({"pitch": 2e-6}, r"\.pitch 2e-06 m gives .* taxels"),
        ({"young": 1e5}, r"unknown key bodies\.block\.elastic\.young"),
        ({"modulsu": 1e5}, r"did you mean bodies\.block\.elastic\.modulus"),
    ],
)
def test_wrong_values_are_named(changed, words):
    with pytest.raises(AsperityError, match=words) as refused:
        block(**changed)
    assert str(refused.value).startswith(("bodies.block.elastic", "unknown key bodies.block."))
    assert "\n" not in str(refused.value)


SKIN = {"thickness": 1e-3, "modulus": 1e4}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"bodies": {"block": {"skin": SKIN}}}, r"block\.elastic and bodies\.block\.skin: .* one"),
        ({"tool": {"skin": SKIN}}, r"bodies\.block\.elastic and tool\.skin: a scene has one soft"),
        ({"bodies": {"probe": {"elastic": {"modulus": 1e5}}}}, "a scene has one soft body"),
        ({"bodies": {"block": {"elastic": None}, "probe": {"elastic": {"modulus": 1e5}}}},
         r"bodies\.probe\.elastic: 'probe' is the tool"),
        ({"bodies": {"block": {"elastic": 3}}}, r"bodies\.block\.elastic must be a table"),
    ],
)  # fmt: skip
def test_wrong_scenes_are_refused(changed, words):
    with pytest.raises(AsperityError, match=words) as refused:
        load_scene("elastic-block").changed(**changed)
    assert "\n" not in str(refused.value)


def scene_with(geoms, elastic=None, more="", **tables):
    """Return the scene of a ball over a body of some geoms, and other bodies."""
    bodies = f"""<body name="block">{geoms}</body>{more}
        <body name="probe" pos="0 0 0.02"><freejoint/><geom type="sphere" size="0.004"/></body>"""
    xml = MODEL.format(
        name="t", note="", compiler="", extent=0.1, centre="0 0 0", light="0 0 1", assets="",
        bodies=bodies,
    )  # fmt: skip
    table = {"modulus": 1e5, "spacing": 5e-3} if elastic is None else elastic
    document = {"schema": 1, "tool": {"body": "probe"}}
    return scene_of(xml, document | {"bodies": {"block": {"elastic": table}}} | tables)


@pytest.mark.parametrize(
    ("geoms", "more", "words"),
    [
        ('<geom type="sphere" size="0.01"/>', "", r"elastic: body 'block' is made of sphere; val"),
        ('<geom type="box" size=".01 .01 .01"/><geom type="box" size=".01 .02 .01"/>', "",
         "made of box, box; valid: one box, or a mesh"),
        ('<geom type="box" size=".01 .01 .01"/>',
         '<body name="post" pos="0.05 0 0"><geom size="0.002"/></body>', "there is 'post'; leave"),
    ],
)  # fmt: skip
def test_other_bodies_are_refused(geoms, more, words):
    with pytest.raises(AsperityError, match=words):
        scene_with(geoms, more=more)


def test_what_is_not_given_is_chosen_and_noted():
    scene = scene_with('<geom type="box" size="0.02 0.015 0.006"/>', {"modulus": 1e5})
    solid = scene.elastic
    assert solid.spacing == pytest.approx(3e-3)
    assert solid.layer_thickness == pytest.approx(1.5e-3)
    assert solid.layer_modulus == 1e5
    (note,) = (note for note in scene.notes if "elastic" in note)
    for words in ("spacing 3 mm", "layer_thickness 1.5 mm", "pitch 0.375 mm", "held at the bottom"):
        assert words in note
    # A thin, wide box is not divided beyond what a tick can bear.
    wide = scene_with('<geom type="box" size="0.1 0.1 0.004"/>', {"modulus": 1e5}).elastic
    assert len(wide.divided[0].vertices) <= elastic_solid.FEW_VERTICES


@pytest.mark.parametrize(
    ("fixed", "axis", "side"), [("bottom", 2, 0), ("top", 2, 1), ("left", 0, 0), ("back", 1, 1)]
)
def test_it_is_held_where_it_is_fixed(fixed, axis, side):
    solid = block(fixed=fixed).elastic
    mesh, body = solid.divided[0], solid.elastic
    end = (mesh.vertices[:, axis].min(), mesh.vertices[:, axis].max())[side]
    still = np.abs(mesh.vertices[:, axis] - end) < 1e-9
    moves = np.abs(body.modes).reshape(-1, 3, body.modes.shape[1]).max(axis=(1, 2))
    np.testing.assert_array_equal(moves < 1e-9 * moves.max(), still)


def test_a_box_lies_where_its_geom_does():
    solid = scene_with(
        '<geom type="box" size="0.01 0.02 0.005" pos="0.03 0 0.001" quat="0.5 0 0 0.5"/>'
    ).elastic
    vertices = solid.divided[0].vertices
    np.testing.assert_allclose(vertices.min(axis=0), [0.01, -0.01, -0.004], atol=1e-12)
    np.testing.assert_allclose(vertices.max(axis=0), [0.05, 0.01, 0.006], atol=1e-12)


def test_the_block_survives_a_folder(tmp_path):
    scene = block(friction=0.3)
    scene.save(tmp_path / "block")
    again = read_scene(tmp_path / "block")
    assert again.document == scene.document
    assert again.notes == scene.notes
    for name in ("modulus", "poisson", "spacing", "friction", "layer_thickness", "pitch", "fixed"):
        assert getattr(again.elastic, name) == getattr(scene.elastic, name)
    np.testing.assert_array_equal(again.elastic.elastic.modes, scene.elastic.elastic.modes)


def test_it_is_small_on_its_way_to_another_process():
    solid = block().elastic
    small = len(pickle.dumps(solid))
    _ = solid.elastic, solid.surface.arrays
    packed = pickle.dumps(solid)
    assert len(packed) == small
    np.testing.assert_array_equal(pickle.loads(packed).elastic.modes, solid.elastic.modes)


def test_the_modal_form_is_kept_and_serves_any_modulus(tmp_path, monkeypatch):
    monkeypatch.setattr(elastic_solid, "kept_folder", lambda kind: tmp_path / kind)
    first = block().elastic.elastic
    (file,) = tmp_path.rglob("*.npz")
    monkeypatch.setattr(elastic_solid, "elastic_body", None)  # from now on: from the file
    solid = block(modulus=2e6, density=500.0).elastic
    other = solid.elastic
    assert [file] == [*tmp_path.rglob("*.npz")]
    monkeypatch.undo()
    mesh, nodes, cells = solid.divided
    direct = elastic_body(
        mesh, nodes, cells, modulus=2e6, density=500.0, held=solid.held, poisson=0.45, modes=8
    )
    np.testing.assert_allclose(other.frequencies, direct.frequencies, rtol=1e-9)
    np.testing.assert_allclose(
        other.compliance, direct.compliance, atol=1e-11 * direct.compliance.max()
    )
    assert other.mass == pytest.approx(direct.mass, rel=1e-12)
    assert other.mass == pytest.approx(500.0 / 1070.0 * first.mass, rel=1e-12)


def test_a_damaged_file_is_computed_again(tmp_path, monkeypatch):
    monkeypatch.setattr(elastic_solid, "kept_folder", lambda kind: tmp_path / kind)
    first = block().elastic.elastic
    (file,) = tmp_path.rglob("*.npz")
    file.write_bytes(file.read_bytes()[:1000])
    np.testing.assert_allclose(block().elastic.elastic.frequencies, first.frequencies, rtol=1e-12)


def test_anti_aliasing_is_off_and_noted():
    scene = load_scene("elastic-block").changed(force={"anti_alias": "tick"})
    assert scene.anti_alias == scene.acting_anti_alias == "off"
    assert any(note.startswith("force.anti_alias: off") for note in scene.notes)
    assert not any("anti_alias" in note for note in load_scene("elastic-block").notes)
    assert scene.shortest_wavelength == scene.elastic.pitch  # its dots' rims are finer


@pytest.mark.parametrize("measure", [measure_stability, lambda scene: compare(scene, [])])
def test_what_is_of_rigid_bodies_refuses_one(measure):
    with pytest.raises(AsperityError, match="elastic-block has an elastic body"):
        measure(load_scene("elastic-block"))


def test_a_mesh_needs_the_extra_soft(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pytetwild", None)
    scene = mesh_scene(tmp_path, elastic=False)
    with pytest.raises(AsperityError, match=r"elastic: a mesh is filled .*'asperity\[soft\]'"):
        scene.changed(bodies={"target": {"elastic": {"modulus": 1e5}}})


def test_a_mesh_is_filled(tmp_path, monkeypatch):
    """By a stand-in for pytetwild where that is not installed: the tetrahedra of its box."""
    monkeypatch.setattr(elastic_solid, "kept_folder", lambda kind: tmp_path / kind)
    nodes, cells, _ = elastic_solid.box_tetrahedra((0.01, 0.0075, 0.005), (4, 3, 2))
    wanted = []

    def filled(mesh, edge_length):
        wanted.append((mesh.name, edge_length))
        return nodes, cells

    monkeypatch.setattr(elastic_solid, "tetrahedra_in", filled)
    monkeypatch.setattr(elastic_solid, "require_tetrahedra", lambda: None)
    scene = mesh_scene(tmp_path)
    solid = scene.elastic
    assert solid.divided[0] is solid.body.mesh
    low = solid.elastic.modes[3 * np.flatnonzero(solid.body.mesh.vertices[:, 2] < -0.0049)]
    assert np.abs(low).max() < 1e-6 * np.abs(solid.elastic.modes).max()
    _ = scene.changed(force={"friction": 0.1}).elastic.divided
    assert len(wanted) == 1  # and then from the disk


def mesh_scene(folder, elastic=True):
    """Return the scene of a ball over a box that is a mesh."""
    import trimesh

    import asperity

    box = trimesh.creation.box((0.02, 0.015, 0.01)).subdivide()
    box.export(folder / "box.stl")
    scene = asperity.make_scene(tool="sphere:6mm", target=folder / "box.stl", unit="m")
    table = {"elastic": {"modulus": 1e5, "spacing": 5e-3, "modes": 5}} if elastic else {}
    return scene.changed(bodies={"target": table})
