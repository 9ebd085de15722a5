"""Assets as they come: the maps that a mesh brings, solids and patterns in one word, the scale."""

import base64
import io
import json

import numpy as np
import pytest
import tifffile
import trimesh
from PIL import Image

import asperity
from asperity.errors import AsperityError
from asperity.geometry.mesh.map_names import maps_in_folder
from asperity.scene.scale import scale_rows, scale_table
from asperity.scene.scene import scene_of
from asperity.scene.shorthand import file_table, pattern, primitive
from asperity.texture.files import loading

HALF, WAVES, AMPLITUDE = 0.02, 10, 4e-5
TOP = np.array([(-HALF, -HALF, 0), (HALF, -HALF, 0), (HALF, HALF, 0), (-HALF, HALF, 0)])
CORNERS = np.concatenate([TOP, TOP - [0, 0, 0.01]])
FACES = np.array([
    (0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6), (0, 4, 5), (0, 5, 1),
    (1, 5, 6), (1, 6, 2), (2, 6, 7), (2, 7, 3), (3, 7, 4), (3, 4, 0),
])  # fmt: skip


def png(values):
    stream = io.BytesIO()
    Image.fromarray(np.round(values).astype(np.uint8)).save(stream, "png")
    return stream.getvalue()


def pictures(size=128):
    """Return pictures of waves of 40 um amplitude along u on 40 mm, by kind."""
    phase = np.tile(2 * np.pi * WAVES * (np.arange(size) + 0.5) / size, (size, 1))
    slope = AMPLITUDE * 2 * np.pi * WAVES / (2 * HALF) * np.cos(phase)
    normal = np.stack([-slope, 0 * slope, 1 + 0 * slope], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return {
        "Color": png(np.full((size, size, 3), (150, 110, 70))),
        "NormalGL": png(127.5 * (normal + 1)), "Displacement": png(127.5 * (1 + np.sin(phase))),
    }  # fmt: skip


@pytest.fixture
def tile(tmp_path):
    def write(material=(), kinds=(), *, lib=True, shift=0.0):
        rows = ["mtllib tile.mtl"] if lib else []
        rows += ["v {:.9g} {:.9g} {:.9g}".format(*(c + shift)) for c in CORNERS]
        rows += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "usemtl tile"]
        rows += ["f " + " ".join(f"{i + 1}/{i % 4 + 1}" for i in f) for f in FACES]
        (tmp_path / "tile.obj").write_text("\n".join(rows) + "\n")
        (tmp_path / "tile.mtl").write_text("\n".join(["newmtl tile", *material]) + "\n")
        for kind in kinds:
            (tmp_path / f"tile_{kind}.png").write_bytes(pictures()[kind])
        return tmp_path / "tile.obj"

    return write


def target_of(scene):
    return next(body for body in scene.bodies if body.name == "target")


def noted(scene, *words):
    return any(all(word in note for word in words) for note in scene.notes)


@pytest.mark.parametrize(
    ("line", "kinds", "relief"),
    [
        ("disp -mm 0 8e-05 tile_Displacement.png", ["Displacement"], 80e-6),
        ("disp -mm 0 -8e-05 tile_Displacement.png", ["Displacement"], 80e-6),
        ("norm tile_NormalGL.png", ["NormalGL"], 80e-6),
        ("map_Bump -bm 1 tile_NormalGL.png", ["NormalGL"], 80e-6),  # as Blender has it
        ("map_Bump tile_Displacement.png", ["Displacement"], 200e-6),
        ("map_Kd tile_Color.png", ["Displacement", "NormalGL", "Color"], 80e-6),
        ("", ["NormalGL"], 80e-6),
    ],
)
def test_the_map_of_a_material_is_felt(tile, line, kinds, relief):
    mesh = tile([line], kinds)
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    texture = target_of(scene).texture
    assert texture.relief == pytest.approx(relief, rel=0.08)
    assert texture.size == pytest.approx((0.04, 0.04), rel=1e-6)
    assert noted(scene, "is the texture", "tile_")
    # Its waves run along x on the top.
    across, along = np.ptp(texture.samples, axis=0).max(), np.ptp(texture.samples, axis=1).max()
    assert across < 0.1 * along


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("-t 0.5 0 0", "-t"),
        ("-imfchan g", "-imfchan g"),
        ("-mm 0 2 -t 1 1 1", "-t, -mm"),
        ("-t 0 0 0", ""),
        ("-boost 2 -cc off -texres 512", ""),
    ],
)
def test_options_that_change_the_relief_and_are_not_used_are_noted(tile, options, said):
    note = f"tile_Displacement.png: its options {said} change what is felt, and are not used"
    for line in (f"bump {options} tile_Displacement.png", f"bump tile_Displacement.png {options}"):
        scene = asperity.make_scene(tool="sphere:3mm", target=tile([line], ["Displacement"]))
        assert noted(scene, note) if said else not noted(scene, "its options")
        assert target_of(scene).texture.relief == pytest.approx(200e-6, rel=0.01)


