"""The dragged hand against solve_ivp, closed forms and a brute-force notch; its statuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

import naive
from asperity.dynamics.dragged_hand.hand import Hand, MotionStatus, drag
from asperity.dynamics.dragged_hand.periodic_motion import PERIODIC_TOLERANCE
from asperity.errors import AsperityError
from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.piecewise import PiecewiseCubic, tabulate

MM = 1e-3
ACCURACY = 2e-5  # of the largest |u''|; the metrics of the study need 1e-3
PATH = 1e-6  # of the period, and of the drive's speed, likewise
HAND = Hand()


def _table(surface, diameter, force, tolerance=1e-6) -> PiecewiseCubic:
    trace = surface.tracer(diameter * MM)
    return tabulate(
        lambda u: force * trace(u).slope, surface.period, cells=surface.cells, tolerance=tolerance
    )


def _sinusoid(spacing, diameter=3.0, force=0.58, **more):
    return _table(Sinusoid(0.1 * MM, spacing * MM), diameter, force, **more)


def _reference(surface, diameter, force, table, hand, speed, times, start):
    trace = surface.tracer(diameter * MM)
    return naive.ride(
        lambda u: force * float(trace(u).slope), table.jumps, surface.period,
        (hand.mass, hand.stiffness, hand.damping), speed, times, start,
    )  # fmt: skip


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


RIDES = {
    "one kink a period": (Sinusoid(0.1 * MM, 1.3 * MM), 3.0, 0.58, 0.042, HAND),
    "fine and fast": (Sinusoid(0.1 * MM, 1.0 * MM), 2.0, 0.87, 0.169, HAND),
    "near the drop point": (Sinusoid(0.1 * MM, 2.4 * MM), 3.0, 0.58, 0.083, HAND),
    "no kinks": (Sinusoid(0.1 * MM, 3.5 * MM), 3.0, 0.58, 0.042, HAND),
    "strong and slow": (Sinusoid(0.1 * MM, 2.0 * MM), 3.0, 0.58, 0.02, HAND),
    "subharmonic": (Sinusoid(0.1 * MM, 3.5 * MM), 3.0, 5.0, 0.042, HAND),
    "trapezoids": (Grating(0.4 * MM, 1.5 * MM, 0.25 * MM, 0.3 * MM), 3.0, 0.2, 0.083, HAND),
    "square ridges": (Grating(0.2 * MM, 1.0 * MM), 2.0, 0.2, 0.169, HAND),
    "dots": (DotPlate(1.2 * MM, columns=3, rows=2), 3.0, 0.2, 0.083, HAND),
    "overdamped": (Sinusoid(0.1 * MM, 1.3 * MM), 3.0, 0.58, 0.042, Hand(0.02, 100.0, 8.0)),
    "ringing": (Sinusoid(0.1 * MM, 1.3 * MM), 3.0, 0.3, 0.083, Hand(0.1, 900.0, 1.5)),
}


@pytest.mark.parametrize("name", RIDES)
def test_motion_is_that_of_an_event_driven_high_order_solver(name):
    surface, diameter, force, speed, hand = RIDES[name]
    table = _table(surface, diameter, force)
    motion = drag(table, hand, speed)
    assert motion.status == (
        MotionStatus.SUBHARMONIC if name == "subharmonic" else MotionStatus.PERIODIC
    )
    times = np.arange(motion.acceleration.size) * motion.step
    ride = _reference(
        surface, diameter, force, table, hand, speed, times, (motion.place[0], motion.speed[0])
    )
    scale = max(np.abs(ride.extremes))
    np.testing.assert_allclose(motion.place, ride.place, atol=PATH * surface.period)
    np.testing.assert_allclose(motion.speed, ride.speed, atol=PATH * speed * 10)
    assert motion.largest == pytest.approx(ride.extremes[1], abs=ACCURACY * scale)
    assert motion.smallest == pytest.approx(ride.extremes[0], abs=ACCURACY * scale)
    # A sample that falls within 1e-5 of a period of a jump may lie on its other side.
    differs = np.abs(motion.acceleration - ride.acceleration) > ACCURACY * scale
    assert np.count_nonzero(differs) <= 1
    assert _rms(motion.acceleration[~differs]) == pytest.approx(
        _rms(ride.acceleration[~differs]), rel=ACCURACY
    )


@pytest.mark.parametrize(
    ("spacing", "force", "speed"), [(1.3, 0.58, 0.042), (2.0, 1.0, 0.042), (3.0, 5.0, 0.083)]
)
def test_every_moment_from_the_start_is_that_of_the_solver(spacing, force, speed):
    # The latter two are thrown back over jumps, and leap on: motion in both directions.
    surface = Sinusoid(0.1 * MM, spacing * MM)
    table = _table(surface, 3.0, force)
    motion = drag(table, HAND, speed, settle=0.0, length=3 * surface.period)
    times = np.arange(motion.acceleration.size) * motion.step
    ride = _reference(surface, 3.0, force, table, HAND, speed, times, (0.0, speed))
    np.testing.assert_allclose(motion.place, ride.place, atol=10 * PATH * surface.period)
    assert motion.largest == pytest.approx(ride.extremes[1], rel=1e-3)
    assert motion.smallest == pytest.approx(ride.extremes[0], rel=1e-3)
    if force > 0.9:
        assert np.min(motion.speed) < -0.5 * speed


@pytest.mark.parametrize("jump", [0.0, 4.0])
def test_errors_fall_by_order_four_with_refine(jump):
    # So strong a force that its errors stand above rounding at 256 steps a period.
    period = 2 * MM
    table = tabulate(
        lambda u: 6 * np.sin(2 * np.pi * u / period) + jump * (0.5 - np.mod(u / period - 0.3, 1)),
        period, cells=256, tolerance=1e-9,
    )  # fmt: skip
    assert table.jumps.size == (1 if jump else 0)
    runs = [
        drag(table, HAND, 0.169, refine=refine, settle=0.0, length=3 * period)
        for refine in (1, 2, 4, 16)
    ]
    every = [round(run.acceleration.size / runs[0].acceleration.size) for run in runs]
    places = [run.place[::k] for run, k in zip(runs, every, strict=True)]
    errors = [np.max(np.abs(place - places[-1])) / period for place in places[:-1]]
    assert errors[0] < 1e-7
    assert errors[1] < errors[0] / 8
    assert errors[2] < errors[1] / 4 or errors[2] < 1e-10


def test_without_texture_the_hand_stays_with_the_drive():
    table = tabulate(lambda u: np.zeros_like(u), 1 * MM)
    motion = drag(table, HAND, 0.042)
    times = np.arange(motion.speed.size) * motion.step
    assert motion.status == MotionStatus.PERIODIC
    np.testing.assert_allclose(motion.place, 0.042 * times, atol=1e-15)
    np.testing.assert_allclose(motion.speed, 0.042, rtol=1e-12)
    assert abs(motion.largest) < 1e-9
    assert abs(motion.smallest) < 1e-9


def test_a_constant_force_holds_the_hand_back_by_force_over_stiffness():
    table = tabulate(lambda u: np.full_like(u, 0.3), 1 * MM)
    motion = drag(table, HAND, 0.042, settle=2.0, length=1 * MM)
    np.testing.assert_allclose(motion.lag, -0.3 / HAND.stiffness, atol=1e-9 * MM)
    drive = motion.place - motion.lag
    np.testing.assert_allclose(np.diff(drive), 0.042 * motion.step, rtol=1e-9)
    assert drive[0] == pytest.approx(0.042 * motion.settled_after % (1 * MM), abs=1e-9 * MM)


@pytest.mark.parametrize("speed", [0.002, 0.02, 0.2])
@pytest.mark.parametrize("hand", [HAND, Hand(0.2, 2000.0, 1.0), Hand(0.01, 50.0, 20.0)])
def test_a_weak_sinusoidal_force_gives_the_harmonic_response(speed, hand):
    period, strength = 2 * MM, 1e-7  # [N]: the lag, below 1e-8 m, does not change the phase
    table = tabulate(lambda u: strength * np.sin(2 * np.pi * u / period), period, tolerance=1e-9)
    assert drag(table, hand, speed).status == MotionStatus.PERIODIC
    omega = 2 * np.pi * speed / period
    response = -strength / (hand.stiffness - hand.mass * omega**2 + 1j * hand.damping * omega)
    # A tiny response counts as settled early: compare after 30 time constants.
    settled = drag(table, hand, speed, settle=30 * hand.time_constant, length=period)
    times = np.arange(settled.speed.size) * settled.step
    phase = omega * (settled.settled_after + times)
    wanted = np.imag(response * np.exp(1j * phase)) * -(omega**2)
    size = abs(response) * omega**2
    np.testing.assert_allclose(settled.acceleration, wanted, atol=2e-4 * size)
    assert settled.largest == pytest.approx(size, rel=2e-4)
    assert settled.smallest == pytest.approx(-size, rel=2e-4)


def _brute_notch(surface, diameter, force, hand, speed, place, rate, duration):
    """Integrate by a million plain steps; jumps become ramps of 1/20000 of the period."""
    count, period = 20000, surface.period
    slope = surface.tracer(diameter * MM)((np.arange(count) + 0.5) / count * period).slope
    force_at = (force * np.append(slope, slope[0])).tolist()
    u, s, step, rows = place, rate, 2e-6, []
    for i in range(round(duration / step)):
        x = (u / period) % 1.0 * count - 0.5
        k = math.floor(x)
        f = force_at[k] + (x - k) * (force_at[k + 1] - force_at[k])
        pull = hand.stiffness * (speed * i * step - u) + hand.damping * (speed - s)
        s += step * (pull - f) / hand.mass
        u += step * s
        rows.append(u)
    return np.array(rows), step


@pytest.mark.parametrize(("spacing", "force", "speed"), [(1.0, 0.58, 2e-3), (2.0, 1.5, 5e-3)])
def test_a_slow_hand_rests_in_the_notch_until_it_is_pulled_out(spacing, force, speed):
    surface = Sinusoid(0.1 * MM, spacing * MM)
    motion = drag(_table(surface, 3.0, force), HAND, speed, refine=2, settle=0.0,
                  length=3 * surface.period)  # fmt: skip
    duration = motion.duration - motion.step
    brute, step = _brute_notch(surface, 3.0, force, HAND, speed, 0.0, speed, duration)
    times = np.arange(motion.place.size) * motion.step
    found = np.interp(times, (np.arange(brute.size) + 1) * step, brute)
    # At a leap from notch to notch 1e-4 of the period in time is more in place.
    miss = np.abs(motion.place - found) / surface.period
    assert np.quantile(miss, 0.95) < 1e-3
    assert np.max(miss) < 2e-2
    resting = motion.speed == 0.0
    assert np.mean(resting) > 0.1
    assert np.all(motion.acceleration[resting] == 0.0)
    notch = np.mod(motion.place[resting] / surface.period, 1.0)
    np.testing.assert_allclose(notch, 0.5, atol=1e-7)


COMMON = [
    (spacing, diameter, force, speed)
    for spacing in (0.5, 1.3, 3.5)
    for diameter, force, speed in (
        (2.0, 0.58, 0.083), (3.0, 0.58, 0.083), (4.0, 0.58, 0.083),
        (3.0, 0.29, 0.083), (3.0, 0.87, 0.083), (3.0, 0.58, 0.042), (3.0, 0.58, 0.169),
    )
]  # fmt: skip


@pytest.mark.parametrize(("spacing", "diameter", "force", "speed"), COMMON)
def test_common_settings_are_periodic_and_close_their_orbit(spacing, diameter, force, speed):
    motion = drag(_sinusoid(spacing, diameter, force), HAND, speed)
    assert motion.status == MotionStatus.PERIODIC
    assert motion.periods == 1
    assert motion.mismatch <= PERIODIC_TOLERANCE
    assert motion.duration == pytest.approx(spacing * MM / speed, rel=1e-12)
    assert motion.largest >= np.max(motion.acceleration)
    assert motion.smallest <= np.min(motion.acceleration)
    # The hand trails the drive, which sets out at the start of the first period.
    assert -HAND.damping * 0.5 < motion.place[0] / (spacing * MM) < 0.5


@pytest.mark.parametrize("spacing", [1.9, 2.45])
def test_the_periodic_motion_attracts_what_starts_beside_it(spacing):
    # At 42 mm/s the hand takes long to settle here, alternating between two motions.
    surface, speed = Sinusoid(0.1 * MM, spacing * MM), 0.042
    table = _table(surface, 3.0, 0.58)
    motion = drag(table, HAND, speed)
    assert motion.status == MotionStatus.PERIODIC
    beside = (motion.place[0] + 1e-3 * surface.period, motion.speed[0])
    times = np.arange(0, 14) * surface.period / speed
    ride = _reference(surface, 3.0, 0.58, table, HAND, speed, times, beside)
    away = np.abs(ride.place - speed * times - motion.place[0]) / surface.period
    assert away[0] == pytest.approx(1e-3)
    assert np.max(away[-4:]) < 0.25e-3


@pytest.mark.parametrize(
    ("spacing", "force", "speed", "periods"), [(3.5, 5.0, 0.042, 2), (2.0, 5.0, 0.005, 3)]
)
def test_a_subharmonic_motion_repeats_after_its_periods_and_not_after_one(
    spacing, force, speed, periods
):
    table = _sinusoid(spacing, 3.0, force)
    motion = drag(table, HAND, speed, refine=8)
    assert motion.status == MotionStatus.SUBHARMONIC
    assert motion.periods == periods
    assert motion.place.size % periods == 0
    length = spacing * MM
    before = motion.settled_after * (1 - 1e-9)  # not a step more, for rounding
    long = drag(table, HAND, speed, refine=8, settle=before, length=2 * periods * length)
    once = motion.place[:: round(long.step / motion.step)]
    steps = once.size // periods
    assert long.place.size == 2 * once.size
    # The record has finer steps than the drag before it.
    np.testing.assert_allclose(long.place[: once.size], once, atol=2e-3 * length)
    after_all = long.place[once.size :] - periods * length
    np.testing.assert_allclose(after_all, long.place[: once.size], atol=1e-5 * length)
    for fewer in range(1, periods):
        later = long.place[fewer * steps : fewer * steps + once.size] - fewer * length
        assert np.max(np.abs(later - once)) > 2e-2 * length


def test_a_slowly_settling_motion_is_not_called_subharmonic():
    # Near a motion that alternates while it settles, every second period is nearly the same.
    for spacing in (2.3, 2.35, 2.4, 2.45):
        for extrapolate in (True, False):
            motion = drag(_sinusoid(spacing), HAND, 0.042, extrapolate=extrapolate)
            assert motion.status != MotionStatus.SUBHARMONIC


def test_a_motion_that_never_repeats_says_so():
    motion = drag(_sinusoid(1.6), HAND, 0.03)
    assert motion.status == MotionStatus.APERIODIC
    assert motion.mismatch > 100 * PERIODIC_TOLERANCE
    assert motion.periods > 8
    ends = [
        drag(_sinusoid(1.6), HAND, 0.03, settle=3.0, length=k * 1.6 * MM).place[-1] - k * 1.6 * MM
        for k in range(1, 9)
    ]
    assert np.min(np.abs(np.diff(ends))) > 1e-5 * MM


def test_extrapolation_ends_in_the_motion_that_dragging_ends_in():
    for spacing, force, speed in ((1.3, 0.58, 0.083), (0.5, 0.87, 0.042), (3.5, 0.29, 0.169)):
        table = _sinusoid(spacing, 3.0, force)
        ahead, dragged = (drag(table, HAND, speed, extrapolate=way) for way in (True, False))
        assert ahead.settled_after <= dragged.settled_after
        np.testing.assert_allclose(ahead.place, dragged.place, atol=1e-4 * spacing * MM)
        assert ahead.largest == pytest.approx(dragged.largest, rel=1e-3)


@pytest.mark.parametrize("damping", [6.82, 6.83, 6.838, 6.83893951287493, 6.84, 6.85])
def test_extrapolation_does_not_lead_away_from_a_motion_that_is_all_but_found(damping):
    """There the Jacobian is rounding's; jumps by it, repeated, ended a hundred metres away."""
    table = _sinusoid(2.4570492134007547)
    hand = Hand(0.04672751429017279, 263.463213648087, damping)
    ahead, dragged = (drag(table, hand, 0.083, extrapolate=way) for way in (True, False))
    assert ahead.status == MotionStatus.PERIODIC
    assert ahead.mismatch <= 1.1 * PERIODIC_TOLERANCE
    assert ahead.largest == pytest.approx(dragged.largest, rel=1e-3)
    assert _rms(ahead.acceleration) == pytest.approx(_rms(dragged.acceleration), rel=1e-3)


