"""The thread between a servo that cannot wait and a device that makes wait; time is injected."""

import numpy as np
import pytest
from clocks import Clock, until

from asperity.realtime.devices.polling_thread import HOLD, Measurement, PollingThread, UnusableError
from asperity.realtime.devices.protocol import ZERO, Reading

PUSH = (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)


class Asked:
    """A device that writes down what it is asked."""

    def __init__(self):
        self.wrenches = []
        self.fails = 0
        self.unusable = 0
        self.reopened = 0

    def __call__(self, wrench):
        self.wrenches.append(wrench)
        if self.fails:
            self.fails -= 1
            raise OSError("the cable\nis out")
        if self.unusable:
            self.unusable -= 1
            raise UnusableError("nonsense")
        n = float(len(self.wrenches))
        return Measurement((n, 0.0, 0.0), (0.0, n, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, n), 5)

    def reopen(self):
        self.reopened += 1


def test_an_answer_fills_the_reading_once_as_new():
    clock, asked, reading = Clock(), Asked(), Reading.empty()
    poller = PollingThread(asked, clock=clock)
    assert not poller.take(reading)
    assert reading.age == float("inf")
    poller.hand_over(PUSH)
    poller.step()
    clock.now += 0.004
    assert poller.take(reading)
    np.testing.assert_array_equal(reading.pose, [1, 0, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(reading.twist, [0, 1, 0, 0, 0, 1])
    assert (reading.buttons, reading.error) == (5, "")
    assert reading.age == pytest.approx(0.004)
    assert not poller.take(reading)  # the same answer is no news


def test_zero_is_sent_when_writes_stop():
    clock, asked = Clock(), Asked()
    poller = PollingThread(asked, clock=clock)
    poller.step()
    poller.hand_over(PUSH)
    clock.now += 0.9 * HOLD
    poller.step()
    clock.now += 0.2 * HOLD
    poller.step()
    assert asked.wrenches == [ZERO, PUSH, ZERO]


def test_a_stale_reading_keeps_the_place_and_forgets_the_speed():
    clock, asked, reading = Clock(), Asked(), Reading.empty()
    poller = PollingThread(asked, clock=clock)
    poller.step()
    clock.now += 0.3
    poller.take(reading)
    assert reading.age == pytest.approx(0.3)
    assert reading.pose[0] == 1.0
    assert not reading.twist.any()


def test_failures_are_reported_on_one_line_and_the_device_reopened():
    asked, reading = Asked(), Reading.empty()
    asked.fails = 2
    poller = PollingThread(asked, reopen=asked.reopen)
    poller.start()
    errors = []

    def recovered():
        new = poller.take(reading)
        if reading.error:
            errors.append(reading.error)
        return new

    assert until(recovered)
    poller.stop()
    assert errors
    assert set(errors) == {"the cable is out"}
    assert asked.reopened == 2


def test_an_unusable_answer_costs_neither_pause_nor_reopening():
    asked, reading = Asked(), Reading.empty()
    asked.unusable = 50  # with a pause after each this would take 100 s
    poller = PollingThread(asked, reopen=asked.reopen)
    poller.start()
    assert until(lambda: poller.take(reading))
    poller.stop()
    assert asked.reopened == 0


def test_stopping_sends_zero_last_and_ends_the_thread():
    asked = Asked()
    poller = PollingThread(asked)
    poller.start()
    poller.hand_over(PUSH)
    assert until(lambda: PUSH in asked.wrenches)
    poller.stop()
    assert asked.wrenches[-1] == ZERO
    count = len(asked.wrenches)
    poller.hand_over(PUSH)
    assert not until(lambda: len(asked.wrenches) > count, 0.05)