def test_the_strength_of_normals_that_stand_for_bumps_is_noted(tile):
    mesh = tile(["map_Bump -bm 0.5 tile_NormalGL.png"], ["NormalGL"])
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    assert noted(scene, "tile_NormalGL.png: its scale of 0.5 is not used")


def test_heights_of_a_map_are_in_the_unit_that_the_mesh_states(tile):
    mesh = tile(["disp -mm 0 0.08 tile_Displacement.png"], ["Displacement"])
    text = mesh.read_text().replace("0.02", "20").replace("-0.01", "-10")
    mesh.write_text("# units: mm\n" + text)
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    assert np.ptp(target_of(scene).mesh.vertices, axis=0)[0] == pytest.approx(0.04)
    assert target_of(scene).texture.relief == pytest.approx(80e-6, rel=0.08)


def test_maps_that_are_not_used_are_named(tile):
    scene = asperity.make_scene(tool="sphere:3mm", target=tile(["disp lost.png"]))
    assert target_of(scene).texture is None
    assert noted(scene, "displacement map lost.png is not there")
    smooth = tile(["map_Kd tile_Color.png"], ["Color"])
    assert target_of(asperity.make_scene(tool="sphere:3mm", target=smooth)).texture is None
    mesh = tile(["disp lost.png", "newmtl b", "norm tile_NormalGL.png"], ["NormalGL"])
    text = mesh.read_text().split("\n")
    mesh.write_text("\n".join([*text[:-3], "usemtl b", *text[-3:]]))
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    assert noted(scene, "material 'tile': its displacement map", "is not there")
    assert noted(scene, "material 'b'", "cover no area, so its maps are not used: tile_NormalGL")
    (mesh.parent / "tile_NormalGL.png").unlink()
    (mesh.parent / "tile_seen.png").write_bytes(pictures()["Color"])
    scene = asperity.make_scene(tool="sphere:3mm", target=tile())
    assert noted(scene, "pictures beside it that are not used: ", "tile_seen.png")
    smooth = asperity.make_scene(
        tool="sphere:3mm", target=tile(["map_Kd tile_Color.png"], ["Color"])
    )
    assert target_of(smooth).texture is None or noted(smooth, "is the texture")


def test_a_mesh_is_shown_in_its_colour(tile):
    mesh = tile(["Kd 0.5 1 1", "map_Kd tile_Color.png"], ["Color"])
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    seen = scene.model.geom("target-shape").rgba
    assert seen == pytest.approx([0.5 * 150 / 255, 110 / 255, 70 / 255, 1], abs=2e-3)
    assert noted(scene, "it is shown in the mean colour of tile_Color.png")


def test_a_folder_of_maps_is_a_texture(tile, tmp_path):
    mesh = tile()
    folder = tmp_path / "maps"
    folder.mkdir()
    for kind, data in pictures().items():
        (folder / f"Bricks_2K_{kind}.png").write_bytes(data)
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh, target_texture=folder)
    assert target_of(scene).texture.relief == pytest.approx(80e-6, rel=0.08)
    assert noted(scene, "Bricks_2K_Displacement.png", "slopes are those of Bricks_2K_NormalGL.png")
    scene = asperity.make_scene(tool="sphere:3mm", target="box:40x40x10mm", target_texture=folder)
    assert target_of(scene).texture.relief == pytest.approx(80e-6, rel=0.08)
    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "photo.png").write_bytes(b"x")
    with pytest.raises(AsperityError, match=r"no file in this folder is named .*photo.png"):
        asperity.make_scene(tool="sphere:3mm", target=mesh, target_texture=tmp_path / "none")