@pytest.mark.parametrize("shift", [0.0, 0.1234, 0.5, 0.5 + 1e-12, 0.9])
@pytest.mark.parametrize("start", [0.0, 0.3, -7.7, 0.5])
def test_motion_does_not_depend_on_where_the_table_or_the_drive_begins(shift, start):
    # shift = 0.5 puts the jump on the table's first edge.
    surface, speed = Sinusoid(0.1 * MM, 1.3 * MM), 0.042
    trace, period = surface.tracer(3 * MM), surface.period
    shifted = tabulate(lambda u: 0.58 * trace(u + shift * period).slope, period)
    wanted = drag(_table(surface, 3.0, 0.58), HAND, speed)
    motion = drag(shifted, HAND, speed, start=start * period)
    assert motion.largest == pytest.approx(wanted.largest, rel=1e-3)
    assert motion.smallest == pytest.approx(wanted.smallest, rel=1e-3)
    # `place` counts from the start of the period in which the drive sets out.
    lag = motion.place[0] - math.fmod(start, 1.0) * period
    assert abs(lag) < 0.5 * period
    phase = math.fmod(start, 1.0) + shift
    moment = np.mod(phase, 1.0) * period / speed
    path = np.append(wanted.place, wanted.place[0] + period)
    there = np.interp(moment, np.arange(path.size) * wanted.step, path) - speed * moment
    assert lag == pytest.approx(there, abs=1e-3 * period)


