"""Bodies that are meshes: from files, made, or plain MuJoCo; scenes straight from files."""

import importlib.util

import mujoco
import numpy as np
import pytest
from PIL import Image

from asperity import make_scene
from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.scene.mesh import MESHES, body_mesh, mesh_and_pieces, uv_size
from asperity.scene.mjcf import is_closed, mesh_assets, mesh_geoms
from asperity.scene.scene import read_scene, scene_of

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
SIDES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)
BLOCK = {"kind": "block", "length": 0.03, "width": 0.02, "height": 0.01}


def write_box(path, size, uv=True, middle=(0.0, 0.0, 0.0)):
    """Write a box as OBJ, each side with the whole texture; `size` in the file's unit."""
    lines = [f"v {x} {y} {z}" for x, y, z in 0.5 * np.array(size) * CORNERS + middle]
    if uv:
        lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    for side in SIDES + 1:
        lines.append("f " + " ".join(f"{v}/{k}" if uv else f"{v}" for k, v in enumerate(side, 1)))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_image(path, rows=32, columns=64):
    grey = np.random.default_rng(2).integers(0, 60000, (rows, columns)).astype(np.uint16)
    Image.fromarray(grey).save(path)
    return path


def mesh_scene(table=None, geoms="", pieces=None):
    """Return MJCF and document of a block as a mesh under a probe."""
    mesh, own = mesh_and_pieces(BLOCK, "block")
    pieces = own if pieces is None else pieces
    xml = f"""<mujoco><asset>{mesh_assets("block", mesh, pieces)}</asset><worldbody>
      <body name="block" pos="0.1 0 0" quat="0.6 0 0.8 0">
      {mesh_geoms("block", mesh, density=[1e3] * len(pieces), rgba=["1 0 0 1"] * len(pieces))}
      {geoms}</body>
      <body name="probe" pos="0 0 0.1"><freejoint/><geom size="0.001"/></body>
    </worldbody></mujoco>"""
    bodies = {} if table is None else {"block": {"mesh": table}}
    return xml, {"schema": 1, "tool": {"body": "probe"}, "bodies": bodies}


def placed_vertices(model, geom):
    """Return the vertices of a geom's mesh in its body's frame, as MuJoCo places them."""
    number = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    return model.mesh_vert[first : first + count] @ turn.reshape(3, 3).T + model.geom_pos[geom]


def body_of(scene, name):
    return next(body for body in scene.bodies if body.name == name)


