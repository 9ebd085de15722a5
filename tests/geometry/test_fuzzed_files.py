"""Damaged files of every kind: each is read, or refused in one line, soon and in little memory."""

import base64
import gzip
import io
import json
import re
import resource
import struct
import time
import tomllib
import warnings
import zipfile

import numpy as np
import pytest

import asperity
from asperity.baking.points import read_points
from asperity.errors import AsperityError
from asperity.geometry.mesh.files import read_mesh

POINTS = np.random.default_rng(0).uniform(-0.02, 0.02, (40, 3))
FACES = np.random.default_rng(1).permuted(np.tile(np.arange(40), (30, 1)), axis=1)[:, :3]
LONGEST, MOST = 10.0, 2 << 30
"""Time [s] and memory [bytes] that a file may take."""


def rows(values, form="{:.6g}"):
    return "\n".join(" ".join(form.format(x) for x in row) for row in values) + "\n"


def stl():
    faces = b"".join(struct.pack("<12fH", 0, 0, 0, *POINTS[f].ravel(), 0) for f in FACES)
    return bytes(80) + struct.pack("<I", len(FACES)) + faces


def text_stl():
    out = ["solid a"]
    for face in FACES:
        out += ["facet normal 0 0 1", "outer loop"]
        out += ["vertex {:g} {:g} {:g}".format(*POINTS[i]) for i in face]
        out += ["endloop", "endfacet"]
    return "\n".join([*out, "endsolid a"]).encode()


def obj():
    text = "mtllib a.mtl\n" + "".join(f"v {line}\n" for line in rows(POINTS).splitlines())
    # A small part of the texture: to count what overlaps on it takes longer than to read.
    text += "vt 0 0\nvt 0.1 0\nvt 0 0.1\nusemtl a\n"
    return (text + "".join("f {}/1 {}/2 {}/-1\n".format(*(f + 1)) for f in FACES)).encode()


def ply(form):
    head = f"ply\nformat {form} 1.0\nelement vertex 40\n"
    head += "".join(f"property float {c}\n" for c in "xyz")
    head += f"element face {len(FACES)}\nproperty list uchar int vertex_indices\nend_header\n"
    if form == "ascii":
        return (head + rows(POINTS) + rows(np.column_stack([np.full(30, 3), FACES]))).encode()
    order = "<" if "little" in form else ">"
    data = b"".join(struct.pack(f"{order}B3i", 3, *face) for face in FACES)
    return head.encode() + POINTS.astype(order + "f4").tobytes() + data


def off():
    faces = np.column_stack([np.full(30, 3), FACES])
    return (f"COFF # a\n40 {len(FACES)} 0\n" + rows(np.column_stack([POINTS, POINTS]))
            + rows(faces, "{}")).encode()  # fmt: skip


def zipped():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("in/a.mtl", "newmtl a\ndisp a.png\n")
        archive.writestr("in/a.obj", obj())
    return stream.getvalue()


def glb(*, binary=True):
    data = POINTS.astype("<f4").tobytes() + FACES.astype("<u2").tobytes()
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [1, 1, 1], "rotation": [0, 0, 0, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 480, "byteStride": 12},
                        {"buffer": 0, "byteOffset": 480, "byteLength": 180}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 40, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 90, "type": "SCALAR"}],
    }  # fmt: skip
    if not binary:
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        tree["buffers"][0]["uri"] = uri
        return json.dumps(tree).encode()
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def pcd(form):
    head = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 40\nHEIGHT 1\n"
    head += f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 40\nDATA {form}\n"
    data = POINTS.astype("<f4")
    if form == "ascii":
        return (head + rows(POINTS)).encode()
    if form == "binary":
        return head.encode() + data.tobytes()
    whole = data.T.tobytes()
    packed = b"".join(b"\x1f" + whole[i : i + 32] for i in range(0, len(whole), 32))
    return head.encode() + struct.pack("<II", len(packed), len(whole)) + packed


def ptx():
    head = "8\n5\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n"
    return (head + rows(np.column_stack([POINTS, np.full(40, 0.5)]))).encode()


