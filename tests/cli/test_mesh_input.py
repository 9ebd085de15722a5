"""Bad meshes and bad options for them: code 2, one line, and nothing left in the output folder."""

import json
import os
import re
import subprocess
import sys
import warnings

import numpy as np
import pytest
import trimesh
from PIL import Image

from asperity import Simulation, make_scene
from asperity.cli import main
from asperity.errors import AsperityError
from asperity.geometry.convex import pieces
from asperity.runs.recording import read_recording

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
SIDES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)


def write_box(path, sides, uv=True, sides_of=SIDES, more=()):
    """Write a box as OBJ, each side with the whole texture."""
    lines = [f"v {x} {y} {z}" for x, y, z in 0.5 * np.array(sides) * CORNERS]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"] if uv else []
    for side in sides_of + 1:
        lines.append("f " + " ".join(f"{v}/{k}" if uv else f"{v}" for k, v in enumerate(side, 1)))
    path.write_text("\n".join([*lines, *more]) + "\n")
    return path


@pytest.fixture
def cube(tmp_path):
    return write_box(tmp_path / "cube.obj", (0.02, 0.02, 0.02))


@pytest.fixture
def slab(tmp_path):
    return write_box(tmp_path / "slab.obj", (0.06, 0.05, 0.01), uv=False)


@pytest.fixture
def rough(tmp_path):
    grey = np.random.default_rng(2).integers(0, 60000, (32, 64)).astype(np.uint16)
    Image.fromarray(grey).save(tmp_path / "rough.png")
    return tmp_path / "rough.png"


def refuse(capsys, folder, *arguments):
    """Run a command that must refuse; return its one line."""
    before = sorted(folder.rglob("*"))
    assert main(["run", *map(str, arguments), "--out", str(folder / "new" / "out")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1, said.err
    assert said.err.startswith("asperity: error: ")
    assert sorted(folder.rglob("*")) == before
    return said.err


def check_words(line, words):
    for word in words:
        assert word in line, f"{word!r} is not in {line!r}"


# --- files of meshes ----------------------------------------------------------------------------

TRIANGLE = "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\n"


def stl(keep=None, damage=None):
    def make(path):
        data = bytearray(trimesh.creation.box((0.02, 0.02, 0.02)).export(file_type="stl"))
        if damage is not None:
            data[96:100] = np.float32(damage).tobytes()
        path.write_bytes(data[:keep])

    return make


def text(content):
    return lambda path: path.write_text(content)


def huge_hammer(path):
    trimesh.creation.box((1500.0, 3000.0, 1500.0)).export(path)


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("none.obj", lambda path: None, ["no such file"]),
        ("folder.obj", lambda path: path.mkdir(), ["folder.obj"]),
        ("empty.stl", lambda path: path.touch(), ["the file is empty"]),
        ("head.stl", stl(keep=20), ["cut short", "20"]),
        ("cut.stl", stl(keep=84), ["cut short", "84"]),
        ("cut.stl", stl(keep=300), ["cut short", "300"]),
        ("cut.glb", lambda path: path.write_bytes(b"glTF\2\0\0\0"), ["cannot be read as a .glb"]),
        ("cut.ply", text("ply\nformat ascii 1.0\n"), ["cannot be read as a .ply"]),
        ("nan.stl", stl(damage=np.nan), ["vertices[0] is nan", "valid: finite"]),
        ("inf.stl", stl(damage=np.inf), ["vertices[0] is inf", "valid: finite"]),
        ("nan.obj", text(TRIANGLE.replace("0.01", "nan", 1) + "f 1 2 3\n"), ["is nan", "finite"]),
        ("far.obj", text(TRIANGLE + "f 1 2 9\n"), ["names vertex 9", "1 to 3"]),
        ("back.obj", text(TRIANGLE + "f -1 -2 -9\n"), ["names vertex -9", "1 to 3"]),
        ("points.obj", text(TRIANGLE), ["no triangles"]),
        ("words.obj", text("hello\n"), ["no triangles"]),
        ("zero.obj", text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), ["none of its 1 triangles"]),
        ("one.obj", text("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n"), ["all its vertices are at one"]),
        ("hammer.stl", huge_hammer, ["1500 x 3000 x 1500 m", "0.1 mm to 2 m", "unit='um' (3 mm)"]),
        ("mesh.fbx", text("x"), ["unknown kind of file '.fbx'", ".obj, .glb, .gltf, .ply, .stl"]),
    ],
)
@pytest.mark.parametrize("role", ["tool", "target"])
def test_meshes_that_are_none(role, name, make, words, cube, capsys, tmp_path):
    path = tmp_path / name
    make(path)
    files = dict.fromkeys(("tool", "target"), cube) | {role: path}
    line = refuse(capsys, tmp_path, "--tool", files["tool"], "--target", files["target"])
    assert "unit=" not in line  # the command names its option
    line = re.sub(rf"--{role}-unit (\w+)", r"unit='\1'", line)
    check_words(line, [f"{role}: ", name.partition(".")[0], *words])
    with pytest.raises(AsperityError) as refused:
        make_scene(**files)
    assert line == f"asperity: error: {refused.value}\n"


