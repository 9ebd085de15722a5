"""The spline passes through its samples, and goes on beyond its ends as its border says."""

import numpy as np
import pytest
from scipy import ndimage

from asperity.texture.spline import spline_coefficients

SHAPES = [(1,), (2,), (5,), (300,), (4, 4), (7, 3), (64, 200)]
SCIPY = {"wrap": "grid-wrap", "mirror": "reflect"}


def at_samples(coefficients):
    """Return the spline at its samples: (1, 4, 1) / 6 along every axis."""
    for axis in range(coefficients.ndim):
        c = np.moveaxis(coefficients, axis, 0)
        coefficients = np.moveaxis((c[:-2] + 4.0 * c[1:-1] + c[2:]) / 6.0, 0, axis)
    return coefficients


@pytest.mark.parametrize("border", ["wrap", "mirror"])
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_the_spline_passes_through_every_sample_and_what_lies_beyond(shape, border):
    heights = np.random.default_rng(3).normal(size=shape)
    margin = min(3, *shape)
    found = at_samples(spline_coefficients(heights, border, margin))
    mode = {"wrap": "wrap", "mirror": "symmetric"}[border]
    np.testing.assert_allclose(found, np.pad(heights, margin + 1, mode=mode), atol=2e-14)


@pytest.mark.parametrize("border", ["wrap", "mirror"])
def test_long_ones_are_those_of_scipy(border):
    heights = np.random.default_rng(4).normal(size=(80, 50))
    expected = ndimage.spline_filter(heights, 3, np.float64, SCIPY[border])
    np.testing.assert_allclose(
        spline_coefficients(heights, border)[2:-2, 2:-2], expected, atol=1e-12
    )