@pytest.mark.parametrize("tiles", [2, 3])
def test_motion_does_not_depend_on_how_many_periods_the_table_holds(tiles):
    surface, speed = Sinusoid(0.1 * MM, 1.3 * MM), 0.042
    trace = surface.tracer(3 * MM)
    table = tabulate(lambda u: 0.58 * trace(u).slope, tiles * surface.period, cells=64 * tiles)
    assert table.jumps.size == tiles
    wanted = drag(_table(surface, 3.0, 0.58), HAND, speed)
    motion = drag(table, HAND, speed)
    assert motion.status == MotionStatus.PERIODIC
    assert motion.largest == pytest.approx(wanted.largest, rel=ACCURACY)
    assert motion.smallest == pytest.approx(wanted.smallest, rel=ACCURACY)
    assert _rms(motion.acceleration) == pytest.approx(_rms(wanted.acceleration), rel=1e-2)


def test_settle_and_length_set_the_record():
    motion = drag(_sinusoid(1.3), HAND, 0.042, settle=0.2, length=10 * MM)
    assert motion.duration == pytest.approx(10 * MM / 0.042, abs=motion.step)
    assert 0.2 <= motion.settled_after <= 0.2 + 1e-3
    assert motion.status == MotionStatus.APERIODIC
    assert math.isnan(motion.mismatch)
    later = drag(_sinusoid(1.3), HAND, 0.042, settle=0.0, length=30 * MM)
    skip = round(motion.settled_after / motion.step)
    size = motion.speed.size
    np.testing.assert_allclose(later.speed[skip : skip + size], motion.speed, rtol=1e-6)
    whole = later.place[skip : skip + size] - motion.place
    np.testing.assert_allclose(whole, round(whole[0] / (1.3 * MM)) * 1.3 * MM, atol=1e-9)