def test_one_triangle_is_refused_by_name(cube, tmp_path):
    (tmp_path / "one.obj").write_text(TRIANGLE + "f 1 2 3\n")
    with pytest.raises(AsperityError, match="target: one has 3 vertices; valid: 4 or more"):
        make_scene(tool=cube, target=tmp_path / "one.obj")


@pytest.mark.parametrize(
    "points",
    [
        [(x, y, z) for x, z in ((0, 0), (5, 0), (0, 5)) for y in (0, 2)],
        [(x, y, z) for x, z in ((0, 0), (6, 0), (0, 2)) for y in (0, 3)],
        [(0, 0, 0), (5, 0, 0), (0, 5, 0), (0, 0, 5)],
        [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 3)],
    ],
    ids=["ramp", "wedge", "tetrahedron", "pyramid"],
)
def test_simple_solids_are_tools(points, slab, tmp_path):
    trimesh.convex.convex_hull(np.array(points, float)).export(tmp_path / "solid.stl")
    make_scene(tool={"file": tmp_path / "solid.stl", "unit": "cm"}, target=slab)


def test_the_smallest_valid_tool(slab, tmp_path):
    tiny = write_box(tmp_path / "tiny.obj", (1e-4, 1e-4, 1e-4))
    assert pressed(make_scene(tool=tiny, target=slab), 2e-4)[2] > 0.0


# --- meshes that are odd but work -----------------------------------------------------------------


def pressed(scene, depth=1e-3):
    """Return the wrench of a tool pressed from where it is drawn."""
    at = scene.start.copy()
    at[2] -= depth
    wrench = Simulation(scene.changed(force={"anti_alias": "off"})).step(at)
    assert np.isfinite(wrench).all()
    return wrench


@pytest.mark.parametrize(
    ("make", "note"),
    [
        (lambda path: write_box(path, (0.06, 0.05, 0.01), sides_of=SIDES[:, ::-1]), "inside out"),
        (
            lambda path: write_box(path, (0.06, 0.05, 0.01), more=["v 0 0 0", "f 1 2 9"]),
            "more than two triangles",
        ),
        (lambda path: write_box(path, (0.06, 0.05, 0.01), sides_of=SIDES[1:]), "border"),
        (
            lambda path: write_box(path, (0.06, 0.05, 0.01), sides_of=SIDES[[*range(6), 0]]),
            "same three corners",
        ),
    ],
    ids=["inside out", "non-manifold", "open", "twice"],
)
def test_odd_meshes_work_and_are_noted(make, note, cube, tmp_path, monkeypatch):
    pytest.importorskip("coacd", reason="coacd cuts what is not convex and closed")
    coarse = {"mcts_iterations": 5, "mcts_nodes": 5, "mcts_max_depth": 1, "seed": 0}
    monkeypatch.setattr(pieces, "_SETTINGS", coarse | {"preprocess_resolution": 30})
    scene = make_scene(tool=cube, target=make(tmp_path / "odd.obj"))
    told = [line for line in scene.notes if line.startswith("target: ")]
    assert any(note in line for line in told), told
    assert pressed(scene)[2] > 0.1


def test_a_mesh_that_crosses_itself_works_and_is_noted(cube, tmp_path):
    pytest.importorskip("coacd", reason="coacd cuts what is not convex")
    first, second = trimesh.creation.box((0.06, 0.05, 0.01)), trimesh.creation.box((0.02,) * 3)
    trimesh.util.concatenate([first, second]).export(tmp_path / "cross.stl")
    scene = make_scene(tool=cube, target=tmp_path / "cross.stl")
    assert any("runs through itself" in note for note in scene.notes)
    assert pressed(scene)[2] > 0.1


