"""Mesh files as other programs write them: each kind of habit comes in right, or is refused."""

import base64
import json
import struct
import sys

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.mesh.files import companions, read_contents, read_mesh
from asperity.geometry.mesh.map_names import maps_by_name, maps_in_folder

FACES = np.array([
    (0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6), (0, 4, 5), (0, 5, 1),
    (1, 5, 6), (1, 6, 2), (2, 6, 7), (2, 7, 3), (3, 7, 4), (3, 4, 0),
])  # fmt: skip
TOP = np.array([(-20, -20, 0), (20, -20, 0), (20, 20, 0), (-20, 20, 0)]) * 1e-3
CORNERS = np.concatenate([TOP, TOP - [0, 0, 0.01]])
UV = np.array([(0.1, 0.1), (0.9, 0.1), (0.9, 0.7), (0.1, 0.7)] * 2)


def noted(mesh, text):
    return any(text in note for note in mesh.notes)


def is_box(mesh, count=12):
    assert len(mesh.faces) == count
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.04, 0.04, 0.01], rel=1e-3)


# STL


def stl(order="<", count=12, behind=b"", head=b"exported"):
    records = b"".join(
        struct.pack(order + "12fH", 0, 0, 0, *(1e3 * CORNERS[face]).ravel(), 0) for face in FACES
    )
    return head.ljust(80) + struct.pack(order + "I", count) + records + behind


def text_stl(*, case=str, end="\n", ends=True, comma=False):
    lines = ["solid box"]
    for face in FACES:
        rows = ["      vertex {:g} {:g} {:g}".format(*(1e3 * CORNERS[i])) for i in face]
        lines += ["  facet normal 0 0 1", "    outer loop", *rows, "    endloop", "  endfacet"]
    text = end.join([*lines, *(["endsolid box"] if ends else [])]) + end
    return case(text.replace(".", ",") if comma else text).encode()


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (stl(), ""),
        (stl(behind=bytes(37)), "37 bytes behind its last triangle"),
        (stl(behind=bytes(50)), "50 bytes behind its last triangle"),
        (stl(count=0), "does not count its triangles: 12 follow"),
        (stl(count=0xFFFFFFFF), "does not count its triangles: 12 follow"),
        (stl(">"), "the highest byte first"),
        (stl(head=b"solid made by CAD"), ""),
        (text_stl(), ""),
        (text_stl(case=str.upper), ""),
        (text_stl(end="\r"), ""),
        (b"\xef\xbb\xbf" + text_stl(end="\r\n"), ""),
        (text_stl().decode().encode("utf-16"), ""),
        (text_stl(comma=True), ""),
        (text_stl(end=" "), ""),
        (text_stl().replace(b"endsolid", b"end solid"), ""),
    ],
)
def test_stl_as_programs_write_it(tmp_path, content, note):
    path = tmp_path / "a.stl"
    path.write_bytes(content)
    mesh = read_mesh(path, unit="mm")
    is_box(mesh)
    assert not note or noted(mesh, note)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (stl()[:-10], "cut short: 12 triangles need 684 bytes, there are 674"),
        (stl(count=0)[:-10], "its head counts 0 triangles, but 590 bytes follow"),
        (text_stl(ends=False), "cut short after 36 vertices"),
        (text_stl().rpartition(b"vertex")[0] + b"vertex 2", "cut short after 35 vertices"),
        (text_stl().replace(b"vertex -20", b"vertex x20", 1), "a vertex is 'x20"),
    ],
)
def test_stl_that_is_damaged_is_named(tmp_path, content, said):
    path = tmp_path / "a.stl"
    path.write_bytes(content)
    with pytest.raises(AsperityError, match=said):
        read_mesh(path, unit="mm")


