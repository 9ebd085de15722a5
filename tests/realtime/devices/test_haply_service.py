"""The real client against the stand-in for the service, with faults of all kinds."""

import socket
import subprocess
import sys
import time
import tracemalloc

import numpy as np
import pytest
from clocks import until

from asperity.errors import AsperityError
from asperity.realtime.devices.haply.fake_device import HaplyFakeDevice
from asperity.realtime.devices.haply.fake_service import FakeService, still_hand
from asperity.realtime.devices.haply.messages import HOME
from asperity.realtime.devices.haply.service import HaplyServiceDevice, attached
from asperity.realtime.devices.polling_thread import PollingThread
from asperity.realtime.devices.protocol import Reading

PUSH = np.array([0.3, 0.0, 0.6, 0.0, 0.0, 0.0])


@pytest.fixture
def service():
    # A command of the fake lasts long here: a loaded machine must not end it in between.
    with FakeService(still_hand, command_seconds=0.5) as service:
        yield service


@pytest.fixture
def device(service):
    device = HaplyServiceDevice(uri=service.uri)
    device.open()
    yield device
    device.close()


def ticks_until(device, condition, wrench=PUSH, patience=10.0):
    """Write and read as a servo does until a condition holds; return errors and readings."""
    reading, errors = Reading.empty(), []

    def tick():
        new = device.read(reading)
        device.write(wrench)
        if reading.error:
            errors.append(reading.error)
        assert np.isfinite(reading.pose).all()
        assert np.isfinite(reading.twist).all()
        return condition(new, reading)

    assert until(tick, patience), f"errors meanwhile: {set(errors)}"
    return errors, reading


def good(new, reading):
    return new and not reading.error


def test_the_pose_comes_and_the_force_arrives(service, device):
    _, reading = ticks_until(device, lambda new, _: new and service.force() == (0.3, 0.0, 0.6))
    np.testing.assert_allclose(reading.pose[:3], HOME, atol=5e-3)
    np.testing.assert_array_equal(reading.pose[3:], [1, 0, 0, 0])
    assert reading.age < 1.0
    # The hand's spring of 300 N/m gives way to it.
    ticks_until(device, lambda _, reading: abs(reading.pose[2] - HOME[2] - 0.6 / 300.0) < 1e-4)


def test_the_first_message_tells_who_it_is(service, device):
    ticks_until(device, good)
    assert service.sessions == [
        {"profile": {"name": "asperity"}, "basis": {"permutation": "XYZ"}},
    ]
    ticks_until(device, good)
    assert "session" not in service.last_message


def test_the_other_spelling(service):
    device = HaplyServiceDevice(uri=service.uri, spelling="values", profile="")
    device.open()
    ticks_until(device, lambda new, _: service.force() == (0.3, 0.0, 0.6))
    device.close()
    assert "values" in service.last_message["inverse3"][0]["commands"]["set_cursor_force"]
    assert service.sessions == []


@pytest.mark.parametrize(("kind", "bits"), [("wireless", 0b110), ("wired", 0b1)])
def test_orientation_and_buttons_come_from_the_grip(kind, bits):
    with FakeService(still_hand, grip=kind) as service:
        service.orientation = (0.8, 0.0, 0.6, 0.0)
        service.buttons = (kind == "wired", True, True)
        device = HaplyServiceDevice(uri=service.uri)
        device.open()
        _, reading = ticks_until(device, good)
        device.close()
    np.testing.assert_allclose(reading.pose[3:], [0.8, 0.0, 0.6, 0.0])
    assert reading.buttons == bits


def test_a_grip_that_goes_leaves_the_orientation_and_no_turning(service, device):
    service.orientation = (0.8, 0.0, 0.6, 0.0)
    ticks_until(device, lambda _, reading: reading.pose[5] == 0.6)
    service.grip = "none"
    _, reading = ticks_until(device, lambda _, reading: not reading.twist[3:].any())
    np.testing.assert_allclose(reading.pose[3:], [0.8, 0.0, 0.6, 0.0])


def test_one_message_is_under_way_at_most_however_slow_the_service(service, device):
    ticks_until(device, good)
    service.delay = 0.05
    before, began = service.messages, time.monotonic()
    ticks_until(device, lambda *_: service.messages - before >= 4)
    # A tick a millisecond wrote hundreds of wrenches meanwhile.
    assert service.messages - before <= (time.monotonic() - began) / 0.05 + 2


def test_the_newest_wrench_is_sent_not_an_old_one(service, device):
    service.delay = 0.02
    reading = Reading.empty()
    for i in range(200):
        device.write(np.array([0.0, 0.0, 0.001 * i, 0.0, 0.0, 0.0]))
        device.read(reading)
    assert until(lambda: device.write(PUSH) or service.force() == (0.3, 0.0, 0.6))


