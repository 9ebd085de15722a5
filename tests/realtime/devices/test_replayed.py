"""A recorded motion as a device; the clock is injected."""

import numpy as np
import pytest
from clocks import Clock

from asperity.errors import AsperityError
from asperity.realtime.devices.protocol import Reading
from asperity.realtime.devices.replayed import ReplayedDevice
from asperity.runs.recording import RecordingWriter

TIMES = np.array([5.0, 5.5, 6.5])
POSES = np.array(
    [[0, 0, 0, 1, 0, 0, 0], [0.01, 0, 0.02, 1, 0, 0, 0], [0.01, 0, 0.02, 0, 0, 0, 1.0]]
)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "poses.npy"
    np.save(path, np.column_stack([TIMES, POSES]))
    return path


def opened(path, clock, **options):
    device = ReplayedDevice(path, clock=clock, **options)
    device.open()
    return device


def test_it_moves_by_the_clock_and_then_holds(file):
    clock, reading = Clock(), Reading.empty()
    device = opened(file, clock)
    assert device.seconds == 1.5
    assert device.read(reading)
    np.testing.assert_allclose(reading.pose, POSES[0])
    clock.now += 0.25
    device.read(reading)
    np.testing.assert_allclose(reading.pose, [0.005, 0, 0.01, 1, 0, 0, 0])
    np.testing.assert_allclose(reading.twist, [0.02, 0, 0.04, 0, 0, 0])
    clock.now += 0.75
    device.read(reading)
    np.testing.assert_allclose(reading.twist, [0, 0, 0, 0, 0, np.pi], atol=1e-12)
    np.testing.assert_allclose(reading.pose[3:], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert not device.finished
    clock.now += 100.0
    assert device.read(reading)
    np.testing.assert_allclose(reading.pose, POSES[2])
    assert device.finished
    assert not reading.twist.any()
    assert reading.age == 0.0


def test_it_loops(file):
    clock, reading = Clock(), Reading.empty()
    device = opened(file, clock, end="loop")
    clock.now += 7 * 1.5 + 0.25
    device.read(reading)
    np.testing.assert_allclose(reading.pose[:3], [0.005, 0, 0.01])
    assert not device.finished


def test_a_recording_is_replayed_also_one_that_was_cut_short(tmp_path):
    path = tmp_path / "recording.h5"
    with RecordingWriter(path) as writer:
        for time, pose in zip(TIMES, POSES, strict=True):
            writer.add(
                time=time, handle_pose=pose, tool_pose=np.zeros(7), contact_wrench=np.zeros(6),
                device_wrench=np.zeros(6), contact_count=0, flags=0,
            )  # fmt: skip
    clock, reading = Clock(), Reading.empty()
    for source in (path, tmp_path):  # the file, or the folder of the run
        device = opened(source, clock)
        np.testing.assert_array_equal(device.first_pose, POSES[0])
        clock.now += 0.25
        device.read(reading)
        np.testing.assert_allclose(reading.pose[:3], [0.005, 0, 0.01])


def test_wrenches_are_kept_and_nothing_raises(file):
    device, reading = opened(file, Clock()), Reading.empty()
    device.write(np.arange(6.0))
    assert device.wrench == (0, 1, 2, 3, 4, 5)
    for wrench in (np.full(6, np.nan), None, np.zeros(3)):
        device.write(wrench)
        assert device.wrench == (0.0,) * 6
        device.read(reading)
        assert "not six finite" in reading.error
    device.close()
    device.close()
    assert not device.read(reading)
    assert device.limits.radius >= 0.022


def test_one_pose_is_a_hand_that_holds_still(tmp_path):
    path = tmp_path / "one.csv"
    path.write_text("0, 0.1, 0, 0, 1, 0, 0, 0\n")
    for end in ("hold", "loop"):
        device, reading = opened(path, Clock(), end=end), Reading.empty()
        assert device.read(reading)
        assert reading.pose[0] == 0.1


def test_what_cannot_be_replayed_is_refused(tmp_path, file):
    with pytest.raises(AsperityError, match="no such file of poses"):
        ReplayedDevice(tmp_path / "none.csv")
    with pytest.raises(AsperityError, match="no such recording"):
        ReplayedDevice(tmp_path / "none.h5")
    with pytest.raises(AsperityError, match="did you mean 'loop'"):
        ReplayedDevice(file, end="lop")
    with RecordingWriter(tmp_path / "empty.h5"):
        pass
    with pytest.raises(AsperityError, match="no ticks"):
        ReplayedDevice(tmp_path / "empty.h5")
