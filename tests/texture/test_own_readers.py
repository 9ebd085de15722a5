"""Files of programs that no library here reads: Surfer, Nanonis, Gwyddion, Zygo and Wyko."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

import numpy as np
import pytest

from asperity.baking.sources import kind_of
from asperity.errors import AsperityError, SurfaceError
from asperity.texture.files.reading import Heights, read_heights

ROWS, COLUMNS = 20, 30
STEP = 2e-6
V, U = np.mgrid[0:ROWS, 0:COLUMNS]
TRUTH = np.sin(U / 3.0) + 0.5 * np.cos(V / 4.0 + U / 9.0)  # row 0 at v = 0; no turn is like it
TRUTH = 3e-5 * (TRUTH - TRUTH.min()) / np.ptp(TRUTH)
TOP = np.flipud(TRUTH)


def rows(values: np.ndarray, separator: str = " ") -> str:
    return "".join(separator.join(f"{v:.9g}" for v in row) + "\n" for row in values)


def same(found: Heights, atol: float = 2e-9) -> None:
    np.testing.assert_allclose(np.broadcast_to(found.pixel_size, 2), STEP, rtol=1e-6)
    assert found.samples.shape == TRUTH.shape
    np.testing.assert_allclose(
        found.samples - found.samples.min(), TRUTH - TRUTH.min(), rtol=0, atol=atol
    )


# --- Surfer -------------------------------------------------------------------------------------


def surfer(form: str, values: np.ndarray = TRUTH) -> bytes:
    ends = (0.0, (COLUMNS - 1) * STEP, 1.0, 1.0 + (ROWS - 1) * STEP)
    if form == "DSAA":
        head = f"DSAA\n{COLUMNS} {ROWS}\n{ends[0]} {ends[1]}\n{ends[2]:.9f} {ends[3]:.9f}\n0 1\n"
        return (head + rows(values)).encode()
    if form == "DSBB":
        head = struct.pack("<4shh6d", b"DSBB", COLUMNS, ROWS, *ends, 0.0, 1.0)
        return head + values.astype("<f4").tobytes()
    grid = struct.pack("<ii8d", ROWS, COLUMNS, 0.0, 1.0, STEP, STEP, 0.0, 1.0, 0.0, 1.70141e38)
    parts = [(b"DSRB", struct.pack("<i", 2)), (b"GRID", grid), (b"DATA", values.tobytes())]
    return b"".join(struct.pack("<4si", name, len(data)) + data for name, data in parts)


@pytest.mark.parametrize("form", ["DSAA", "DSBB", "DSRB"])
def test_grids_of_surfer_are_read(tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.grd"
    path.write_bytes(surfer(form))
    found = read_heights(path)
    same(found)
    assert any("no unit is stated" in note for note in found.notes)
    assert kind_of(path) == "heights"
    gaps = TRUTH.copy()
    gaps[3, 4] = 1.70141e38
    path.write_bytes(surfer(form, gaps))
    with pytest.raises(SurfaceError, match="1 of 600 values are missing"):
        read_heights(path)


@pytest.mark.parametrize("form", ["DSAA", "DSBB", "DSRB"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_a_grid_cut_short_is_refused(tmp_path: Path, form: str, share: float) -> None:
    data = surfer(form)
    path = tmp_path / "a.grd"
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(SurfaceError, match="damaged or cut short; valid: a grid of Surfer"):
        read_heights(path)
    head = f"ncols {COLUMNS}\nnrows {ROWS}\nxllcorner 0\nyllcorner 0\ncellsize {STEP}\n"
    path.write_text(head + rows(TOP))
    same(read_heights(path))  # ESRI's have the suffix too
    path.write_bytes(b"CDF\x01" + bytes(100))
    with pytest.raises(SurfaceError, match="no grid of Surfer; valid"):
        read_heights(path)


# --- Nanonis ------------------------------------------------------------------------------------


def scan(*, direction: str = "down", channels: str = "14\tZ\tm\tboth\t2E-8\t0") -> bytes:
    maps = [c.split("\t") for c in channels.split("\n")]
    head = (
        ":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\n              FLOAT            MSBFIRST\n"
        f":SCAN_PIXELS:\n       {COLUMNS}       {ROWS}\n:SCAN_RANGE:\n"
        f"  {COLUMNS * STEP:E}  {ROWS * STEP:E}\n:SCAN_ANGLE:\n  0.0E+0\n:SCAN_DIR:\n{direction}\n"
        ":Scan>channels:\nCurrent (A);Z (m)\n:DATA_INFO:\n"
        "\tChannel\tName\tUnit\tDirection\tCalibration\tOffset\n"
        + "".join(f"\t{line}\n" for line in channels.split("\n"))
        + "\n:SCANIT_END:\n\n\n"
    )
    shown = TOP if direction == "down" else TRUTH
    body = b""
    for _, name, _, ways, *_ in maps:
        one = shown if name == "Z" else 0.0 * shown
        body += one.astype(">f4").tobytes()
        body += np.fliplr(one).astype(">f4").tobytes() if ways == "both" else b""
    return head.encode() + b"\x1a\x04" + body


CURRENT = "0\tCurrent\tA\tboth\t1E-9\t0"


@pytest.mark.parametrize("direction", ["down", "up"])
@pytest.mark.parametrize(
    "channels", ["14\tZ\tm\tboth\t2E-8\t0", f"{CURRENT}\n14\tZ\tm\tforward\t2E-8\t0"]
)
def test_scans_of_nanonis_are_read(tmp_path: Path, direction: str, channels: str) -> None:
    path = tmp_path / "a.sxm"
    path.write_bytes(scan(direction=direction, channels=channels))
    found = read_heights(path)
    same(found)
    assert any(note.startswith("channel 'Z', forward") for note in found.notes)


def test_scans_without_heights_or_cut_short_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.sxm"
    path.write_bytes(scan(channels=CURRENT))
    with pytest.raises(SurfaceError, match=r"no channel of heights among Current \[A\]"):
        read_heights(path)
    for wrong in (scan()[:-3000], scan()[:200], scan().replace(b"SCAN_PIXELS", b"SCAN_PIXELZ")):
        path.write_bytes(wrong)
        with pytest.raises(SurfaceError, match=r"valid: the file as Nanonis wrote it$"):
            read_heights(path)


def field(**changes: str) -> bytes:
    keys = {"XRes": f"{COLUMNS}", "YRes": f"{ROWS}", "XReal": f"{COLUMNS * STEP:g}",
            "YReal": f"{ROWS * STEP:g}", "XYUnits": "m", "ZUnits": "m", "Title": "ö"}  # fmt: skip
    keys |= changes
    head = "Gwyddion Simple Field 1.0\n"
    head += "".join(f"{key} = {value}\n" for key, value in keys.items() if value)
    data = head.encode()
    return data + b"\0" * (4 - len(data) % 4) + TOP.astype("<f4").tobytes()


@pytest.mark.parametrize("title", ["a", "ab", "abc", "abcd"])
def test_simple_fields_of_gwyddion_are_read_whatever_their_padding(tmp_path, title: str) -> None:
    path = tmp_path / "a.gsf"
    path.write_bytes(field(Title=title))
    same(read_heights(path))
    assert kind_of(path) == "heights"


def test_simple_fields_without_a_size_in_volts_or_cut_short_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gsf"
    path.write_bytes(field(XReal="", ZUnits=""))
    with pytest.raises(SurfaceError, match="choose a value for pixel_size"):
        read_heights(path)
    found = read_heights(path, pixel_size=STEP)
    same(found)
    assert any("no unit is stated" in note for note in found.notes)
    path.write_bytes(field(ZUnits="V"))
    with pytest.raises(SurfaceError, match="its values are in 'V'; valid: a channel of heights"):
        read_heights(path)
    for wrong in (field()[:-9], field(YRes=""), field(XRes="a"), b"GSF" + field()):
        path.write_bytes(wrong)
        with pytest.raises(SurfaceError, match="damaged"):
            read_heights(path)


# --- Interferometers ----------------------------------------------------------------------------


def zygo(form: str, *, resolution: int = 1) -> str:
    head = (
        f"Zygo {form} Data File - Format 2\n0 8 2 1 0\n0 0 0 0 0 0\n5 7 {COLUMNS} {ROWS}\n"
        f'"a comment"\n""\n""\n0 0.5 6.328e-07 0 1 0 {STEP} 1578650000\n{COLUMNS} {ROWS} 0 0 ""\n'
        f'0 0 0 0 0 0\n{resolution} 1 20 2 0\n0 ""\n1 0\n""\n#\n'
    )
    if form == "XYZ":
        lines = [
            f"{u + 5} {v + 7} {'No Data' if (u, v) == (3, 4) else f'{1e6 * TOP[v, u]:.6f}'}\n"
            for v in range(ROWS)
            for u in range(COLUMNS)
        ]
        return head + "".join(lines) + "#\n"
    steps = {0: 4096, 1: 32768, 2: 131072}[resolution]
    phases = np.round(TOP / (0.5 * 6.328e-7) * steps).astype(int).ravel()
    phases[4 * COLUMNS + 3] = 2147483640
    lines = [" ".join(map(str, phases[i : i + 10])) + "\n" for i in range(0, phases.size, 10)]
    return head + "#\n" + "".join(lines) + "#\n"


@pytest.mark.parametrize("name", ["a.xyz", "a.asc", "a.txt"])
@pytest.mark.parametrize(("form", "resolution"), [("XYZ", 0), ("ASCII", 0), ("ASCII", 1)])
def test_texts_of_zygo_are_read(tmp_path: Path, name: str, form: str, resolution: int) -> None:
    path = tmp_path / name
    path.write_text(zygo(form, resolution=resolution))
    with pytest.raises(SurfaceError, match="1 of 600 values are missing"):
        read_heights(path)
    found = read_heights(path, missing="fill")
    filled = np.flipud(np.arange(TOP.size).reshape(TOP.shape)) == 4 * COLUMNS + 3
    found.samples[filled] = TRUTH[filled]
    same(found)


def test_a_damaged_text_of_zygo_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.asc"
    for wrong in (zygo("ASCII")[:-900], zygo("ASCII").replace("6.328e-07", "x"), zygo("XYZ")[:90]):
        path.write_text(wrong)
        with pytest.raises(SurfaceError, match="a text by Zygo that is damaged"):
            read_heights(path)


@pytest.mark.parametrize("in_nm", [True, False])
def test_texts_of_wyko_are_read(tmp_path: Path, in_nm: bool) -> None:
    unit = 1e-9 if in_nm else 632.8e-9 / 2.0
    blocks = [TRUTH.T / unit, 0.0 * TRUTH.T]  # a line is a column, from the bottom
    head = (
        f"Wyko ASCII Data File Format 0\t{int(in_nm)}\t1\nX Size\t{COLUMNS}\nY Size\t{ROWS}\n"
        f"Block Name\tType\tLength\tValue\nWavelength\t7\t4\t632.8\nMult\t7\t4\t2\n"
        f"Aspect\t7\t4\t1\nPixel_size\t7\t4\t{1e3 * STEP}\nTitle\t5\t20\tA title\n"
    )
    text = head + "RAW_DATA\t3\t2400\t\n" + rows(blocks[0], "\t")
    path = tmp_path / "a.asc"
    path.write_text(text + "Intensity\t3\t2400\t\n" + rows(blocks[1], "\t"))
    same(read_heights(path))
    path.write_text(text.replace("X Size", "X Sighs"))
    with pytest.raises(SurfaceError, match="without its X Size"):
        read_heights(path)


# --- Packed text --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.txt.gz", "a.csv.GZ", "a.asc.gz"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16-le"])
def test_packed_text_is_read(tmp_path: Path, name: str, encoding: str) -> None:
    head = f"# Width: {1e6 * COLUMNS * STEP} µm\n# Height: {1e6 * ROWS * STEP} µm\n"
    text = head + "# Value units: m\n" + rows(TOP, "\t")
    (tmp_path / name).write_bytes(gzip.compress(text.encode(encoding)))
    same(read_heights(tmp_path / name))


def test_a_packed_array_is_read(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", TOP)
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy.gz").write_bytes(gzip.compress(data))
    plain, packed = (read_heights(tmp_path / f"a.npy{e}", pixel_size=STEP) for e in ("", ".gz"))
    assert (plain.samples == packed.samples).all()
    assert plain.notes == packed.notes
    (tmp_path / "a.npy.gz").write_bytes(gzip.compress(data[:-8]))
    with pytest.raises(SurfaceError, match=r"cannot be read as a \.npy file: damaged"):
        read_heights(tmp_path / "a.npy.gz", pixel_size=STEP)


def test_packed_text_that_is_damaged_or_too_large_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.txt.gz"
    packed = gzip.compress(rows(TOP).encode())
    for wrong, why in (
        (packed[:-20], "is cut short"),
        (packed[:30] + b"\xff" * 20 + packed[50:], "gzip cannot unpack it"),
        (gzip.compress(b"0 " * (2**27 + 1), 1), "more than 256 MiB"),
    ):
        path.write_bytes(wrong)
        with pytest.raises(AsperityError, match=why):
            read_heights(path, pixel_size=1e-5)
    (tmp_path / "a.png.gz").write_bytes(packed)
    with pytest.raises(SurfaceError, match=r"unknown kind of file '\.gz'"):
        read_heights(tmp_path / "a.png.gz")