@pytest.mark.parametrize("name", ["hammer-blocks", "file-cad"])
def test_the_mesh_lies_where_any_mujoco_tool_shows_it(name):
    scene = load_scene(name)
    model = scene.model
    meshes = [body for body in scene.bodies if body.mesh is not None]
    assert len(meshes) >= 2
    for body in meshes:
        shape = model.geom(f"{body.name}-shape").id
        assert (model.geom_contype[shape], model.geom_group[shape]) == (0, 2)
        np.testing.assert_allclose(placed_vertices(model, shape), body.mesh.vertices, atol=1e-7)
        assert {geom.kind for geom in body.geoms} == {"mesh"}
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in range(1, len(body.geoms) + 1):
            piece = model.geom(f"{body.name}-{i}").id
            assert (model.geom_contype[piece], model.geom_group[piece]) == (1, 3)
            points = placed_vertices(model, piece)
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
            # The geom's box holds its piece.
            local = placed_vertices(model, piece) - body.geoms[i - 1].position
            assert np.linalg.norm(local, axis=1).max() <= np.linalg.norm(body.geoms[i - 1].size)
        np.testing.assert_allclose(low, body.mesh.vertices.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(high, body.mesh.vertices.max(axis=0), atol=1e-6)


def test_the_tools_frames_are_where_they_are_said_to_be():
    scene = load_scene("hammer-blocks")
    hammer = body_of(scene, "hammer").mesh.vertices
    face = hammer[np.argmin(hammer[:, 2])]
    np.testing.assert_allclose(face, 0.0, atol=1e-9)
    assert hammer[:, 0].min() < -0.2  # the handle
    assert scene.start[2] == pytest.approx(0.03 + 5e-4)
    np.testing.assert_array_equal(scene.start[3:], [1, 0, 0, 0])
    assert 0.3 < scene.model.body("hammer").mass[0] < 0.7
    scene = load_scene("file-cad")
    file = body_of(scene, "file").mesh.vertices
    assert file[:, 0].max() == pytest.approx(0.12)
    assert scene.start[2] == pytest.approx(0.022 + 0.002 + 5e-4)


def test_a_mesh_s_mass_is_that_of_its_volume():
    xml, document = mesh_scene(BLOCK)
    scene = scene_of(xml, document)
    mesh = body_of(scene, "block").mesh
    assert is_closed(mesh)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    assert 0.9 * 6e-6 < volume < 6e-6  # chamfered
    assert scene.model.body("block").mass[0] == pytest.approx(1e3 * volume, rel=1e-5)
    np.testing.assert_allclose(scene.model.body("block").ipos, 0.0, atol=1e-8)
    # An open one has no volume; its pieces have.
    without = mesh.faces[:-2]
    assert not is_closed(type(mesh)(mesh.vertices, without, mesh.normals[:-2]))


def test_a_mesh_is_placed_in_its_body():
    turned = {"position": [0.0, 0.0, 0.5], "quaternion": [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]}
    plain, placed = body_mesh(BLOCK, "m", None), body_mesh(BLOCK | turned, "m", None)
    np.testing.assert_allclose(np.ptp(placed.vertices, axis=0), [0.01, 0.02, 0.03], atol=1e-12)
    np.testing.assert_allclose(placed.vertices.mean(axis=0), [0, 0, 0.5], atol=1e-12)
    np.testing.assert_allclose(placed.normals[..., 2], -plain.normals[..., 0], atol=1e-12)
    _, pieces = mesh_and_pieces(BLOCK | turned, "m")
    np.testing.assert_allclose(pieces[0].mean(axis=0), [0, 0, 0.5], atol=1e-12)


def test_a_plain_mujoco_mesh_is_taken_as_it_is():
    xml, document = mesh_scene()
    scene = scene_of(xml, document)
    body = body_of(scene, "block")
    mesh, _ = mesh_and_pieces(BLOCK, "block")
    np.testing.assert_allclose(
        np.ptp(body.mesh.vertices, axis=0), np.ptp(mesh.vertices, axis=0), atol=1e-8
    )
    assert "no [bodies.block.mesh]" in scene.notes[0]
    # Two pieces in odd places: each where its geom is.
    moved = [CORNERS * 0.004, CORNERS * 0.002 + [0.02, 0.01, 0.0]]
    scene = scene_of(*mesh_scene(pieces=moved))
    points = body_of(scene, "block").mesh.vertices
    for piece in moved:
        for corner in piece:
            assert np.linalg.norm(points - corner, axis=1).min() < 1e-7


def test_meshes_in_files_of_mujoco_move_into_the_scene(tmp_path):
    write_box(tmp_path / "box.obj", (2.0, 4.0, 6.0), middle=(10.0, 0.0, 0.0))
    Image.new("RGB", (4, 4), (200, 30, 30)).save(tmp_path / "red.png")
    (tmp_path / "scene.toml").write_text('schema = 1\n[tool]\nbody = "probe"\n')
    (tmp_path / "scene.xml").write_text(
        """<mujoco><compiler meshdir="."/><asset>
        <mesh file="box.obj" scale="0.001 0.001 0.001"/>
        <texture name="t" type="2d" file="red.png"/><material name="m" texture="t"/></asset>
        <worldbody>
        <body name="box"><geom type="mesh" mesh="box" pos="0 0 0.5" material="m"/></body>
        <body name="probe" pos="0 0 1"><freejoint/><geom size="0.001"/></body>
        </worldbody></mujoco>"""
    )
    scene = read_scene(tmp_path)
    assert "red.png" in scene.notes[0]
    scene.save(tmp_path / "copy")
    for found in (scene, load_scene(tmp_path / "copy")):
        points = body_of(found, "box").mesh.vertices
        np.testing.assert_allclose(points.min(axis=0), [9e-3, -2e-3, 0.497], atol=1e-6)
        np.testing.assert_allclose(points.max(axis=0), [11e-3, 2e-3, 0.503], atol=1e-6)


@pytest.mark.parametrize(
    ("table", "names"),
    [
        ({"unit": "mm"}, ["bodies.block.mesh", "kind", "file", "hammer"]),
        ({"kind": "hamer"}, ["bodies.block.mesh.kind", "did you mean 'hammer'"]),
        ({"kind": ["block"]}, ["bodies.block.mesh.kind"]),
        (
            {"kind": "block", "lenght": 1.0},
            ["bodies.block.mesh.lenght", "bodies.block.mesh.length"],
        ),
        ({"kind": "block", "length": 0.03}, ["bodies.block.mesh.width is missing"]),
        (BLOCK | {"length": -1.0}, ["bodies.block.mesh", "length", "-1"]),
        (BLOCK | {"length": "3"}, ["bodies.block.mesh.length", "a number"]),
        (BLOCK | {"position": [1.0]}, ["bodies.block.mesh", "position", "3 finite"]),
        (BLOCK | {"quaternion": [1.0, 1.0, 0.0, 0.0]}, ["bodies.block.mesh", "quaternion"]),
        (BLOCK | {"length": 30.0}, ["bodies.block.mesh"]),
        (BLOCK | {"position": [0.5, 0.0, 0.0]}, ["bodies.block.mesh", "unit", "mm"]),
        ({"file": "none.obj"}, ["bodies.block.mesh.file", "none.obj"]),
        ({"file": 3}, ["bodies.block.mesh.file", "a text"]),
        ({"file": "x.obj", "hardangle": 3.0}, ["hardangle", "bodies.block.mesh.hard_angle"]),
        ({"file": "x.obj", "atlas": 1}, ["bodies.block.mesh.atlas", "true or false"]),
    ],
)
def test_wrong_meshes_are_refused(table, names):
    with pytest.raises(AsperityError) as refused:
        scene_of(*mesh_scene(table))
    assert "\n" not in str(refused.value)
    for name in names:
        assert name in str(refused.value)


@pytest.mark.parametrize("table", [None, BLOCK])
def test_meshes_and_simple_geoms_do_not_mix(table):
    with pytest.raises(AsperityError, match=r"block.*sphere.*separate body"):
        scene_of(*mesh_scene(table, geoms='<geom size="0.01"/>'))


def test_a_mesh_without_mesh_geoms_is_refused():
    scene = load_scene("probe-plate")
    with pytest.raises(AsperityError, match=r"bodies\.plate\.mesh.*box"):
        scene.changed(bodies={"plate": {"mesh": BLOCK}})


def test_a_wrong_unit_is_seen(tmp_path):
    write_box(tmp_path / "block.obj", (30.0, 20.0, 10.0))
    xml, document = mesh_scene({"file": str(tmp_path / "block.obj"), "unit": "mm"})
    scene = scene_of(xml, document)
    assert body_of(scene, "block").mesh.name == "block"
    with pytest.raises(AsperityError, match=r"bodies\.block\.mesh.*unit"):
        scene.changed(bodies={"block": {"mesh": {"unit": "cm"}}})


def test_every_maker_gives_a_mesh_with_pieces():
    for kind in MESHES:
        table = BLOCK if kind == "block" else {"kind": kind}
        mesh, pieces = mesh_and_pieces(table, "m")
        assert mesh.name == kind
        assert mesh.uv is not None
        assert len(pieces) >= 1


def test_how_far_texture_coordinates_reach():
    mesh, _ = mesh_and_pieces(BLOCK | {"uv_size": (0.012, 0.03)}, "m")
    u, v = uv_size(mesh)
    assert u == pytest.approx(0.012, rel=0.05)
    assert v == pytest.approx(0.03, rel=0.05)


class TestFromFiles:
    """`make_scene`."""

    @pytest.fixture
    def files(self, tmp_path):
        return {
            "tool": write_box(tmp_path / "bar.obj", (8.0, 8.0, 30.0), middle=(0, 0, 40)),
            "target": write_box(tmp_path / "slab.obj", (40.0, 60.0, 5.0), uv=False),
            "target_texture": write_image(tmp_path / "rough.png"),
            "unit": "mm",
        }

    def test_two_meshes_and_an_image_are_a_scene(self, files, tmp_path):
        scene = make_scene(**files, tool_texture={"kind": "knurl", "pitch": 1e-3, "height": 1e-4})
        assert scene.name == "bar-on-slab"
        assert scene.tool == "tool"
        target, tool = (body_of(scene, name) for name in ("target", "tool"))
        assert (target.mapping, tool.mapping) == ("uv", "triplanar")
        assert target.texture.relief == pytest.approx(2e-4, rel=1e-2)
        told = "\n".join(scene.notes)
        for word in (
            "atlas was made",
            "no height_range for rough.png: 0.2 mm",
            "no size for rough",
        ):
            assert word in told
        # The tool stands above the slab's top, both textures' reach away, and slides along y.
        low = tool.mesh.vertices[:, 2].min() + scene.start[2]
        reach = tool.texture.highest + target.texture.highest
        assert low - 2.5e-3 == pytest.approx(reach + 1e-4, abs=2e-7)
        assert scene.motion.length == pytest.approx(0.036)
        assert scene.motion.direction == pytest.approx(np.pi / 2)
        assert scene.start[1] == pytest.approx(-0.018)
        assert scene.model.body("tool").mass[0] == pytest.approx(
            1e3 * 8e-3 * 8e-3 * 30e-3, rel=1e-4
        )
        scene.save(tmp_path / "saved")
        assert {p.name for p in (tmp_path / "saved").glob("[!.]*")} == {
            "scene.xml", "scene.toml", "bar.obj", "slab.obj", "rough.png",
        }  # fmt: skip
        again = load_scene(tmp_path / "saved")
        for body in scene.bodies:
            np.testing.assert_array_equal(body.mesh.uv, body_of(again, body.name).mesh.uv)
            np.testing.assert_array_equal(
                body.texture.samples, body_of(again, body.name).texture.samples
            )
        stiffer = again.changed(force={"stiffness": 900.0})
        np.testing.assert_array_equal(stiffer.start, scene.start)

    def test_what_is_given_is_not_chosen(self, files):
        texture = {
            "file": files.pop("target_texture"), "height_range": 1e-5, "size": [0.02, 0.01],
            "mapping": "triplanar",
        }  # fmt: skip
        with pytest.raises(AsperityError, match="border"):
            make_scene(**files, target_texture=texture | {"border": "none"})
        scene = make_scene(**files, target_texture=texture, stiffness=123.0, name="mine")
        field = body_of(scene, "target").texture
        assert field.size == pytest.approx((0.02, 0.01))
        assert (scene.name, scene.force.stiffness) == ("mine", 123.0)
        assert not any("no size" in note or "no height" in note for note in scene.notes)

    def test_an_image_by_triplanar_reaches_once_over_the_body(self, files):
        texture = {"file": files.pop("target_texture"), "mapping": "triplanar"}
        field = body_of(make_scene(**files, target_texture=texture), "target").texture
        assert field.size == pytest.approx((0.06, 0.03))
        assert field.border == "wrap"

    def test_an_image_on_texture_coordinates_is_as_large_as_they_say(self, tmp_path):
        box = write_box(tmp_path / "cube.obj", (0.02, 0.02, 0.02))
        scene = make_scene(tool=box, target=box, tool_texture=write_image(tmp_path / "i.png"))
        assert body_of(scene, "tool").texture.size == pytest.approx((0.02, 0.02))

    def test_without_xatlas_it_is_triplanar(self, files, monkeypatch):
        find = importlib.util.find_spec
        monkeypatch.setattr(
            importlib.util, "find_spec", lambda name: None if name == "xatlas" else find(name)
        )
        scene = make_scene(**files)
        assert body_of(scene, "target").mapping == "triplanar"
        assert any("xatlas" in note for note in scene.notes)

    def test_a_peak_has_a_short_slide(self, files, tmp_path):
        peak = tmp_path / "peak.obj"
        peak.write_text(
            "v -20 -20 0\nv 20 -20 0\nv 20 20 0\nv -20 20 0\nv 0 0 20\n"
            "f 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
        )
        scene = make_scene(tool=files["tool"], target=peak, unit="mm")
        assert scene.motion.length == pytest.approx(2e-3)
        low = body_of(scene, "tool").mesh.vertices[:, 2].min() + scene.start[2]
        assert low == pytest.approx(0.02 + 1e-4, abs=1e-6)

    def test_a_tool_may_be_turned(self, files):
        half = float(np.sqrt(0.5))
        files["tool"] = {"file": files["tool"], "quaternion": [half, 0.0, half, 0.0]}
        scene = make_scene(**files)
        low = body_of(scene, "tool").mesh.vertices[:, 2].min() + scene.start[2]
        assert np.ptp(body_of(scene, "tool").mesh.vertices[:, 0]) == pytest.approx(0.03)
        assert 2.5e-3 < low < 3e-3

    @pytest.mark.parametrize(
        ("change", "names"),
        [
            ({"tool": "none.obj"}, ["tool", "none.obj"]),
            ({"target": {"unit": "mm"}}, ["target", "kind", "file"]),
            ({"target": {}}, ["target", "file"]),
            ({"target": 3}, ["target", "table"]),
            ({"unit": "furlong"}, ["unit", "furlong", "mm"]),
            ({"unit": "m"}, ["bar", "m"]),
            ({"target_texture": "none.png"}, ["target_texture", "none.png"]),
            ({"tool_texture": {"kind": "knurled"}}, ["texture.kind", "did you mean 'knurl'"]),
            ({"tool_texture": {"kind": "sinusoid", "mapping": 3}}, ["tool.texture.mapping", "3"]),
            ({"stiffness": -1.0}, ["stiffness", "-1"]),
        ],
    )
    def test_bad_input_is_one_line(self, files, change, names):
        with pytest.raises(AsperityError) as refused:
            make_scene(**files | change)
        assert "\n" not in str(refused.value)
        for name in names:
            assert name in str(refused.value)
