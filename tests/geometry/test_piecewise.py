"""Tables of cubics: as good as promised between jumps, and every jump where it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity.geometry.offsets.analytic import Sinusoid
from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.piecewise import PiecewiseCubic, mirrored, tabulate
from asperity.geometry.offsets.sampled import SampledProfile

PLACE = 1e-8  # of the period: where a jump is put
NEAR = 1e-7  # of the period: nearer to a jump than this, neither side is wrong
SLACK = 3.0  # the tolerance is checked at four places of an interval, not at all
MM = 1e-3


def _sawtooth(u, jump, size, period=1.0):
    """Return a line that falls by `size` over the period and jumps up by it at `jump`."""
    return size * (0.5 - np.mod((u - jump) / period, 1.0))


def _distance(a, b, period=1.0):
    across = np.abs(np.subtract.outer(a, b)) % period
    return np.minimum(across, period - across)


def _check(function, table, tolerance, jumps):
    assert table.jumps.size == len(jumps)
    if len(jumps):
        assert np.max(np.min(_distance(table.jumps, jumps), axis=1)) < PLACE
    assert np.all(np.isin(table.jumps, table.edges))
    u = np.random.default_rng(0).uniform(0, 1, 20000)
    clear = np.ones(u.size, dtype=bool)
    if len(jumps):
        clear = np.min(_distance(u, jumps), axis=1) > NEAR
    largest = np.max(np.abs(function(u)))
    miss = np.max(np.abs(table(u) - function(u))[clear])
    assert miss <= SLACK * tolerance * largest
    assert np.all(np.diff(table.edges) > 0)
    assert table.edges[0] == 0.0
    assert table.edges[-1] == table.period == 1.0


SMOOTH = {
    "sine": lambda u: np.sin(2 * np.pi * u),
    "many waves": lambda u: np.sin(22 * np.pi * u) + np.cos(14 * np.pi * u),
    "steep": lambda u: np.exp(30 * (np.cos(2 * np.pi * u) - 1)),
    "constant": lambda u: np.full_like(u, -2.5),
    "zero": lambda u: np.zeros_like(u),
    "kinked": lambda u: np.abs(np.mod(u - 0.3141, 1.0) - 0.5),
}


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("name", SMOOTH)
def test_a_function_without_jumps_is_reproduced_and_has_none(name, tolerance):
    table = tabulate(SMOOTH[name], 1.0, tolerance=tolerance)
    if name == "kinked" and tolerance < 1e-6:
        # Twelve halvings of a cell leave a kink of 2 an error of a tenth of the width.
        assert table.error < 0.2 / 64 / 2**12
        assert table.jumps.size == 0
    else:
        _check(SMOOTH[name], table, tolerance, [])


# Beside an edge the places that are asked do not see a jump: 1e-3 of a cell is 1.6e-5.
BESIDE = [0.25 + s * d for s in (-1, 1) for d in (1e-12, 1e-10, 3e-9, 1e-7, 1e-5, 5e-4, 3e-3)]


@pytest.mark.parametrize("size", [2.0, -2.0, 0.05])
@pytest.mark.parametrize("jump", [0.0, 0.5, 0.25, 0.3, 1 / 3, 1e-9, 1 - 1e-9, 1e-5, *BESIDE])
def test_one_jump_is_found_wherever_it_is(jump, size):
    def function(u):
        return _sawtooth(u, jump, size) + np.sin(2 * np.pi * u)

    _check(function, tabulate(function, 1.0), 1e-6, [jump])


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=5),
    st.floats(-2.0, 2.0).filter(lambda size: abs(size) > 1e-2),
)
def test_jumps_are_found_at_random_places(jumps, size):
    jumps = np.array(jumps)
    apart = _distance(jumps, jumps) + np.eye(jumps.size)
    if np.min(apart) < 2e-3:  # a 1/1024 of the period is searched for one jump
        return

    def function(u):
        return sum(_sawtooth(u, jump, size) for jump in jumps) + 3 * np.cos(2 * np.pi * u)

    _check(function, tabulate(function, 1.0), 1e-6, jumps)


@pytest.mark.parametrize("size", [-3e-3, -1e-3, 1e-3])
def test_a_small_jump_against_a_steep_slope_is_found(size):
    # The jump is smaller than the change over the interval in which it is looked for.
    def function(u):
        return np.sin(2 * np.pi * (u - 0.3)) + _sawtooth(u, 0.3012345, size)

    _check(function, tabulate(function, 1.0), 1e-6, [0.3012345])


def test_two_jumps_in_one_searched_interval_do_no_harm_elsewhere():
    def function(u):
        return _sawtooth(u, 0.3001, 1.0) + _sawtooth(u, 0.3002, 0.7) + np.sin(2 * np.pi * u)

    table = tabulate(function, 1.0)
    u = np.random.default_rng(1).uniform(0, 1, 20000)
    clear = np.min(_distance(u, [0.3001, 0.3002]), axis=1) > 1e-5
    assert np.max(np.abs(table(u) - function(u))[clear]) < 1e-5
    assert np.max(np.min(_distance([0.3001, 0.3002], table.jumps), axis=1)) < 1e-5


def test_a_fine_tolerance_on_many_cells_ends():
    # A jump cannot be bracketed to less than rounding.
    def function(u):
        return _sawtooth(u, 0.123456, 1.0)

    table = tabulate(function, 1.0, cells=4000, tolerance=1e-10)
    assert table.jumps == pytest.approx([0.123456], abs=1e-12)


def test_tables_scale_with_the_period_and_repeat():
    period = 2 * MM
    function = Sinusoid(0.1 * MM, period).tracer(3 * MM)
    table = tabulate(lambda u: function(u).slope, period)
    np.testing.assert_allclose(table.jumps, [1 * MM], atol=PLACE * period)
    u = np.linspace(0.01, 0.49, 100) * period
    np.testing.assert_allclose(table(u), function(u).slope, atol=1e-6)
    np.testing.assert_allclose(table(u - 3 * period), table(u), atol=1e-12)
    np.testing.assert_allclose(table.scaled(-2.5)(u), -2.5 * table(u))
    assert table.scaled(-2.5).error == 2.5 * table.error


def test_the_table_of_a_jittered_dot_plate_has_the_jumps_of_a_dense_scan():
    plate = DotPlate(1.5 * MM, columns=4, rows=2)
    trace = plate.tracer(3 * MM)
    table = tabulate(lambda u: trace(u).slope, plate.period, cells=plate.cells)
    u = np.linspace(0, plate.period, 400001)
    slope = trace(u).slope
    # Smooth parts change by at most pixel / radius * a few; jumps by far more.
    leaps = np.flatnonzero(np.abs(np.diff(slope)) > 2e-3)
    dense = 0.5 * (u[leaps] + u[leaps + 1])
    sizes = np.abs(trace(table.jumps + 1e-9).slope - trace(table.jumps - 1e-9).slope)
    np.testing.assert_allclose(table.jumps[sizes > 2e-3], dense, atol=plate.period / 400000)
    clear = np.min(np.abs(np.subtract.outer(u[::37], table.jumps)), axis=1) > 1e-8
    assert np.max(np.abs(table(u[::37]) - slope[::37])[clear]) < 5e-6


def test_the_table_of_a_rough_profile_stays_small():
    # An unpolished contact makes the slope noisy, and a table of noise is 200 times as long.
    rng = np.random.default_rng(1)
    waves = np.fft.rfftfreq(400)
    waves[0] = np.inf
    heights = np.fft.irfft(waves**-1.3 * np.exp(2j * np.pi * rng.random(waves.size)), 400)
    surface = SampledProfile(heights * 30e-6 / np.std(heights), 0.05 * MM, "wrap")
    trace = surface.tracer(3 * MM)
    table = tabulate(lambda u: trace(u).slope, surface.period, cells=surface.cells)
    assert table.edges.size < 6000
    assert 90 < table.jumps.size < 140
    u = rng.uniform(0, 1, 20000) * surface.period
    miss = np.abs(table(u) - trace(u).slope)
    assert np.quantile(miss, 0.999) < 2e-6
    assert np.mean(miss**2) ** 0.5 < 1e-5


@pytest.mark.parametrize("ends", [0.0, 0.2])
def test_mirrored_table_is_the_table_of_the_odd_continuation(ends):
    def half(u):
        return np.sin(np.pi * u) ** 2 * _sawtooth(u, 0.37, 1.0) + ends * np.cos(np.pi * u)

    def whole(u):
        place = np.mod(u, 2.0)
        return np.where(place <= 1.0, half(place), -half(2.0 - place))

    table = mirrored(tabulate(half, 1.0))
    assert table.period == 2.0
    expected = [0.37, 1.63] if ends == 0.0 else [0.0, 0.37, 1.0, 1.63]
    np.testing.assert_allclose(table.jumps, expected, atol=PLACE)
    assert np.all(np.isin(table.jumps, table.edges))
    assert np.all(np.diff(table.edges) > 0)
    u = np.random.default_rng(2).uniform(0, 2, 5000)
    clear = np.min(_distance(u, expected, 2.0), axis=1) > NEAR
    np.testing.assert_allclose(table(u)[clear], whole(u)[clear], atol=5e-6)


def test_mirrored_jumps_at_the_ends_survive_a_poor_table():
    half = tabulate(lambda u: 0.3 + 0.1 * np.cos(np.pi * u), 1.0)._replace(error=0.05)
    np.testing.assert_array_equal(mirrored(half).jumps, [0.0, 1.0])


def test_call_takes_any_shape_and_the_ends_of_intervals():
    table = PiecewiseCubic(
        np.array([0.0, 1.0, 3.0]), np.array([[1.0, 2.0, 0.0, 0.0], [5.0, 0.0, 0.0, 8.0]]),
        np.array([1.0]), 0.0,
    )  # fmt: skip
    np.testing.assert_allclose(table(np.array([[0.0, 0.5], [1.0, 2.0]])), [[1, 2], [5, 6]])
    assert table(np.array(3.0)) == 1.0
    assert table(np.array(-1.0)) == pytest.approx(6.0)
