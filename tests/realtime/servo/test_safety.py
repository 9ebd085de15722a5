"""Nothing that is not finite, too strong or too sudden gets past `SafeDevice`, whatever comes."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scripted import DT, LIMITS, QUICK, Bench, HandClock, ScriptedDevice, wave

import asperity
from asperity.errors import AsperityError
from asperity.realtime.servo.safety import SafeDevice, SafetySettings
from asperity.simulation.tool_contact import LIMITED, SILENT

SETTINGS = SafetySettings()
NUMBERS = st.floats(width=64, allow_nan=True, allow_infinity=True) | st.floats(-5.0, 5.0)


def begun(settings=SETTINGS):
    clock = HandClock()
    device = ScriptedDevice(clock)
    safe = SafeDevice(device, dt=DT, settings=settings)
    safe.begin(clock.time)
    return clock, device, safe


def ticks(clock, safe, wrench, count, **options):
    for _ in range(count):
        clock.work(DT)
        safe.read(clock.time)
        safe.write(np.array(wrench, dtype=float), clock.time, **options)


def assert_safe(device, settings=SETTINGS):
    sent = np.array([wrench for _, wrench in device.written])
    assert np.isfinite(sent).all()
    force = np.linalg.norm(sent[:, :3], axis=1)
    torque = np.linalg.norm(sent[:, 3:], axis=1)
    assert force.max() <= LIMITS.max_force * (1 + 1e-12)
    assert torque.max() <= LIMITS.max_torque * (1 + 1e-12)
    # Faster than the slew limit only to zero.
    for part, most in ((sent[:, :3], LIMITS.max_force), (sent[:, 3:], LIMITS.max_torque)):
        steps = np.linalg.norm(np.diff(part, axis=0, prepend=np.zeros((1, 3))), axis=1)
        to_zero = ~part.any(axis=1)
        assert (steps[~to_zero] <= most * DT / settings.slew * (1 + 1e-9)).all()
    return sent


@given(st.lists(st.tuples(*[NUMBERS] * 6), min_size=1, max_size=60))
@settings(max_examples=150, deadline=None)
def test_no_wrench_gets_past_it(wrenches):
    clock, device, safe = begun(SafetySettings(soft_start=3e-3))
    for wrench in wrenches:
        ticks(clock, safe, wrench, 1)
    assert_safe(device)
    assert safe.counts.not_finite == sum(not math.isfinite(sum(w)) for w in wrenches)


@given(st.lists(st.tuples(*[NUMBERS] * 13), min_size=1, max_size=30), st.floats(allow_nan=True))
@settings(max_examples=150, deadline=None)
def test_no_reading_gets_past_it(poses, age):
    """Whatever a device says of itself, what the loop gets is a pose, and near."""
    clock, device, safe = begun()
    for numbers in poses:
        device.pose = lambda t, numbers=numbers: numbers[:7]
        device.twist = lambda t, numbers=numbers: numbers[7:]
        device.age = lambda t: age
        ticks(clock, safe, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 1)
        pose, twist = safe.reading.pose, safe.reading.twist
        assert np.isfinite(pose).all()
        assert np.isfinite(twist).all()
        assert np.linalg.norm(pose[3:]) == pytest.approx(1.0, abs=1e-12)
        assert np.linalg.norm(pose[:3]) <= 2.0 * LIMITS.radius * (1 + 1e-12)
        assert np.linalg.norm(twist[:3]) <= 10.0 * (1 + 1e-12)
        assert np.linalg.norm(twist[3:]) <= 100.0 * (1 + 1e-12)
    assert_safe(device)


def test_limits_hold_the_norm_and_keep_the_direction():
    clock, device, safe = begun()
    ticks(clock, safe, [30.0, 0.0, 40.0, 0.0, 2.0, 0.0], 400)
    sent = assert_safe(device)
    np.testing.assert_allclose(sent[-1], [1.8, 0.0, 2.4, 0.0, 0.1, 0.0], rtol=1e-9)
    assert safe.flags & LIMITED
    assert safe.counts.clamped_force > 300
    assert safe.counts.clamped_torque > 300


def test_a_user_s_limit_only_lowers():
    _, _, low = begun(SafetySettings(max_force=1.0))
    _, _, high = begun(SafetySettings(max_force=100.0))
    assert (low.max_force, high.max_force) == (1.0, LIMITS.max_force)


def test_it_comes_up_softly_and_then_is_left_alone():
    clock, device, safe = begun(SafetySettings(soft_start=0.1))
    ticks(clock, safe, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 150)
    np.testing.assert_allclose(device.forces[:100], np.arange(1, 101) / 100)
    np.testing.assert_array_equal(device.forces[100:], 1.0)
    assert safe.flags == 0


def test_a_wrench_within_limits_is_sent_as_it_is():
    clock, device, safe = begun(QUICK)
    wrench = np.array([0.3, -0.2, 1.0, 0.01, -0.02, 0.03])
    ticks(clock, safe, wrench, 3)
    np.testing.assert_array_equal(device.written[-1][1], wrench)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_wrench_that_is_not_finite_is_zero_at_once(bad):
    clock, device, safe = begun()
    ticks(clock, safe, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 400)
    ticks(clock, safe, [0.0, bad, 2.0, 0.0, 0.0, 0.0], 1)
    assert device.forces[-2] == 2.0
    assert not device.written[-1][1].any()
    assert safe.flags & SILENT
    assert safe.counts.not_finite == 1


@pytest.mark.parametrize(
    "silent", ["nothing new", "old", "never", "nan", "not a rotation", "an exception"]
)
def test_silence_is_zero_in_time_and_comes_back_softly(silent):
    clock, device, safe = begun(SafetySettings(soft_start=0.05))
    ticks(clock, safe, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 200)
    usual = (device.fresh, device.age, device.pose)
    if silent == "nothing new":
        device.fresh = lambda t: False
    elif silent == "an exception":
        device.fresh = lambda t: OSError("cable out")
    elif silent in ("old", "never"):
        device.age = lambda t: 0.02 if silent == "old" else math.inf
    else:
        part = {"nan": (math.nan, 1.0), "not a rotation": (0.0, 7.0)}[silent]
        device.pose = lambda t: np.array([part[0], 0.0, 0.0, part[1], 0.0, 0.0, 0.0])
    ticks(clock, safe, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 50)
    quiet = device.forces[200:]
    # The first of these is a tick after the last reading.
    assert np.argmax(quiet == 0.0) + 1 <= 5  # within 5 ms
    assert (quiet[4:] == 0.0).all()
    device.fresh, device.age, device.pose = usual
    ticks(clock, safe, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 100)
    again = device.forces[250:]
    np.testing.assert_allclose(again[:10], 2.0 * np.arange(1, 11) / 50)
    assert again[-1] == 2.0
    assert safe.counts.silences == 1
    assert safe.counts.silent_ticks == pytest.approx(46, abs=1)
    if silent == "an exception":
        assert safe.counts.last_error == "OSError: cable out"
    if silent in ("nan", "not a rotation"):
        assert safe.counts.bad_readings == 50


def test_after_a_short_silence_it_comes_up_sooner():
    clock, device, safe = begun(SafetySettings(soft_start=0.5))
    ticks(clock, safe, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 600)
    device.fresh = lambda t: False
    ticks(clock, safe, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 8)
    assert device.forces[-1] == 0.0
    device.fresh = lambda t: True
    ticks(clock, safe, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 90)
    assert (np.diff(device.forces[608:680]) > 0.0).all()
    assert device.forces[-1] == 2.0


def test_poses_far_out_are_drawn_in():
    clock, device, safe = begun()
    device.pose = lambda t: np.array([1e9, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    device.twist = lambda t: np.array([0.0, 1e9, 0.0, 0.0, 0.0, 1e9])
    ticks(clock, safe, np.zeros(6), 1)
    assert safe.reading.pose[0] == pytest.approx(2 * LIMITS.radius)
    np.testing.assert_allclose(safe.reading.twist, [0.0, 10.0, 0.0, 0.0, 0.0, 100.0])
    assert safe.counts.workspace_clamps == 1


def test_a_device_that_raises_on_writing_and_closing_does_no_harm():
    clock, device, safe = begun()

    def fails(*_):
        raise OSError("gone")

    device.write = device.close = fails
    ticks(clock, safe, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 3)
    safe.close()
    safe.close()
    assert safe.counts.errors == 7
    assert safe.summary()["last_error"] == "OSError: gone"


def test_the_whole_loop_is_held_to_the_limits():
    """A handle that leaps about through a stiff wall, with nonsense between."""
    draw = np.random.default_rng(5)
    bench = Bench(mode="implicit", settings=SETTINGS)

    def pose(t):
        if draw.random() < 0.02:
            return np.full(7, math.nan)
        return np.array([*draw.normal(0.0, 10.0 ** draw.integers(-3, 6), 3), 1.0, 0.0, 0.0, 0.0])

    bench.device.pose = pose
    bench.device.twist = lambda t: draw.normal(0.0, 1e3, 6)
    bench.run(2000)
    sent = assert_safe(bench.device)
    assert np.linalg.norm(sent, axis=1).max() > 0.5
    bench.device.pose, bench.device.twist = wave, lambda t: np.zeros(6)
    assert np.isfinite(bench.tool.pose).all()


def test_nothing_else_writes_to_a_device_or_opens_one():
    """Apart from wrappers of devices, only holders of a `SafeDevice` do."""
    source = Path(asperity.__file__).parent / "realtime"
    passing_on = {"devices/calibration.py", "servo/safety.py"}
    found = {
        file.relative_to(source).as_posix()
        for file in source.rglob("*.py")
        if re.search(r"^[^>\n]*device\.(write|open)\(", file.read_text("utf-8"), re.MULTILINE)
    }
    assert found - passing_on == {"servo/loop.py", "servo/device_check.py", "servo/process.py"}
    for name in found - passing_on:
        assert "SafeDevice" in (source / name).read_text("utf-8"), name


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"slew": -1.0}, "slew must lie between 0 and 1 s, got -1.0"),
        ({"max_force": -2.0}, "max_force must be a finite number, 0 or above"),
        ({"silent_after": 0.0}, "silent_after must lie between"),
    ],
)
def test_wrong_settings_are_refused(options, expected):
    with pytest.raises(AsperityError, match=expected):
        SafetySettings(**options)


def test_the_old_names_still_work_and_name_the_new_ones():
    safe = SafeDevice(Bench().device, dt=DT)
    with pytest.warns(DeprecationWarning, match="said is deprecated: use raw_reading"):
        assert safe.said is safe.raw_reading
    with pytest.warns(DeprecationWarning, match="told is deprecated: use summary"):
        assert safe.told() == safe.summary()