def packed():
    return gzip.compress(rows(POINTS).encode())


def las():
    head = struct.pack("<4sHHIHH8sBB32s32sHHHIIBHI5I", b"LASF", 0, 0, 0, 0, 0, b"", 1, 2, b"", b"",
                       1, 2026, 227, 227, 0, 0, 20, 40, 40, 0, 0, 0, 0)  # fmt: skip
    head += struct.pack("<12d", *[1e-4] * 3, *[0] * 9)
    return head + b"".join(struct.pack("<3iHBBbBH", *np.int32(p * 1e4), *[0] * 6) for p in POINTS)


USDA = """#usda 1.0
( metersPerUnit = 1 )
def Xform "World"
{
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [%s]
        int[] faceVertexIndices = [%s]
        point3f[] points = [%s]
        texCoord2f[] primvars:st = [%s] ( interpolation = "vertex" )
        rel material:binding = </World/w>
    }
    def Material "w"
    {
        token outputs:surface.connect = </World/w/s.outputs:surface>
        def Shader "s"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (1, 0.5, 0)
            token outputs:surface
        }
    }
}
"""


def usd(suffix, folder):
    """A mesh as text, in a crate, or in a package."""
    Usd, UsdUtils = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdUtils"))
    places = (", ".join(f"({x:g}, {y:g}, {z:g})" for x, y, z in POINTS),
              ", ".join(f"({x:g}, {y:g})" for x, y, _ in POINTS))  # fmt: skip
    text = USDA % (", ".join("3" * len(FACES)), ", ".join(map(str, FACES.ravel())), *places)
    (folder / "seed.usda").write_text(text)
    if suffix == ".usda":
        return text.encode()
    Usd.Stage.Open(str(folder / "seed.usda")).Export(str(folder / "seed.usdc"))
    if suffix == ".usdz":
        UsdUtils.CreateNewUsdzPackage(str(folder / "seed.usdc"), str(folder / "seed.usdz"))
    return (folder / f"seed{suffix}").read_bytes()


FILES = {
    "a.stl": (read_mesh, stl), "text.stl": (read_mesh, text_stl), "a.obj": (read_mesh, obj),
    "a.ply": (read_mesh, lambda: ply("ascii")),
    "little.ply": (read_mesh, lambda: ply("binary_little_endian")),
    "big.ply": (read_mesh, lambda: ply("binary_big_endian")), "a.glb": (read_mesh, glb),
    "a.gltf": (read_mesh, lambda: glb(binary=False)),
    "a.off": (read_mesh, off), "a.zip": (read_mesh, zipped),
    "a.stl.gz": (read_mesh, lambda: gzip.compress(stl())),
    "a.xyz": (read_points, lambda: rows(POINTS).encode()),
    "named.csv": (read_points, lambda: b"x;y;z\n" + rows(POINTS).replace(" ", ";").encode()),
    "points.ply": (read_points, lambda: ply("ascii")),
    "a.pcd": (read_points, lambda: pcd("ascii")),
    "names.csv": (read_points, lambda: re.sub(rb"(?m)^(?=.)", b"P1 ", rows(POINTS).encode())),
    "a.ptx": (read_points, ptx), "packed.xyz.gz": (read_points, packed),
    "binary.pcd": (read_points, lambda: pcd("binary")),
    "packed.pcd": (read_points, lambda: pcd("binary_compressed")), "a.las": (read_points, las),
}  # fmt: skip
WORDS = (
    b"nan", b"inf", b"-1", b"1e999", b"99999999999", b"-99999999999999999999", b"4294967295", b"0",
    b"\0", b"\xff", b"\xef\xbb\xbf", b"\n", b"\r", b" ", b",", b";", b"/", b"{}", b"[]", b"null",
    b'"', b"true", b"list", b"0.5", b"#",
)  # fmt: skip


