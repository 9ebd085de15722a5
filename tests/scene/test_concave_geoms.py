"""Concave meshes in MJCF: cut into convex pieces where MuJoCo would collide their hull."""

import sys

import numpy as np
import pytest

import asperity
from asperity.errors import AsperityError
from asperity.geometry.convex.pieces import is_convex, piece_error
from asperity.scene.builtin import SCENES, load_scene
from asperity.scene.mjcf import compiled
from asperity.scene.scene import read_scene, scene_of

trimesh = pytest.importorskip("trimesh")

DOCUMENT = {"schema": 1, "tool": {"body": "ball"}}
R = 2e-3


def cup_with_hole():
    """Return a tube that is closed below but for a hole, as a surface of revolution."""
    profile = [(3, 0), (15, 0), (15, 20), (12, 20), (12, 4), (3, 4), (3, 0)]
    return trimesh.creation.revolve(1e-3 * np.array(profile, float), sections=24)


def channel():
    y = 1e-3 * np.array([-60, 60, 60, 20, 20, -20, -20, -60])
    z = 1e-3 * np.array([0, 0, 50, 50, 10, 10, 50, 50])
    points = np.array([(x, *p) for x in (-0.06, 0.06) for p in zip(y, z, strict=True)])
    cap = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]
    faces = [(a, c, b) for a, b, c in cap] + [(a + 8, b + 8, c + 8) for a, b, c in cap]
    for i in range(8):
        j = (i + 1) % 8
        faces += [(i, j, j + 8), (i, j + 8, i + 8)]
    return trimesh.Trimesh(points, faces, process=False)


SHAPES = {
    "channel": channel,
    "ring": lambda: trimesh.creation.annulus(r_min=0.01, r_max=0.02, height=0.01, sections=16),
    "cup": cup_with_hole,
}


def text(rows):
    return " ".join(f"{value:.9g}" for value in np.ravel(rows))


def xml_of(solid, geom="", more="", asset=""):
    return f"""<mujoco><asset>
      <mesh name="shape" vertex="{text(solid.vertices)}" face="{text(solid.faces)}"/>{asset}
    </asset><worldbody>
    <body name="body"><geom type="mesh" mesh="shape" {geom}/>{more}</body>
    <body name="ball" pos="0 0 .3"><freejoint/><geom type="sphere" size="{R}"/></body>
    </worldbody></mujoco>"""


def body_of(scene):
    return next(body for body in scene.bodies if body.name == "body")


def pieces_of(scene):
    """Return the corners of the touchable geoms of the body, as MuJoCo places them."""
    model, pieces = scene.model, []
    for i in range(model.ngeom):
        if model.geom_contype[i] and model.body(int(model.geom_bodyid[i])).name == "body":
            mesh = model.geom_dataid[i]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            turn = trimesh.transformations.quaternion_matrix(model.geom_quat[i])[:3, :3]
            points = model.mesh_vert[first : first + count] @ turn.T + model.geom_pos[i]
            pieces.append(points.astype(float))
    assert len(pieces) == len(body_of(scene).geoms)
    return tuple(pieces)


def errors_of(scene):
    """Return how far the surface reaches out of the pieces, or the pieces out of its box [m]."""
    mesh, pieces = body_of(scene).mesh, pieces_of(scene)
    corners = np.concatenate(pieces)
    beyond = max(
        (mesh.vertices.min(axis=0) - corners.min(axis=0)).max(),
        (corners.max(axis=0) - mesh.vertices.max(axis=0)).max(),
    )
    return max(piece_error(mesh, pieces), beyond)