def test_the_unit_that_a_file_states_is_its_unit(tmp_path):
    path = tmp_path / "a.stl"
    path.write_bytes(stl(head=b"UNITS=mm   COLOR=abcd"))
    mesh = read_mesh(path)
    is_box(mesh)
    assert noted(mesh, "its unit is mm, as it states")
    assert noted(read_mesh(path, unit="cm"), "states that its unit is mm, but it is read in cm")
    rows = "\n".join("v {:g} {:g} {:g}".format(*(1e3 * c)) for c in CORNERS)
    faces = "\n".join("f {} {} {}".format(*(f + 1)) for f in FACES)
    (tmp_path / "b.obj").write_text(f"# File units = millimeters\n{rows}\n{faces}\n")
    is_box(read_mesh(tmp_path / "b.obj"))


# PLY


def ply(form="ascii", *, quads=False, kind="float", picture="", faces=FACES, shift=0.0):
    """Return the box as a PLY; as quads, its first face is one quad and the rest triangles."""
    lists = [list(face) for face in faces]
    if quads:
        lists = [[0, 1, 2, 3], *lists[2:]]
    head = f"ply\nformat {form} 1.0\n{picture}element vertex 8\n"
    head += "".join(f"property {kind} {c}\n" for c in "xyz")
    head += f"element face {len(lists)}\nproperty list uchar int vertex_indices\nend_header\n"
    points = CORNERS + shift
    if form == "ascii":
        rows = [" ".join(f"{x:.9g}" for x in row) for row in points]
        rows += [" ".join(map(str, [len(row), *row])) for row in lists]
        return (head + "\n".join(rows) + "\n").encode()
    order = "<" if "little" in form else ">"
    data = points.astype(order + {"float": "f4", "double": "f8"}[kind]).tobytes()
    data += b"".join(struct.pack(f"{order}B{len(row)}i", len(row), *row) for row in lists)
    return head.encode() + data


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("quads", [False, True])
@pytest.mark.parametrize("kind", ["float", "double"])
def test_ply_of_triangles_and_of_mixed_polygons(tmp_path, form, quads, kind):
    path = tmp_path / "a.ply"
    path.write_bytes(ply(form, quads=quads, kind=kind))
    mesh = read_mesh(path)
    is_box(mesh)
    assert not noted(mesh, "open")


@pytest.mark.parametrize("there", [False, True])
def test_ply_that_names_a_picture_is_quiet(tmp_path, capfd, there):
    path = tmp_path / "a.ply"
    path.write_bytes(ply(picture="comment TextureFile a b.png\n"))
    if there:
        (tmp_path / "a b.png").write_bytes(b"no picture")
    mesh = read_mesh(path)
    is_box(mesh)
    assert mesh.materials[0].maps["colour"].name == "a b.png"
    assert capfd.readouterr() == ("", "")


def test_strips_of_triangles(tmp_path):
    text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    text += "property float z\nelement tristrips 1\nproperty list int int vertex_indices\n"
    text += "end_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n6 0 1 2 3 -1 0\n"
    (tmp_path / "a.ply").write_text(text)
    mesh = read_mesh(tmp_path / "a.ply")
    assert len(mesh.faces) == 2
    assert (mesh.normals[..., 2] > 0.99).all()


def test_a_ply_that_is_cut_short_says_so(tmp_path):
    for form in ("ascii", "binary_little_endian"):
        whole = ply(form)
        (tmp_path / "a.ply").write_bytes(whole[:-30])
        with pytest.raises(AsperityError, match="cut short"):
            read_mesh(tmp_path / "a.ply")


