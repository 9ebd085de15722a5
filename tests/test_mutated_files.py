"""Damaged files of heights and poses: each is read or refused in one line, soon."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import re
import resource
import struct
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from asperity.errors import AsperityError
from asperity.scene.trajectory_file import read_poses
from asperity.texture.height_field import HeightField

LONGEST = 300
"""Characters of a refusal, its path left out."""
INSIDE = re.compile(r"Error\b.?[:(]|Traceback|has no attribute|can't decode|column index")
"""Words of Python's that a refusal has not."""
SECONDS, BYTES = 10.0, 2 << 30
"""Time and memory that a file may take."""
TIMES = 1000
"""Mutations of each seed."""
V, U = np.mgrid[0:12, 0:16]
H = np.sin(U / 3.0) + np.cos(V / 2.0)
NUMBERS = [b"0", b"-1", b"1e400", b"-1e-400", b"nan", b"9" * 30, b"65536", b"4294967295", b"1e9"]


def text(rows: np.ndarray, separator: str = ",") -> str:
    return "\n".join(separator.join(f"{value:.6g}" for value in row) for row in rows) + "\n"


def picture(form: str, pixels: np.ndarray, **options: object) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, form, **options)
    return stream.getvalue()


def tiff(values: np.ndarray, **options: object) -> bytes:
    stream = io.BytesIO()
    tifffile.imwrite(stream, values, **options)
    return stream.getvalue()


def saved(save, *values: object, **named: object) -> bytes:
    stream = io.BytesIO()
    save(stream, *values, **named)
    return stream.getvalue()


def x3p() -> bytes:
    data = H.astype("<f8").tobytes()
    axes = "".join(
        f"<C{name}><AxisType>{kind}</AxisType><DataType>D</DataType><Increment>1e-5</Increment>"
        f"<Offset>0</Offset></C{name}>"
        for name, kind in zip("XYZ", "IIA", strict=True)
    )
    main = (
        '<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1><Revision>ISO5436 - '
        f"2000</Revision><FeatureType>SUR</FeatureType><Axes>{axes}</Axes></Record1><Record3>"
        "<MatrixDimension><SizeX>16</SizeX><SizeY>12</SizeY><SizeZ>1</SizeZ></MatrixDimension>"
        "<DataLink><PointDataLink>bindata/data.bin</PointDataLink><MD5ChecksumPointData>"
        f"{hashlib.md5(data).hexdigest()}</MD5ChecksumPointData></DataLink></Record3></p:ISO5436_2>"
    )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr("main.xml", main)
        file.writestr("bindata/data.bin", data)
    return stream.getvalue()


def sdf() -> bytes:
    keys = {"ManufacID": "none", "CreateDate": "010120260000", "ModDate": "010120260000",
            "NumPoints": 16, "NumProfiles": 12, "Xscale": 1e-5, "Yscale": 1e-5, "Zscale": 1e-6,
            "Zresolution": 1e-9, "Compression": 0, "DataType": 7, "CheckType": 0}  # fmt: skip
    head = "".join(f"{key} = {value}\n" for key, value in keys.items())
    return ("aISO-1.0\n" + head + "*\n" + text(H, " ") + "*\n").encode()


def sxm() -> bytes:
    head = (
        ":NANONIS_VERSION:\n2\n:SCAN_PIXELS:\n 16 12\n:SCAN_RANGE:\n 1.6E-4 1.2E-4\n:SCAN_DIR:\n"
        "down\n:SCAN_ANGLE:\n 0.0\n:DATA_INFO:\n\tChannel\tName\tUnit\tDirection\tCalibration\n"
        "\t0\tCurrent\tA\tforward\t1E-9\n\t14\tZ\tm\tboth\t2E-8\n\n:SCANIT_END:\n\n\n"
    )
    return head.encode() + b"\x1a\x04" + np.tile((1e-6 * H).astype(">f4"), (3, 1)).tobytes()


def gsf() -> bytes:
    head = b"Gwyddion Simple Field 1.0\nXRes = 16\nYRes = 12\nXReal = 1.6e-4\nYReal = 1.2e-4\n"
    head += b"ZUnits = m\n"
    return head + b"\0" * (4 - len(head) % 4) + (1e-6 * H).astype("<f4").tobytes()


def surfer() -> bytes:
    ends = struct.pack("<4shh6d", b"DSBB", 16, 12, 0.0, 1.5e-4, 0.0, 1.1e-4, -2e-5, 2e-5)
    return ends + (1e-5 * H).astype("<f4").tobytes()


