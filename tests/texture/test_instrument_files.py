"""Files of instruments and of float pictures, read by the real packages."""

import contextlib
import hashlib
import struct
import zipfile
import zlib

import h5py
import numpy as np
import pytest
import scipy.io
import tifffile

from asperity.errors import SurfaceError
from asperity.texture.files.reading import read_heights
from asperity.texture.height_field import HeightField

HEIGHTS = 3e-3 + 1e-4 * np.random.default_rng(0).normal(size=(24, 40)).astype(np.float32)
RELIEF = float(np.ptp(HEIGHTS.astype(np.float64)))
WANTED = np.flipud(HEIGHTS.astype(np.float64) - HEIGHTS.astype(np.float64).mean())
"""What is read: the bottom of the picture is v = 0, and the mean is zero."""


# --- SurfaceTopography --------------------------------------------------------------------------


@pytest.fixture
def coin(data):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .tmd")
    return HeightField.from_file(data / "measured/tmd-1.tmd")


def test_the_coin_is_the_same_from_the_instrument_s_file(coin, data):
    known = HeightField.from_file(data / "measured/us_dime_gelsight.npz")
    assert coin.samples.shape == known.samples.shape == (300, 300)
    assert coin.pixel_size == pytest.approx(known.pixel_size, rel=1e-12)
    assert coin.pixel_size[0] == pytest.approx(63.19e-6, rel=1e-4)
    assert coin.relief == pytest.approx(351e-6, rel=5e-3)
    # The array's rows go from the top, where its lettering begins: seen from the other side it is
    # mirrored. The two levels differ by a constant; no other way to lay it down comes near.
    apart = [
        np.abs((turned - turned.mean()) - (known.samples - known.samples.mean())).max()
        for turned in (coin.samples[::-1], coin.samples, coin.samples[:, ::-1], coin.samples.T)
    ]
    assert apart[0] < 1e-6
    assert min(apart[1:]) > 1e-4


def test_an_instrument_s_file_says_its_unit_and_pixel_size(coin):
    told = " ".join(coin.notes)
    assert "in the file's unit, mm, are turned into m" in told
    assert "pixel size 63.1887 um, from the file" in told


@pytest.mark.parametrize("keep", [0, 40, 5000])
def test_a_damaged_instrument_s_file_is_refused(data, tmp_path, keep):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .tmd")
    path = tmp_path / "cut.tmd"
    path.write_bytes((data / "measured/tmd-1.tmd").read_bytes()[:keep])
    with pytest.raises(SurfaceError, match=r"cut\.tmd: .*(empty|cannot be read)") as said:
        HeightField.from_file(path)
    assert "\n" not in str(said.value)


# --- X3P, SDF and NMS, made here ----------------------------------------------------------------

MAP = 2e-5 * (np.sin(np.arange(30) / 4.0) + np.cos(np.arange(20)[:, None] / 3.0))
REVISIONS = ["ISO5436 - 2000", "ISO5436 – 2000", "ISO5436 — 2000", "ISO 5436-2000"]