def test_coordinates_far_from_the_origin_keep_their_shape_or_say_what_is_lost(tmp_path):
    wave = np.sin(np.linspace(0, 6, 400))
    x, y = np.meshgrid(np.arange(20) * 0.01, np.arange(20) * 0.01)
    points = np.stack([x.ravel(), y.ravel(), 1e-3 * wave], axis=1)
    points += np.array([5e5, 5.4e6, 100.0])
    cells = (np.arange(19)[:, None] * 20 + np.arange(19)).ravel()
    faces = np.concatenate(
        [np.stack([cells, cells + 1, cells + 21], 1), np.stack([cells, cells + 21, cells + 20], 1)]
    )
    head = "ply\nformat {} 1.0\nelement vertex 400\n"
    head += "".join(f"property float {c}\n" for c in "xyz")
    head += "element face 722\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(f"{v:.6f}" for v in row) for row in points]
    rows += ["3 {} {} {}".format(*face) for face in faces]
    (tmp_path / "digits.ply").write_text(head.format("ascii") + "\n".join(rows) + "\n")
    mesh = read_mesh(tmp_path / "digits.ply")
    assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(np.ptp(wave) * 1e-3, rel=1e-3)
    assert not noted(mesh, "coarse")
    data = points.astype("<f4").tobytes()
    data += b"".join(struct.pack("<B3i", 3, *face) for face in faces)
    (tmp_path / "short.ply").write_bytes(head.format("binary_little_endian").encode() + data)
    assert noted(read_mesh(tmp_path / "short.ply"), "the shape is coarse")
    data = (points - [5e5, 5.4e6, 0] + [2000, 2000, 0]).astype("<f4").tobytes()
    data += b"".join(struct.pack("<B3i", 3, *face) for face in faces)
    (tmp_path / "near.ply").write_bytes(head.format("binary_little_endian").encode() + data)
    assert noted(read_mesh(tmp_path / "near.ply"), "steps of 122 um on a size of 190 mm")
    rows[:400] = [" ".join(f"{v:.6g}" for v in row) for row in points]
    (tmp_path / "none.ply").write_text(head.format("ascii") + "\n".join(rows) + "\n")
    with pytest.raises(AsperityError, match=r"area; .* it lies 5\.4e\+06 m from the origin"):
        read_mesh(tmp_path / "none.ply")


def test_a_vertex_that_no_face_uses_may_be_nan(tmp_path):
    rows = ["{:g} {:g} {:g}".format(*row) for row in CORNERS]
    faces = ["3 {} {} {}".format(*face) for face in FACES]
    head = "ply\nformat ascii 1.0\nelement vertex 9\n"
    head += "".join(f"property float {c}\n" for c in "xyz")
    head += "element face 12\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "\n".join([*rows, "nan nan nan", *faces]) + "\n")
    mesh = read_mesh(tmp_path / "a.ply")
    is_box(mesh)
    assert noted(mesh, "1 vertex dropped that no triangle uses")


# OBJ


def obj_of(tmp_path, material, name="a"):
    rows = ["v {:g} {:g} {:g}".format(*corner) for corner in CORNERS]
    rows += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "usemtl my tile"]
    rows += ["f " + " ".join(f"{i + 1}/{i % 4 + 1}" for i in face) for face in FACES]
    (tmp_path / f"{name}.obj").write_text(f"mtllib {name}.mtl\n" + "\n".join(rows) + "\n")
    (tmp_path / f"{name}.mtl").write_text("newmtl my tile\n" + material + "\n")
    return tmp_path / f"{name}.obj"


@pytest.mark.parametrize(
    ("line", "kind", "name", "height_range"),
    [
        ("disp -mm 0 8e-05 tile height.png", "displacement", "tile height.png", 8e-5),
        ("  map_disp tile.png", "displacement", "tile.png", None),
        ("disp C:\\maps\\tile.png", "displacement", "tile.png", None),
        ("norm -bm 0.5 tile.png", "normal", "tile.png", None),
        ("map_Bump -bm 0.5 -clamp on tile.png", "bump", "tile.png", None),
        ("bump tile.png", "bump", "tile.png", None),
    ],
)
def test_the_maps_of_an_obj_are_known(tmp_path, line, kind, name, height_range):
    mesh = read_mesh(obj_of(tmp_path, f"map_Kd tile_Color.png\n{line}"))
    (material,) = mesh.materials
    assert material.name == "my tile"
    assert material.felt == kind
    assert material.maps[kind].name == name
    assert material.maps[kind].height_range == height_range
    assert material.maps["colour"].name == "tile_Color.png"


