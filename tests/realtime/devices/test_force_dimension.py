"""Force Dimension: signs and axes against a stand-in, signatures against the package's own mock."""

import os
import subprocess
import sys
import textwrap
import types

import numpy as np
import pytest
from clocks import until

from asperity.errors import AsperityError
from asperity.realtime.devices import force_dimension
from asperity.realtime.devices.force_dimension import ForceDimensionDevice
from asperity.realtime.devices.protocol import Reading

PUSH = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])


class Stub(types.SimpleNamespace):
    """dhd: functions return -1 for failure and fill what they are given."""

    def __init__(self, wrist=True, active=True):
        super().__init__()
        self.sent, self.fails, self.closed, self.stopped, self.opened = [], False, 0, 0, 0
        self.wrist, self.active = wrist, active
        # Towards the user, to the right, up.
        self.place, self.velocity, self.angular_velocity = (
            [-0.03, 0.02, 0.01],
            [1.0, 2.0, 3.0],
            [4, 5, 6],
        )
        self.frame = np.eye(3).tolist()
        self.expert = types.SimpleNamespace(setWatchdog=self._watchdog)
        self.watchdog = None

    def _watchdog(self, duration):
        self.watchdog = duration

    def open(self):
        self.opened += 1
        return -1 if self.fails else 0

    def close(self):
        self.closed += 1
        return 0

    def stop(self):
        self.stopped += 1
        return 0

    def errorGetLastStr(self):
        return "no device found"

    def hasWrist(self):
        return self.wrist

    def hasActiveWrist(self):
        return self.active

    def enableForce(self, on):
        return 0

    def setForce(self, force):
        self.sent.append((*force, 0, 0, 0))
        return -1 if self.fails else 0

    def setForceAndTorque(self, force, torque):
        self.sent.append((*force, *torque))
        return -1 if self.fails else 0

    def getPosition(self, out):
        out[:] = self.place
        return 0

    def getPositionAndOrientationFrame(self, out, frame):
        out[:] = self.place
        for row, values in zip(frame, self.frame, strict=True):
            row[:] = values
        return 0

    def getLinearVelocity(self, out):
        out[:] = self.velocity
        return 0

    def getAngularVelocityRad(self, out):
        out[:] = self.angular_velocity
        return 0

    def getButtonMask(self):
        return 0b101


@pytest.fixture
def stub(monkeypatch):
    stub = Stub()
    monkeypatch.setattr(force_dimension, "_import", lambda: stub)
    return stub


@pytest.fixture
def device(stub):
    device = ForceDimensionDevice(model="sigma.7")
    device.open()
    yield device
    device.close()