def test_a_gltf_brings_the_picture_within_it(tmp_path):
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)] * 2, dtype="<f4")
    parts = [CORNERS.astype("<f4").tobytes(), uv.tobytes(), FACES.astype("<u2").tobytes()]
    parts.append(pictures()["NormalGL"])
    starts = np.cumsum([0, *map(len, parts)])
    tree = {
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"normalTexture": {"index": 0}}], "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png", "name": "waves"}],
        "buffers": [{"byteLength": int(starts[-1]), "uri": "data:application/octet-stream;base64,"
                     + base64.b64encode(b"".join(parts)).decode()}],
        "bufferViews": [{"buffer": 0, "byteOffset": int(a), "byteLength": len(part)}
                        for a, part in zip(starts, parts, strict=False)],
        "accessors": [
            {"bufferView": i, "componentType": c, "count": n, "type": kind}
            for i, (c, n, kind) in enumerate(
                [(5126, 8, "VEC3"), (5126, 8, "VEC2"), (5123, 36, "SCALAR")])],
    }  # fmt: skip
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    scene = asperity.make_scene(tool="sphere:3mm", target=tmp_path / "a.gltf")
    assert target_of(scene).texture.relief == pytest.approx(80e-6, rel=0.08)
    assert noted(scene, "its own normal map is the texture: waves.png")
    scene.save(tmp_path / "saved")
    again = asperity.load_scene(tmp_path / "saved")
    assert target_of(again).texture.relief == pytest.approx(target_of(scene).texture.relief)


def test_a_picture_of_a_kind_that_is_not_read_is_noted(tile):
    mesh = tile(["norm tile_Normal.ktx2"])
    (mesh.parent / "tile_Normal.ktx2").write_bytes(b"\xabKTX 20\xbb")
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    assert target_of(scene).texture is None
    assert noted(scene, "its normal map tile_Normal.ktx2 is not used: of a kind", ".png")


def test_a_normal_map_that_cannot_be_read_is_noted(tile, tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "a_disp.png").write_bytes(pictures()["Displacement"])
    (tmp_path / "maps" / "a_nor_gl.png").write_bytes(b"x")
    scene = asperity.make_scene(tool="sphere:3mm", target=tile(), target_texture=tmp_path / "maps")
    assert noted(scene, "the relief is not found from a_nor_gl.png: ")
    assert noted(scene, "no height_range for a_disp.png: 0.2 mm (default)")


def test_a_saved_scene_has_what_its_meshes_name(tile, tmp_path):
    points, faces = CORNERS.astype("<f4").tobytes(), FACES.astype("<u2").tobytes()
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a b.bin").write_bytes(points + faces)
    tree = {
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": 168, "uri": "parts/a%20b.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": 96},
                        {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}],
    }  # fmt: skip
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    scene = asperity.make_scene(tool=tmp_path / "a.gltf", target=tile(["Kd 1 0 0"]))
    scene.save(tmp_path / "saved")
    again = asperity.load_scene(tmp_path / "saved")
    assert not noted(again, "is not there")
    assert len(next(b for b in again.bodies if b.name == "tool").mesh.faces) == 12


def test_a_mesh_far_from_the_origin_is_moved_there(tile):
    scene = asperity.make_scene(tool="sphere:3mm", target=tile(shift=np.array([500.0, -3e3, 20.0])))
    assert np.abs(target_of(scene).mesh.vertices).max() < 0.03
    assert noted(scene, "it lies 3e+03 m from the origin: moved there")


# In one word


@pytest.mark.parametrize(
    ("text", "kind", "size"),
    [
        ("sphere:3mm", "sphere", (0.0015,)), ("box:20x10x5mm", "box", (0.01, 0.005, 0.0025)),
        ("box:2cm x 10mm x 5mm", "box", (0.01, 0.005, 0.0025)),
        ("capsule:3x20mm", "capsule", (0.0015, 0.0085)),
        ("cylinder:.5x2in", "cylinder", (0.00635, 0.0254)),
        ("ellipsoid:8x6x4mm", "ellipsoid", (0.004, 0.003, 0.002)),
    ],
)  # fmt: skip
def test_solids_in_one_word(text, kind, size):
    geom, note = primitive(text)
    assert geom.kind == kind
    assert geom.size[: len(size)] == pytest.approx(size)
    assert "mm" in note
    assert primitive("part.stl") is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sphere:3", "valid: diameter with a unit, such as sphere:20mm"),
        ("sphere", "is no sphere"), ("box:20x10mm", "length x width x height"),
        ("sphere:3 feet", "is no sphere"), ("sphere:0mm", "none of 0"),
        ("capsule:3x2mm", "longer than its diameter"), ("sphere:30m", "0.1 mm to 2 m"),
    ],
)  # fmt: skip
def test_solids_that_are_none(text, said):
    with pytest.raises(AsperityError, match=said):
        primitive(text)