def test_an_obj_lays_its_map_with_its_own_scale_and_offset(tmp_path):
    mesh = read_mesh(obj_of(tmp_path, "disp -s 2 3 1 -o 0.5 0 0 tile.png"))
    assert mesh.uv[..., 0].min() == pytest.approx(0.5)
    assert mesh.uv[..., 0].max() == pytest.approx(2.5)
    assert mesh.uv[..., 1].max() == pytest.approx(3.0)


def test_obj_of_polygons_in_mixed_forms_and_other_habits(tmp_path):
    rows = ["v\t{:g} {:g} {:g} 0.5 0.5 0.5".format(*corner) for corner in CORNERS]
    rows += ["vt 0 0 0", "vn 0 0 1", "f 1/1/1 2/1/1 3/1/1 4/1/1"]
    rows += ["f " + " ".join(f"{i + 1}" for i in face) for face in FACES[2:]]
    (tmp_path / "a.obj").write_text("\r\n".join(rows))
    mesh = read_mesh(tmp_path / "a.obj")
    is_box(mesh)
    assert mesh.uv is None
    (tmp_path / "b.obj").write_text("v 1 2 3\nv 1 x 0\n")
    with pytest.raises(AsperityError, match="v 2 is '1 x 0'; valid: numbers"):
        read_mesh(tmp_path / "b.obj")
    (tmp_path / "b.obj").write_text("v 1 2 3\nv 1 1 0\nv 1 2 0\nf 1 2 7\n")
    with pytest.raises(AsperityError, match="face 1 names vertex 7; valid: 1 to 3"):
        read_mesh(tmp_path / "b.obj")


@pytest.mark.parametrize(
    ("library", "material", "line"),
    [
        ("A.MTL", "m", "bump BUMP.PNG"),
        ("C:\\work\\a.mtl", "m", "bump D:\\work\\Maps\\my bump.png"),
        ("a.mtl # by a program", "m # the first", "bump bump.png # grey"),
        ('"a.mtl"', "m", 'map_Bump "maps/my bump.png" -bm 0.5'),
        ("a.mtl", "m", "bump maps\\my bump.png -s 2 2 1 -bm 0.5"),
    ],
)
def test_an_obj_from_another_computer_finds_its_files(tmp_path, library, material, line):
    (tmp_path / "maps").mkdir()
    for name in ("bump.png", "maps/my bump.png"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "a.mtl").write_text(f"newmtl m\n{line}\n")
    corners = [f"v {x:g} {y:g} {z:g} \\ " for x, y, z in CORNERS]
    rows = [f"mtllib {library}", *corners, "vt 0 0", "vt 1 0", "vt 1 1", f"usemtl {material}"]
    rows += ["f " + " \\ \n".join(f"{i + 1}/{i % 3 + 1}" for i in face) for face in FACES]
    (tmp_path / "a.obj").write_text("\n".join(rows).replace(" \\ \nv", "\nv") + "\n")
    mesh = read_mesh(tmp_path / "a.obj")
    assert len(mesh.faces) == 12
    picture = mesh.materials[0].maps["bump"]
    assert picture.is_there
    assert picture.name.lower() in ("bump.png", "my bump.png")
    assert (mesh.uv.max() == pytest.approx(2)) == ("-s 2" in line)
    assert companions(tmp_path / "a.obj") == [tmp_path / "a.mtl"]


