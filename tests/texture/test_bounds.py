"""The pyramids bound the surface, its curvature and its third derivatives, on every level."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from asperity.texture.bounds import pyramid_of
from asperity.texture.spline import evaluate_1d, evaluate_2d, spline_coefficients

ROUNDING = 1e-12  # the bound and the value are sums of the same 16 terms in another order
STEP = 1e-4  # third derivatives are constant along u or v inside a cell: exact but for rounding
DIFFERENCE = 1e-9


def _blocks(pyramid, which):
    for level in range(pyramid.offsets.size):
        rows, columns = pyramid.shapes[level]
        start = pyramid.offsets[level]
        yield level, which[start : start + rows * columns].reshape(rows, columns)


def _maps():
    rng = np.random.default_rng(3)
    spike = np.zeros((9, 9))
    spike[4, 4] = 1.0
    yield "white noise", rng.normal(size=(13, 22))
    yield "one spike", spike
    yield "constant", np.full((5, 6), 0.3)
    yield "narrow", rng.normal(size=(2, 17))


MAPS = dict(_maps())


@pytest.mark.parametrize("name", MAPS)
def test_no_point_of_a_map_rises_above_its_block_on_any_level(name):
    coefficients = spline_coefficients(MAPS[name], "mirror", 3)
    pyramid = pyramid_of(coefficients)
    rows, columns = pyramid.shapes[0]
    assert (rows, columns) == tuple(n - 3 for n in coefficients.shape)
    assert tuple(pyramid.shapes[-1]) == (1, 1)
    rng = np.random.default_rng(4)
    for y, x in zip(rng.uniform(0, rows, 3000), rng.uniform(0, columns, 3000), strict=True):
        r, c = int(y), int(x)
        s, _, _, s_uu, s_uv, s_vv = evaluate_2d(coefficients, r, c, y - r, x - c)
        steepest = np.linalg.eigvalsh([[s_uu, s_uv], [s_uv, s_vv]])[-1]
        for level, heights in _blocks(pyramid, pyramid.heights):
            assert s <= heights[r >> level, c >> level] + ROUNDING
        for level, curvatures in _blocks(pyramid, pyramid.curvatures):
            assert steepest <= curvatures[r >> level, c >> level] + ROUNDING


@pytest.mark.parametrize("name", ["white noise", "one spike"])
def test_no_third_derivative_of_a_map_exceeds_its_block(name):
    coefficients = spline_coefficients(MAPS[name], "wrap")
    pyramid = pyramid_of(coefficients)
    rows, columns = pyramid.shapes[0]
    rng = np.random.default_rng(5)
    for _ in range(1000):
        r, c = rng.integers(rows), rng.integers(columns)
        tv, tu = rng.uniform(0.01, 0.99, 2)

        def seconds(dv: float, du: float, r=r, c=c, tv=tv, tu=tu) -> np.ndarray:
            return np.array(evaluate_2d(coefficients, r, c, tv + dv, tu + du)[3:])

        along_u = (seconds(0, STEP) - seconds(0, -STEP)) / (2 * STEP)
        along_v = (seconds(STEP, 0) - seconds(-STEP, 0)) / (2 * STEP)
        largest = max(np.abs(along_u).max(), np.abs(along_v).max())
        for level, changes in _blocks(pyramid, pyramid.changes):
            assert largest <= changes[r >> level, c >> level] + DIFFERENCE


@pytest.mark.parametrize("n", [2, 5, 64, 100])
def test_no_point_of_a_profile_rises_above_its_block_on_any_level(n):
    coefficients = spline_coefficients(np.random.default_rng(n).normal(size=n), "wrap", 2)
    pyramid = pyramid_of(coefficients)
    for x in np.random.default_rng(6).uniform(0, pyramid.shapes[0, 1], 2000):
        cell = int(x)
        value, _, curvature = evaluate_1d(coefficients, cell, x - cell)
        for level, heights in _blocks(pyramid, pyramid.heights):
            assert value <= heights[0, cell >> level] + ROUNDING
        for level, curvatures in _blocks(pyramid, pyramid.curvatures):
            assert curvature <= curvatures[0, cell >> level] + ROUNDING


def test_each_level_holds_the_maxima_of_the_level_below():
    pyramid = pyramid_of(spline_coefficients(MAPS["white noise"], "wrap", 2))
    for which in (pyramid.heights, pyramid.curvatures, pyramid.changes):
        levels = [block for _, block in _blocks(pyramid, which)]
        for below, above in itertools.pairwise(levels):
            for (r, c), value in np.ndenumerate(above):
                assert value == np.max(below[2 * r : 2 * r + 2, 2 * c : 2 * c + 2])


def test_the_bound_of_a_constant_surface_is_the_surface():
    pyramid = pyramid_of(spline_coefficients(MAPS["constant"], "wrap"))
    np.testing.assert_allclose(pyramid.heights, 0.3, atol=ROUNDING)
    np.testing.assert_allclose(pyramid.curvatures, 0.0, atol=ROUNDING)