HANDS = {
    "default": HAND,
    "light": Hand(1e-4, 300.0, 0.3),
    "heavy": Hand(5.0, 300.0, 20.0),
    "stiff": Hand(0.05, 1e5, 30.0),
    "overdamped": Hand(0.05, 300.0, 60.0),
    "ringing": Hand(0.05, 300.0, 0.05),
}


@pytest.mark.parametrize("name", HANDS)
def test_every_motion_is_finite(name):
    hand = HANDS[name]
    for spacing in (0.3, 2.0, 3.5):
        for force in (0.0, 0.1, 5.0):
            table = _sinusoid(spacing, force=1.0).scaled(force)
            for speed in (1e-4, 3e-3, 0.042, 1.0, 30.0):
                motion = drag(table, hand, speed, settle=0.0, length=2 * spacing * MM)
                for part in (motion.place, motion.speed, motion.acceleration):
                    assert np.all(np.isfinite(part))
                assert motion.largest >= np.max(motion.acceleration)
                assert motion.smallest <= np.min(motion.acceleration)
                # A force of at most F, never more than 0.5 here, pushes no damped mass on a
                # spring farther than twice its rest; one that rings may add up two pushes.
                swing = force * 0.5 / hand.stiffness
                lag = motion.place - speed * np.arange(motion.place.size) * motion.step
                assert np.max(np.abs(lag)) <= (4.0 if name == "ringing" else 2.0) * swing + 1e-12


