"""Uploads are data: bounded, and looked at before they are decoded."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest
from PIL import Image

from asperity.errors import AsperityError
from asperity.viewer.server import uploads
from asperity.viewer.server.uploads import Uploads


@pytest.fixture
def kept():
    out = Uploads()
    yield out
    out.close()


def png(rows=32, columns=48):
    file = io.BytesIO()
    Image.fromarray(np.arange(rows * columns, dtype=np.uint8).reshape(rows, columns)).save(
        file, "PNG"
    )
    return file.getvalue()


def npy(array):
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def glb(tree):
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text


def stl(count, said=None):
    return bytes(80) + struct.pack("<I", count if said is None else said) + bytes(50 * count)


def threemf(count, places=1):
    """Return a 3MF of one solid of `count` equal triangles, placed so many times."""
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="0"/>' for x, y in ((0, 0), (9, 0), (0, 9)))
    model = (
        '<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        f'<object id="1"><mesh><vertices>{vertices}</vertices><triangles>'
        + '<triangle v1="0" v2="1" v3="2"/>' * count
        + "</triangles></mesh></object></resources><build>"
        + '<item objectid="1"/>' * places
        + "</build></model>"
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", model)
    return file.getvalue()


def test_an_image_is_kept_under_a_name_of_our_own(kept):
    path = kept.image("../../etc/coin.PNG", png())
    assert path.read_bytes() == png()
    assert path.name == "upload-1.png"
    kept.close()
    assert not path.exists()


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("a.exe", b"MZ", r"a\.exe is no image; valid: \.png"),
        ("a.png", b"", "is empty"),
        ("a.png", b"not a picture at all", "is not a .png file, or damaged"),
        ("a.png", png()[:60], "cannot be read"),
        ("a.png", png(2, 2), "has 4 pixels; valid: 16 to"),
        ("a.npy", npy(np.array([{"a": 1}] * 20, dtype=object)), "array of objects"),
        ("a.npy", npy(np.zeros((64, 64)))[:-100], "truncated"),
        ("a.tif", b"II*\0 nothing", "is not a .tif file, or damaged"),
        ("<script>.png", b"x", r"^_script_\.png is not"),
    ],
)
def test_what_is_no_image_is_refused_in_one_line(kept, name, content, why):
    with pytest.raises(AsperityError, match=why) as caught:
        kept.image(name, content)
    assert "\n" not in str(caught.value)
    assert list(kept._folder.iterdir()) == []


def test_an_image_that_says_it_is_huge_is_not_decoded(kept, monkeypatch):
    monkeypatch.setattr(uploads, "read_pixels", lambda path: pytest.fail("it was decoded"))
    bomb = bytearray(png())
    bomb[16:24] = struct.pack(">II", 60_000, 60_000)
    with pytest.raises(AsperityError, match=r"3600000000 pixels; valid|is not a .png file"):
        kept.image("bomb.png", bytes(bomb))


def test_too_many_bytes_are_refused(kept, monkeypatch):
    monkeypatch.setattr(uploads, "MAX_BYTES", 1000)
    with pytest.raises(AsperityError, match="MB; valid"):
        kept.image("a.png", bytes(1001))


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("a.gltx", b"{}", r"is no mesh; valid: \.stl, \.obj, \.ply, \.off, \.glb, \.gltf, \.3mf"),
        ("a.gltf", b"{", "is not a .gltf file"),
        ("a.gltf", b'{"buffers": [{"uri": "a.bin"}]}', "refers to other files"),
        ("a.3mf", b"PK", "is not a .3mf file"),
        ("a.3mf", threemf(200_001), "200001 triangles"),
        ("a.3mf", threemf(12, places=20_000), "240000 triangles"),
        ("a.3mf", threemf(0), r"^a\.3mf.*"),
        ("a.stl", stl(1, said=10**9), "1000000000 triangles; valid: 200000 at most"),
        ("a.obj", b"f 1 2 3\n" * 200_001, "200001 triangles"),
        ("a.off", b"OFF 3 1 0\n" + b"3 0 1 2\n" * 200_001, "200001 triangles"),
        ("a.ply", b"ply\nelement face 999999\nend_header\n", "999999 triangles"),
        ("a.glb", glb({"buffers": [{"uri": "/etc/passwd"}]}), "refers to other files"),
        ("a.glb", b"glTF", "is not a .glb file"),
        ("a.stl", b"short", "is not a .stl file"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_line(kept, name, content, why):
    with pytest.raises(AsperityError, match=why) as caught:
        kept.mesh(name, content)
    assert str(kept._folder) not in str(caught.value)
    assert list(kept._folder.iterdir()) == []


def test_an_archive_is_bounded_by_its_unpacked_size(kept, monkeypatch):
    monkeypatch.setattr(uploads, "MAX_UNPACKED", 2**20)
    with pytest.raises(AsperityError, match=r"a\.3mf has 3 MB unpacked; valid: 1 MB"):
        kept.mesh("a.3mf", threemf(100_000))
    assert kept.mesh("b.3mf", threemf(8)).suffix == ".3mf"


def test_a_mesh_is_counted_by_what_it_says(kept):
    tree = {
        "accessors": [{"count": 36}, {"count": 24}],
        "meshes": [{"primitives": [{"indices": 0, "attributes": {"POSITION": 1}}]}],
    }
    assert uploads._triangles("a", ".glb", glb(tree)) == 12
    assert kept.mesh("part.stl", stl(4)).suffix == ".stl"