def test_materials_that_a_library_does_not_have_are_noted(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl steel\n")
    rows = ["mtllib a.mtl", "v 0 0 0", "v 0.1 0 0", "v 0 0.1 0", "usemtl Steel", "f 1 2 3"]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    assert noted(read_mesh(tmp_path / "a.obj"), "that its library does not have: Steel")


def test_pictures_are_known_by_their_names(tmp_path):
    names = {
        "Bricks_2K_Displacement.png": "displacement", "Bricks_2K_NormalGL.png": "normal",
        "Bricks_2K_NormalDX.png": None, "Bricks_2K_Color.jpg": "colour",
        "Bricks_2K_Roughness.jpg": "roughness", "Bricks_2K_AmbientOcclusion.jpg": None,
    }  # fmt: skip
    for name in names:
        (tmp_path / name).write_bytes(b"x")
    found = maps_by_name(tmp_path.iterdir())
    assert {picture.name: kind for kind, picture in found.items()} == {
        name: kind for name, kind in names.items() if kind
    }
    for name, kind in {
        "rock_wall_disp_4k.png": "displacement", "rock_wall_nor_gl_4k.png": "normal",
        "Metal-height.tif": "displacement", "wood_NRM.png": "normal", "T_BaseColor.png": "colour",
    }.items():  # fmt: skip
        folder = tmp_path / kind / name
        folder.mkdir(parents=True)
        (folder / name).write_bytes(b"x")
        assert list(maps_by_name(folder.iterdir())) == [kind]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ("Rock_2K_Displacement.jpg Rock_4K_Displacement.jpg Rock_16K_Displacement.jpg",
         {"displacement": "Rock_4K_Displacement.jpg"}),
        ("Rocks_DISP16_4K.tif Rocks_DISP_4K.jpg Rocks_NRM16_4K.tif Rocks_COL_VAR1_4K.jpg",
         {"displacement": "Rocks_DISP16_4K.tif", "normal": "Rocks_NRM16_4K.tif",
          "colour": "Rocks_COL_VAR1_4K.jpg"}),
        ("wood_Normal_DirectX.png wood_Normal_OpenGL.png", {"normal": "wood_Normal_OpenGL.png"}),
        ("T_Wood_N.tga T_Wood_ORM.tga T_Wood_D.tga",
         {"normal": "T_Wood_N.tga", "colour": "T_Wood_D.tga"}),
        ("._a_Height.png a_Height.png", {"displacement": "a_Height.png"}),  # macOS, foreign disks
        ("speed_bump_ao_4k.png normal_AmbientOcclusion.png normal_MetallicSmoothness.png", {}),
        ("brickheight.png bricknormal.png",
         {"displacement": "brickheight.png", "normal": "bricknormal.png"}),
        ("a_Height.png b_NormalGL.png a_NormalGL_1K.png b_Color.png",
         {"displacement": "a_Height.png", "normal": "a_NormalGL_1K.png", "colour": "b_Color.png"}),
        ("a_disp.exr a_disp.jpg", {"displacement": "a_disp.jpg"}),  # OpenEXR is not installed
        ("brick_N.png brick_H.png", {}),
    ],
)  # fmt: skip
def test_of_several_pictures_the_best_is_taken(tmp_path, monkeypatch, names, expected):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    for name in names.split():
        (tmp_path / name).write_bytes(b"x")
    found = maps_by_name(tmp_path.iterdir())
    assert {kind: picture.name for kind, picture in found.items()} == expected


def test_folders_as_libraries_pack_them(tmp_path):
    for name in ("wall_4k.blend", "textures/wall_disp_4k.png", "textures/wall_disp_1k.png",
                 "textures/wall_nor_gl_4k.png", "__MACOSX/._wall_disp_4k.png"):  # fmt: skip
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    notes = []
    maps = maps_in_folder(tmp_path, notes)
    assert maps["displacement"].name == "wall_disp_4k.png"
    assert maps["normal"].name == "wall_nor_gl_4k.png"
    assert notes == ["of its 2 displacement maps wall_disp_4k.png is used, not wall_disp_1k.png"]
    (tmp_path / "textures" / "wood_disp_4k.png").write_bytes(b"x")
    with pytest.raises(AsperityError, match=r"maps of 2 materials \(wall, wood\); valid: a folder"):
        maps_in_folder(tmp_path, notes)
    short = tmp_path / "short"
    short.mkdir()
    for name in ("brick_N.png", "brick_H.png"):
        (short / name).write_bytes(b"x")
    assert sorted(maps_in_folder(short, notes)) == ["displacement", "normal"]


# glTF


