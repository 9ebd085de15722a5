"""The serial backend against a stand-in for its package, and that against a pseudo-terminal."""

import os
import struct
import sys
import threading
import types

import numpy as np
import pytest
from clocks import until

from asperity.errors import AsperityError
from asperity.realtime.devices.haply.serial_port import HaplyHardwareDevice
from asperity.realtime.devices.protocol import Reading

PUSH = np.array([0.1, 0.2, 0.3, 9.0, 9.0, 9.0])


class Stub(types.ModuleType):
    """As HaplyHardwareAPI 0.1.13 behaves: it answers zeros, not errors."""

    def __init__(self, port):
        super().__init__("HaplyHardwareAPI")
        self.forces, self.position, self.raises = [], [0.01, -0.12, 0.15], None
        self.quaternion, self.ports, self.grips = [0.0, 0.0, 1.0, 0.0], [port], [port]
        stub = self

        class SerialStream:
            def __init__(self, port):
                self.port = port

        class Inverse3:
            def __init__(self, stream):
                self.stream = stream

            def set_read_timeout(self, seconds):
                stub.timeout = seconds

            def end_effector_force(self, force):
                if stub.raises:
                    raise stub.raises
                stub.forces.append(force)
                return list(stub.position), [0.1, 0.2, 0.3]

        class Handle:
            def __init__(self, stream):
                self.stream = stream

            def GetVersegripStatus(self):
                return {"quaternion": stub.quaternion, "buttons": 3}

        self.SerialStream, self.Inverse3, self.Handle = SerialStream, Inverse3, Handle

    def detect_inverse3s(self):
        return self.ports

    def detect_handles(self):
        return self.grips


@pytest.fixture
def port(tmp_path):
    path = tmp_path / "ttyACM0"
    path.write_text("")
    return str(path)


@pytest.fixture
def stub(monkeypatch, port):
    stub = Stub(port)
    monkeypatch.setitem(sys.modules, "HaplyHardwareAPI", stub)
    return stub


@pytest.fixture
def device(stub):
    device = HaplyHardwareDevice()
    device.open()
    yield device
    device.close()


def test_pose_and_buttons_come_and_the_force_goes(stub, device):
    reading = Reading.empty()
    assert until(lambda: device.read(reading) and reading.buttons == 3)
    np.testing.assert_array_equal(reading.pose, [0.01, -0.12, 0.15, 0, 0, 1, 0])
    np.testing.assert_array_equal(reading.twist[:3], [0.1, 0.2, 0.3])
    assert until(lambda: device.write(PUSH) or stub.forces[-1] == [0.1, 0.2, 0.3])
    assert until(lambda: stub.forces[-1] == [0.0, 0.0, 0.0])  # writes stopped
    assert stub.timeout < 0.1


@pytest.mark.parametrize(
    "position", [[0.0, 0.0, 0.0], [float("nan"), 0.0, 0.1], [0.0, 1e6, 0.0], [float("inf")] * 3]
)
def test_an_answer_that_is_none_counts_as_silence(stub, device, position):
    reading = Reading.empty()
    assert until(lambda: device.read(reading))
    stub.position = position
    assert until(lambda: device.read(reading) or reading.age > 0.1)
    assert until(lambda: bool(device.read(reading) or reading.error))
    np.testing.assert_array_equal(reading.pose[:3], [0.01, -0.12, 0.15])
    stub.position = [0.02, -0.12, 0.15]
    assert until(lambda: device.read(reading))


def test_what_the_package_raises_is_reported_and_nan_is_not_sent(stub, device):
    reading = Reading.empty()
    stub.raises = RuntimeError("serial\nport gone")
    assert until(lambda: device.read(reading) or reading.error == "serial port gone")
    stub.raises = None
    device.write(np.full(6, np.nan))
    assert until(lambda: device.read(reading) and True)
    assert np.isfinite(stub.forces).all()


def test_a_grip_that_tells_nonsense_leaves_the_orientation(stub, device):
    reading = Reading.empty()
    assert until(lambda: device.read(reading) and reading.pose[5] == 1.0)
    stub.quaternion = [0.0, 0.0, 0.0, 0.0]
    assert until(lambda: device.read(reading) or "norm 0" in reading.error)
    assert until(lambda: "norm 0" in reading.error or (device.read(reading) and False))
    assert reading.pose[5] == 1.0


def test_a_port_that_goes_and_comes_is_opened_anew(stub, device, port):
    reading, first = Reading.empty(), device._device
    assert until(lambda: device.read(reading))
    stub.raises = OSError("unplugged")
    os.remove(port)
    assert until(lambda: device.read(reading) or "No such file" in reading.error)
    stub.raises = None
    with open(port, "w"):
        pass
    assert until(lambda: device.read(reading) and reading.age < 0.05)
    assert device._device is not first
    assert len(device._streams) == 3  # the old one is kept: the package may still use it


def test_opening_says_what_is_wrong(stub):
    stub.position = [0.0, 0.0, 0.0]
    with pytest.raises(AsperityError, match="does not answer"):
        HaplyHardwareDevice().open()
    with pytest.raises(AsperityError, match=r"does not answer.*No such file"):
        HaplyHardwareDevice(port="/dev/nothing-there").open()
    stub.ports = []
    with pytest.raises(AsperityError, match=r"no Inverse3 found.*dialout"):
        HaplyHardwareDevice().open()


def test_without_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "HaplyHardwareAPI", None)
    with pytest.raises(AsperityError, match=r"pip install 'asperity\[haply\]'"):
        HaplyHardwareDevice().open()


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals")
def test_the_package_itself_with_a_stand_in_for_the_firmware():
    """The firmware answers 0x2a and three floats (a force) by 0x2b and six (place, velocity)."""
    pytest.importorskip("HaplyHardwareAPI")
    import tty

    ours, theirs = os.openpty()
    tty.setraw(ours), tty.setraw(theirs)
    forces, answering = [], threading.Event()
    answering.set()

    def firmware():
        waiting = b""
        while True:
            try:
                waiting += os.read(ours, 256)
            except OSError:
                return
            while len(waiting) >= 13:
                forces.append(struct.unpack("<3f", waiting[1:13]))
                waiting = waiting[13:]
                if answering.is_set():
                    place = struct.pack("<6f", 0.25, -0.125, 0.5, 1.0, 2.0, 3.0)
                    os.write(ours, b"\x2b" + place)

    threading.Thread(target=firmware, daemon=True).start()
    device = HaplyHardwareDevice(port=os.ttyname(theirs), grip_port="")
    device.open()
    reading = Reading.empty()
    assert until(lambda: device.read(reading))
    np.testing.assert_array_equal(reading.pose[:3], [0.25, -0.125, 0.5])
    np.testing.assert_array_equal(reading.twist[:3], [1.0, 2.0, 3.0])
    wrench = np.array([0.5, 0.25, -1.0, 0, 0, 0])
    assert until(lambda: device.write(wrench) or forces[-1] == (0.5, 0.25, -1.0))
    answering.clear()
    assert until(lambda: device.read(reading) or "does not answer" in reading.error)
    assert until(lambda: "does not answer" in reading.error or (device.read(reading) and False))
    answering.set()
    assert until(lambda: device.read(reading))
    device.close()
    assert forces[-1] == (0.0, 0.0, 0.0)
    os.close(ours), os.close(theirs)
