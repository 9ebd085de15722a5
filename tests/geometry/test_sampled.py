"""Sampled profiles and maps: the certified search against dense maxima, and its hard cases."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy import ndimage

import naive
from asperity.errors import AsperityError
from asperity.geometry.offsets import disk_search, sphere_search
from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.sampled import (
    CERTIFIED_TO,
    HeightMap,
    SampledProfile,
    offset_surface,
)
from asperity.texture.bounds import pyramid_of
from asperity.texture.spline import BORDERS, evaluate_1d, spline_coefficients

MM = 1e-3
PIXEL = 0.05 * MM
ABOVE = 1e-14  # [m] rounding of sums of terms of the order of the radius
FOUND = 1e-10  # [m] what the twins' finest points may miss
STEP = 2e-9  # [m] for central differences of the height
SLOPE = 2e-6  # rounding of heights of 1e-4 m over STEP, twice
SECONDS = 30.0  # for 1600 places that take 1 s: a search that does not prune takes minutes


def _rough(*shape, roughness=10e-6, power=2.0, seed=0):
    """Return a periodic self-affine surface with `roughness` [m] RMS."""
    rng = np.random.default_rng(seed)
    waves = np.sqrt(
        sum(np.square(k) for k in np.meshgrid(*map(np.fft.fftfreq, shape), indexing="ij"))
    )
    waves.flat[0] = np.inf
    heights = np.fft.ifftn(waves**-power * np.fft.fftn(rng.normal(size=shape))).real
    return heights * roughness / np.std(heights)


def _map_heights(samples, pixel, border):
    return lambda u, v: naive.spline(samples, border, v / pixel, u / pixel)


def _block(rows, columns, height=0.6 * MM):
    heights = np.zeros((rows, columns))
    heights[rows - 20 : rows - 8, columns - 20 : columns - 8] = height
    return heights


PROFILES = {
    "smooth": (_rough(90), 2.0),
    "rough": (_rough(90, power=1.0), 2.0),
    "white noise": (np.random.default_rng(1).normal(size=60) * 10e-6, 1.0),
    "one spike": (np.eye(41)[20] * 0.1 * MM, 2.0),
    "one step taller than the probe": (np.repeat([0.0, 1.0 * MM], 30), 0.6),
    "a block within reach beyond the border": (np.repeat([0.0, 0.6 * MM, 0.0], [40, 12, 8]), 1.0),
    "as long as the probe is wide": (_rough(40), 2.0),
    "two samples": (np.array([0.0, 20e-6]), 0.1),
    "three samples": (np.array([0.0, 20e-6, -7e-6]), 0.12),
    "constant": (np.full(50, 0.2 * MM), 1.0),
    "high above zero": (_rough(60) + 0.5, 1.0),
}


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("name", PROFILES)
def test_profile_offset_is_the_dense_maximum(name, border):
    samples, diameter = PROFILES[name]
    surface = SampledProfile(samples, PIXEL, border)
    u = np.random.default_rng(2).uniform(-1.2, 2.2, 60) * surface.length
    u = np.append(u, np.array([0.0, 0.5, 1.0, 2.0]) * surface.length)
    x = np.arange(u.min() - diameter * MM, u.max() + diameter * MM, PIXEL / 200)
    z = naive.spline(samples, border, np.mod(x / PIXEL, 2 * samples.size))
    excess = surface.tracer(diameter * MM)(u).height - naive.rest_on_points(x, z, diameter * MM, u)
    # Points PIXEL / 200 apart miss a maximum by its curvature; a steep contact bends the most.
    steep = np.max(np.abs(np.diff(z))) / (PIXEL / 200)
    bend = np.max(np.abs(np.diff(z, 2))) / (PIXEL / 200) ** 2
    bend += 2 * (1 + steep**2) ** 1.5 / (diameter * MM)
    scale = max(1.0, np.max(np.abs(samples)) / MM)
    assert np.min(excess) >= -CERTIFIED_TO - ABOVE * scale
    assert np.max(excess) <= bend * (PIXEL / 200) ** 2 / 8 + ABOVE * scale


MAPS = {
    "smooth": (_rough(40, 46), 1.5),
    "rough": (_rough(40, 46, power=1.3), 1.5),
    "white noise": (np.random.default_rng(1).normal(size=(24, 31)) * 10e-6, 1.0),
    "one spike": (np.outer(np.eye(25)[12], np.eye(29)[14]) * 0.1 * MM, 1.0),
    "as wide as the probe": (_rough(20, 24), 1.0),
    "a block within reach beyond the border": (_block(24, 28), 1.0),
    "two by two": (np.array([[0.0, 20e-6], [5e-6, -9e-6]]), 0.1),
    "two by five": (_rough(2, 5), 0.1),
    "constant": (np.full((30, 20), 0.2 * MM), 0.7),
}


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("name", MAPS)
def test_map_offset_is_the_dense_maximum(name, border):
    samples, diameter = MAPS[name]
    rng = np.random.default_rng(3)
    lines = rng.uniform(0, samples.shape[0] * PIXEL, 4)
    lines[0] = 0.0
    for line in lines:
        surface = HeightMap(samples, PIXEL, border, line=float(line))
        u = rng.uniform(-1.1, 2.1, 2) * surface.length
        heights = surface.tracer(diameter * MM)(u).height
        for place, height in zip(u, heights, strict=True):
            dense = naive.rest_on_map(
                _map_heights(samples, PIXEL, border), diameter * MM, place, line, PIXEL / 8
            )
            assert height >= dense - CERTIFIED_TO - ABOVE
            assert height <= dense + FOUND


def test_map_offset_reaches_across_both_borders():
    # Above the corner the block is 8 samples away along u and v, beyond the wrapped borders.
    surface = HeightMap(_block(40, 40), PIXEL, "wrap", line=0.0)
    height = float(surface.tracer(1.8 * MM)(0.0).height)
    heights = _map_heights(_block(40, 40), PIXEL, "wrap")
    dense = naive.rest_on_map(heights, 1.8 * MM, 0.0, 0.0, PIXEL / 8)
    assert dense > 0.01 * MM
    assert dense - CERTIFIED_TO - ABOVE <= height <= dense + FOUND


@pytest.mark.parametrize("height", [2e-6, 20e-6, 200e-6])
def test_no_point_of_rough_profiles_lies_above_the_certified_maximum(height):
    # Many maxima compete: a bound that is a little too low shows at one place in hundreds.
    rng = np.random.default_rng(16)
    finer, n = 32, 40
    for diameter in (0.2 * MM, 0.5 * MM, 1.5 * MM):
        samples = rng.normal(size=n) * height
        u = rng.uniform(0, n * PIXEL, 400)
        x = np.arange(-n * finer, 2 * n * finer) * PIXEL / finer
        z = naive.spline(samples, "wrap", np.mod(x / PIXEL, n))
        dense = naive.rest_on_points(x, z, diameter, u)
        surface = SampledProfile(samples, PIXEL, "wrap")
        assert np.min(surface.tracer(diameter)(u).height - dense) >= -CERTIFIED_TO - ABOVE


@pytest.mark.parametrize(
    ("smooth", "height"), [(0.0, 2e-6), (0.0, 200e-6), (1.0, 50e-6), (1.5, 200e-6), (5.0, 200e-6)]
)
def test_no_point_of_rough_maps_lies_above_the_certified_maximum(smooth, height):
    rng = np.random.default_rng(3)
    finer, n = 8, 32
    samples = ndimage.gaussian_filter(rng.normal(size=(n, n)), smooth, mode="wrap")
    samples *= height / np.std(samples)
    for diameter in (0.3 * MM, 1.5 * MM):
        reach = int(diameter / 2 / PIXEL * finer) + 1
        places = np.mod(np.arange(-reach, n * finer + reach) / finer, n)
        z = naive.spline(samples, "wrap", *np.meshgrid(places, places, indexing="ij"))
        across = np.arange(-reach, reach + 1) * PIXEL / finer
        inside = (diameter / 2) ** 2 - across[:, None] ** 2 - across**2
        tip = np.where(inside > 0, np.sqrt(np.maximum(inside, 0)), -np.inf) - diameter / 2
        # A sphere above every fourth of these points, along eight of their rows.
        columns = np.arange(0, n * finer, 4)
        for row in rng.integers(0, n * finer, 8):
            surface = HeightMap(samples, PIXEL, "wrap", line=float(row * PIXEL / finer))
            found = surface.tracer(diameter)(columns * PIXEL / finer).height
            band = z[row : row + 2 * reach + 1]
            dense = [np.max(band[:, c : c + 2 * reach + 1] + tip) for c in columns]
            assert np.min(found - dense) >= -CERTIFIED_TO - ABOVE


def test_no_point_of_a_cell_lies_above_what_the_disk_search_finds_in_it():
    rng = np.random.default_rng(19)
    spans, share = np.empty((64, 2)), np.linspace(0, 1, 401)
    for _ in range(3000):
        coefficients = rng.normal(size=4) * rng.choice([0.1, 1.0, 10.0])
        radius, u = rng.choice([1.0, 3.0, 20.0]), rng.uniform(-1.0, 2.0)
        best, at = disk_search._search_cell(coefficients, 0, u, radius, 1e-9, -np.inf, u, spans)
        inside = radius**2 - (share - u) ** 2
        z = [evaluate_1d(coefficients, 0, t)[0] for t in share[inside > 0]]
        if z:
            assert best >= np.max(z + np.sqrt(inside[inside > 0])) - radius - 1e-9 - 1e-12
            assert 0.0 <= at <= 1.0


@pytest.mark.parametrize("smooth", [0.0, 1.0, 3.0])
def test_no_point_of_a_node_lies_above_its_bound(smooth):
    # The search discards a node by this bound alone, so it is the certificate.
    rng = np.random.default_rng(18)
    samples = ndimage.gaussian_filter(rng.normal(size=(40, 40)), smooth, mode="wrap")
    coefficients = spline_coefficients(samples / np.std(samples), "wrap")
    pyramid = pyramid_of(coefficients)
    share = np.linspace(0, 1, 17)
    tightest = np.inf
    for _ in range(3000):
        radius, level = rng.choice([2.0, 6.0, 15.0]), rng.integers(-4, 5)
        u, v = rng.uniform(10, 30, 2)
        away = rng.uniform(-1, 1, 2) * radius
        column, row = (int(np.clip(at, 0, 40) // 2.0**level) for at in (u + away[0], v + away[1]))
        block, sphere = sphere_search.Block(level, row, column), sphere_search.Sphere(u, v, radius)
        bound = sphere_search._bound(coefficients, pyramid, block, sphere, -np.inf)[0]
        x = np.minimum((column + share) * 2.0**level, 41.0)
        y = np.minimum((row + share) * 2.0**level, 41.0)
        x, y = np.meshgrid(x, y)
        inside = radius**2 - (x - u) ** 2 - (y - v) ** 2
        if np.all(inside <= 0):
            continue
        z = naive.kernel_values(coefficients, y[inside > 0] - 0.5, x[inside > 0] - 0.5)
        highest = np.max(z + np.sqrt(inside[inside > 0])) - radius
        assert bound >= highest - 1e-12
        tightest = min(tightest, bound - highest)
    assert tightest < 1e-3


def test_map_offset_is_the_dense_maximum_on_the_coin(data):
    with np.load(data / "measured" / "us_dime_gelsight.npz") as file:
        samples, pixel = file["height_mm"].astype(float) * MM, float(file["pixel_mm"][0]) * MM
    samples = samples[90:190, 100:200] - samples.mean()
    heights = _map_heights(samples, pixel, "mirror")
    rng = np.random.default_rng(4)
    for diameter in (0.5 * MM, 1 * MM, 3 * MM):
        for u, v in rng.uniform(0, 100 * pixel, (3, 2)):
            surface = HeightMap(samples, pixel, line=float(v))
            height = float(surface.tracer(diameter)(u).height)
            dense = naive.rest_on_map(heights, diameter, u, v, pixel / 8)
            assert dense - CERTIFIED_TO - ABOVE <= height <= dense + FOUND


SURFACES = [
    surface
    for border in BORDERS
    for surface in (
        SampledProfile(_rough(90), PIXEL, border),
        SampledProfile(_rough(90, power=0.7), PIXEL, border),
        HeightMap(_rough(40, 46), PIXEL, border, line=0.3 * MM),
        HeightMap(_rough(40, 46, power=1.2), PIXEL, border),
    )
]


@pytest.mark.parametrize("surface", SURFACES)
def test_slope_is_the_derivative_and_contact_is_where_it_touches(surface):
    diameter = 1.5 * MM
    trace = surface.tracer(diameter)
    u = np.random.default_rng(5).uniform(-1, 2, 300) * surface.period
    low, here, high = trace(u - STEP), trace(u), trace(u + STEP)
    smooth = np.abs(high.slope - low.slope) < 1e-4
    assert np.mean(smooth) > 0.9
    difference = (high.height - low.height) / (2 * STEP)
    np.testing.assert_allclose(here.slope[smooth], difference[smooth], atol=SLOPE)
    across = here.contact - u
    if isinstance(surface, SampledProfile):
        touching = surface.heights(here.contact) + np.sqrt((diameter / 2) ** 2 - across**2)
        np.testing.assert_allclose(here.height, touching - diameter / 2, atol=ABOVE)
        # A smooth surface and the disk share their tangent at the contact.
        np.testing.assert_allclose(surface.slopes(here.contact), here.slope, atol=1e-8)


@pytest.mark.parametrize("surface", SURFACES)
def test_surface_slopes_are_derivatives_of_its_heights(surface):
    u = np.random.default_rng(6).uniform(-1, 2, 300) * surface.period
    difference = (surface.heights(u + STEP) - surface.heights(u - STEP)) / (2 * STEP)
    np.testing.assert_allclose(surface.slopes(u), difference, atol=SLOPE)


@pytest.mark.parametrize("surface", SURFACES)
def test_trace_repeats_after_the_period_and_a_mirrored_one_runs_back(surface):
    trace = surface.tracer(1.5 * MM)
    u = np.random.default_rng(7).uniform(0.01, 0.99, 100) * surface.period
    here, after = trace(u), trace(u + 3 * surface.period)
    np.testing.assert_allclose(after.height, here.height, atol=10 * ABOVE)
    np.testing.assert_allclose(surface.heights(u + surface.period), surface.heights(u), atol=1e-13)
    if surface.mirrored:
        back = trace(-u)
        np.testing.assert_allclose(back.height, here.height, atol=10 * ABOVE)
        np.testing.assert_allclose(back.slope, -here.slope, atol=1e-8)
        np.testing.assert_allclose(back.contact, -here.contact, atol=1e-11)
    else:
        assert surface.period == surface.length


def test_the_trace_does_not_depend_on_the_order_of_places():
    # The last contact is the next search's first guess; it must not show in the result.
    noise = np.random.default_rng(15).normal(size=(40, 40)) * 20e-6
    for surface in (
        SampledProfile(_rough(300, power=1.0), PIXEL),
        SampledProfile(noise.ravel(), PIXEL),
        HeightMap(_rough(40, 46), PIXEL),
        HeightMap(noise, PIXEL),
    ):
        trace = surface.tracer(1.5 * MM)
        u = np.sort(np.random.default_rng(8).uniform(0, 1, 800)) * surface.period
        order = np.random.default_rng(9).permutation(u.size)
        sorted_, shuffled = trace(u), trace(u[order])
        np.testing.assert_allclose(shuffled.height, sorted_.height[order], atol=CERTIFIED_TO)
        np.testing.assert_allclose(shuffled.slope, sorted_.slope[order], atol=1e-7)


@pytest.mark.parametrize(("n", "height", "slope"), [(100, 1e-11, 1e-6), (200, 1e-12, 1e-7)])
def test_sampled_sinusoid_is_the_sinusoid(n, height, slope):
    # The spline through n samples a period is off by (2 pi / n)^4 a / 384 and 4 a pi^3 / n^3.
    exact = Sinusoid(0.1 * MM, 2 * MM)
    places = (np.arange(2 * n) + 0.5) * exact.period / n
    samples = exact.heights(places)
    u = np.random.default_rng(10).uniform(-0.49, 0.49, 300) * exact.period
    wanted = exact.tracer(3 * MM)(u)
    ridges = HeightMap(np.tile(samples, (2 * n, 1)), exact.period / n, "wrap")
    for surface in (SampledProfile(samples, exact.period / n, "wrap"), ridges):
        trace = surface.tracer(3 * MM)(u)
        np.testing.assert_allclose(trace.height, wanted.height, atol=height)
        np.testing.assert_allclose(trace.slope, wanted.slope, atol=slope)


def test_sampled_grating_tends_to_the_grating():
    exact = Grating(0.3 * MM, 1.5 * MM, 0.5 * MM, 0.4 * MM)
    u = np.linspace(0, exact.period, 101)
    wanted = exact.tracer(1.5 * MM)(u).height
    for n in (50, 100, 200, 400, 800):
        places = (np.arange(n) + 0.5) * exact.period / n
        surface = SampledProfile(exact.heights(places), exact.period / n, "wrap")
        miss = np.max(np.abs(surface.tracer(1.5 * MM)(u).height - wanted))
        # At a corner a spline is off by at most a fifth of the pixel times the change of slope.
        assert miss <= 0.2 * 0.75 * exact.period / n


def _bowl(radius, n=40):
    across = (np.arange(n) + 0.5 - n / 2) * PIXEL
    inside = radius**2 - across[:, None] ** 2 - across**2
    return radius - np.sqrt(np.maximum(inside, (0.3 * radius) ** 2))


SIDE = 40
FLAT_OR_ADVERSARIAL = {
    "constant": np.full((SIDE, SIDE), 0.1 * MM),
    "nearly constant": np.random.default_rng(11).normal(size=(SIDE, SIDE)) * 1e-12,
    "one spike": np.outer(np.eye(SIDE)[20], np.eye(SIDE)[37]) * 0.1 * MM,
    "white noise": np.random.default_rng(12).normal(size=(SIDE, SIDE)) * 10e-6,
    "tall white noise": np.random.default_rng(13).normal(size=(SIDE, SIDE)) * 100e-6,
    "chessboard": 20e-6 * (-1.0) ** np.add.outer(np.arange(SIDE), np.arange(SIDE)),
    "bowl of the probe's own radius": _bowl(1.0 * MM),
    "bowl a little wider": _bowl(1.001 * MM),
    "bowl a little narrower": _bowl(0.999 * MM),
    "trough of the probe's own radius": np.tile(_bowl(1.0 * MM)[20], (SIDE, 1)),
    "terraces taller than the probe": np.kron(np.eye(4), np.full((10, 10), 2.4 * MM)),
}


@pytest.mark.parametrize("name", FLAT_OR_ADVERSARIAL)
def test_search_stays_fast_and_certified_where_everything_ties(name, recwarn):
    samples, diameter = FLAT_OR_ADVERSARIAL[name], 2.0 * MM
    began = time.perf_counter()
    offset = offset_surface(samples, PIXEL, diameter)
    assert time.perf_counter() - began < SECONDS
    assert np.all(np.isfinite(offset))
    assert np.all(offset >= samples - ABOVE)
    heights = _map_heights(samples, PIXEL, "mirror")
    for row, column in ((0, 0), (20, 37), (24, 31)):
        at = (column + 0.5) * PIXEL, (row + 0.5) * PIXEL
        dense = naive.rest_on_map(heights, diameter, *at, PIXEL / 3)
        assert offset[row, column] >= dense - CERTIFIED_TO - ABOVE
    assert not recwarn.list


def test_a_wall_taller_than_the_probe_is_placed_to_a_small_part_of_a_pixel():
    # Beside such a wall the offset is steeper than any bound; its place still has to be right.
    samples = np.tile(np.repeat([0.0, 2.0 * MM], 30), (40, 1))
    ridge, diameter = HeightMap(samples, PIXEL), 1 * MM
    u = np.linspace(0.3, 0.7, 161) * ridge.length
    trace = ridge.tracer(diameter)(u)
    profile = SampledProfile(samples[0], PIXEL).tracer(diameter)
    shift = PIXEL / 32
    assert np.all(np.isfinite(trace.slope))
    assert np.all(trace.height >= np.minimum(profile(u - shift).height, profile(u + shift).height))
    assert np.all(trace.height <= profile(u).height + CERTIFIED_TO + ABOVE)


def test_tracers_keep_the_shape_of_their_places():
    for surface in (SampledProfile(_rough(30), PIXEL), HeightMap(_rough(30, 30), PIXEL)):
        trace = surface.tracer(1 * MM)
        grid = np.random.default_rng(14).uniform(0, 5 * MM, (4, 6))
        for part, whole in zip(trace(grid), trace(grid.ravel()), strict=True):
            assert part.shape == (4, 6)
            np.testing.assert_allclose(part.ravel(), whole, atol=CERTIFIED_TO)
        assert trace(1 * MM).height.shape == ()
        assert surface.heights(1 * MM).shape == ()


BAD = np.zeros((30, 30))
BAD[3, 4] = math.nan


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SampledProfile(np.zeros(1), PIXEL), "2 samples"),
        (lambda: SampledProfile(np.zeros((3, 3)), PIXEL), "1-D"),
        (lambda: SampledProfile(BAD[3], PIXEL), "1 NaN or infinite values of 30"),
        (lambda: SampledProfile(np.zeros(9), 0.0), "pixel_size"),
        (lambda: SampledProfile(np.zeros(9), math.nan), "pixel_size"),
        (lambda: SampledProfile(np.zeros(9), PIXEL, "miror"), "did you mean 'mirror'"),
        (lambda: SampledProfile(["rough"], PIXEL), "array of numbers"),
        (lambda: SampledProfile(np.zeros(9), PIXEL).tracer(0.0), "diameter"),
        (lambda: SampledProfile(np.zeros(9), PIXEL).tracer(math.nan), "diameter"),
        (lambda: SampledProfile(np.zeros(9), PIXEL).tracer(10 * PIXEL), "wider than the surface"),
        (lambda: HeightMap(np.zeros(9), PIXEL), "2-D"),
        (lambda: HeightMap(np.zeros((1, 9)), PIXEL), "2 samples"),
        (lambda: HeightMap(BAD, PIXEL), "1 NaN"),
        (lambda: HeightMap(np.zeros((9, 9)), -PIXEL), "pixel_size"),
        (lambda: HeightMap(np.zeros((9, 9)), PIXEL, line=-PIXEL), "line"),
        (lambda: HeightMap(np.zeros((9, 9)), PIXEL, line=math.nan), "line"),
        (lambda: HeightMap(np.zeros((9, 30)), PIXEL).tracer(10 * PIXEL), "wider than the surface"),
        (lambda: offset_surface(BAD, PIXEL, 1e-3), "1 NaN"),
        (lambda: offset_surface(np.zeros((2, 2, 2)), PIXEL, 1e-4), "1-D or 2-D"),
        (lambda: offset_surface(np.zeros((9, 9)), PIXEL, -1e-4), "diameter"),
        (lambda: offset_surface(np.zeros((9, 9)), PIXEL, 1e-4, border="tile"), "border"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(AsperityError, match=message):
        make()
