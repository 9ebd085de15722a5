"""Files of instruments and of float pictures, read by the real packages."""

import numpy as np
import pytest

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
    # The two levels differ by a constant. No other way to lay it down comes near.
    apart = [
        np.abs((turned - turned.mean()) - (known.samples - known.samples.mean())).max()
        for turned in (coin.samples, coin.samples[::-1], coin.samples[:, ::-1], coin.samples.T)
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
