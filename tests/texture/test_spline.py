"""The cubic B-spline: it interpolates, its derivatives are its own, its borders repeat."""

from __future__ import annotations

import numpy as np
import pytest

import naive
from asperity.texture.spline import (
    BORDERS,
    evaluate_1d,
    evaluate_2d,
    spline_along,
    spline_coefficients,
)
from naive import kernel_values

ROUNDING = 1e-13  # samples are of the order 1, and a handful of operations deep
STEP = 1e-5
DIFFERENCE = 1e-8  # central differences: STEP**2 times a third derivative of about 10, rounding
SIZES = (2, 3, 4, 5, 17, 64)


def _random(*shape: int) -> np.ndarray:
    return np.random.default_rng(shape).normal(size=shape)


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("n", SIZES)
def test_profile_passes_through_every_sample(n, border):
    samples = _random(n)
    values = kernel_values(spline_coefficients(samples, border), np.arange(n) + 0.5)
    np.testing.assert_allclose(values, samples, atol=ROUNDING)


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("shape", [(2, 2), (2, 7), (5, 3), (16, 23)])
def test_map_passes_through_every_sample(shape, border):
    samples = _random(*shape)
    rows, columns = np.meshgrid(*(np.arange(n) + 0.5 for n in shape), indexing="ij")
    values = kernel_values(spline_coefficients(samples, border), rows, columns)
    np.testing.assert_allclose(values, samples, atol=ROUNDING)


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("n", SIZES)
def test_coefficients_solve_the_dense_interpolation_equations(n, border):
    samples = _random(n)
    coefficients = spline_coefficients(samples, border)[2:-2]
    np.testing.assert_allclose(
        coefficients, naive.collocation_coefficients(samples, border), atol=10 * ROUNDING
    )


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("n", SIZES)
def test_profile_equals_scipy_spline_over_its_whole_length(n, border):
    samples, places = _random(n), np.linspace(0.0, n, 401)
    values = kernel_values(spline_coefficients(samples, border), places)
    expected = naive.spline(samples, border, places)
    np.testing.assert_allclose(values, expected, atol=10 * ROUNDING)
    along = spline_along(spline_coefficients(samples, border))
    np.testing.assert_allclose(along(places), expected, atol=10 * ROUNDING)


@pytest.mark.parametrize("border", BORDERS)
def test_map_equals_scipy_spline_over_its_whole_extent(border):
    samples = _random(9, 14)
    rng = np.random.default_rng(0)
    rows, columns = rng.uniform(0, 9, 4000), rng.uniform(0, 14, 4000)
    values = kernel_values(spline_coefficients(samples, border), rows, columns)
    np.testing.assert_allclose(
        values, naive.spline(samples, border, rows, columns), atol=10 * ROUNDING
    )


@pytest.mark.parametrize("border", BORDERS)
def test_cells_in_the_margin_continue_the_surface(border):
    n, margin = 6, 6
    samples = _random(n)
    coefficients = spline_coefficients(samples, border, margin)
    assert coefficients.size == n + 4 + 2 * margin
    places = np.linspace(-margin, n + margin, 601)[:-1]
    cells = np.floor(places + 0.5).astype(int)
    values = [
        evaluate_1d(coefficients, cell + margin, place + 0.5 - cell)[0]
        for cell, place in zip(cells, places, strict=True)
    ]
    np.testing.assert_allclose(values, naive.spline(samples, border, places), atol=10 * ROUNDING)


@pytest.mark.parametrize("shape", [(3, 5), (7, 4)])
@pytest.mark.parametrize("border", BORDERS)
def test_margin_may_reach_over_several_periods_of_a_map(shape, border):
    samples, margin = _random(*shape), 11
    coefficients = spline_coefficients(samples, border, margin)
    rng = np.random.default_rng(1)
    rows, columns = (rng.uniform(-margin, n + margin, 300) for n in shape)
    values = []
    for v, u in zip(rows, columns, strict=True):
        row, column = int(np.floor(v + 0.5)), int(np.floor(u + 0.5))
        at = (row + margin, column + margin, v + 0.5 - row, u + 0.5 - column)
        values.append(evaluate_2d(coefficients, *at)[0])
    np.testing.assert_allclose(
        values, naive.spline(samples, border, rows, columns), atol=10 * ROUNDING
    )


