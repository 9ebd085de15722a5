"""Sinusoids and gratings: exact offsets against dense maxima, slopes, and the closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import optimize

import naive
from asperity.errors import AsperityError
from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.sampled import SampledProfile
from asperity.geometry.offsets.surface import drop_point

DENSE = 0.5e-6  # [m] between points: they miss a maximum by its curvature times DENSE**2 / 8
ABOVE = 1e-15  # [m] rounding: the dense maximum cannot exceed the true one
STEP = 1e-8  # [m] for central differences of the height
SLOPE = 1e-7  # rounding of heights of 1e-4 m over STEP, twice; STEP**2 times the third derivative
CLOSED_FORM = 1e-3  # the paper's figures are given to this
MM = 1e-3


def _check_slopes(trace, period, places):
    """Compare the slope with differences of the height, but where the contact leaps."""
    low, here, high = trace(places - STEP), trace(places), trace(places + STEP)
    smooth = np.abs(high.slope - low.slope) < 1e-4
    assert np.mean(smooth) > 0.9
    difference = (high.height - low.height) / (2 * STEP)
    np.testing.assert_allclose(here.slope[smooth], difference[smooth], atol=SLOPE)


@pytest.mark.parametrize("amplitude", [0.02, 0.1, 0.8])
@pytest.mark.parametrize("spacing", [0.3, 1.0, 2.0, 2.4, 3.5, 12.0])
@pytest.mark.parametrize("diameter", [0.3, 3.0])
def test_sinusoid_is_the_dense_maximum(amplitude, spacing, diameter):
    surface = Sinusoid(amplitude * MM, spacing * MM)
    u = np.random.default_rng(0).uniform(-2.5, 2.5, 60) * spacing * MM
    u = np.append(u, np.array([0.0, 0.25, 0.5, 1.0]) * spacing * MM)
    x = np.arange(u.min() - diameter * MM / 2, u.max() + diameter * MM / 2, DENSE)
    dense = naive.rest_on_points(x, surface.heights(x), diameter * MM, u)
    excess = surface.tracer(diameter * MM)(u).height - dense
    wavenumber = 2 * math.pi / (spacing * MM)
    steep = amplitude * MM * wavenumber
    bend = steep * wavenumber + (1 + steep**2) ** 1.5 / (diameter * MM / 2)
    assert np.all(excess >= -ABOVE)
    assert np.max(excess) <= bend * DENSE**2 / 8 + ABOVE


@pytest.mark.parametrize("spacing", [0.4, 1.3, 2.0, 3.5])
def test_sinusoid_slope_is_the_derivative_and_contact_touches(spacing):
    surface, diameter = Sinusoid(0.1 * MM, spacing * MM), 3 * MM
    u = np.random.default_rng(1).uniform(-2, 2, 300) * spacing * MM
    _check_slopes(surface.tracer(diameter), surface.period, u)
    trace = surface.tracer(diameter)(u)
    across = trace.contact - u
    touching = surface.heights(trace.contact) + np.sqrt((diameter / 2) ** 2 - across**2)
    np.testing.assert_allclose(trace.height, touching - diameter / 2, atol=ABOVE)
    # Disk and surface have one tangent at the contact.
    np.testing.assert_allclose(trace.slope, surface.slopes(trace.contact), atol=SLOPE)


GRATINGS = {
    "square": Grating(0.4 * MM, 1.5 * MM),
    "square, wide gap": Grating(0.4 * MM, 3.5 * MM, 0.5 * MM),
    "edges without width": Grating(0.2 * MM, 1.0 * MM, 0.0),
    "trapezoid": Grating(0.4 * MM, 1.5 * MM, 0.25 * MM, 0.3 * MM),
    "triangle": Grating(0.4 * MM, 1.5 * MM, 0.0, 0.75 * MM),
    "taller than the probe": Grating(2.5 * MM, 1.5 * MM, 0.25 * MM, 0.3 * MM),
}


@pytest.mark.parametrize("diameter", [0.9, 3.0])
@pytest.mark.parametrize("name", GRATINGS)
def test_grating_is_the_dense_maximum(name, diameter):
    surface = GRATINGS[name]
    u = np.random.default_rng(2).uniform(-1.5, 1.5, 80) * surface.period
    u = np.append(u, np.array([0.0, 0.5, 1.0]) * surface.period)
    corners, tops = surface.outline()
    # Segment by segment, both ends included: walls and corners are not rounded off.
    xs, zs = [], []
    for k in range(corners.size - 1):
        length = math.hypot(corners[k + 1] - corners[k], tops[k + 1] - tops[k])
        share = np.linspace(0, 1, int(length / DENSE) + 2)
        xs.append(corners[k] + share * (corners[k + 1] - corners[k]))
        zs.append(tops[k] + share * (tops[k + 1] - tops[k]))
    x = np.concatenate([np.concatenate(xs) + tile * surface.period for tile in range(-5, 5)])
    dense = naive.rest_on_points(x, np.tile(np.concatenate(zs), 10), diameter * MM, u)
    excess = surface.tracer(diameter * MM)(u).height - dense
    steep = surface.height / surface.flank if surface.flank else 0.0
    assert np.all(excess >= -ABOVE)
    assert np.max(excess) <= math.hypot(1, steep) / (diameter * MM / 2) * DENSE**2 / 8 + ABOVE


@pytest.mark.parametrize("name", GRATINGS)
def test_grating_slope_is_the_derivative(name):
    surface = GRATINGS[name]
    u = np.random.default_rng(3).uniform(-2, 2, 300) * surface.period
    _check_slopes(surface.tracer(3 * MM), surface.period, u)


@pytest.mark.parametrize("surface", [Sinusoid(0.1 * MM, 2 * MM), *GRATINGS.values()])
def test_offset_repeats_mirrors_and_stays_between_surface_and_crest(surface):
    trace = surface.tracer(3 * MM)
    u = np.random.default_rng(4).uniform(0, 1, 200) * surface.period
    here, after, behind = trace(u), trace(u + 7 * surface.period), trace(-u)
    np.testing.assert_allclose(after.height, here.height, atol=1e-14)
    np.testing.assert_allclose(behind.height, here.height, atol=1e-14)
    assert np.all(here.height >= surface.heights(u) - ABOVE)
    crest = surface.amplitude if isinstance(surface, Sinusoid) else surface.height
    assert np.all(here.height <= crest + ABOVE)


def test_larger_probes_ride_higher():
    for surface in (Sinusoid(0.1 * MM, 2 * MM), *GRATINGS.values()):
        u = np.linspace(0, surface.period, 101)
        heights = [surface.tracer(d * MM)(u).height for d in (0.9, 1.0, 2.0, 4.0, 40.0)]
        assert np.all(np.diff(heights, axis=0) >= -ABOVE)


def test_tracer_keeps_the_shape_of_its_places():
    for surface in (Sinusoid(0.1 * MM, 2 * MM), GRATINGS["square"]):
        trace = surface.tracer(3 * MM)
        grid = np.random.default_rng(5).uniform(0, 5 * MM, (4, 6))
        flat = trace(grid.ravel())
        for part, whole in zip(trace(grid), flat, strict=True):
            assert part.shape == (4, 6)
            np.testing.assert_array_equal(part.ravel(), whole)
        assert trace(1 * MM).height.shape == ()


@pytest.mark.parametrize("diameter", [2.0, 3.0, 4.0])
def test_grating_drop_point_is_where_the_probe_first_reaches_the_floor(diameter):
    height = 0.4 * MM

    def clearance(spacing: float) -> float:
        surface = Grating(height, spacing)
        u = np.linspace(0, surface.period, 257)  # holds the middle of the gap
        return float(np.min(surface.tracer(diameter * MM)(u).height)) - 1e-12

    low, high = 0.5 * MM, 4 * MM
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if clearance(middle) > 0 else (low, middle)
    formula = 2 * math.sqrt(height * (diameter * MM - height))
    assert low == pytest.approx(formula, rel=CLOSED_FORM)
    assert drop_point(diameter * MM, height=height) == pytest.approx(formula, rel=1e-12)
    assert formula == pytest.approx({2: 1.60, 3: 2.04, 4: 2.40}[int(diameter)] * MM, abs=5e-6)


@pytest.mark.parametrize("diameter", [2.0, 3.0, 4.0])
def test_sinusoid_drop_point_is_where_the_probe_first_reaches_the_trough(diameter):
    amplitude = 0.1 * MM

    def clearance(spacing: float) -> float:
        # Near the drop point the clearance is of second order in the spacing: 1e-13 m is 1e-4.
        at = Sinusoid(amplitude, spacing).tracer(diameter * MM)(np.array([0.5 * spacing]))
        return float(at.height[0]) + amplitude - 1e-13

    found = optimize.brentq(clearance, 1.0 * MM, 6 * MM, xtol=1e-10)
    formula = math.pi * math.sqrt(2 * amplitude * diameter * MM)
    assert found == pytest.approx(formula, rel=CLOSED_FORM)
    assert drop_point(diameter * MM, amplitude=amplitude) == pytest.approx(formula, rel=1e-12)


@pytest.mark.parametrize(
    ("diameter", "slope", "spacing"),
    [(2.0, 0.4464, 1.2625), (3.0, 0.3590, 1.5698), (4.0, 0.3086, 1.8264)],
)
def test_largest_slope_over_all_sinusoids(diameter, slope, spacing):
    def steepest(length: float) -> float:
        places = np.linspace(0.25, 0.5 - 1e-9, 4001) * length
        trace = Sinusoid(0.1 * MM, length).tracer(diameter * MM)(places)
        return -float(np.max(np.abs(trace.slope)))

    best = optimize.minimize_scalar(
        steepest, bounds=(0.5 * spacing * MM, 2 * spacing * MM), method="bounded",
        options={"xatol": 1e-9},
    )  # fmt: skip
    assert -best.fun == pytest.approx(slope, rel=CLOSED_FORM)
    assert best.x == pytest.approx(spacing * MM, rel=CLOSED_FORM)


def test_slope_tends_to_spacing_over_diameter_and_to_the_surface_slope():
    amplitude, diameter = 0.1 * MM, 3 * MM

    def steepest(length: float) -> float:
        places = np.linspace(0, 0.5 - 1e-9, 4001) * length
        return float(np.max(np.abs(Sinusoid(amplitude, length).tracer(diameter)(places).slope)))

    for length, within in ((0.3 * MM, 0.02), (0.03 * MM, 2e-4)):
        assert steepest(length) == pytest.approx(length / diameter, rel=within)
    for length, within in ((30 * MM, 2e-3), (300 * MM, 2e-5)):
        assert steepest(length) == pytest.approx(2 * math.pi * amplitude / length, rel=within)


def test_two_probes_after_each_other_are_one_of_both_diameters():
    # Minkowski sums; at 6 mm no probe is stopped by two crests at once, so all is smooth.
    surface, n = Sinusoid(0.1 * MM, 6 * MM), 600
    places = (np.arange(n) + 0.5) * surface.period / n
    first = SampledProfile(surface.tracer(1 * MM)(places).height, surface.period / n, "wrap")
    u = np.linspace(0, surface.period, 333)
    # The spline through 600 samples of a smooth curve is good to about h**4 / 384 f''''.
    np.testing.assert_allclose(
        first.tracer(2 * MM)(u).height, surface.tracer(3 * MM)(u).height, atol=1e-11
    )


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: Sinusoid(-1e-4, 1e-3), "amplitude"),
        (lambda: Sinusoid(1e-4, 0.0), "spacing"),
        (lambda: Sinusoid(1e-4, math.nan), "spacing"),
        (lambda: Grating(math.inf, 1e-3), "height"),
        (lambda: Grating(1e-4, -1e-3), "spacing"),
        (lambda: Grating(1e-4, 1e-3, -1e-4), "ridge"),
        (lambda: Grating(1e-4, 1e-3, 1e-4, math.nan), "flank"),
        (lambda: Grating(1e-4, 1e-3, 1e-4, 0.6e-3), "flank"),
        (lambda: Sinusoid(1e-4, 1e-3).tracer(0.0), "diameter"),
        (lambda: Grating(1e-4, 1e-3).tracer(-1e-3), "diameter"),
        (lambda: Grating(0.4e-3, 1e-3).tracer(0.8e-3), "height"),
        (lambda: drop_point(math.nan, height=1e-4), "diameter"),
        (lambda: drop_point(1e-3, height=0.0), "height"),
        (lambda: drop_point(1e-3, amplitude=-1.0), "amplitude"),
        (lambda: drop_point(1e-3), "exactly one"),
    ],
)
def test_bad_values_are_named(make, name):
    with pytest.raises(AsperityError, match=name):
        make()