def gltf(
    *, uv=("f4", UV), position=("f4", CORNERS), mode=4, indices=FACES, node=(), transform=None,
    required=(), sparse=False, stride=0, attributes=(),
):  # fmt: skip
    """Return a glTF document of the box."""
    codes = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
    blocks, views, accessors = b"", [], []

    def add(dtype, values, kind, normalised=None):
        nonlocal blocks
        values = np.asarray(values)
        rows = values.astype("<" + dtype)
        step = -(-rows.itemsize * rows.shape[1] // 4) * 4 + stride
        data = b"".join(row.tobytes().ljust(step, b"\7") for row in rows)
        view = {"buffer": 0, "byteOffset": len(blocks), "byteLength": len(data)}
        views.append(view | ({"byteStride": step} if kind != "SCALAR" else {}))
        accessor = {"bufferView": len(views) - 1, "componentType": codes[dtype], "type": kind}
        accessor |= {"count": len(rows)} | ({"normalized": True} if normalised else {})
        accessors.append(accessor)
        blocks += data + bytes(-len(data) % 4)

    add(*position[:2], "VEC3", len(position) > 2)
    add(*uv[:2], "VEC2", len(uv) > 2)
    flat = np.asarray(indices).reshape(-1)
    data = flat.astype("<u2").tobytes()
    views.append({"buffer": 0, "byteOffset": len(blocks), "byteLength": len(data)})
    accessors.append({"bufferView": 2, "componentType": 5123, "count": len(flat), "type": "SCALAR"})
    blocks += data + bytes(-len(data) % 4)
    if sparse:  # two positions are replaced by themselves, the base is 0 there
        accessors[0]["sparse"] = {
            "count": 8, "indices": {"bufferView": len(views), "componentType": 5121},
            "values": {"bufferView": len(views) + 1},
        }  # fmt: skip
        for data in (bytes(range(8)), CORNERS.astype("<f4").tobytes()):
            views.append({"buffer": 0, "byteOffset": len(blocks), "byteLength": len(data)})
            blocks += data
        del accessors[0]["bufferView"]
    extension = {"extensions": {"KHR_texture_transform": transform}} if transform else {}
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0} | dict(node)],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "TEXCOORD_0": 1} | dict(attributes), "indices": 2,
            "mode": mode, "material": 0,
        }]}],
        "materials": [{"normalTexture": {"index": 0} | extension}],
        "textures": [{"source": 0}], "images": [{"uri": "bumps%20of%20it.png"}],
        "buffers": [{"byteLength": len(blocks), "uri": "data:application/octet-stream;base64,"
                     + base64.b64encode(blocks).decode()}],
        "bufferViews": views, "accessors": accessors, "extensionsRequired": list(required),
    }  # fmt: skip


@pytest.fixture
def read(tmp_path):
    def read_tree(tree):
        (tmp_path / "a.gltf").write_text(json.dumps(tree))
        return read_mesh(tmp_path / "a.gltf")

    return read_tree


def laid(mesh, u, v):
    """Check the ranges of u, and of v counted from above as glTF does."""
    uv = mesh.uv
    assert (uv[..., 0].min(), uv[..., 0].max()) == pytest.approx(u, abs=5e-3)
    assert (1 - uv[..., 1].max(), 1 - uv[..., 1].min()) == pytest.approx(v, abs=5e-3)


@pytest.mark.parametrize(
    ("uv", "u", "v"),
    [
        (("f4", UV), (0.1, 0.9), (0.1, 0.7)),
        (("u2", np.round(UV * 65535), True), (0.1, 0.9), (0.1, 0.7)),
        (("u1", np.round(UV * 255), True), (0.1, 0.9), (0.1, 0.7)),
        (("i2", np.round(UV * 32767), True), (0.1, 0.9), (0.1, 0.7)),
        (("i1", np.round(UV * 127), True), (0.1, 0.9), (0.1, 0.7)),
        (("u2", np.round(UV * 10)), (1, 9), (1, 7)),
        (("i1", np.round(UV * 10) - 5), (-4, 4), (-4, 2)),
        (("u1", np.round(UV * 250)), (25, 225), (25, 175)),
    ],
)
def test_texture_coordinates_of_all_types(read, uv, u, v):
    mesh = read(gltf(uv=uv))
    is_box(mesh)
    laid(mesh, u, v)