def test_files_that_are_not_there_are_refused_with_what_would_be(tile):
    for wrong in ("cube:3mm", "sphere 3mm"):
        with pytest.raises(AsperityError, match=r"no such file: .*; valid: .* sphere:3mm \(sphere"):
            asperity.make_scene(tool=wrong, target="box:40x40x10mm")
    with pytest.raises(AsperityError, match=r"no such file: knurled:1mm; valid: .* knurl:0.8mm"):
        asperity.make_scene(tool="sphere:3mm", tool_texture="knurled:1mm", target="box:9x9x9mm")
    assert primitive("Sphere: 3mm")[0].kind == "sphere"


@pytest.mark.parametrize(("kind", "up"), [("n", True), ("N_DX", False)])
def test_names_as_unreal_s_and_names_that_state_green(tile, kind, up):
    mesh = tile()
    name = "T_tile_N.png" if kind == "n" else "tile_normal_dx.png"
    (mesh.parent / name).write_bytes(pictures()["NormalGL"])
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    assert target_of(scene).texture.relief == pytest.approx(80e-6, rel=0.2)
    assert noted(scene, "does green point up?") == up
    assert noted(scene, "green points down, as the file's name states") != up


def test_patterns_in_one_word():
    table, note = pattern("knurl:0.8mm")
    assert table["kind"] == "knurl"
    assert table["pitch"] == pytest.approx(8e-4)
    assert table["height"] == pytest.approx(1.6e-4)
    assert "height 0.00016" in note
    table, note = pattern("grating:pitch=2mm,height=50um,direction=45deg,periods=4")
    assert table["height"] == pytest.approx(5e-5)
    assert table["direction"] == pytest.approx(np.pi / 4)
    assert table["periods"] == 4
    assert note == ""
    assert pattern("sinusoid")[0]["wavelength"] == pytest.approx(2e-3)
    assert pattern("cast.png") is None
    for text, said in (("knurl:0.8", "a length with a unit"), ("knurl:hight=1mm", "height")):
        with pytest.raises(AsperityError, match=said):
            pattern(text)


def test_short_names_of_patterns_need_their_length():
    """Alone they may be names of files."""
    table, _ = pattern("ridges:0.8mm")
    assert (table["kind"], table["pitch"]) == ("grating", 8e-4)
    assert pattern("ridges") is None


def test_options_of_a_file_follow_it(tile, tmp_path):
    text = "a:b/cast.png:colour=red,pixel_size=10um,size=20x10mm,invert=true,nodata=-9999,unit=mm"
    assert file_table(text) == {
        "file": "a:b/cast.png", "colour": "red", "pixel_size": pytest.approx(1e-5), "unit": "mm",
        "size": pytest.approx([0.02, 0.01]), "invert": True, "nodata": -9999.0,
    }  # fmt: skip
    assert file_table("a.png:pixel_size=30um")["pixel_size"] == 3e-5  # not 2.9999999999999997e-05
    assert file_table("p.csv:order=time,x,y")["order"] == "time,x,y"
    assert file_table("C:\\cast.png") == {"file": "C:\\cast.png"}
    (tmp_path / "odd:name=1").write_bytes(b"")
    assert list(file_table(str(tmp_path / "odd:name=1"))) == ["file"]
    mesh = tile(kinds=["Displacement", "NormalGL"])
    texture = f"{tmp_path / 'tile_NormalGL.png'}:kind=normal-directx,pixel_size=0.5mm"
    scene = asperity.make_scene(tool="sphere:3mm", target=f"{mesh}:unit=cm", target_texture=texture)
    assert target_of(scene).texture.pixel_size == pytest.approx((5e-4, 5e-4))
    assert np.ptp(target_of(scene).mesh.vertices, axis=0)[0] == pytest.approx(4e-4)
    with pytest.raises(AsperityError, match=r"kolour.*did you mean .*colour"):
        asperity.make_scene(
            tool="sphere:3mm", target=mesh, target_texture=f"{mesh}:kolour=red,pixel_size=1mm"
        )


