"""Line spectral frequencies: there and back, in order, and stable when mixed."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.vibrotactile.lsf import (
    are_stable,
    coefficients_of,
    frequencies_of,
    is_stable,
    power_gain,
    reflections_of,
)


def stable(rng, order, size=0.9):
    a = np.ones(1)
    for k in rng.uniform(-size, size, order):
        a = np.append(a, 0.0) + k * np.append(0.0, a[::-1])
    return a


@pytest.mark.parametrize("order", [1, 2, 3, 8, 17, 24])
def test_coefficients_come_back(order):
    rng = np.random.default_rng(order)
    for _ in range(20):
        a = stable(rng, order)
        lsf = frequencies_of(a)
        assert are_stable(lsf)
        assert lsf.size == order
        assert coefficients_of(lsf) == pytest.approx(a, abs=1e-9 * np.abs(a).max())


def test_white_noise_has_even_frequencies():
    # A = 1: the sum has its zeros where z^(p+1) = -1, the difference where it is 1.
    assert frequencies_of([1.0, 0.0, 0.0, 0.0]) == pytest.approx(np.pi * np.arange(1, 4) / 4)


def test_the_first_belongs_to_the_sum():
    # Of order 2 by hand: a pole pair at radius r and angle w.
    r, w = 0.9, 0.7
    first, second = frequencies_of([1.0, -2 * r * np.cos(w), r * r])
    b, c = -2 * r * np.cos(w), r * r
    assert -2 * np.cos(first) == pytest.approx(b + c - 1)
    assert -2 * np.cos(second) == pytest.approx(b - c + 1)


def test_any_mean_of_stable_filters_is_stable():
    rng = np.random.default_rng(0)
    for _ in range(50):
        rows = np.array([frequencies_of(stable(rng, 12, 0.97)) for _ in range(3)])
        a = coefficients_of(rng.dirichlet(np.ones(3)) @ rows)
        assert np.max(np.abs(np.roots(a))) < 1.0
        assert is_stable(a)


def test_a_mean_of_coefficients_need_not_be():
    # Why the frequencies are mixed: two stable filters whose mean coefficients ring up.
    rng, found = np.random.default_rng(1), 0
    for _ in range(300):
        a, b = stable(rng, 6, 0.99), stable(rng, 6, 0.99)
        found += not is_stable(0.5 * (a + b))
    assert found > 0


def test_reflections_and_power_of_a_first_order():
    assert reflections_of([1.0, -0.8]) == pytest.approx([-0.8])
    assert power_gain([1.0, -0.8]) == pytest.approx(1.0 / (1.0 - 0.64))


def test_an_unstable_filter_is_refused():
    assert not is_stable([1.0, -2.1, 1.1])
    with pytest.raises(AsperityError, match="not stable"):
        frequencies_of([1.0, 0.0, 1.0])
