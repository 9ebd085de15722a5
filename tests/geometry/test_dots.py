"""Plates of raised dots: exact offsets against dense points, and what jitter and seed do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.offsets.dots import DotPlate

MM = 1e-3
ANGLES, SHARES = 720, 241
ABOVE = 1e-15  # [m] rounding
STEP = 1e-8  # [m] for central differences of the height
SLOPE = 1e-7  # rounding of heights of 1e-4 m over STEP, twice

PLATES = {
    "jittered cones": DotPlate(1.5 * MM, rows=3, columns=4),
    "regular cylinders": DotPlate(1.0 * MM, flank=0.0, jitter=0.0, rows=1, columns=1),
    "fully jittered": DotPlate(1.2 * MM, jitter=1.0, seed=5, rows=2, columns=3),
    "wide flanks that overlap": DotPlate(0.4 * MM, flank=0.5 * MM, rows=3, columns=3),
    "wide gaps, off the row": DotPlate(5.0 * MM, rows=2, columns=2, line=1.1 * MM),
}


def _points(plate, u, v, radius):
    """Return points of all dots that a sphere above (u, v) may touch: tops, edges, flanks."""
    top = plate.diameter / 2
    share = np.linspace(0, 1, SHARES)
    away = np.concatenate([top * share, top + plate.flank * share])
    rise = np.concatenate([np.ones(SHARES), 1 - share]) * plate.height
    turn = np.linspace(0, 2 * np.pi, ANGLES, endpoint=False)
    du, dv = np.outer(away, np.cos(turn)), np.outer(away, np.sin(turn))
    z = np.broadcast_to(rise[:, None], du.shape)
    centres, reach = plate.centres(), radius + top + plate.flank
    for row in range(
        math.floor((v - reach) / plate.pitch), math.floor((v + reach) / plate.pitch) + 1
    ):
        for column in range(
            math.floor((u - reach) / plate.pitch), math.floor((u + reach) / plate.pitch) + 1
        ):
            at = centres[row % plate.rows, column % plate.columns]
            yield at[0] + column * plate.pitch + du, at[1] + row * plate.pitch + dv, z


def _dense(plate, diameter, u, v):
    radius, best = diameter / 2, 0.0  # the floor
    for x, y, z in _points(plate, u, v, radius):
        inside = radius**2 - (x - u) ** 2 - (y - v) ** 2
        touching = inside > 0
        if np.any(touching):
            best = max(best, np.max(z[touching] + np.sqrt(inside[touching]) - radius))
    return best


@pytest.mark.parametrize("name", PLATES)
def test_offset_is_the_dense_maximum(name):
    plate, diameter = PLATES[name], 3 * MM
    line = plate.line if plate.line is not None else plate.pitch / 2
    u = np.random.default_rng(0).uniform(-1, 2, 8) * plate.period
    dense = np.array([_dense(plate, diameter, place, line) for place in u])
    excess = plate.tracer(diameter)(u).height - dense
    # A point of the dots lies within half a step of the contact, along the outline and around.
    slant = math.hypot(plate.flank, plate.height) / SHARES if plate.flank else 0.0
    around = 2 * np.pi * (plate.diameter / 2 + plate.flank) / ANGLES
    steep = plate.height / plate.flank if plate.flank else 0.0
    bend = 2 * math.hypot(1, steep) / diameter
    # Around, the contact's slope times the bend of the edge adds to the sphere's own bend.
    turn = bend + 2 * max(steep, 1.0) / plate.diameter
    assert np.all(excess >= -ABOVE)
    assert np.max(excess) <= bend * slant**2 / 8 + turn * around**2 / 8 + ABOVE


@pytest.mark.parametrize("name", PLATES)
def test_slope_is_the_derivative_of_the_height(name):
    plate = PLATES[name]
    trace = plate.tracer(3 * MM)
    u = np.random.default_rng(1).uniform(0, 1, 400) * plate.period
    low, here, high = trace(u - STEP), trace(u), trace(u + STEP)
    smooth = np.abs(high.slope - low.slope) < 1e-4
    assert np.mean(smooth) > 0.9
    difference = (high.height - low.height) / (2 * STEP)
    np.testing.assert_allclose(here.slope[smooth], difference[smooth], atol=SLOPE)


@pytest.mark.parametrize("name", PLATES)
def test_probe_touches_the_tops_and_no_more(name):
    plate = PLATES[name]
    height = plate.tracer(3 * MM)(np.linspace(0, plate.period, 4001)).height
    assert np.max(height) <= plate.height + ABOVE
    assert np.min(height) >= 0.0
    row, column = 0, plate.columns - 1
    at = plate.centres()[row, column]
    over = DotPlate(**{**vars(plate), "line": float(at[1])})
    centre = at[0] + column * plate.pitch
    touched = over.tracer(3 * MM)(np.array([centre, centre - 3 * plate.period]))
    np.testing.assert_allclose(touched.height, plate.height, atol=ABOVE)
    np.testing.assert_allclose(touched.slope, 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["jittered cones", "fully jittered", "wide flanks that overlap"])
def test_tiny_sphere_feels_the_heights(name):
    plate, diameter = PLATES[name], 1e-8
    for v in np.random.default_rng(2).uniform(-1, 2, 12) * plate.rows * plate.pitch:
        u = np.random.default_rng(3).uniform(-1, 2, 300) * plate.period
        line = DotPlate(**{**vars(plate), "line": float(v)})
        np.testing.assert_array_equal(line.heights(u), plate.heights(u, v))
        # On a slope s a sphere's lowest point stands R (sqrt(1 + s^2) - 1) above the surface.
        lift = diameter / 2 * (math.hypot(1, plate.height / plate.flank) - 1)
        excess = line.tracer(diameter)(u).height - plate.heights(u, v)
        assert np.all(excess >= -ABOVE)
        assert np.max(excess) <= lift + ABOVE


def test_without_jitter_all_seeds_give_one_regular_plate():
    u = np.linspace(0, 30 * MM, 2001)
    plates = [DotPlate(1.5 * MM, jitter=0.0, seed=seed) for seed in (0, 7)]
    first, second = (plate.tracer(3 * MM)(u).height for plate in plates)
    np.testing.assert_array_equal(first, second)
    shifted = plates[0].tracer(3 * MM)(u + plates[0].pitch).height
    np.testing.assert_allclose(shifted, first, atol=1e-14)
    np.testing.assert_allclose(plates[0].centres(), plates[0].pitch / 2)


def test_jitter_follows_the_seed_and_keeps_dots_in_their_cells():
    one, same, other = (DotPlate(1.5 * MM, jitter=1.0, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.centres(), same.centres())
    assert np.max(np.abs(one.centres() - other.centres())) > 0.1 * MM
    assert np.min(one.centres()) >= one.diameter / 2
    assert np.max(one.centres()) <= one.pitch - one.diameter / 2
    assert np.std(one.centres()) == pytest.approx(0.5 * 1.5 * MM / math.sqrt(3), rel=0.1)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"spacing": 0.0}, "spacing"),
        ({"height": -1e-4}, "height"),
        ({"diameter": math.nan}, "diameter"),
        ({"flank": -1e-6}, "flank"),
        ({"jitter": 1.5}, "jitter"),
        ({"jitter": math.nan}, "jitter"),
        ({"rows": 0}, "rows"),
        ({"columns": 0}, "columns"),
    ],
)
def test_bad_values_are_named(arguments, name):
    with pytest.raises(AsperityError, match=name):
        DotPlate(**({"spacing": 1e-3} | arguments))


def test_probes_that_walls_would_stop_are_refused():
    with pytest.raises(AsperityError, match="diameter"):
        DotPlate(1e-3).tracer(0.0)
    with pytest.raises(AsperityError, match=r"0\.4 mm stop a probe of diameter 0\.8 mm"):
        DotPlate(1e-3, flank=0.0).tracer(0.8e-3)