@pytest.fixture
def no_coacd(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "coacd", None)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_concave_geom_is_cut_and_told(shape):
    pytest.importorskip("coacd")
    solid = SHAPES[shape]()
    xml = xml_of(solid, 'name="part" pos="0.01 0.02 0" quat="0.6 0 0.8 0"')
    scene = scene_of(xml, DOCUMENT)
    body = body_of(scene)
    assert len(body.geoms) >= 3
    (note,) = [note for note in scene.notes if "concave" in note]
    assert "'part'" in note
    assert f"{len(body.geoms)} convex pieces" in note
    # What is felt is the mesh, where the geom places it; the pieces lie there too.
    turn = trimesh.transformations.quaternion_matrix([0.6, 0, 0.8, 0])[:3, :3]
    placed = solid.vertices @ turn.T + [0.01, 0.02, 0]
    distance = np.linalg.norm(body.mesh.vertices[:, None] - placed, axis=2).min(axis=1)
    assert distance.max() < 1e-7
    assert len(body.mesh.faces) == len(solid.faces)
    assert errors_of(scene) < 0.02 * np.ptp(solid.vertices, axis=0).max()
    # Its mass, and that of the tool, are what they were.
    model, before = scene.model, compiled(xml)
    np.testing.assert_allclose(model.body_mass, before.body_mass, rtol=1e-12)
    np.testing.assert_allclose(model.body_inertia, before.body_inertia, rtol=1e-9)
    assert scene.xml == xml


def test_a_scene_with_a_concave_geom_is_saved_and_read(tmp_path):
    pytest.importorskip("coacd")
    scene = scene_of(xml_of(channel()), DOCUMENT)
    scene.save(tmp_path / "scene")
    again = read_scene(tmp_path / "scene")
    assert again.notes == scene.notes
    assert "'shape'" in scene.notes[0]  # a geom without a name is named by its mesh
    assert len(body_of(again).geoms) == len(body_of(scene).geoms)
    np.testing.assert_array_equal(body_of(again).mesh.vertices, body_of(scene).mesh.vertices)
    stiffer = scene.changed(force={"stiffness": 800.0})
    assert len(body_of(stiffer).geoms) == len(body_of(scene).geoms)
    # From a file of the mesh, found beside the scene.
    channel().export(tmp_path / "u.stl")
    folder = tmp_path / "files"
    folder.mkdir()
    (folder / "scene.toml").write_text('schema = 1\n[tool]\nbody = "ball"\n')
    (folder / "scene.xml").write_text(
        '<mujoco><asset><mesh name="u" file="../u.stl"/></asset><worldbody><body name="body">'
        '<geom type="mesh" mesh="u"/></body><body name="ball" pos="0 0 .3"><freejoint/>'
        '<geom size=".002"/></body></worldbody></mujoco>'
    )
    assert any("3 convex pieces" in note for note in load_scene(folder).notes)


def test_two_geoms_of_one_concave_mesh_beside_a_convex_one():
    pytest.importorskip("coacd")
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    asset = f'<mesh name="box" vertex="{text(box.vertices)}"/>'
    more = '<geom name="b" type="mesh" mesh="shape" pos="0 0.2 0"/><geom type="mesh" mesh="box"/>'
    scene = scene_of(xml_of(channel(), 'name="a"', more, asset), DOCUMENT)
    told = [note for note in scene.notes if "concave" in note]
    assert len(told) == 2
    assert "'a'" in told[0]
    assert "'b'" in told[1]
    assert len(body_of(scene).geoms) == 7
    asperity.Simulation(scene)  # as many geoms as in the model


def test_defaults_and_compiler_options_do_not_reach_the_pieces():
    pytest.importorskip("coacd")
    xml = xml_of(channel()).replace(
        "<mujoco>",
        '<mujoco><compiler discardvisual="true" angle="degree"/><default><mesh scale="2 1 1"/>'
        '<geom contype="3" density="500"/></default>',
    )
    scene = scene_of(xml, DOCUMENT)
    np.testing.assert_allclose(np.ptp(body_of(scene).mesh.vertices, axis=0), [0.24, 0.12, 0.05])
    assert errors_of(scene) < 2e-3
    np.testing.assert_allclose(scene.model.body_mass, compiled(xml).body_mass)


def test_without_coacd_a_concave_geom_is_refused_in_one_line(no_coacd):
    with pytest.raises(AsperityError) as caught:
        scene_of(xml_of(channel(), 'name="part"'), DOCUMENT)
    message = str(caught.value)
    assert "\n" not in message
    for said in ("'part'", "'body'", "not convex", "coacd", "pip install 'asperity[bake]'"):
        assert said in message
    seen = scene_of(
        xml_of(channel(), 'contype="0" conaffinity="0"', '<geom size=".01"/>'), DOCUMENT
    )
    assert len(body_of(seen).geoms) == 1