def test_positions_of_whole_numbers(read):
    scale = float(np.abs(CORNERS).max())
    for dtype, most, normalised in (("i2", 32767, (True,)), ("i1", 127, (True,)), ("i2", 9e3, ())):
        size = scale if normalised else scale / most
        stored = (dtype, np.round(CORNERS / scale * most), *normalised)
        required = ["KHR_mesh_quantization"]
        mesh = read(gltf(position=stored, node={"scale": [size] * 3}, required=required))
        assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.04, 0.04, 0.01], rel=0.01)


def test_strides_sparse_values_and_nodes(read):
    is_box(read(gltf(stride=8)))
    is_box(read(gltf(sparse=True)))
    turned = {"rotation": [0, 0, 2**-0.5, 2**-0.5], "translation": [0.1, 0, 0]}
    mesh = read(gltf(position=("f4", CORNERS * [1, 0.5, 1]), node=turned))
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.02, 0.04, 0.01])
    assert mesh.vertices[:, 0].mean() == pytest.approx(0.1)


def test_strips_and_fans_are_triangles(read):
    strip = read(gltf(mode=5, indices=[0, 1, 3, 2]))
    fan = read(gltf(mode=6, indices=[0, 1, 2, 3]))
    for mesh in (strip, fan):
        assert len(mesh.faces) == 2
        assert np.cross(*np.diff(mesh.vertices[mesh.faces[0]], axis=0))[2] > 0
        assert not noted(mesh, "winding")
    with pytest.raises(AsperityError, match="no triangles"):
        read(gltf(mode=1))


def test_the_transform_of_a_texture_is_applied(read):
    laid(read(gltf(transform={"scale": [4, -4], "offset": [0, -1]})), (0.4, 3.6), (-3.8, -1.4))
    # The extension's own example: the lower left quadrant of the picture, turned.
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)] * 2)
    example = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    mesh = read(gltf(uv=("f4", corners), transform=example, required=["KHR_texture_transform"]))
    laid(mesh, (0, 0.5), (0.5, 1))
    assert mesh.materials[0].maps["normal"].name == "bumps%20of%20it.png"


def test_what_is_required_and_not_known_is_refused_by_name(read):
    for name in ("EXT_of_tomorrow", "KHR_draco_mesh_compression"):
        with pytest.raises(AsperityError, match=name):
            read(gltf(required=[name]))
    is_box(read(gltf(required=["KHR_materials_clearcoat"])))
    old = gltf() | {"asset": {"version": "1.0"}}
    with pytest.raises(AsperityError, match=r"this is glTF 1.0; valid: glTF 2.0"):
        read(old)
    new = gltf() | {"asset": {"version": "2.0", "minVersion": "3.0"}}
    with pytest.raises(AsperityError, match=r"this is glTF 3.0; valid: glTF 2.0"):
        read(new)
    (tree := gltf())["nodes"][0]["children"] = [0]
    with pytest.raises(AsperityError, match="contain themselves"):
        read(tree)
    (tree := gltf())["accessors"][1]["count"] = 9
    with pytest.raises(AsperityError, match=r"accessors\[1\] needs 72 bytes, its buffer has 64"):
        read(tree)