def test_a_scene_in_two_words():
    scene = asperity.make_scene(
        tool="capsule:3x20mm", target="box:40x40x5mm", target_texture="knurl:0.8mm"
    )
    assert scene.name == "capsule-on-box"
    assert target_of(scene).texture.highest == pytest.approx(1.6e-4, rel=0.05)
    low = scene.start[2] - 0.01
    assert 0.0025 < low < 0.0035
    again = asperity.make_scene(tool="sphere:3mm", target="ellipsoid:40x30x20mm")
    assert 0.0105 < again.start[2] < 0.0117


# The scale


def test_the_table_of_the_scale_states_what_is_sure(tile):
    mesh = tile(["norm tile_NormalGL.png"], ["NormalGL"])
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh)
    size, texture, relief = scale_rows(scene)
    assert size == ("target", "size", "40 x 40 x 10 mm", "ASSUMED: unit m (the file states none)")
    assert texture.value == "40 x 40 mm, pixels of 312 um"
    assert texture.source.startswith("ASSUMED: as its texture coordinates")
    assert relief.source == "read: from the normals and the size"
    given = {"file": str(mesh.parent / "tile_NormalGL.png"), "kind": "normal", "pixel_size": 1e-4}
    scene = asperity.make_scene(tool="sphere:3mm", target=mesh, target_texture=given, unit="m")
    assert [row.source for row in scale_rows(scene)][:2] == ["given: unit m", "given"]
    assert scale_table(asperity.load_scene("probe-plate")) == ""


@pytest.mark.parametrize("kind", ["npy", "csv", "headed", "points"])
def test_the_table_states_which_unit_is_assumed(tmp_path, kind):
    v, u = np.mgrid[0:40, 0:40]
    values = 1e-5 * np.sin(u / 3)
    path = tmp_path / ("a.npy" if kind == "npy" else "a.csv")
    if kind == "npy":
        np.save(path, values)
    elif kind == "points":
        columns = [1e-4 * u.ravel(), 1e-4 * v.ravel(), values.ravel()]
        np.savetxt(path, np.column_stack(columns), header="x,y,z", delimiter=",", comments="")
    else:
        head = {"header": "z [um]", "comments": ""} if kind == "headed" else {}
        np.savetxt(path, values * (1e6 if kind == "headed" else 1.0), delimiter=",", **head)
    texture = {"file": str(path)} | ({} if kind == "points" else {"pixel_size": 1e-4})
    scene = asperity.make_scene(tool="sphere:3mm", target="box:9x9x5mm", target_texture=texture)
    extent, relief = (row.source for row in scale_rows(scene))
    assert relief == (
        "read: a.csv" if kind == "headed" else f"ASSUMED: unit m ({path.name} states none)"
    )
    assert extent == ("ASSUMED: unit m (a.csv states none)" if kind == "points" else "given")


def test_a_file_of_heights_is_read_once(tmp_path, monkeypatch):
    """For its scale and as a texture; the tool's place is found without reading it again."""
    rows = "\n".join("\t".join(f"{(u * v) % 7}" for u in range(40)) for v in range(30))
    path = tmp_path / "a.txt"
    path.write_text(f"# Width: 4 mm\n# Height: 3 mm\n# Value units: um\n{rows}\n")
    read, times = loading.load_text, []
    monkeypatch.setattr(loading, "load_text", lambda *a, **k: (times.append(a), read(*a, **k))[1])
    scene = asperity.make_scene(tool="sphere:3mm", target="box:9x9x5mm", target_texture=path)
    assert len(times) == 1
    whole = scene_of(scene.xml, scene.document, name=scene.name)
    np.testing.assert_array_equal(whole.model.body_pos, scene.model.body_pos)
    np.testing.assert_array_equal(whole.start, scene.start)
    assert target_of(whole).texture.highest == target_of(scene).texture.highest
    assert {*whole.notes} <= {*scene.notes}


def test_an_option_of_images_is_refused_for_text_that_was_read_for_its_scale(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(",".join(f"{(u * v) % 7}e-6" for u in range(40)) for v in range(30)))
    texture = {"file": path, "pixel_size": 1e-4, "colour": "luminance"}
    with pytest.raises(AsperityError, match="colour= states what the colours of an image mean"):
        asperity.make_scene(tool="sphere:3mm", target="box:9x9x5mm", target_texture=texture)