@pytest.mark.parametrize("speed", [1e-4, 1e-3])
@pytest.mark.parametrize("spacing", [0.3, 1.0, 3.5])
def test_a_very_slow_drive_does_not_outrun_the_hand(spacing, speed):
    # A step of a fixed part of the period would be longer than the hand's own swing.
    motion = drag(_sinusoid(spacing, force=0.1), HAND, speed)
    finer = drag(_sinusoid(spacing, force=0.1), HAND, speed, refine=2)
    assert motion.status == finer.status
    assert motion.largest == pytest.approx(finer.largest, rel=0.01)
    assert motion.smallest == pytest.approx(finer.smallest, rel=0.01)


def test_time_constant_is_that_of_the_slowest_part_of_a_free_motion():
    for hand in (HAND, Hand(0.05, 300.0, 0.1), Hand(0.05, 300.0, 7.8), Hand(0.05, 300.0, 100.0)):
        rates = np.roots([hand.mass, hand.damping, hand.stiffness]).real
        assert hand.time_constant == pytest.approx(-1 / np.max(rates), rel=1e-6)
    # So much damping that a difference of rates would be lost in rounding.
    assert Hand(0.05, 300.0, 1e9).time_constant == pytest.approx(1e9 / 300.0, rel=1e-9)


TABLE = PiecewiseCubic(np.array([0.0, 1 * MM]), np.zeros((1, 4)), np.empty(0), 0.0)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        *[
            (lambda name=name, bad=bad: Hand(**{name: bad}), name)
            for name in ("mass", "stiffness", "damping")
            for bad in (0.0, -1.0, math.nan, math.inf)
        ],
        *[
            (lambda bad=bad: drag(TABLE, HAND, bad), "speed")
            for bad in (0.0, -0.1, math.nan, math.inf)
        ],
        (lambda: drag(TABLE, HAND, 0.1, start=math.nan), "start"),
        (lambda: drag(TABLE, HAND, 0.1, refine=0.0), "refine"),
        (lambda: drag(TABLE, HAND, 0.1, refine=math.nan), "refine"),
        (lambda: drag(TABLE, HAND, 0.1, settle=1.0), "settle and length"),
        (lambda: drag(TABLE, HAND, 0.1, length=1.0), "settle and length"),
        (lambda: drag(TABLE, HAND, 0.1, settle=-1.0, length=1.0), "settle"),
        (lambda: drag(TABLE, HAND, 0.1, settle=1.0, length=0.0), "length"),
        (lambda: drag(TABLE, HAND, 0.1, settle=1.0, length=math.nan), "length"),
    ],
)
def test_bad_values_are_named(make, name):
    with pytest.raises(AsperityError, match=name):
        make()