@pytest.mark.parametrize(
    "solid",
    [
        trimesh.creation.box((0.1, 0.02, 0.01)),
        trimesh.creation.icosphere(3, 0.02),
        trimesh.creation.cylinder(0.01, 0.08, sections=97),
        trimesh.creation.cone(0.01, 0.03),
    ],
    ids=["box", "ball", "cylinder", "cone"],
)
def test_a_convex_mesh_is_left_alone(no_coacd, solid):
    """Turned, far from its frame, in few digits, and with a corner a little under its hull."""
    rng = np.random.default_rng(0)
    turned = solid.vertices @ np.linalg.qr(rng.normal(size=(3, 3)))[0].T
    turned *= np.sign(np.linalg.det(np.linalg.lstsq(solid.vertices, turned, rcond=None)[0]))
    size = np.ptp(turned, axis=0).max()
    rounded = np.round(turned + 0.5, 6)
    bumpy = turned + rng.uniform(-2e-4, 2e-4, turned.shape) * size
    for vertices in (turned, rounded, bumpy):
        moved = trimesh.Trimesh(vertices, solid.faces, process=False)
        scene = scene_of(xml_of(moved), DOCUMENT)
        assert len(body_of(scene).geoms) == 1
        assert not any("concave" in note for note in scene.notes)
    # In separate triangles, as STL has it.
    split = trimesh.Trimesh(
        turned[solid.faces].reshape(-1, 3), np.arange(solid.faces.size).reshape(-1, 3),
        process=False,
    )  # fmt: skip
    assert len(body_of(scene_of(xml_of(split), DOCUMENT)).geoms) == 1


def test_a_side_that_meets_the_corner_of_another_makes_no_hole(no_coacd):
    """A box with a vertex on one of its edges that only one of the two faces has."""
    box = trimesh.creation.box((0.04, 0.02, 0.02))
    points = box.vertices[box.faces]
    first, rest = points[0], points[1:]
    middle = 0.5 * (first[0] + first[1])
    halves = [[first[0], middle, first[2]], [middle, first[1], first[2]]]
    for triangles, is_whole in ((np.concatenate([halves, rest]), True), (rest, False)):
        faces = np.arange(3 * len(triangles)).reshape(-1, 3)
        open_box = trimesh.Trimesh(triangles.reshape(-1, 3), faces, process=False)
        assert is_convex(open_box.vertices, open_box.faces, 1e-3) == is_whole


@pytest.mark.parametrize("depth", [5e-3, 2e-2])
def test_a_dent_deeper_than_the_tolerance_is_concave(no_coacd, depth):
    solid = trimesh.creation.icosphere(2, 0.05)
    vertices = np.array(solid.vertices)
    vertices[0] *= 1.0 - 2.0 * depth - 0.04  # an icosphere's corners stand out by 0.02
    with pytest.raises(AsperityError, match="not convex"):
        scene_of(xml_of(trimesh.Trimesh(vertices, solid.faces, process=False)), DOCUMENT)


@pytest.mark.parametrize("name", SCENES)
def test_built_in_scenes_are_convex_already(no_coacd, name):
    scene = load_scene(name)
    assert not any("concave" in note for note in scene.notes)
    assert scene.model.ngeom == compiled(scene.xml).ngeom


def test_the_ball_in_the_channel():
    """Nothing in the empty channel; k times the depth in its floor."""
    pytest.importorskip("coacd")
    scene = scene_of(xml_of(channel()), {**DOCUMENT, "force": {"stiffness": 400.0}})
    simulation = asperity.Simulation(scene)
    for above in (0.02, 0.01, 0.005, 0.001, -1e-4, -5e-4, -2e-3):
        simulation.reset()
        for _ in range(2):
            force = simulation.step([0, 0, 0.01 + R + above, 1, 0, 0, 0])[:3]
            assert force == pytest.approx([0, 0, 400.0 * max(0.0, -above)], abs=1e-6)
