"""Meshes from files: what the formats hold comes in, and nothing else; real ones all load."""

import json
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_mesh import check, mesh_or_line, noted

from asperity.errors import AsperityError
from asperity.geometry.mesh.atlas import with_atlas
from asperity.geometry.mesh.files import read_mesh
from asperity.geometry.mesh.mesh import mesh_from_arrays

trimesh = pytest.importorskip("trimesh")

QUAD = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 0.5 0
vt 0.5 1
vt 0 1
"""
OPEN = "it is open: 4 border edges"


@pytest.fixture
def write(tmp_path):
    def write_to(name, text):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write_to


def by_place(mesh, values):
    """Return values at corners, looked up by where the corners are, in mm."""
    at = np.round(mesh.vertices[mesh.faces] * 1e3).astype(int).reshape(-1, 3)
    found = {}
    for place, value in zip(map(tuple, at), values.reshape(len(at), -1), strict=True):
        found.setdefault(tuple(map(int, place)), set()).add(tuple(np.round(value, 6).tolist()))
    return found


# OBJ


def test_obj_with_a_seam_keeps_both_texture_coordinates(write):
    seam = QUAD + "vt 0.9 0.1\nvt 0.9 0.9\nv 2 0 0\nv 2 1 0\n"
    seam += "f 1/1 2/2 3/3 4/4\nf 2/5 5/1 6/2 3/6\n"
    mesh = read_mesh(write("a.obj", seam), unit="cm")
    assert len(mesh.faces) == 4
    found = by_place(mesh, mesh.uv)
    assert found[(10, 0, 0)] == {(0.5, 0.0), (0.9, 0.1)}
    assert found[(0, 0, 0)] == {(0.0, 0.0)}
    assert np.array_equal(mesh.normals, np.broadcast_to([0, 0, 1.0], (4, 3, 3)))
    assert not noted(mesh, "normals")


def test_obj_normals_are_used_only_where_there_are_any(write):
    tilted = QUAD + "vn 0.6 0 0.8\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n"
    mesh = read_mesh(write("a.obj", tilted))
    assert mesh.normals == pytest.approx(np.broadcast_to([0.6, 0, 0.8], (2, 3, 3)))
    assert mesh.uv is None
    assert noted(mesh, "the file's normals carry the displacement")
    mesh = read_mesh(write("a.obj", tilted), hard_angle=180)
    assert mesh.normals == pytest.approx(np.broadcast_to([0, 0, 1], (2, 3, 3)))
    mesh = read_mesh(write("a.obj", QUAD + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"))
    assert mesh.notes == (OPEN,)
    all_three = QUAD + "vn 0.6 0 0.8\nf 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n"
    mesh = read_mesh(write("a.obj", all_three))
    assert mesh.normals == pytest.approx(np.broadcast_to([0.6, 0, 0.8], (2, 3, 3)))
    assert by_place(mesh, mesh.uv)[(1000, 1000, 0)] == {(0.5, 1.0)}


def test_obj_indices_that_count_backwards_count_from_their_line(write):
    text = QUAD + "f -4/-4 -3/-3 -2/-2 -1/-1\n" + "v 5 5 5\nvt 0.7 0.7\n"
    mesh = read_mesh(write("a.obj", text), unit="cm")
    plain = read_mesh(write("b.obj", QUAD + "f 1/1 2/2 3/3 4/4\n"), unit="cm")
    assert by_place(mesh, mesh.uv) == by_place(plain, plain.uv)


def test_obj_of_several_materials_is_put_together(write):
    text = QUAD + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 4/4\n"
    mesh = read_mesh(write("a.obj", text))
    assert len(mesh.faces) == 2
    assert noted(mesh, "2 geometries put together")
    assert by_place(mesh, mesh.uv)[(0, 1000, 0)] == {(0.0, 1.0)}
    half = QUAD + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1 3 4\n"
    mesh = read_mesh(write("a.obj", half))
    assert mesh.uv is None
    assert noted(mesh, "1 geometry of 2 without texture coordinates")


# PLY and STL


def ply(vertex, rows, faces, extra=""):
    head = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    head += [f"property float {name}" for name in vertex.split()]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    head += ([extra] if extra else []) + ["end_header"]
    return "\n".join(head + rows + faces) + "\n"


def test_ply_normals_stay_with_their_vertices_when_the_texture_splits_these(write):
    normals = np.array([[0.6, 0, 0.8], [0, 0.6, 0.8], [0, 0, 1], [-0.6, 0, 0.8]])
    places = np.array([[1, 1, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0]]) * 0.1
    rows = [" ".join(f"{x:g}" for x in row) for row in np.hstack([places, normals])]
    faces = ["3 0 1 2 6 1 1 0 1 0 0", "3 0 2 3 6 0.5 0.5 0 0 1 0"]
    text = ply("x y z nx ny nz", rows, faces, "property list uchar float texcoord")
    mesh = read_mesh(write("a.ply", text))
    found = by_place(mesh, mesh.normals)
    for place, normal in zip(places, normals, strict=True):
        assert found[tuple(np.round(place * 1e3).astype(int).tolist())] == {tuple(normal)}
    assert by_place(mesh, mesh.uv)[(100, 100, 0)] == {(1, 1), (0.5, 0.5)}


def test_ply_with_coordinates_at_its_vertices(write):
    rows = ["0 0 0 0 0", "1 0 0 1 0", "1 1 0 1 1"]
    mesh = read_mesh(write("a.ply", ply("x y z s t", rows, ["3 0 1 2"])))
    assert by_place(mesh, mesh.uv) == {
        (0, 0, 0): {(0, 0)}, (1000, 0, 0): {(1, 0)}, (1000, 1000, 0): {(1, 1)},
    }  # fmt: skip


def test_stl_is_smooth_whatever_its_facet_normals_say(write):
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    mesh = read_mesh(write("a.STL", sphere.export(file_type="stl")))
    assert mesh.notes == ()
    assert mesh.normals == pytest.approx(mesh.vertices[mesh.faces] / 0.02, abs=0.01)


# glTF


def glb(primitive, transform=None, required=()):
    """Return a GLB of one triangle, with texture coordinates, and normals tilted along x."""
    place = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    normal = np.array([[0.6, 0, 0.8]] * 3, dtype="<f4").tobytes()
    uv = np.array([[0, 1], [1, 1], [0, 0]], dtype="<f4").tobytes()
    data = place + normal + uv
    kinds = [("VEC3", 0, 36), ("VEC3", 36, 36), ("VEC2", 72, 24)]
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0} | ({"matrix": transform} if transform else {})],
        "meshes": [{"primitives": [primitive]}], "materials": [{}],
        "buffers": [{"byteLength": len(data)}], "extensionsRequired": list(required),
        "bufferViews": [{"buffer": 0, "byteOffset": b, "byteLength": n} for _, b, n in kinds],
        "accessors": [
            {"bufferView": i, "componentType": 5126, "count": 3, "type": kind,
             **({"min": [0, 0, 0], "max": [1, 1, 0]} if i == 0 else {})}
            for i, (kind, _, _) in enumerate(kinds)
        ],
    }  # fmt: skip
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I", len(text)) + b"JSON" + text
    chunks += struct.pack("<I", len(data)) + b"BIN\0" + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


ALL = {"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}}


@pytest.mark.parametrize("material", [{}, {"material": 0}])
def test_glb_with_and_without_a_material_keeps_its_coordinates(write, material):
    mesh = read_mesh(write("a.glb", glb(ALL | material)))
    assert by_place(mesh, mesh.uv) == {
        (0, 0, 0): {(0, 0)}, (1000, 0, 0): {(1, 0)}, (0, 1000, 0): {(0, 1)},
    }  # fmt: skip
    assert mesh.normals == pytest.approx(np.broadcast_to([0.6, 0, 0.8], (1, 3, 3)), abs=1e-6)
    bare = read_mesh(write("b.glb", glb({"attributes": {"POSITION": 0}} | material)))
    assert bare.uv is None
    assert np.array_equal(bare.normals, np.broadcast_to([0, 0, 1.0], (1, 3, 3)))


def test_a_transform_places_turns_and_mirrors(write):
    matrix = [-0.5, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 1]  # by columns
    mesh = read_mesh(write("a.glb", glb(ALL, matrix)))
    assert by_place(mesh, mesh.uv) == {
        (100, 200, 300): {(0, 0)}, (-400, 200, 300): {(1, 0)}, (100, 450, 300): {(0, 1)},
    }  # fmt: skip
    expected = np.array([-0.6 / 0.5, 0, 0.8])
    expected /= np.linalg.norm(expected)
    assert mesh.normals == pytest.approx(np.broadcast_to(expected, (1, 3, 3)), abs=1e-6)
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert noted(mesh, "mirrored on 100 %")


def test_a_scene_of_several_parts_and_its_two_forms(tmp_path):
    scene = trimesh.Scene()
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    for x in (0.0, 0.3, 0.6):
        scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    scene.export(tmp_path / "a.glb")
    for name, data in scene.export(file_type="gltf").items():
        (tmp_path / name).write_bytes(data)
    for name in ("a.glb", "model.gltf"):
        mesh = read_mesh(tmp_path / name)
        assert len(mesh.faces) == 36
        assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.7, 0.1, 0.1])
        assert noted(mesh, "3 geometries put together")


def test_compressed_glb_is_refused(write):
    path = write("a.glb", glb(ALL, required=["KHR_draco_mesh_compression"]))
    with pytest.raises(AsperityError, match=r"KHR_draco.*; valid: exported uncompressed"):
        read_mesh(path)


# What is refused


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("none.obj", None, "there is no such file"),
        ("a.step", "x", r"unknown kind of file '.step'; valid: .obj, .glb, .gltf, .ply, .stl"),
        ("a.obj", "", "the file is empty"),
        ("a.obj", "hello", "no triangles"),
        ("a.obj", QUAD, "no triangles"),
        ("a.obj", QUAD + "f 1 2 9\n", "cannot be read|names vertex"),
        ("a.obj", QUAD + "f 1 2 x\n", "cannot be read"),
        ("a.obj", QUAD + "f 1 1 2\n", "none of its 1 triangles has an area"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "is nan"),
        ("a.glb", b"glTF" + bytes(40), "cannot be read as a .glb"),
        ("a.gltf", "{", "cannot be read as a .gltf"),
        ("a.gltf", "{}", "cannot be read|no triangles"),
        ("a.ply", "ply\nformat", "cannot be read as a .ply"),
        ("a.ply", ply("x y z", ["0 0 0", "1 1 1"], []), "no triangles"),
        ("a.stl", bytes(83), "no triangles|cannot be read|cut short"),
        ("a.stl", bytes(84), "no triangles|cannot be read|cut short"),
        ("a.stl", b"hello\n", "no STL file: it is text"),
        ("a.stl", b"some words\n" * 20, "no STL file: it is text"),
    ],
)
def test_what_holds_no_mesh_is_refused_in_one_line(write, tmp_path, name, content, said):
    path = tmp_path / name if content is None else write(name, content)
    with pytest.raises(AsperityError, match=said) as caught:
        read_mesh(path)
    assert "\n" not in str(caught.value)


def test_units(write, tmp_path):
    path = write("hammer.obj", QUAD.replace("1 1 0", "300 90 0") + "f 1 2 3\n")
    with pytest.raises(AsperityError, match=r"300 x 90 x 0 m; .* unit='mm' \(300 mm\)") as caught:
        read_mesh(path)
    assert "'hammer'" in str(caught.value)
    assert "'um' (300 um)" in str(caught.value)
    assert "'ft'" not in str(caught.value)
    mesh = read_mesh(path, unit="mm", name="tool")
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.3, 0.09, 0])
    assert mesh.name == "tool"
    with pytest.raises(AsperityError, match=r"unknown unit 'inch'.*choose from: m, dm, cm, mm"):
        read_mesh(path, unit="inch")
    with pytest.raises(AsperityError, match="this is a folder"):
        read_mesh(tmp_path)
    with pytest.raises(AsperityError, match="hard_angle"):
        read_mesh(path, unit="mm", hard_angle=-1)


@settings(max_examples=60, deadline=None)
@given(data=st.data(), suffix=st.sampled_from(["obj", "glb", "ply", "stl"]))
def test_a_damaged_file_is_refused_in_one_line(data, suffix, tmp_path_factory):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    whole = box.export(file_type=suffix)
    whole = bytearray(whole.encode() if isinstance(whole, str) else whole)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(whole) - 1))
        whole[at] = data.draw(st.integers(0, 255))
    whole = whole[: data.draw(st.integers(1, len(whole)))]
    path = tmp_path_factory.mktemp("damaged") / f"a.{suffix}"
    path.write_bytes(bytes(whole))
    mesh = mesh_or_line(read_mesh, path)
    if mesh is not None:
        check(mesh)


# Real ones: triangles, unit, what the notes must say

REAL = {
    "angle_block.STL": (704, "in", []),
    "assembly_peg_ring.stl": (1152, "m", []),
    "block.stl": (108, "m", []),
    "featuretype.STL": (3476, "in", []),
    "fuze.obj": (1000, "m", ["mirrored", "the file's normals"]),
    "hammerblock.stl": (108, "m", []),
    "hammerhandle.stl": (128, "m", []),
    "hammerhead.stl": (1024, "m", ["runs through itself"]),
    "ico4uv.obj": (1280, "dm", ["mirrored on 100 %", "differ across 100 % of the edges"]),
    "idler_riser.STL": (1572, "in", []),
    "nail.stl": (384, "m", []),
    "octagonal_pocket.ply": (3262, "m", []),
    "spot.obj": (5856, "dm", ["mirrored", "leave 0..1"]),
    "spot_control_mesh.obj": (372, "dm", ["mirrored", "leave 0..1"]),
    "unit_cube.STL": (12, "dm", []),
    "wallhole.obj": (57, "cm", ["open", "without area dropped", "mirrored", "00.mtl is not there"]),
}


@pytest.mark.parametrize("file", REAL)
def test_a_real_mesh_loads(data, file):
    count, unit, expected = REAL[file]
    mesh = read_mesh(data / "meshes" / file, unit=unit)
    assert len(mesh.faces) == count
    assert np.linalg.norm(mesh.normals, axis=2) == pytest.approx(np.ones((count, 3)), abs=1e-12)
    assert [text for text in expected if not noted(mesh, text)] == []
    assert file.lower().endswith("obj") == (mesh.uv is not None)
    assert bool(expected) == bool(mesh.notes)
    if file != "wallhole.obj":
        a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


@pytest.mark.parametrize("file", ["featuretype.STL", "idler_riser.STL", "wallhole.obj"])
def test_a_real_mesh_that_is_not_in_metres_asks_for_its_unit(data, file):
    with pytest.raises(AsperityError, match=r"unit='in' \(\d+ mm\)"):
        read_mesh(data / "meshes" / file)


def test_every_real_mesh_is_read(data):
    present = {path.name for path in (data / "meshes").iterdir() if path.suffix != ".txt"}
    assert present == set(REAL)


# Texture coordinates made for a mesh without


def test_an_atlas_has_one_scale_and_says_which():
    pytest.importorskip("xatlas")
    box = trimesh.creation.box((0.1, 0.04, 0.02))
    # As STL has it: vertices of each triangle its own.
    triangles = box.triangles
    mesh = mesh_from_arrays(triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3))
    made = with_atlas(mesh)
    assert np.array_equal(made.faces, mesh.faces)
    assert made.uv.shape == (12, 3, 2)
    assert made.uv.min() >= 0
    assert made.uv.max() <= 1
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    on_texture = np.linalg.norm(np.roll(made.uv, -1, axis=1) - made.uv, axis=2)
    (note,) = made.notes
    assert "6 charts" in note
    spans = float(note.split("one unit spans ")[1].split(" m")[0])
    assert sides / on_texture == pytest.approx(
        np.full((12, 3), spans), rel=4e-3
    )  # charts in whole texels
    with pytest.raises(AsperityError, match="it has texture coordinates"):
        with_atlas(made)


@pytest.mark.parametrize("file", [name for name in REAL if not name.endswith("obj")])
def test_an_atlas_for_a_real_mesh(data, file):
    pytest.importorskip("xatlas")
    mesh = read_mesh(data / "meshes" / file, unit=REAL[file][1])
    made = with_atlas(mesh)
    again = mesh_from_arrays(made.vertices, made.faces, uv=made.uv)
    odd = [n for n in again.notes if "texture" in n and "have no area" not in n]
    assert all("more than once" in n and float(n.split()[0]) < 0.5 for n in odd), odd
