"""Meshes that gzip or zip has packed."""

from __future__ import annotations

import gzip
import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from asperity._core import unpacking
from asperity.baking.points import read_points
from asperity.baking.sources import kind_of
from asperity.errors import AsperityError
from asperity.geometry.mesh.files import mesh_file, read_mesh
from asperity.scene.from_files import make_scene

TILE = """mtllib tile.mtl
v 0 0 0\nv 0.04 0 0\nv 0.04 0.04 0\nv 0 0.04 0
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl rough\nf 1/1 2/2 3/3 4/4
"""
MTL = "newmtl rough\ndisp -mm 0 0.0004 pictures/height.png\n"


def box(suffix: str) -> bytes:
    data = trimesh.creation.box((0.02, 0.03, 0.04)).export(file_type=suffix)
    return data if isinstance(data, bytes) else data.encode()


def height() -> bytes:
    stream = io.BytesIO()
    v, u = np.mgrid[0:64, 0:64]
    pixels = 127 + 100 * np.sin(u / 5.0) * np.sin(v / 5.0)
    Image.fromarray(pixels.astype(np.uint8)).save(stream, "PNG")
    return stream.getvalue()


def zipped(path: Path, files: dict[str, bytes | str]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb"])
def test_a_mesh_packed_by_gzip_is_that_mesh(tmp_path: Path, suffix: str) -> None:
    plain, packed = tmp_path / f"box.{suffix}", tmp_path / f"box.{suffix}.gz"
    plain.write_bytes(box(suffix))
    packed.write_bytes(gzip.compress(box(suffix)))
    read = read_mesh(packed)
    assert (read.vertices == read_mesh(plain).vertices).all()
    assert read.name == "box"
    assert read.notes == read_mesh(plain).notes
    assert kind_of(packed) == "mesh"


def test_parts_that_were_packed_one_after_the_other_are_all_read(tmp_path: Path) -> None:
    data, path = box("stl"), tmp_path / "box.stl.gz"
    path.write_bytes(gzip.compress(data[:300]) + gzip.compress(data[300:]))
    assert len(read_mesh(path).faces) == 12


def test_points_packed_by_gzip(tmp_path: Path) -> None:
    points = np.random.default_rng(0).uniform(size=(40, 3)).astype("<f4")
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 40\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path = tmp_path / "a.ply.gz"
    path.write_bytes(gzip.compress(head.encode() + points.tobytes()))
    assert kind_of(path) == "points"
    assert np.allclose(read_points(path).places, points)


@pytest.mark.parametrize("folder", ["", "scan/"])
def test_a_zip_brings_the_mesh_with_its_materials_and_pictures(tmp_path: Path, folder: str) -> None:
    files = {"tile.obj": TILE, "tile.mtl": MTL, "pictures/height.png": height()}
    files = {folder + name: data for name, data in files.items()}
    path = zipped(tmp_path / "tile.zip", {**files, "__MACOSX/._tile.obj": b"x", "readme.txt": "-"})
    mesh = read_mesh(path)
    assert mesh.name == "tile"
    assert mesh.materials[0].maps["displacement"].is_there
    assert kind_of(path) == "mesh"
    scene = make_scene(tool="sphere:3mm", target=path)
    texture = next(body.texture for body in scene.bodies if body.name == "target")
    assert texture is not None
    assert texture.relief == pytest.approx(4e-4, rel=0.05)
    scene.save(tmp_path / "scene")
    assert (tmp_path / "scene" / "tile.zip").is_file()


def test_maps_beside_the_mesh_in_a_zip_are_found_by_their_names(tmp_path: Path) -> None:
    files = {"tile.obj": TILE.replace("mtllib tile.mtl\n", "").replace("usemtl rough\n", "")}
    path = zipped(tmp_path / "packed.zip", {**files, "tile_Displacement.png": height()})
    scene = make_scene(tool="sphere:3mm", target=path)
    assert "tile_Displacement.png" in "\n".join(scene.notes)


def test_errors_name_the_zip_and_not_where_it_was_unpacked(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.zip", {"in/cut.stl": box("stl")[:300]})
    with pytest.raises(AsperityError, match="cut short") as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}/in/cut.stl: it is cut short")


def test_a_zip_that_changed_is_read_anew(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.zip", {"a.stl": box("stl")})
    first = mesh_file(path)
    assert mesh_file(path) == first
    zipped(path, {"b.obj": box("obj"), "more.txt": "-"})
    assert mesh_file(path).name == "b.obj"


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"a.stl": box("stl"), "b/c.obj": box("obj")}, "2 meshes in it (a.stl, b/c.obj); valid"),
        ({"a.txt": "-"}, "no mesh in it (a.txt); valid: one of .obj"),
        ({}, "no mesh in it (); valid: one of .obj"),
        ({"../a.stl": box("stl")}, "it holds '../a.stl'; valid: names of files within it"),
        ({"/a.stl": box("stl")}, "it holds '/a.stl'; valid"),
        ({"in\\..\\..\\a.stl": box("stl")}, "valid: names of files within it"),
        ({"C:a.stl": box("stl")}, "it holds 'C:a.stl'; valid"),
        ({"inner.zip": b"PK"}, "no mesh in it (inner.zip)"),
    ],
)
def test_zips_that_are_refused_in_one_line(tmp_path: Path, files, said: str) -> None:
    (tmp_path / "own").mkdir()
    path = zipped(tmp_path / "own" / "a.zip", files)
    with pytest.raises(AsperityError) as caught:
        read_mesh(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert [file.name for file in tmp_path.rglob("*")] == ["own", "a.zip"]


def test_bombs_are_refused_before_they_are_unpacked(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(unpacking, "MOST_UNPACKED", 2**20)
    monkeypatch.setattr(unpacking, "mkdtemp", lambda **_: pytest.fail("it is unpacked"))
    path = zipped(tmp_path / "a.zip", {"a.stl": bytes(2**20), "b.txt": b"1"})
    with pytest.raises(AsperityError, match="unpacked it has 1 MiB; valid: 1 at most"):
        read_mesh(path)
    path = tmp_path / "a.stl.gz"
    path.write_bytes(gzip.compress(bytes(2**20 + 1)))
    with pytest.raises(AsperityError, match="unpacked it has more than 1 MiB"):
        read_mesh(path)


def test_a_zip_that_lies_about_its_size_is_not_unpacked_beyond_it(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.zip", {"a.stl": bytes(2**22)})
    data = path.read_bytes().replace(struct.pack("<I", 2**22), struct.pack("<I", 100))
    path.write_bytes(data)
    with pytest.raises(AsperityError, match=r"cannot be read as a \.zip file: Bad CRC-32"):
        read_mesh(path)


def test_damaged_zips_are_refused_in_one_line(tmp_path: Path) -> None:
    whole = zipped(tmp_path / "a.zip", {"a.stl": box("stl")}).read_bytes()
    rng = np.random.default_rng(0)
    for k in range(100):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.integers(0, 256)
        path = tmp_path / f"{k}.zip"
        path.write_bytes(data if k % 2 else data[: rng.integers(1, len(data))])
        said = ""
        try:
            read_mesh(path)
        except AsperityError as error:
            said = str(error)
        assert "\n" not in said
        assert "asperity-" not in said