def test_a_gltf_names_its_files_encoded_or_not(tmp_path):
    tree = gltf()
    data = base64.b64decode(tree["buffers"][0]["uri"].partition(",")[2])
    for uri, name in (("a%20b.bin", "a b.bin"), ("c d.bin", "c d.bin")):
        (tmp_path / name).write_bytes(data)
        tree["buffers"][0]["uri"] = uri
        (tmp_path / "a.gltf").write_text(json.dumps(tree))
        is_box(read_mesh(tmp_path / "a.gltf"))
    tree["buffers"][0]["uri"] = "lost.bin"
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    with pytest.raises(AsperityError, match=r"its file lost.bin is not there"):
        read_contents(tmp_path / "a.gltf")
    tree["buffers"][0]["uri"] = "Bin\\C D.BIN"  # written on Windows
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "c d.bin").write_bytes(data)
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    is_box(read_mesh(tmp_path / "a.gltf"))


def test_what_is_invisible_or_stored_twice(read):
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    (tree := gltf())["nodes"].append({"mesh": 0, "translation": [1, 0, 0], **hidden})
    tree.pop("scenes", None)
    mesh = read(tree)
    is_box(mesh)
    assert noted(mesh, "what is invisible is left out")
    (tree := gltf())["nodes"][0]["weights"] = [0.5]
    assert noted(read(tree), "its morph targets are left out")
    compressed = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}
    (tree := gltf())["meshes"][0]["primitives"][0]["extensions"] = compressed
    is_box(read(tree))  # not required: it stands there uncompressed too
    del tree["accessors"][0]["bufferView"]
    with pytest.raises(AsperityError, match=r"compressed \(KHR_draco_mesh_compression\)"):
        read(tree)


# Polygons


def test_concave_polygons_keep_their_shape(tmp_path):
    # An L, a comb and a ring that a bridge cuts, in a plane that leans.
    ell = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    comb = [(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3)]
    comb += [(0, 3)]
    ring = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
    for polygon, area in ((ell, 3.0), (comb, 11.0), (ring, 12.0)):
        for around in (polygon, polygon[3:] + polygon[:3], polygon[::-1]):
            points = np.array([(x, y, 0.5 * x - 0.25 * y) for x, y in around]) * 0.1
            rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points]
            rows.append("f " + " ".join(str(i + 1) for i in range(len(points))))
            (tmp_path / "a.obj").write_text("\n".join(rows))
            mesh = read_mesh(tmp_path / "a.obj")
            a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
            up = 0.5 * np.cross(b - a, c - a)[:, 2]
            assert abs(up.sum()) == pytest.approx(0.01 * area)
            assert np.abs(up).sum() == pytest.approx(0.01 * area)


@pytest.mark.parametrize(
    "comment",
    [
        "units: mm",
        "Units are millimeters",
        "unit mm",
        "exported in mm",
        "UNITS=MM",
        "This file uses millimeters as units for non-parametric coordinates.",
    ],
)
def test_comments_state_the_unit(tmp_path, comment):
    rows = [f"# {comment}", *("v {:g} {:g} {:g}".format(*(1e3 * corner)) for corner in CORNERS)]
    rows += ["f " + " ".join(f"{i + 1}" for i in face) for face in FACES]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    mesh = read_mesh(tmp_path / "a.obj")
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(np.ptp(CORNERS, axis=0))
    assert noted(mesh, "its unit is mm, as it states")


def test_a_box_that_single_precision_has_flattened_is_doubted(tmp_path):
    corners = (CORNERS + np.array([5e5, 4e6, 100.0])).astype("<f4")
    faces = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[f].ravel(), 0) for f in FACES)
    (tmp_path / "a.stl").write_bytes(bytes(80) + struct.pack("<I", len(FACES)) + faces)
    assert noted(read_mesh(tmp_path / "a.stl"), "the shape is coarse")


def test_partial_texture_coordinates_are_noted(tmp_path):
    rows = ["v {:g} {:g} {:g}".format(*corner) for corner in CORNERS]
    rows += ["vt 0 0", "vt 1 0", "vt 1 1"]
    first, *others = FACES.tolist()
    rows += ["f " + " ".join(f"{i + 1}/{k + 1}" for k, i in enumerate(first))]
    rows += ["f " + " ".join(f"{i + 1}" for i in face) for face in others]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    assert noted(read_mesh(tmp_path / "a.obj"), "some of its corners have no texture coordinates")