def mutated(data, rng):
    """Return data with some bytes, numbers or parts changed, cut, or written twice."""
    out = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        if not out:
            break
        at = int(rng.integers(0, len(out)))
        size = int(rng.integers(1, 20))
        choice = rng.integers(0, 6)
        if choice == 0:
            out[at] = rng.integers(0, 256)
        elif choice == 1:
            out[at : at + size] = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
        elif choice == 2:
            out[at : at + int(rng.integers(0, 12))] = WORDS[rng.integers(0, len(WORDS))]
        elif choice == 3:
            del out[at : at + size]
        elif choice == 4:
            out = out[:at]
        else:
            out[at:at] = out[at : at + 10 * size]
    return bytes(out)


def try_many(read, path, data, seed, count):
    """Read mutated files; return how many were read."""
    good = 0
    rng = np.random.default_rng(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        for k in range(count):
            path.write_bytes(mutated(data, rng))
            began, said = time.perf_counter(), ""
            try:
                read(path)
                good += 1
            except AsperityError as error:
                said = str(error)
            except Exception as error:
                raise AssertionError(f"{path.name}, seed {seed}, file {k}: {error!r}") from error
            assert time.perf_counter() - began < LONGEST
            assert "\n" not in said
            assert len(said) < 300 + len(str(path)), said
    return good


def _most_memory():
    """Return the most memory that this process has had [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


@pytest.mark.parametrize("count", [30, pytest.param(150, marks=pytest.mark.slow)])
@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_damaged_files_of_usd(tmp_path, suffix, count):
    data = usd(suffix, tmp_path)
    (tmp_path / f"a{suffix}").write_bytes(data)
    assert len(read_mesh(tmp_path / f"a{suffix}").faces) == len(FACES)
    # Each under a name of its own: usd-core keeps what it has read.
    rng, said = np.random.default_rng(2), ""
    before = _most_memory()  # what other tests have taken
    for k in range(count):
        path = tmp_path / f"{k}{suffix}"
        path.write_bytes(mutated(data, rng))
        began = time.perf_counter()
        try:
            read_mesh(path)
        except AsperityError as error:
            said = str(error)
        assert time.perf_counter() - began < LONGEST
        assert "\n" not in said
        assert "Crate" not in said
        assert len(said) < 300 + len(str(path)), said
        path.unlink()
    assert _most_memory() - before < MOST


@pytest.mark.parametrize("name", FILES)
def test_a_few_damaged_files(tmp_path, name):
    read, make = FILES[name]
    if name == "a.las":
        pytest.importorskip("laspy")
    (tmp_path / name).write_bytes(make())
    read(tmp_path / name)
    try_many(read, tmp_path / name, make(), 0, 60)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_many_damaged_files(tmp_path, name):
    read, make = FILES[name]
    if name == "a.las":
        pytest.importorskip("laspy")
    before = _most_memory()
    try_many(read, tmp_path / name, make(), 1, 7000)
    assert _most_memory() - before < MOST


SCENE = b"""<mujoco><asset><hfield name="w" nrow="4" ncol="4" size=".02 .02 .001 .005"
  elevation="0 1 0 1  0 1 0 1  0 1 0 1  0 1 0 1"/></asset>
  <worldbody><body name="plate"><geom type="hfield" hfield="w" friction=".5"/></body>
  <body name="tool" pos="0 0 .01"><freejoint/><geom size=".002"/>
  <body pos="0 0 .01"><geom type="box" size=".001 .001 .001"/></body></body></worldbody></mujoco>"""
TOML = b'schema = 1\n[tool]\nbody = "tool"\n[force]\nstiffness = 400.0\n[trajectory]\nspeed = 0.1\n'


@pytest.mark.parametrize("count", [40, pytest.param(2000, marks=pytest.mark.slow)])
def test_damaged_scenes(tmp_path, count):
    rng = np.random.default_rng(0)
    assert tomllib.loads(TOML.decode())
    for k in range(count):
        wrong = k % 3
        (tmp_path / "scene.xml").write_bytes(mutated(SCENE, rng) if wrong != 1 else SCENE)
        (tmp_path / "scene.toml").write_bytes(mutated(TOML, rng) if wrong != 0 else TOML)
        said = ""
        try:
            asperity.load_scene(tmp_path)
        except AsperityError as error:
            said = str(error)
        assert "\n" not in said