def write_x3p(path, *, revision=REVISIONS[0], inside="", link="bindata/data.bin", offset="0",
              pixel=(1e-5, 1e-5), kind="D", prefix="p:", feature="SUR"):  # fmt: skip
    """An X3P file (ISO 25178-72) with heights in metres: a zip of main.xml and the numbers."""
    types = {"D": ("<f8", 1.0), "F": ("<f4", 1.0), "I": ("<i2", 2e-9), "L": ("<i4", 1e-10)}
    dtype, step = types[kind]
    data = np.round(MAP / step) if kind in "IL" else MAP
    content = data.astype(dtype).tobytes()
    axes = "".join(
        f"<C{name}><AxisType>{how}</AxisType><DataType>{kind}</DataType><Increment>{by}</Increment>"
        f"<Offset>{offset}</Offset></C{name}>"
        for name, how, by in zip("XYZ", "IIA", (*pixel, step), strict=True)
    )
    main = (
        f'<?xml version="1.0" encoding="UTF-8"?><{prefix}ISO5436_2 '
        f'xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1><Revision>{revision}</Revision>'
        f"<FeatureType>{feature}</FeatureType><Axes>{axes}</Axes></Record1><Record2><Date>N/A"
        "</Date><Creator>nobody</Creator></Record2><Record3><MatrixDimension><SizeX>30</SizeX>"
        "<SizeY>20</SizeY><SizeZ>1</SizeZ></MatrixDimension><DataLink><PointDataLink>"
        f"{link}</PointDataLink><MD5ChecksumPointData>{hashlib.md5(content).hexdigest()}"
        f"</MD5ChecksumPointData></DataLink></Record3></{prefix}ISO5436_2>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("__MACOSX/._main.xml", b"other")
        archive.writestr(f"{inside}main.xml", main.encode())
        archive.writestr(f"{inside}bindata/data.bin", content)
    return path


@pytest.mark.parametrize(
    "change",
    [
        *({"revision": revision} for revision in REVISIONS),
        {"inside": "scan 1/"},
        {"inside": "a/b/", "link": "bindata\\data.bin"},
        {"link": "./bindata/data.bin"},
        {"offset": ""},
        {"prefix": ""},
        {"kind": "F"},
        {"kind": "I"},
        {"kind": "L"},
        {"pixel": (1e-5, 3e-5)},
        {"pixel": (1e-5, 1.0005e-5)},
    ],
)
def test_x3p_as_forensic_programs_write_it(tmp_path, change):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .x3p")
    field = HeightField.from_file(write_x3p(tmp_path / "a.x3p", **change))
    assert field.pixel_size == pytest.approx(change.get("pixel", (1e-5, 1e-5)))
    np.testing.assert_allclose(field.samples, MAP, atol=2e-9)
    assert not any("plausible" in note for note in field.notes)


def test_x3p_that_is_no_map_is_refused(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .x3p")
    for change, words in (
        ({"feature": "PCL"}, "its feature type is 'PCL'; valid: SUR"),
        ({"link": "elsewhere.bin"}, "damaged, or no zip of main.xml"),
        ({"revision": "1.0"}, "finds no heights in it"),
    ):
        with pytest.raises(SurfaceError, match=words) as refused:
            HeightField.from_file(write_x3p(tmp_path / "a.x3p", **change))
        assert len(str(refused.value).replace(str(tmp_path), "")) <= 300


@pytest.mark.parametrize("inside", ["", "scan 1/"])
def test_points_that_an_x3p_states_as_invalid_are_missing(tmp_path, inside):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .x3p")
    path = write_x3p(tmp_path / "a.x3p", kind="I", inside=inside)
    valid = np.ones(MAP.shape, bool)
    valid[3, 7] = valid[11, 20] = False
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    turned = "".join(f"<r{i}{j}>{int(i == 4 - j)}</r{i}{j}>" for i in (1, 2, 3) for j in (1, 2, 3))
    main = parts[f"{inside}main.xml"].decode()
    main = main.replace(
        "</DataLink>", "<ValidPointsLink>bindata/v.bin</ValidPointsLink></DataLink>"
    )
    main = main.replace("</Axes>", f"<Rotation>{turned}</Rotation></Axes>")
    parts[f"{inside}main.xml"] = main.encode()
    parts[f"{inside}bindata/v.bin"] = np.packbits(valid.ravel(), bitorder="little").tobytes()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    with pytest.raises(SurfaceError, match="2 of 600 values are missing"):
        HeightField.from_file(path)
    field = HeightField.from_file(path, missing="fill")
    np.testing.assert_allclose(field.samples[valid], MAP[valid], atol=2e-9)
    assert abs(field.samples - MAP)[~valid].min() > 1e-8
    assert any("its Rotation" in note for note in field.notes)
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr(f"{inside}bindata/v.bin", b"short")
    with pytest.raises(SurfaceError, match="valid points are 40 bits; valid: 600"):
        HeightField.from_file(path)


@pytest.mark.parametrize("kind", ["D", "L"])
def test_x3p_may_list_its_heights_in_the_index(tmp_path, kind):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .x3p")
    path = write_x3p(tmp_path / "a.x3p", kind=kind)
    right = HeightField.from_file(path)
    with zipfile.ZipFile(path) as archive:
        index = archive.read("main.xml").decode()
        values = np.frombuffer(archive.read("bindata/data.bin"), {"D": "<f8", "L": "<i4"}[kind])
    start, end = index.index("<DataLink>"), index.index("</DataLink>") + len("</DataLink>")

    def read(words):
        listed = "".join(f"<Datum>{word}</Datum>" for word in words)
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(
                "main.xml", f"{index[:start]}<DataList>{listed}</DataList>{index[end:]}"
            )
        return HeightField.from_file(path)

    words = [repr(value) for value in values.tolist()]
    np.testing.assert_allclose(read(words).samples, right.samples, atol=1e-15)
    places = [f"{i % 30};{i // 30};{word}" for i, word in enumerate(words)]
    np.testing.assert_allclose(read(places).samples, right.samples, atol=1e-15)
    with pytest.raises(SurfaceError, match="1 of 600 values are missing"):
        read(["", *words[1:]])


def write_sur(path, *, packed, unit=b"\xb5m", layers=1):
    """Write HEIGHTS as 32-bit numbers of nm, with pixels of 10 x 12 um."""
    rows, columns = HEIGHTS.shape
    values = np.round(HEIGHTS.astype(np.float64) * 1e9).astype("<i4")
    head = bytearray(512)
    head[:12] = b"DSCOMPRESSED" if packed else b"DIGITAL SURF"
    struct.pack_into("<HHHH", head, 12, 0, 1, 1, 2)
    struct.pack_into("<Hii", head, 98, 32, int(values.min()), int(values.max()))
    struct.pack_into("<iiI", head, 108, columns, rows, values.size)
    struct.pack_into("<fff", head, 120, 1e-2, 1.2e-2, 1e-3)
    for place, name in enumerate((b"mm", b"mm", unit, b"mm", b"mm", unit)):
        head[180 + 16 * place : 180 + 16 * place + len(name)] = name
    struct.pack_into("<fff", head, 276, 1.0, 1.0, 1.0)
    struct.pack_into("<HH", head, 334, 5, 3)
    body, data = b"hello" + bytes(3), layers * values.tobytes()
    if packed:
        half = len(data) // 2
        parts = [zlib.compress(part) for part in (data[:half], data[half:])]
        sizes = half, len(parts[0]), len(data) - half, len(parts[1])
        body += struct.pack("<5I", 2, *sizes) + b"".join(parts)
    else:
        body += data
    path.write_bytes(bytes(head) + body)
    return path


def test_compressed_files_of_mountainsmap(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .sur")
    plain = HeightField.from_file(write_sur(tmp_path / "a.sur", packed=False))
    assert np.corrcoef(plain.samples.ravel(), WANTED.ravel())[0, 1] > 0.999
    assert plain.pixel_size == pytest.approx((1e-5, 1.2e-5))
    assert plain.relief == pytest.approx(RELIEF, rel=1e-4)
    packed = HeightField.from_file(write_sur(tmp_path / "b.sur", packed=True))
    np.testing.assert_array_equal(packed.samples, plain.samples)
    for change, said in (
        ({"layers": 3}, "several layers"), ({"unit": b"a.u."}, r"in 'a\.u\.'; valid: heights"),
    ):  # fmt: skip
        with pytest.raises(SurfaceError, match=said):
            HeightField.from_file(write_sur(tmp_path / "c.sur", packed=True, **change))
    content = (tmp_path / "b.sur").read_bytes()
    (tmp_path / "b.sur").write_bytes(content[:-40])
    with pytest.raises(SurfaceError, match="damaged: its compressed heights"):
        HeightField.from_file(tmp_path / "b.sur")


def test_a_tiff_of_park_systems_has_its_heights_beside_the_preview(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads Park's tags")
    rows, columns = HEIGHTS.shape
    values = np.round((HEIGHTS.astype(np.float64) - 3e-3) * 1e7).astype("<i2")

    def text(words, count):
        return words.encode("utf-16-le").ljust(2 * count, b"\0")

    head = struct.pack("<I", 0) + text("Topography", 32) + text("C-AFM", 8)
    head += struct.pack("<dIIIIdIdIII", 0.0, 0, 0, columns, rows, 0.0, 0, 0.0, 1, 1, 0)
    head += struct.pack("<dddddd", 10.0 * columns, 12.0 * rows, 0, 0, 1, 0) + text("nA", 8)
    head += struct.pack("<ddddd", 0, 0, 0.1, 1.0, 0.0) + text("um", 8)
    head += struct.pack("<iiiIII", int(values.min()), int(values.max()), 0, 0, 0, 1)
    upwards = np.flipud(values).tobytes()  # its first line is the lowest
    tags = [(50432, 4, 1, 0x0E031301, True), (50433, 4, 1, 0x1000001, True),
            (50434, 7, len(upwards), upwards, True), (50435, 7, len(head), head, True)]  # fmt: skip
    preview = np.zeros((rows, columns, 3), dtype=np.uint8)
    tifffile.imwrite(tmp_path / "a.tiff", preview, photometric="rgb", extratags=tags)
    found = read_heights(tmp_path / "a.tiff")
    assert found.pixel_size == pytest.approx((1e-5, 1.2e-5))
    np.testing.assert_allclose(found.samples - found.samples.mean(), WANTED, atol=1e-7)


def write_sdf(path, pixel):
    """An SDF file (ISO 25178-71) as text, its lengths in metres."""
    head = {"ManufacID": "none", "CreateDate": "010120260000", "ModDate": "010120260000",
            "NumPoints": 30, "NumProfiles": 20, "Xscale": pixel[0], "Yscale": pixel[1],
            "Zscale": 1e-6, "Zresolution": 1e-9, "Compression": 0, "DataType": 7,
            "CheckType": 0}  # fmt: skip
    rows = "\n".join(" ".join(f"{1e6 * z:.9g}" for z in row) for row in MAP)
    keys = "".join(f"{key} = {value}\n" for key, value in head.items())
    path.write_text(f"aISO-1.0\n{keys}*\n{rows}\n*\n")
    return path


def test_sdf_may_have_oblong_pixels_and_those_too_large_are_doubted(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .sdf")
    found = read_heights(write_sdf(tmp_path / "a.sdf", (1e-5, 1.2e-5)))
    assert found.pixel_size == pytest.approx((1e-5, 1.2e-5))
    np.testing.assert_allclose(found.samples, MAP, atol=1e-12)
    older = (tmp_path / "a.sdf").read_text().replace("aISO-1.0", "aBCR-1.0")
    (tmp_path / "c.sdf").write_text(older)
    np.testing.assert_allclose(read_heights(tmp_path / "c.sdf").samples, MAP, atol=1e-12)
    found = read_heights(write_sdf(tmp_path / "b.sdf", (1e-2, 1e-2)))
    assert any("is that plausible? A pixel size of 10 mm" in note for note in found.notes)


def test_nms_whose_pixels_come_out_too_large_is_doubted(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .nms")
    head = bytearray(3468)  # lowest and highest, number of samples, their distance
    struct.pack_into("<2d", head, 16, 0.0, 80.0)
    struct.pack_into("<2I2d", head, 1368, 30, 20, 10.0, 10.0)
    grey = np.round(65535 * (MAP - MAP.min()) / np.ptp(MAP)).astype("<u2").tobytes()
    (tmp_path / "a.nms").write_bytes(bytes(head) + grey)
    found = read_heights(tmp_path / "a.nms")
    assert any("is that plausible? A pixel size of 10 mm" in note for note in found.notes)


# --- OpenEXR ------------------------------------------------------------------------------------


@pytest.fixture
def exr(tmp_path):
    """Return what writes channels into an EXR and gives its path."""
    openexr = pytest.importorskip("OpenEXR", reason="OpenEXR reads .exr")

    def write(channels, **header):
        header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage} | header
        path = tmp_path / "map.exr"
        openexr.File(header, channels).write(str(path))
        return path

    return write


@pytest.mark.parametrize(
    "channels",
    [
        {"Y": HEIGHTS},
        {"Z": HEIGHTS},
        {"height": HEIGHTS},
        {"Y": HEIGHTS, "A": np.ones_like(HEIGHTS)},
        {"R": HEIGHTS, "G": HEIGHTS, "B": HEIGHTS},
        {"RGB": np.dstack([HEIGHTS] * 3)},
        {"RGBA": np.dstack([HEIGHTS] * 3 + [np.ones_like(HEIGHTS)])},
    ],
    ids=lambda channels: "+".join(channels),
)
def test_float_heights_are_read_without_loss(exr, channels):
    found = read_heights(exr(channels), pixel_size=1e-5, height_range=RELIEF)
    np.testing.assert_allclose(found.samples, WANTED, rtol=0, atol=1e-12 * RELIEF)
    assert not any("smoothed" in note for note in found.notes)


def test_where_the_picture_stands_in_its_window_does_not_matter(exr):
    window = {"dataWindow": ((5, 7), (44, 30)), "displayWindow": ((0, 0), (60, 60))}
    found = read_heights(exr({"Y": HEIGHTS}, **window), pixel_size=1e-5, height_range=RELIEF)
    np.testing.assert_allclose(found.samples, WANTED, rtol=0, atol=1e-12 * RELIEF)


def test_half_floats_are_read_as_they_are(exr):
    half = HEIGHTS.astype(np.float16)
    found = read_heights(
        exr({"Y": half}), pixel_size=1e-5, height_range=float(np.ptp(half.astype(float)))
    )
    wanted = np.flipud(half.astype(float) - half.astype(float).mean())
    np.testing.assert_allclose(found.samples, wanted, rtol=0, atol=1e-12 * RELIEF)


def test_a_picture_of_floats_has_no_scale_either(exr):
    with pytest.raises(SurfaceError, match=r"does not hold its scale.*pixel_size.*height_range"):
        read_heights(exr({"Y": HEIGHTS}))


def test_gaps_in_a_float_picture(exr):
    gaps = HEIGHTS.copy()
    gaps[3, 4], gaps[0, 0] = np.nan, np.inf
    path = exr({"Y": gaps})
    with pytest.raises(SurfaceError, match="2 of 960 values are missing"):
        read_heights(path, pixel_size=1e-5, height_range=RELIEF)
    found = read_heights(path, pixel_size=1e-5, height_range=RELIEF, missing="fill")
    assert np.isfinite(found.samples).all()


def test_a_constant_float_picture_is_flat(exr):
    path = exr({"Y": np.full((8, 9), 0.3, np.float32)})
    assert HeightField.from_file(path, pixel_size=1e-5, height_range=1e-4).relief == 0.0


def test_channels_that_are_no_heights_are_named(exr):
    with pytest.raises(SurfaceError, match=r"none of the channels G, R is a height"):
        read_heights(exr({"R": HEIGHTS, "G": HEIGHTS}), pixel_size=1e-5, height_range=RELIEF)


@pytest.mark.parametrize("damage", ["empty", "junk", "head", "cut"])
def test_a_damaged_float_picture_is_refused(exr, damage):
    path = exr({"Y": HEIGHTS})
    whole = path.read_bytes()
    parts = {
        "empty": b"",
        "junk": b"junk" * 20,
        "head": whole[:60],
        "cut": whole[: len(whole) // 2],
    }
    path.write_bytes(parts[damage])
    with pytest.raises(SurfaceError, match=r"map\.exr: .*(empty|cannot be read)") as said:
        read_heights(path, pixel_size=1e-5, height_range=RELIEF)
    assert "\n" not in str(said.value)


def normals():
    slopes = np.full((16, 16, 3), [0.0, 0.0, 1.0], np.float32)
    slopes[:, :8, 0], slopes[:, 8:, 0] = 0.3, -0.3
    slopes /= np.linalg.norm(slopes, axis=2, keepdims=True)
    return 0.5 * slopes + 0.5


def test_normals_in_floats_are_integrated(exr):
    field = HeightField.from_file(exr({"RGB": normals()}), pixel_size=1e-5, kind="normal-opengl")
    # A ridge of eight samples to a side; between samples it is a little round.
    assert 7 * 0.3e-5 < field.relief < 8 * 0.3e-5


@pytest.mark.xfail(
    strict=True,
    reason="images._refuse_normal_map looks at whole numbers only: normals in an EXR (or a float "
    "TIFF) are read as heights, by their luminance",
)
def test_normals_in_floats_are_not_taken_for_heights(exr):
    with pytest.raises(SurfaceError, match="normal map"):
        read_heights(exr({"RGB": normals()}), pixel_size=1e-5, height_range=1e-4)


@pytest.mark.parametrize("kind", ["mat", "h5"])
def test_plain_arrays_have_a_row_for_each_v(tmp_path, kind):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .mat and .h5")
    v, u = np.mgrid[0:20, 0:30]
    arrays, path = {"X": 1e-5 * u, "Y": 1e-5 * v, "Z": MAP}, tmp_path / f"a.{kind}"
    if kind == "mat":
        scipy.io.savemat(path, arrays)
    else:
        with h5py.File(path, "w") as file:
            file.update(arrays)
    found = read_heights(path, pixel_size=1e-5, unit="m")
    np.testing.assert_allclose(found.samples, MAP, atol=1e-15)
    assert any("'Z'" in note for note in found.notes)


@pytest.mark.parametrize("packed", [False, True])
def test_a_damaged_mat_file_is_refused_before_scipy_reads_it(tmp_path, packed):
    pytest.importorskip("SurfaceTopography", reason="SurfaceTopography reads .mat")
    path = tmp_path / "a.mat"
    others = {"c": np.array([1 + 2j, 3]), "s": "text", "e": {"a": np.eye(3)}}
    scipy.io.savemat(path, {"Z": MAP, **others}, do_compression=packed)
    content = path.read_bytes()
    read_heights(path, pixel_size=1e-5, unit="m")
    rng = np.random.default_rng(0)
    for _ in range(150):
        damaged = bytearray(content)
        for place in rng.integers(0, 400, size=rng.integers(1, 6)):
            damaged[place] = rng.integers(0, 256)
        path.write_bytes(damaged)
        with contextlib.suppress(SurfaceError):
            read_heights(path, pixel_size=1e-5, unit="m")
    start = content.index(b"IM") + 2
    path.write_bytes(content[:start] + b"\xf3" + content[start + 1 :])
    with pytest.raises(SurfaceError, match=r"a\.mat: .*damaged, or cut short"):
        read_heights(path, pixel_size=1e-5, unit="m")