def test_wrapped_values_repeat_after_n_and_mirrored_ones_after_2n():
    samples, margin = _random(5), 5
    places = np.linspace(0.01, 4.99, 97)
    cells = np.floor(places + 0.5).astype(int)
    for border in BORDERS:
        c = spline_coefficients(samples, border, margin)
        ahead = places + 5 if border == "wrap" else 10.0 - places
        ahead_cells = np.floor(ahead + 0.5).astype(int)
        for p, i, q, j in zip(places, cells, ahead, ahead_cells, strict=True):
            here = evaluate_1d(c, i + margin, p + 0.5 - i)
            there = evaluate_1d(c, j + margin, q + 0.5 - j)
            sign = 1.0 if border == "wrap" else -1.0
            np.testing.assert_allclose(
                there, [here[0], sign * here[1], here[2]], atol=100 * ROUNDING
            )


def test_profile_derivatives_match_finite_differences():
    coefficients = spline_coefficients(_random(12), "wrap")
    for cell in range(1, 12):
        for t in (0.1, 0.5, 0.93):
            _, slope, curvature = evaluate_1d(coefficients, cell, t)
            before = evaluate_1d(coefficients, cell, t - STEP)
            after = evaluate_1d(coefficients, cell, t + STEP)
            assert slope == pytest.approx((after[0] - before[0]) / (2 * STEP), abs=DIFFERENCE)
            assert curvature == pytest.approx((after[1] - before[1]) / (2 * STEP), abs=DIFFERENCE)


def test_map_derivatives_match_finite_differences():
    coefficients = spline_coefficients(_random(8, 9), "mirror")
    rng = np.random.default_rng(2)
    for _ in range(60):
        row, column = rng.integers(1, 8), rng.integers(1, 9)
        tv, tu = rng.uniform(0.1, 0.9, 2)
        _, s_u, s_v, s_uu, s_uv, s_vv = evaluate_2d(coefficients, row, column, tv, tu)

        def change(dv: float, du: float, row=row, column=column, tv=tv, tu=tu) -> np.ndarray:
            after = evaluate_2d(coefficients, row, column, tv + dv, tu + du)
            before = evaluate_2d(coefficients, row, column, tv - dv, tu - du)
            return (np.array(after) - np.array(before)) / (2 * STEP)

        along_u, along_v = change(0.0, STEP), change(STEP, 0.0)
        np.testing.assert_allclose([s_u, s_uu, s_uv], along_u[[0, 1, 2]], atol=DIFFERENCE)
        np.testing.assert_allclose([s_v, s_uv, s_vv], along_v[[0, 1, 2]], atol=DIFFERENCE)


def test_value_slope_and_curvature_are_continuous_across_cells():
    coefficients = spline_coefficients(_random(10), "wrap")
    for cell in range(10):
        left = evaluate_1d(coefficients, cell, 1.0)
        right = evaluate_1d(coefficients, cell + 1, 0.0)
        np.testing.assert_allclose(left, right, atol=100 * ROUNDING)


def test_quadratics_are_reproduced_away_from_the_ends():
    # The spline reproduces cubics; the ends disturb it by 0.27 a sample, so 30 samples suffice.
    x = np.arange(80) + 0.5
    coefficients = spline_coefficients(0.01 * (x - 40) ** 2, "mirror")
    places = np.linspace(35, 45, 101)
    values = kernel_values(coefficients, places)
    slopes = spline_along(coefficients)(places, nu=1)
    np.testing.assert_allclose(values, 0.01 * (places - 40) ** 2, atol=1e-12)
    np.testing.assert_allclose(slopes, 0.02 * (places - 40), atol=1e-12)
