"""When the page says that the loop starves or loses its force, and how it gives way."""

import numpy as np
import pytest

from asperity.realtime.servo.ipc import TICK
from asperity.simulation.tool_contact import LIMITED, PASSIVITY, SILENT
from asperity.viewer.loop_health import LoopHealth
from asperity.viewer.panels.panel import Frame
from asperity.viewer.replayed_contacts import empty_snapshot
from asperity.viewer.server.pace import SLOWEST, UPDATE_RATE, UpdatePace


def frames(seconds, *, rate=1000.0, contact=1.0, felt=1.0, flags=0, misses=0):
    """Yield a frame every tenth of a second of a loop that is like this all the time."""
    for i in range(round(10 * seconds)):
        ticks = np.zeros(100, TICK)
        ticks["contact_wrench"][:, 2], ticks["device_wrench"][:, 2] = contact, felt
        ticks["contact_count"], ticks["flags"] = contact > 0.0, flags
        yield Frame(
            i, 0.1 * i, None, ticks, 0, True, 1, rate, misses, live=empty_snapshot()
        )  # fmt: skip


def judged(**like):
    health = LoopHealth()
    return [health.trouble(frame, 1000.0) for frame in frames(4.0, **like)][-1]


def test_a_loop_that_keeps_its_rate_and_force_is_well():
    assert judged() is None
    assert judged(contact=0.0, felt=0.0) is None
    assert judged(flags=PASSIVITY, felt=0.9) is None  # it takes little


@pytest.mark.parametrize(
    ("like", "word", "sinks"),
    [
        ({"rate": 850.0}, "starves: 850 of 1000", False),
        ({"flags": PASSIVITY, "felt": 0.2}, "passivity controller", True),
        ({"flags": LIMITED, "felt": 0.3}, "limit of the device", True),
        ({"flags": SILENT, "felt": 0.0}, "feels nothing", True),
    ],
)
def test_what_is_wrong_is_said_with_what_helps(like, word, sinks):
    trouble = judged(**like)
    assert word in trouble.what
    assert trouble.helps.endswith("helps.") or "choose" in trouble.helps
    assert trouble.sinks is sinks


def test_the_first_seconds_of_a_loop_are_not_judged():
    health = LoopHealth()
    assert all(health.trouble(f, 1000.0) is None for f in frames(1.9, rate=10.0))


def test_drawing_gives_way_to_a_late_loop_and_comes_back():
    pace = UpdatePace()
    slow = [pace.interval(frame, 1000.0) for frame in frames(10.0, rate=500.0)]
    assert slow[-1] == pytest.approx(SLOWEST / UPDATE_RATE)
    assert pace.gives_way
    again = [
        pace.interval(Frame(0, 10.0 + f.now, *([None] * 2), 0, True, 1, 1000.0), 1000.0)
        for f in frames(10.0)
    ]
    assert again[-1] == pytest.approx(1.0 / UPDATE_RATE)