def turned(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    m = np.eye(3)
    m[i, i] = m[j, j] = c
    m[i, j], m[j, i] = -s, s
    return m


def test_its_axes_become_ours(stub, device):
    # It is 30 mm away from the user (their -x), 20 to the right, 10 up.
    reading = Reading.empty()
    assert until(lambda: device.read(reading))
    np.testing.assert_allclose(reading.pose[:3], [0.02, 0.03, 0.01])
    np.testing.assert_allclose(reading.twist, [2, -1, 3, 5, -4, 6])
    assert reading.buttons == 0b101


@pytest.mark.parametrize(("theirs", "ours"), [(0, [0, -1, 0]), (1, [1, 0, 0]), (2, [0, 0, 1])])
def test_a_turn_about_an_axis_of_theirs_is_one_about_that_axis(stub, device, theirs, ours):
    stub.frame = turned(theirs, 0.6).tolist()
    reading = Reading.empty()
    expected = [np.cos(0.3), *(np.sin(0.3) * np.array(ours))]
    assert until(lambda: device.read(reading) and np.allclose(reading.pose[3:], expected))


def test_force_and_torque_go_out_in_their_axes_and_zero_when_writes_stop(stub, device):
    # What pushes to the right (our x) is their y; away (our y) is their -x.
    sent = (-2.0, 1.0, 3.0, -0.2, 0.1, 0.3)
    assert until(lambda: device.write(PUSH) or stub.sent[-1] == sent)
    assert until(lambda: not any(stub.sent[-1]))
    assert stub.watchdog == 200  # times 125 us


def test_power_is_the_same_in_both_frames(stub, device):
    reading = Reading.empty()
    assert until(lambda: device.read(reading))
    assert until(lambda: device.write(PUSH) or any(stub.sent[-1]))
    theirs = np.dot(stub.sent[-1], [*stub.velocity, *stub.angular_velocity])
    assert np.dot(PUSH, reading.twist) == pytest.approx(theirs)


def test_without_an_active_wrist_no_torque_is_sent(stub):
    stub.wrist = stub.active = False
    device = ForceDimensionDevice()
    device.open()
    reading = Reading.empty()
    assert until(lambda: device.write(PUSH) or stub.sent[-1] == (-2.0, 1.0, 3.0, 0, 0, 0))
    assert until(lambda: device.read(reading))
    np.testing.assert_array_equal(reading.pose[3:], [1, 0, 0, 0])
    device.close()


def test_failures_are_reported_and_the_device_is_opened_anew(stub, device):
    reading = Reading.empty()
    stub.fails = True
    assert until(lambda: device.read(reading) or "no device found" in reading.error)
    assert until(lambda: stub.opened > 1)
    stub.fails = False
    assert until(lambda: device.read(reading))
    for frame, place in ((np.full((3, 3), np.nan), None), (None, [np.nan, 0, 0])):
        stub.frame = np.eye(3).tolist() if frame is None else frame.tolist()
        stub.place = [0, 0, 0] if place is None else place
        assert until(lambda: (device.read(reading) and False) or bool(reading.error))
        assert np.isfinite(reading.pose).all()
        stub.frame, stub.place = np.eye(3).tolist(), [0.0, 0.0, 0.0]
        assert until(lambda: device.read(reading))


def test_closing_sends_zero_then_brakes_and_lets_go(stub, device):
    assert until(lambda: device.write(PUSH) or any(stub.sent[-1]))
    device.close()
    device.close()
    assert not any(stub.sent[-1])
    assert (stub.stopped, stub.closed) == (1, 1)


def test_opening_says_what_is_wrong(monkeypatch, stub):
    stub.fails = True
    with pytest.raises(AsperityError, match="no device found; is it switched on"):
        ForceDimensionDevice().open()
    with pytest.raises(AsperityError, match=r"did you mean 'omega.6'"):
        ForceDimensionDevice(model="omega.7")
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "forcedimension_core", None)
    monkeypatch.delitem(sys.modules, "forcedimension_core.dhd", raising=False)
    with pytest.raises(AsperityError, match=r"asperity\[forcedimension\].*SDK 3.16"):
        ForceDimensionDevice().open()


def test_the_calls_fit_the_package_with_its_own_mock_of_the_library():
    """In a process of its own: whether the library is mocked is settled at the first import."""
    pytest.importorskip("pydantic")
    from importlib.util import find_spec

    if find_spec("forcedimension_core") is None:
        pytest.skip("forcedimension-core is not installed")
    script = """
        import time
        import numpy as np
        import forcedimension_core.runtime as runtime
        from asperity.realtime.devices.force_dimension import ForceDimensionDevice
        from asperity.realtime.devices.protocol import Reading

        lib = runtime._libdhd
        for name in ("dhdOpen", "dhdEnableForce", "dhdSetForceAndTorque", "dhdGetLinearVelocity",
                     "dhdGetAngularVelocityRad", "dhdSetWatchdog", "dhdStop", "dhdClose"):
            getattr(lib, name).return_value = 0
        lib.dhdHasWrist.return_value = lib.dhdHasActiveWrist.return_value = True
        lib.dhdGetButtonMask.return_value = 2

        def frame(px, py, pz, matrix, device):
            px.value, py.value, pz.value = -0.03, 0.02, 0.01
            for i in range(9):
                matrix[i] = float(i % 4 == 0)
            return 0

        lib.dhdGetPositionAndOrientationFrame.side_effect = frame
        device = ForceDimensionDevice(model="sigma.7")
        device.open()
        reading = Reading.empty()
        wrench = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
        end = time.monotonic() + 5.0
        while not device.read(reading) and time.monotonic() < end:
            device.write(wrench)
        assert np.allclose(reading.pose, [0.02, 0.03, 0.01, 1, 0, 0, 0]), reading
        assert reading.buttons == 2, reading
        sent = [call.args for call in lib.dhdSetForceAndTorque.call_args_list]
        device.close()
        assert (-2.0, 1.0, 3.0, -0.2, 0.1, 0.3, -1) in sent, sent[-3:]
        assert lib.dhdStop.called and lib.dhdClose.called
        print("fits")
    """
    ended = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)],
        env={**os.environ, "__fdsdkpy_unittest__": "True"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.stdout.strip() == "fits", ended.stderr