def zygo() -> bytes:
    head = (
        'Zygo ASCII Data File - Format 2\n0 8 2 1 0 ""\n0 0 0 0 0 0\n0 0 16 12\n""\n""\n""\n'
        '0 0.5 6.328e-07 0 1 0 1e-5 0\n16 12 0 0 ""\n0 0 0\n0 1 20 2\n0 ""\n1 0\n""\n#\n#\n'
    )
    return (head + text(np.round(1e5 * H), " ") + "#\n").encode()


def wyko() -> bytes:
    head = "Wyko ASCII Data File Format 0\t0\t1\nX Size\t12\nY Size\t16\nWavelength\t7\t4\t632.8\n"
    return (head + "Pixel_size\t7\t4\t0.01\nRAW_DATA\t3\t768\t\n" + text(H, "\t")).encode()


GREY = np.round(127 + 60 * H).astype(np.uint8)
COLOUR = np.stack([GREY, GREY[::-1], 255 - GREY], axis=-1)
POINTS = np.column_stack([U.ravel(), V.ravel(), H.ravel()])
POSES = np.column_stack([np.arange(9) * 1e-3, np.zeros((9, 3)), np.tile([1, 0, 0, 0], (9, 1))])
HEAD = "# Channel: a\n# Width: 160 µm\n# Height: 0.12 mm\n# Value units: µm\n"
SCALE = {"pixel_size": 1e-5, "height_range": 4e-5, "missing": "fill"}
HEIGHTS = {
    "gwyddion.txt": (HEAD + text(H, "\t")).encode(),
    "matrix.csv": ("height [um]\n" + text(H)).encode("utf-16"),
    "semicolons.csv": text(H, ";").replace(".", ",").encode(),
    "points.xyz": ("x y z\n" + text(POINTS, " ")).encode("latin-1"),
    "profile.txt": text(POINTS[:16, ::2], " ").encode(),
    "grid.asc": ("ncols 16\nnrows 12\ncellsize 1e-5\nNODATA_value -9\n" + text(H, " ")).encode(),
    "a.npy": saved(np.save, H),
    "a.npz": saved(np.savez_compressed, height_um=H, pixel_size_um=10.0),
    "grey.png": picture("PNG", GREY),
    "grey16.png": picture("PNG", GREY.astype(np.uint16) * 250),
    "palette.png": saved(Image.fromarray(GREY).convert("P").save, "PNG"),
    "colour.png": picture("PNG", COLOUR),
    "grey.jpg": picture("JPEG", GREY),
    "grey.tga": picture("TGA", GREY),
    "grey.bmp": picture("BMP", GREY),
    "grey.webp": picture("WEBP", COLOUR),
    "colour.dds": picture("DDS", COLOUR),
    "grey.tif": tiff(H.astype(np.float32), extratags=[(42113, "s", 0, "-9999", True)]),
    "zip.tiff": tiff(GREY.astype(np.int16), compression="zlib"),
    "rgb.tif": tiff(COLOUR, photometric="rgb"),
    "a.x3p": x3p(),
    "a.sdf": sdf(),
    "a.sxm": sxm(),
    "a.gsf": gsf(),
    "a.grd": surfer(),
    "text.grd": ("DSAA\n16 12\n0 1.5e-4\n0 1.1e-4\n-2 2\n" + text(1e-5 * H, " ")).encode(),
    "zygo.asc": zygo(),
    "wyko.asc": wyko(),
    "packed.txt.gz": gzip.compress((HEAD + text(H, "\t")).encode()),
}
COLOURED = ("colour.png", "rgb.tif", "grey.webp", "colour.dds")
VICON = "Objects\n100\n,,Tool:Tool,,,,,,\nFrame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ\n,,,,,,mm,mm,mm\n"
FRAMES = np.column_stack([np.arange(9), np.zeros(9), np.tile([0, 0, 0, 1, 5, 6, 7], (9, 1))])
CLOCK = "".join(f"2024-01-10T10:31:0{k}.25,0,0,0.1,1,0,0,0\n" for k in range(9))
ANGLES = "time,x,y,z,roll [deg],pitch [deg],yaw [deg]\n"
MATRICES = np.insert(np.tile(np.eye(4)[:3], (9, 1, 1)).reshape(9, 12), 0, np.arange(9), axis=1)
RECORDS = json.dumps([{"t": p[0], "position": p[1:4], "q": p[4:]} for p in POSES.tolist()])
POSE_FILES = {
    "angles.csv": (ANGLES + text(POSES[:, :7])).encode(),
    "vectors.csv": ("t,x,y,z,rx,ry,rz\n" + text(0.1 * POSES[:, :7])).encode(),
    "kitti.txt": text(MATRICES, " ").encode(),
    "vicon.csv": (VICON + text(FRAMES)).encode(),
    "clock.csv": ("time,x,y,z,qw,qx,qy,qz\n" + CLOCK).encode(),
    "head.csv": ("time,x [mm],y [mm],z [mm],qw,qx,qy,qz\n" + text(POSES)).encode(),
    "tum.txt": ("# timestamp tx ty tz qx qy qz qw\n" + text(POSES, " ")).encode("utf-16"),
    "bare.csv": text(POSES, ";").replace(".", ",").encode(),
    "records.json": RECORDS.encode(),
    "records.jsonl": RECORDS[1:-1].replace("}, ", "}\n").encode(),
    "lists.json": json.dumps(
        {
            "t": POSES[:, 0].tolist(),
            "position": POSES[:, 1:4].tolist(),
            "quaternion": POSES[:, 4:].tolist(),
            "unit": "mm",
        }
    ).encode(),
    "a.npy": saved(np.save, POSES),
    "a.npz": saved(np.savez, times=POSES[:, 0], poses=POSES[:, 1:]),
    "named.npz": saved(np.savez, t=POSES[:, 0], pos=POSES[:, 1:4], quat=POSES[:, 4:]),
}


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Change a file at a few places: bytes, bits, numbers, parts cut, repeated or moved."""
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        if not out:
            return bytes(out)
        at, length = int(rng.integers(len(out))), int(rng.integers(1, 24))
        match rng.integers(7):
            case 0:
                out[at] = rng.integers(256)
            case 1:
                out[at] ^= 1 << int(rng.integers(8))
            case 2:
                del out[at : at + length]
            case 3:
                out[at:at] = out[at : at + length] * int(rng.integers(1, 4))
            case 4:
                out[at : at + length] = rng.bytes(length)
            case 5:
                del out[at:]
            case _:
                found = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", bytes(out)))
                if found:
                    place = found[int(rng.integers(len(found)))].span()
                    out[place[0] : place[1]] = NUMBERS[int(rng.integers(len(NUMBERS)))]
    return bytes(out)


def tried(read, path: Path, content: bytes, **options: object) -> str:
    """Read a file; return how it was refused, "" if it was read. Anything else is an error."""
    path.write_bytes(content)
    start = time.perf_counter()
    try:
        read(path, **options)
    except AsperityError as error:
        message = str(error).replace(f"{path.parent}/", "")
        assert len(message) <= LONGEST, message
        assert "\n" not in message
        assert not INSIDE.search(message), message
        return message
    finally:
        assert time.perf_counter() - start < SECONDS
    return ""


@pytest.mark.slow
@pytest.mark.parametrize("name", HEIGHTS)
def test_mutated_files_of_heights(tmp_path: Path, name: str, capfd: pytest.CaptureFixture) -> None:
    if Path(name).suffix in (".x3p", ".sdf", ".xyz", ".asc"):  # damaged, the latter are no text
        pytest.importorskip("SurfaceTopography", reason="reads files of instruments")
    scaled = ("gwyddion.txt", "a.x3p", "a.sdf", "a.sxm", "a.gsf", "zygo.asc", "wyko.asc")
    options = {} if name in scaled else dict(SCALE)
    colour = {"colour": "luminance"} if name in COLOURED else {}
    (tmp_path / name).write_bytes(HEIGHTS[name])
    HeightField.from_file(tmp_path / name, **options, **colour)  # it may compile
    assert tried(HeightField.from_file, tmp_path / name, HEIGHTS[name], **options, **colour) == ""
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(TIMES):
        content = mutated(HEIGHTS[name], rng)
        refused += bool(tried(HeightField.from_file, tmp_path / name, content, **options))
    assert refused > 0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 < BYTES
    assert capfd.readouterr().err == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", COLOURED)
def test_mutated_normal_maps(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(2)
    for _ in range(TIMES):
        content = mutated(HEIGHTS[name], rng)
        tried(HeightField.from_file, tmp_path / name, content, pixel_size=1e-5, kind="normal")


@pytest.mark.slow
@pytest.mark.parametrize("name", POSE_FILES)
def test_mutated_files_of_poses(tmp_path: Path, name: str) -> None:
    assert tried(read_poses, tmp_path / name, POSE_FILES[name]) == ""
    rng = np.random.default_rng(3)
    for _ in range(TIMES):
        tried(read_poses, tmp_path / name, mutated(POSE_FILES[name], rng))


@pytest.mark.slow
@pytest.mark.parametrize("name", HEIGHTS | POSE_FILES)
def test_no_other_content_under_a_suffix_gets_through(tmp_path: Path, name: str) -> None:
    """What one program wrote, with the suffix of another."""
    pytest.importorskip("SurfaceTopography", reason="its import takes seconds")
    for other in HEIGHTS | POSE_FILES:
        for read in (HeightField.from_file, read_poses):
            tried(read, tmp_path / f"a{Path(name).suffix}", (HEIGHTS | POSE_FILES)[other])
