"""Depths against the brute-force reference, certified gaps, and the noise of the force."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from naive_bodies import AT_REST, ROUND, UP, Pair, meeting, plate, pose, ripple, solid, turn

from asperity.geometry.offsets.analytic import Sinusoid
from asperity.texture.height_field import HeightField
from oracle.depth import reference_depth

MAPS = (
    ("measured/sandpaper_P120_height16.png", {"pixel_size": 8e-6, "height_range": 80e-6}),
    ("measured/sandpaper_P40_height16.png", {"pixel_size": 8e-6, "height_range": 200e-6}),
    ("measured/mdf_stripes_1_height16.png", {"pixel_size": 10e-6, "height_range": 200e-6}),
    ("heights/Ground054_1K_Displacement.jpg", {"pixel_size": 10e-6, "height_range": 100e-6}),
    ("heights/derived_fabric_pattern_07_height16.png", {"pixel_size": 1e-5, "height_range": 1e-4}),
    ("measured/us_dime_gelsight.npz", {}),
    ("heights/godot_wool_depth.png", {"pixel_size": 10e-6, "height_range": 100e-6}),
)
"""The scales of maps without one are ours."""
TILTS = (0.0, 2.0, 10.0, 30.0)
ALLOWED = 0.005
"""Error of a depth, relative to the textures' peak to peak."""


@cache
def real_map(folder: Path, index: int) -> HeightField:
    name, scale = MAPS[index]
    return HeightField.from_file(folder / name, missing="fill", **scale)


def tolerance_of(*fields):
    """Return the gap that is promised: 1 nm or 1e-3 of the rms height of the smoother texture."""
    return max(1e-9, 1e-3 * min(field.rms for field in fields if field is not None))


def on_real_map(data, index, tilt, seed):
    """Return tool, its pose, and ground: both with real maps, the tool tilted [degrees]."""
    rng = np.random.default_rng(100 * index + seed)
    other = real_map(data, (index + 1 + int(rng.integers(len(MAPS) - 1))) % len(MAPS))
    tool = solid(("sphere", "cylinder", "box")[seed % 3], "tool", other)
    about = np.append(rng.standard_normal(2), 0.0)
    at = pose(*rng.uniform(-1e-3, 1e-3, 2), 1.2e-3, turn(about, math.radians(tilt)))
    return tool, at, plate(real_map(data, index))


def compare(cases, report, **look):
    """Return relative errors and statuses of (tool, pose, ground), printed as mean and worst."""
    errors, statuses = [], []
    for tool, at, ground in cases:
        tolerance = tolerance_of(tool.texture, ground.texture)
        found = Pair(tool, ground).along(at, AT_REST, UP, tolerance)
        exact = reference_depth(tool, at, ground, AT_REST, UP, **look).depth
        # U is k delta^2 / 2: 1 % of it is 0.5 % of the depth.
        errors.append(abs(found.depth - exact) / (tool.texture.relief + ground.texture.relief))
        statuses.append(found.status)
    print(f"{report}: mean {100 * np.mean(errors):.5f} %, worst {100 * np.max(errors):.5f} %")
    return np.array(errors), np.array(statuses)


@pytest.mark.parametrize("maps", [(2, 5), pytest.param((3,), marks=pytest.mark.slow)])
def test_depth_on_real_maps(data, maps):
    cases = [on_real_map(data, i, TILTS[i % 4], i) for i in maps]
    errors, statuses = compare(cases, f"{len(maps)} real maps", samples=120, zooms=4)
    assert errors.max() < ALLOWED
    assert not statuses.any()


@pytest.mark.slow
def test_depth_on_real_maps_at_every_tilt(data):
    cases = [on_real_map(data, i, t, s) for i in range(len(MAPS)) for t in TILTS for s in range(2)]
    errors, statuses = compare(cases, f"{len(cases)} cases on real maps", samples=200, zooms=4)
    assert errors.max() < ALLOWED
    assert not statuses.any()


@pytest.mark.parametrize("kind_a", ROUND)
def test_depth_of_every_pair_of_kinds(kind_a):
    for number, kind_b in enumerate((*ROUND, "plane")):
        seed = 10 * ROUND.index(kind_a) + number
        a, pose_a, b, pose_b, n = meeting(kind_a, kind_b, seed)
        found = Pair(a, b).along(pose_a, pose_b, n, 1e-9)
        exact = reference_depth(a, pose_a, b, pose_b, n, samples=100, zooms=5)
        assert found.status == 0, (kind_b, seed)
        assert found.depth == pytest.approx(exact.depth, abs=1.1e-9), (kind_b, seed)


def count_uncertified(cases):
    """Return how many depths came without the promised gap, and how many there were."""
    missed = 0
    for a, pose_a, b, pose_b, n in cases:
        tolerance = tolerance_of(a.texture, b.texture)
        found = Pair(a, b).along(pose_a, pose_b, n, tolerance)
        missed += not found.gap <= tolerance
        assert (found.status == 0) == (found.gap <= tolerance)
    print(f"{missed} of {len(cases)} depths are not certified")
    return missed


@pytest.mark.parametrize("seeds", [[0], pytest.param([1, 2], marks=pytest.mark.slow)])
def test_every_depth_is_certified(seeds):
    kinds = [(a, b) for a in ROUND for b in (*ROUND, "plane")]
    for textured, most in (("a", 0.0), ("b", 0.0), ("ab", 0.1)):
        cases = [meeting(a, b, s, textured) for a, b in kinds for s in seeds]
        # Two curved bodies, both textured and steep to one another, may spend the budget.
        assert count_uncertified(cases) <= most * len(cases)


@pytest.mark.slow
def test_every_depth_on_real_maps_is_certified(data):
    picked = [(i, t, s) for i in range(len(MAPS)) for t in TILTS for s in range(6)]
    cases = []
    for i, t, s in picked:
        tool, at, ground = on_real_map(data, i, t, s)
        cases.append((tool, at, ground, AT_REST, UP))
    assert count_uncertified(cases) == 0


def noise_floor(samples_per_period):
    """Return how far below the force on the exact sinusoid the error of the force lies [dB].

    A sphere of 3 mm on a sinusoid, 2 mm long, 0.1 mm high; a micrometre round kinks left out.
    """
    amplitude, wavelength = 0.1e-3, 2e-3
    trace = Sinusoid(amplitude, wavelength).tracer(3e-3)
    pair = Pair(solid("sphere"), plate(ripple(amplitude, wavelength, samples_per_period)))
    places = np.linspace(0.0, wavelength, 401)
    places = places[np.abs(places - 0.5 * wavelength) > 1e-6]
    exact = trace(places)
    slopes = []
    for place in places:
        # The tangential force per normal force is the slope of m.
        m = pair.along(pose(place, 0, 1.5e-3, turn(UP, 0.0)), AT_REST, UP, 1e-11).m
        slopes.append(-m[0])
    error = np.array(slopes) - exact.slope
    return 10.0 * math.log10(np.mean(error**2) / np.mean(exact.slope**2))


def test_the_force_on_a_stored_sinusoid_has_a_low_noise_floor():
    floors = {n: noise_floor(n) for n in (25, 50, 100)}
    print(", ".join(f"{n} samples a period: {floor:.1f} dB" for n, floor in floors.items()))
    assert floors[25] < -80.0
    assert floors[50] < floors[25] - 12.0
    assert floors[100] < floors[50] - 12.0