def test_capitals_whole_numbers_and_options_given_twice():
    geom, _ = primitive("Box:20X10X5MM")
    assert geom.size == pytest.approx((0.01, 0.005, 0.0025))
    table, _ = pattern("jittered_dots:0.8MM,seed=3")
    assert (table["pitch"], table["seed"]) == (0.0008, 3)
    with pytest.raises(AsperityError, match=r"seed is '1\.5'; valid: a whole number, 0 or above"):
        pattern("jittered_dots:2mm,seed=1.5")
    with pytest.raises(AsperityError, match="pixel_size is given twice; valid: once"):
        file_table("a.png:pixel_size=10um,pixel_size=5um")


def test_a_parameter_of_a_pattern_is_given_once():
    with pytest.raises(AsperityError, match="pitch is given twice; valid: once"):
        pattern("knurl:1mm,pitch=2mm")


@pytest.mark.parametrize(
    ("option", "border"), [("", "wrap"), ("-clamp on ", "clamp"), ("-clamp off ", "wrap")]
)
def test_a_picture_that_is_clamped_does_not_repeat(tile, option, border):
    path = tile([f"disp {option}-mm 0 8e-05 tile_Displacement.png"], ["Displacement"])
    path.write_text(path.read_text().replace("vt 1 1", "vt 2 1"))
    assert target_of(asperity.make_scene(tool="sphere:3mm", target=path)).texture.border == border


@pytest.mark.parametrize(
    ("wraps", "border", "said"),
    [((10497, 10497), "wrap", False), ((33071, 33071), "clamp", False),
     ((33648, 33648), "wrap", True), ((33071, 10497), "wrap", True)],
)  # fmt: skip
def test_a_gltf_states_what_its_picture_does_beyond_its_edges(tile, tmp_path, wraps, border, said):
    uv = np.array([(0, 0), (2, 0), (2, 1), (0, 1)] * 2)
    parts = [CORNERS.astype("<f4").tobytes(), uv.astype("<f4").tobytes(),
             FACES.ravel().astype("<u2").tobytes(), pictures()["NormalGL"]]  # fmt: skip
    starts = np.cumsum([0, *map(len, parts)])
    uri = "data:;base64," + base64.b64encode(b"".join(parts)).decode()
    views = [{"buffer": 0, "byteOffset": int(a), "byteLength": len(part)}
             for a, part in zip(starts, parts, strict=False)]  # fmt: skip
    accessors = [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
                 {"bufferView": 1, "componentType": 5126, "count": 8, "type": "VEC2"},
                 {"bufferView": 2, "componentType": 5123, "count": 36, "type": "SCALAR"},
                ]  # fmt: skip
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
    (tmp_path / "a.gltf").write_text(json.dumps({
        "asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": int(starts[-1])}],
        "bufferViews": views, "accessors": accessors, "meshes": [{"primitives": [primitive]}],
        "nodes": [{"mesh": 0}], "materials": [{"normalTexture": {"index": 0}}],
        "samplers": [dict(zip(("wrapS", "wrapT"), wraps, strict=True))],
        "textures": [{"source": 0, "sampler": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
    }))  # fmt: skip
    scene = asperity.make_scene(tool="sphere:3mm", target=tmp_path / "a.gltf")
    assert target_of(scene).texture.border == border
    assert noted(scene, "is mirrored beyond its edges") == said


def test_a_mesh_s_file_is_read_once_for_a_scene_and_again_for_the_next(tile, monkeypatch):
    from asperity.scene import mesh

    read = []
    original = mesh.read_mesh
    monkeypatch.setattr(mesh, "read_mesh", lambda *a, **k: read.append(a[0]) or original(*a, **k))
    for count in (1, 2):
        asperity.make_scene(tool="sphere:3mm", target=tile(), target_texture="knurl:1mm")
        assert len(read) == count


