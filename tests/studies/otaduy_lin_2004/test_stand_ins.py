"""Stand-ins for measured surfaces: three different ones, each like what it stands for."""

import numpy as np
import pytest
from scipy import ndimage

from asperity.studies.otaduy_lin_2004.real_surfaces import REAL_SURFACES
from asperity.studies.otaduy_lin_2004.stand_ins import GRAINS, RELIEF, coin, sandpaper

PIXEL = 9e-6
COIN_PIXEL = 63.2e-6


@pytest.fixture(scope="module")
def papers():
    return {
        grit: sandpaper((800, 800), PIXEL, grain=grain, seed=1) for grit, grain in GRAINS.items()
    }


@pytest.fixture(scope="module")
def a_coin():
    return coin((300, 300), COIN_PIXEL)


def slopes(heights, pixel_size):
    return np.hypot(*np.gradient(heights, pixel_size))


def wavelength(heights, pixel_size):
    """Return the mean wavelength of a map, weighted by power [m]."""
    power = np.abs(np.fft.fft2(heights - heights.mean())) ** 2
    q = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n, pixel_size) for n in heights.shape),
                              indexing="ij"))  # fmt: skip
    return power.sum() / (q * power).sum()


def tops(heights, grain, pixel_size):
    """Return how many points are higher than all others within half a grain."""
    reach = int(0.5 * grain / pixel_size)
    highest = ndimage.maximum_filter(heights, size=2 * reach + 1, mode="wrap")
    return int(((heights == highest) & (heights > np.median(heights))).sum())


def test_grains_are_as_wide_and_as_many_as_their_grit_says(papers):
    widths = {grit: wavelength(heights, PIXEL) for grit, heights in papers.items()}
    fepa = GRAINS["P40"] / GRAINS["P120"]
    assert widths["P40"] / widths["P120"] == pytest.approx(fepa, rel=0.15)
    for grit, heights in papers.items():
        grain = GRAINS[grit]
        assert 1.0 < widths[grit] / grain < 3.0
        # From a closed coat, about one grain in its own square, to one in three of them.
        in_own_square = tops(heights, grain, PIXEL) * grain**2 / (800 * PIXEL) ** 2
        assert 1 / 3 < in_own_square < 1.0
        assert np.ptp(heights) == pytest.approx(RELIEF * grain)
        assert heights.mean() == pytest.approx(0.0, abs=1e-12)


def test_sandpaper_has_peaks_on_a_ground_and_tiles(papers):
    for heights in papers.values():
        centred = heights - heights.mean()
        assert np.mean(centred**3) / np.std(heights) ** 3 > 0.3  # peaks, as measured ones have
        seam = np.abs(heights[:, 0] - heights[:, -1]).max()
        assert seam <= 1.5 * np.abs(np.diff(heights, axis=1)).max()


def test_a_seed_makes_one_paper(papers):
    again = sandpaper((800, 800), PIXEL, grain=GRAINS["P40"], seed=1)
    np.testing.assert_array_equal(again, papers["P40"])
    other = sandpaper((800, 800), PIXEL, grain=GRAINS["P40"], seed=2)
    assert np.abs(other - again).max() > 1e-6


def test_a_coin_is_smooth_with_raised_letters_and_a_rim(a_coin, papers):
    steep = slopes(a_coin, COIN_PIXEL)
    rough = slopes(papers["P40"], PIXEL)
    # Most of a coin is nearly level; most of sandpaper is not.
    assert np.median(steep) < 0.03
    assert np.median(rough) > 3.0 * np.median(steep)
    # Heights gather on a few levels: field, letters, rim.
    v, u = np.indices(a_coin.shape) - 149.5
    radius = np.hypot(u, v) * COIN_PIXEL
    ring = a_coin[(radius > 6.3e-3) & (radius < 7.7e-3)]
    field, letters = np.percentile(ring, [5, 99])
    assert letters - field == pytest.approx(70e-6, rel=0.25)
    assert 0.1 < np.mean(ring > 0.5 * (field + letters)) < 0.6
    rim = np.median(a_coin[(radius > 8.3e-3) & (radius < 8.6e-3)])
    assert rim - letters > 40e-6


def test_letters_are_the_right_way_round(a_coin):
    # The numeral 1 left of the middle is narrower than the 0 right of it.
    middle = a_coin[135:165] > np.median(a_coin[135:165]) + 30e-6
    columns = middle.any(axis=0)
    assert columns[100:145].sum() < columns[150:200].sum()


def test_the_three_stand_ins_differ():
    maps = [surface.load(None) for surface in REAL_SURFACES]
    assert all("made by code" in remark for _, remark in maps)
    lengths = [wavelength(heights.samples, heights.pixel_size) for heights, _ in maps]
    # Coin, P40, P120: each at least twice as fine as the one before.
    assert lengths[0] > 2.0 * lengths[1] > 4.0 * lengths[2]


def test_stand_ins_are_like_the_measured_surfaces(data):
    for surface in REAL_SURFACES:
        measured, _ = surface.load(data / "measured")
        made, _ = surface.load(None)
        assert made.samples.shape == measured.samples.shape
        assert made.pixel_size == measured.pixel_size
        sizes = [np.std(one.samples) for one in (made, measured)]
        steep = [
            np.sqrt(np.mean(slopes(one.samples, one.pixel_size) ** 2)) for one in (made, measured)
        ]
        long = [wavelength(one.samples, one.pixel_size) for one in (made, measured)]
        assert 0.6 < sizes[0] / sizes[1] < 1.6
        assert 0.6 < steep[0] / steep[1] < 1.6
        assert 0.5 < long[0] / long[1] < 2.0