def test_a_run_tells_what_is_odd(cube, capsys, tmp_path):
    odd = write_box(tmp_path / "odd.obj", (0.06, 0.05, 0.01), sides_of=SIDES[:, ::-1])
    out = tmp_path / "out dir"
    options = ["--seconds", "0.05", "--out", str(out)]
    assert main(["run", "--tool", str(cube), "--target", str(odd), *options]) == 0
    said = capsys.readouterr().out
    assert "target: inside out (negative volume): turned round" in said
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    assert summary["largest_force_n"] > 0.1
    assert any("inside out" in note for note in summary["notes"])
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_a_smooth_run_says_nothing_on_stderr(cube, slab, tmp_path):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        files = ["--tool", str(cube), "--target", str(slab)]
        assert main(["run", *files, "--seconds", "0.05", "--out", str(tmp_path / "out")]) == 0
    assert not [str(w.message) for w in caught if w.category is UserWarning]


# --- textures on meshes -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--tool-texture", "none.png"], ["tool_texture", "no such file", "none.png"]),
        (["--target-texture", ""], ["target_texture", "no such file"]),
        (["--tool-texture", "cube.obj"], ["cube.obj", "unknown kind of file '.obj'", ".png"]),
        (
            ["--tool-texture", "rough.png", "--tool-mapping", "triplaner"],
            ["unknown mapping 'triplaner'", "did you mean 'triplanar'", "planar, cylindrical"],
        ),
        (
            ["--target-texture", "rough.png", "--target-mapping", "UV"],
            ["unknown mapping 'UV'", "triplanar, uv"],
        ),
        (
            ["--tool-texture", "rough.png", "--tool-relief-mm", "-0.2"],
            ["--tool-relief-mm must lie between 1e-06 and 100 mm, got -0.2"],
        ),
        (
            ["--target-texture", "rough.png", "--target-relief-mm", "0"],
            ["--target-relief-mm must lie between", "got 0.0"],
        ),
        (
            ["--target-texture", "rough.png", "--target-relief-mm", "nan"],
            ["--target-relief-mm must lie between", "got nan"],
        ),
        (
            ["--tool-texture", "rough.png", "--tool-relief-mm", "90"],
            ["rough.png", "too steep", "at most 100"],
        ),
        (["--tool-relief-mm", "0.2"], ["--tool-relief-mm needs --tool-texture"]),
        (["--target-mapping", "uv"], ["--target-mapping needs --target-texture"]),
        (["--tool-unit", "furlong"], ["tool", "'furlong'", "m, dm, cm, mm, um, in, ft"]),
        (["--target-unit", "mn"], ["target", "'mn'", "did you mean 'm'", "m, dm, cm, mm"]),
        (["--tool-unit", "mm"], ["cube", "0.1 mm to 2 m", "--tool-unit m (20 mm)"]),
        (["--seed", "3"], ["--seed"]),
        (["--force-n", "100"], ["100 N", "press less"]),
        (["--force-n", "1", "--depth-mm", "1"], ["--force-n or --depth-mm"]),
    ],
)
def test_options_of_meshes(options, words, cube, slab, rough, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = refuse(capsys, tmp_path, "--tool", cube.name, "--target", slab.name, *options)
    check_words(line, words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--tool", "cube.obj"], ["--target missing", "--tool and --target"]),
        (["--target", "cube.obj"], ["--tool missing", "--tool and --target"]),
        (["--tool-unit", "mm"], ["--tool and --target missing"]),
        ([], ["give a scene", "--tool and --target"]),
        (["probe-plate", "--tool", "cube.obj"], ["probe-plate", "--tool, not both"]),
        (
            ["probe-plate", "--target-unit", "mm", "--tool", "cube.obj"],
            ["probe-plate", "--tool, --target-unit, not both"],
        ),
    ],
)
def test_which_scene(arguments, words, cube, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_words(refuse(capsys, tmp_path, *arguments), words)


@pytest.mark.parametrize("range_", [-2e-4, 0.0])
def test_a_relief_that_is_none_in_python(range_, cube, slab, rough):
    texture = {"file": rough, "height_range": range_}
    with pytest.raises(
        AsperityError, match=r"height_range must be a finite number above 0"
    ) as said:
        make_scene(tool=cube, target=slab, tool_texture=texture)
    assert "\n" not in str(said.value)


def test_a_mesh_without_texture_coordinates_is_given_some(cube, slab, rough):
    pytest.importorskip("xatlas", reason="xatlas makes texture coordinates")
    texture = {"file": rough, "mapping": "uv"}
    scene = make_scene(tool=cube, target=slab, target_texture=texture)
    assert any("an atlas was made" in note for note in scene.notes)
    assert pressed(scene)[2] > 0.1


def test_without_xatlas_mapping_uv_is_refused(cube, slab, rough, monkeypatch):
    monkeypatch.setattr("asperity.scene.from_files.importlib.util.find_spec", lambda name: None)
    texture = {"file": rough, "mapping": "uv", "size": (0.01, 0.01)}
    with pytest.raises(AsperityError, match=r"no texture coordinates for mapping uv.*triplanar"):
        make_scene(tool=cube, target=slab, target_texture=texture)


def test_a_texture_without_relief_is_noted_and_not_felt(cube, slab, tmp_path):
    Image.new("L", (16, 16), 127).save(tmp_path / "flat.png")
    flat = {"file": tmp_path / "flat.png", "mapping": "triplanar"}
    scene = make_scene(tool=cube, target=slab, target_texture=flat, tool_texture=flat)
    assert sum("every value is 127: all heights are zero" in note for note in scene.notes) == 2
    plain = make_scene(tool=cube, target=slab)
    np.testing.assert_allclose(pressed(scene), pressed(plain), atol=1e-9)


DAMAGED = [
    ("png", b""),
    ("png", b"\x89PNG\r\n\x1a\n" + b"\0" * 40),
    ("jpg", b"junk"),
    ("tif", b"II"),
]


@pytest.mark.parametrize(
    ("suffix", "content"), DAMAGED, ids=["empty png", "cut png", "junk jpg", "cut tif"]
)
def test_damaged_pictures(suffix, content, cube, slab, tmp_path):
    picture = tmp_path / f"broken.{suffix}"
    picture.write_bytes(content)
    with pytest.raises(AsperityError, match=r"broken\.\w+: (the file is empty|cannot be read)"):
        make_scene(tool=cube, target=slab, tool_texture=picture)


def test_a_damaged_tiff_in_a_command(cube, slab, capsys, tmp_path):
    (tmp_path / "broken.tif").write_bytes(b"II")
    options = ["--tool", cube, "--target", slab, "--tool-texture", tmp_path / "broken.tif"]
    check_words(refuse(capsys, tmp_path, *options), ["broken.tif"])


def test_damaged_pictures_with_their_size_given(cube, slab, tmp_path):
    for suffix, content in DAMAGED:
        picture = tmp_path / f"broken.{suffix}"
        picture.write_bytes(content)
        texture = {"file": picture, "size": (0.01, 0.01)}
        with pytest.raises(AsperityError, match=r"broken\.\w+: (the file is empty|cannot be read)"):
            make_scene(tool=cube, target=slab, tool_texture=texture)


@pytest.mark.xfail(
    strict=True,
    reason="OpenEXR's library writes its own lines about a damaged file to stderr (and, without a "
    "size, the traceback of the above follows)",
)
def test_a_damaged_exr_is_one_line(cube, slab, tmp_path):
    openexr = pytest.importorskip("OpenEXR", reason="OpenEXR reads .exr")
    path, grey = tmp_path / "cut.exr", np.random.default_rng(0).random((24, 40), np.float32)
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    openexr.File(header, {"Y": grey}).write(str(path))
    path.write_bytes(path.read_bytes()[:1000])
    done = subprocess.run(
        [sys.executable, "-m", "asperity", "run", "--tool", cube, "--target", slab,
         "--tool-texture", path, "--out", tmp_path / "out"],
        env=os.environ, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, len((done.stdout + done.stderr).splitlines())) == (2, 1)


def test_a_run_of_files_is_the_scene_that_make_scene_makes(cube, slab, rough, tmp_path):
    out = tmp_path / "out"
    files = ["--tool", cube, "--target", slab, "--tool-texture", rough]
    more = ["--tool-mapping", "triplanar", "--tool-relief-mm", "0.1", "--seconds", "0.05"]
    assert main(["run", *map(str, files), *more, "--out", str(out)]) == 0
    scene = make_scene(
        tool=cube, target=slab,
        tool_texture={"file": str(rough), "mapping": "triplanar", "height_range": 1e-4},
    )  # fmt: skip
    recording = read_recording(out / "recording.h5")
    assert json.loads(recording.attributes["document"]) == json.loads(json.dumps(scene.document))
    simulation = Simulation(scene)
    for pose, wrench in zip(recording.handle_pose[:5], recording.contact_wrench[:5], strict=True):
        simulation.step(pose)
        np.testing.assert_allclose(simulation.contact_wrench, wrench, atol=1e-9)