@pytest.mark.parametrize(("suffix", "up"), [(".glb", "y"), (".obj", "")])
def test_a_mesh_whose_file_states_what_is_up_stands_upright(tmp_path, suffix, up):
    trimesh.creation.box((0.04, 0.005, 0.03)).export(tmp_path / f"plate{suffix}")
    scene = asperity.make_scene(tool="sphere:3mm", target=tmp_path / f"plate{suffix}")
    size = np.ptp(next(b for b in scene.bodies if b.name == "target").mesh.vertices, axis=0)
    np.testing.assert_allclose(size, (0.04, 0.03, 0.005) if up else (0.04, 0.005, 0.03), rtol=1e-5)
    assert any("points upwards" in note for note in scene.notes) == bool(up)
    kept = file_table(f"{tmp_path}/plate.glb:quaternion=1,0,0,0")
    assert kept["quaternion"] == [1.0, 0.0, 0.0, 0.0]


def test_the_workflow_behind_a_size_is_no_kind_of_map(tmp_path):
    shown = ["DISP", "NRM", "COL", "ROUGHNESS", "METALNESS", "AO"]
    for word in shown:
        (tmp_path / f"Bricks09_{word}_4K_METALNESS.png").write_bytes(b"")
    maps = maps_in_folder(tmp_path, [])
    assert {kind: picture.name.split("_")[1] for kind, picture in maps.items()} == {
        "displacement": "DISP", "normal": "NRM", "colour": "COL", "roughness": "ROUGHNESS",
    }  # fmt: skip


@pytest.mark.parametrize("kind", ["csv", "imagej", "given"])
def test_a_map_with_a_size_of_its_own_keeps_it_on_a_mesh(tmp_path, kind):
    trimesh.creation.box((0.04, 0.03, 0.005)).export(tmp_path / "plate.stl")
    values = 1000.0 + 900.0 * np.sin(np.arange(50) / 3) * np.cos(np.arange(40)[:, None] / 4)
    texture = str(tmp_path / ("a.csv" if kind == "csv" else "a.tif"))
    if kind == "csv":
        heights = "\n".join(",".join(f"{x:.1f}" for x in row) for row in values)
        (tmp_path / "a.csv").write_text(f"pixel size: 20 um\nunit: nm\n{heights}\n")
    elif kind == "imagej":
        head = "ImageJ=1.53t\nunit=um\ncf=0\nc0=0\nc1=0.001\nvunit=um\n"
        tifffile.imwrite(texture, values.astype(np.uint16), description=head, metadata=None,
                         resolution=(1 / 20, 1 / 20))  # fmt: skip
    else:
        tifffile.imwrite(texture, values.astype(np.uint16))
        texture += ":pixel_size=20um,unit=nm"
    scene = asperity.make_scene(
        tool="sphere:3mm", target=f"{tmp_path}/plate.stl:unit=m", target_texture=texture
    )
    target = target_of(scene)
    assert target.mapping == "triplanar"
    assert target.texture.size == pytest.approx((1e-3, 0.8e-3))
    assert target.texture.relief == pytest.approx(1.8e-6, rel=0.05)
    assert noted(scene, "mapping triplanar, which keeps the size of a.")
    assert noted(scene, "a.csv covers 1 x 0.8 mm of 40 mm, beyond it is level") == (kind == "csv")
    assert not any(row.source.startswith("ASSUMED") for row in scale_rows(scene))


def test_coordinates_that_stretch_a_map_are_noted(tile, tmp_path):
    (tmp_path / "a.csv").write_text("pixel size: 20 um\nunit: nm\n" + "0,1,2,3\n" * 8)
    scene = asperity.make_scene(
        tool="sphere:3mm", target=tile(), target_texture=f"{tmp_path}/a.csv"
    )
    assert target_of(scene).mapping == "uv"
    assert noted(scene, "lay it over 40 x 40 mm, stretched 500 and 250 times")


def test_options_of_a_map_that_are_no_lengths_are_refused_and_um_is_written_in_greek(tmp_path):
    (tmp_path / "a.csv").write_text("0,1,2,3\n" * 8)
    for option, words in (("size=20mm", "two lengths"), ("pixel_size=ten", "a length or two")):
        with pytest.raises(AsperityError, match=rf"a.csv: .*valid: {words}"):
            asperity.make_scene(
                tool="sphere:3mm", target="box:9x9x9mm", target_texture=f"{tmp_path}/a.csv:{option}"
            )
    given = f"{tmp_path}/a.csv:pixel_size=10µm,unit=µm"
    scene = asperity.make_scene(tool="sphere:3mm", target="box:9x9x9mm", target_texture=given)
    assert target_of(scene).texture.relief == pytest.approx(3e-6, rel=0.2)