def test_a_late_zero_does_not_wait_for_the_answer(service, device):
    ticks_until(device, lambda *_: service.force() == (0.3, 0.0, 0.6))
    service.silent = True  # takes messages, and says nothing more
    before = service.messages
    assert until(lambda: device.write(PUSH) or service.messages > before)
    device.write(np.zeros(6))
    began = time.monotonic()
    assert until(lambda: device.write(np.zeros(6)) or service.force() == (0.0, 0.0, 0.0))
    assert time.monotonic() - began < 0.2  # commands of this fake last 0.5 s


def test_writes_that_stop_leave_no_force(service, device):
    ticks_until(device, lambda *_: service.force() == (0.3, 0.0, 0.6))
    began = time.monotonic()
    assert until(lambda: service.force() == (0.0, 0.0, 0.0))
    assert time.monotonic() - began < 0.3  # by our thread, well before the service idles


def test_closing_leaves_no_force_and_can_be_done_twice(service, device):
    ticks_until(device, lambda *_: service.force() == (0.3, 0.0, 0.6))
    device.close()
    device.close()
    assert until(lambda: service.force() == (0.0, 0.0, 0.0))
    reading = Reading.empty()
    device.write(PUSH)
    assert not device.read(reading)
    assert (reading.age, reading.error) == (float("inf"), "the device is not open")


@pytest.mark.parametrize(
    "wrench",
    [
        np.full(6, np.nan), np.full(6, np.inf), np.array([0, 0, -np.inf, 0, 0, 0]), np.zeros(5),
        np.full(6, 1e308), None, "force", np.zeros((6, 1), complex),
    ],
)  # fmt: skip
def test_no_wrench_makes_it_raise_and_no_number_that_is_none_gets_through(service, device, wrench):
    ticks_until(device, lambda *_: service.force() == (0.3, 0.0, 0.6))
    device.write(wrench)
    reading = Reading.empty()
    device.read(reading)
    good_one = isinstance(wrench, np.ndarray) and wrench.shape == (6,) and wrench[0] == 1e308
    assert (reading.error == "") == good_one
    if not good_one:
        assert "zero was sent" in reading.error
        assert until(lambda: service.force() == (0.0, 0.0, 0.0))
    assert not np.isnan(service.largest_force)


def test_a_cut_connection_is_reported_and_made_anew(service, device):
    ticks_until(device, good)
    service.disconnect()
    errors, reading = ticks_until(device, lambda _, reading: bool(reading.error))
    assert "lost the Haply service" in errors[-1]
    assert not reading.twist.any() or reading.age < 0.06
    _, reading = ticks_until(device, good)
    assert reading.age < 1.0
    assert len(service.sessions) == 2  # introduces itself again
    ticks_until(device, lambda *_: service.force() == (0.3, 0.0, 0.6))


def test_age_grows_while_nobody_is_there_and_then_it_goes_on(service, device):
    ticks_until(device, good)
    service.refuse_clients = True
    service.disconnect()
    _, reading = ticks_until(device, lambda _, reading: reading.age > 0.3)
    assert not reading.twist.any()
    service.refuse_clients = False
    ticks_until(device, good)


def test_a_service_that_goes_silent_is_left_and_tried_again(service, device):
    ticks_until(device, good)
    service.silent = True
    errors, _ = ticks_until(device, lambda _, reading: bool(reading.error))
    assert "silent" in errors[-1]
    service.silent = False
    ticks_until(device, good)


def test_a_frozen_frame_is_no_news():
    with FakeService(lambda t: (0.05 * np.sin(6.0 * t), -0.12, 0.15)) as service:
        device = HaplyServiceDevice(uri=service.uri)
        device.open()
        ticks_until(device, lambda _, reading: abs(reading.twist[0]) > 0.1)
        service.frozen = True
        errors, _ = ticks_until(device, lambda _, reading: reading.age > 0.1)
        assert "repeats one frame" in errors[-1]
        service.frozen = False
        ticks_until(device, good)
        device.close()


@pytest.mark.parametrize(
    ("reply", "expected"),
    [
        ("{", "invalid JSON"), ("", "invalid JSON"), ("[1, 2]", "without a list"),
        (b"\xff\xfe", "invalid JSON"),
        ('{"inverse3": [{"device_id": "FA4E", "state": {}}]}', "cursor_position"),
        ('{"inverse3": [{"device_id": "FA4E", "state": {"cursor_position": {"x": NaN, "y": 0, '
         '"z": 0}, "cursor_velocity": {"x": 0, "y": 0, "z": 0}}}]}', "out of range"),
        ('{"inverse3": [{"device_id": "FA4E", "state": {"cursor_position": {"x": 1e9, "y": 0, '
         '"z": 0}, "cursor_velocity": {"x": 0, "y": 0, "z": 0}}}]}', "out of range"),
    ],
)  # fmt: skip
def test_a_malformed_frame_is_reported_and_survived(service, device, reply, expected):
    ticks_until(device, good)
    service.replies.append(reply)
    errors, _ = ticks_until(device, lambda _, reading: bool(reading.error))
    assert expected in errors[-1]
    ticks_until(device, good)


