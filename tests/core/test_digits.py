"""Numbers are written with as many digits as their comparison needs."""

import numpy as np
import pytest

from asperity._core.digits import plain_number, telling


def test_a_number_beyond_its_limit_does_not_look_like_it():
    assert telling([0.0503], [0.05], digits=2) == ["0.0503"]
    assert telling([0.0496], [0.05], digits=2) == ["0.0496"]
    assert telling([0.05], [0.05], digits=2) == ["0.05"]
    assert telling([0.9002, 0.96], [0.9], digits=2) == ["0.9002", "0.96"]


def test_neighbours_that_differ_are_written_so():
    assert telling([2.0301, 2.0299]) == ["2.0301", "2.0299"]
    assert telling([2.1, 2.1]) == ["2.1", "2.1"]


def test_verdicts_can_be_read_off_what_is_written():
    rng = np.random.default_rng(1)
    for _ in range(500):
        limit = rng.uniform(0.01, 10.0)
        value = limit * (1.0 + 10.0 ** rng.uniform(-6.0, 0.0) * rng.choice([-1, 1]))
        (text,) = telling([value], [float(limit)])
        assert (float(text) > limit) == (value > limit)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (80312.0, "80\u202f300"),
        (999.6, "1\u202f000"),
        (0.00123456, "0.00123"),
        (-2500.0, "-2\u202f500"),
        (1.5, "1.5"),
        (0.0, "0"),
        (2.5e-5, "2.5 × 10⁻⁵"),
    ],
)
def test_powers_of_ten_only_where_they_are_tiny(value, text):
    assert plain_number(value) == text


def test_few_digits_of_a_large_number_are_no_power_of_ten():
    assert plain_number(104.2, 2) == "100"
    assert plain_number(12345.0, 2) == "12\u202f000"