def test_an_unplugged_device_is_reported_and_comes_back(service, device):
    ticks_until(device, good)
    service.unplugged = True
    errors, _ = ticks_until(device, lambda _, reading: reading.age > 0.1)
    assert "still plugged in" in errors[-1] or "lists no Inverse3" in errors[-1]
    service.unplugged = False
    ticks_until(device, good)


def test_an_unplugged_device_that_comes_back_in_a_new_connection(service, device):
    ticks_until(device, good)
    service.unplugged = True
    service.disconnect()
    ticks_until(device, lambda _, reading: reading.age > 0.8)
    service.unplugged = False
    ticks_until(device, good)
    assert len(service.sessions) >= 2


def test_another_device_is_not_pushed_instead(service, device):
    ticks_until(device, good)
    service.device_id = "BBBB"
    errors, _ = ticks_until(device, lambda _, reading: reading.age > 0.1)
    assert "no Inverse3 'FA4E'" in errors[-1]
    assert until(lambda: service.force() == (0.0, 0.0, 0.0))


def test_a_killed_process_leaves_no_force(service):
    script = f"""
import numpy as np, time
from asperity.realtime.devices.haply.service import HaplyServiceDevice
device = HaplyServiceDevice(uri={service.uri!r})
device.open()
while True:
    device.write(np.array([0.3, 0.0, 0.6, 0.0, 0.0, 0.0]))
    time.sleep(0.001)
"""
    servo = subprocess.Popen([sys.executable, "-c", script])
    try:
        assert until(lambda: service.force() == (0.3, 0.0, 0.6), 20.0)
    finally:
        servo.kill()
        servo.wait()
    assert until(lambda: service.force() == (0.0, 0.0, 0.0))


def test_many_ticks_leave_no_memory_behind(service, device):
    reading = Reading.empty()

    def tick(count):
        least = 1 << 60  # seen between two frames
        for i in range(count):
            device.read(reading)
            device.write(PUSH)
            time.sleep(1e-4)
            if i > count // 2:
                least = min(least, tracemalloc.get_traced_memory()[0])
        return least

    tracemalloc.start()
    try:
        before = tick(400)
        grown = tick(2000) - before
    finally:
        tracemalloc.stop()
    # Python keeps some hundred tuples of 88 bytes for reuse; one kept for each tick were 176 kB.
    assert grown < 120_000


def test_opening_says_what_to_do():
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        port = nobody.getsockname()[1]
    with pytest.raises(AsperityError, match="refused; start Haply Hub"):
        HaplyServiceDevice(uri=f"ws://127.0.0.1:{port}").open()
    for uri in ("http://localhost", "ws://", "nonsense", "wss://localhost"):
        with pytest.raises(AsperityError, match=r"is not an address|not wss"):
            HaplyServiceDevice(uri=uri).open()
    with pytest.raises(AsperityError, match="did you mean 'vector'"):
        HaplyServiceDevice(spelling="vectors")
    with pytest.raises(AsperityError, match="unknown grip"):
        HaplyServiceDevice(grip="both")


def test_opening_waits_for_the_named_device(service):
    device = HaplyServiceDevice(uri=service.uri, device_id="AAAA")
    with pytest.raises(AsperityError, match=r"no Inverse3 'AAAA'.*It lists: FA4E"):
        device.open()
    assert attached(service.uri) == ["FA4E"]
    service.unplugged = True
    assert attached(service.uri) == []


def test_neither_reading_nor_writing_waits_for_the_service(service, device, monkeypatch):
    """They may only exchange references: whatever could wait is not for the servo's thread."""
    ticks_until(device, good)
    import threading

    servo = threading.get_ident()
    step = PollingThread.step

    def elsewhere(self):
        assert threading.get_ident() != servo
        return step(self)

    monkeypatch.setattr(PollingThread, "step", elsewhere)
    service.silent = True
    reading, slow = Reading.empty(), 0
    for _ in range(300):
        began = time.perf_counter()
        device.write(PUSH)
        device.read(reading)
        slow += time.perf_counter() - began > 0.1  # the silence lasts 0.25 s
    assert slow == 0


def test_the_fake_device_starts_a_service_and_ends_it():
    device = HaplyFakeDevice(motion="still")
    reading = Reading.empty()
    assert not device.read(reading)
    device.write(PUSH)
    device.open()
    process = device._process
    ticks_until(device, lambda _, reading: abs(reading.pose[2] - HOME[2] - 0.6 / 300.0) < 1e-4)
    device.close()
    device.close()
    assert process.poll() is not None
