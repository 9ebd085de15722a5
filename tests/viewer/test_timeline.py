"""The time that the page shows: now, held, and through what was kept."""

import numpy as np
import pytest
from fake_client import RATE, FakeServoClient, ticks_at

from asperity.runs.recording import RecordingWriter
from asperity.viewer.panels.panel import ViewModel
from asperity.viewer.replayed_contacts import empty_snapshot
from asperity.viewer.tick_buffer import RecordedTicks, TicksInMemory
from asperity.viewer.timeline import HELD_SECONDS, Timeline, TimelineClient


@pytest.fixture
def servo():
    servo = FakeServoClient()
    servo.give(3.0)
    return servo


def seen(servo, timeline, *, times, step=1 / 30):
    """Update as the page does, with the loop going on; return the moments that it showed."""
    view_model, shown = ViewModel(TimelineClient(servo, timeline)), []
    for i in range(times):
        servo.give(step)
        frame = view_model.frame(i * step)
        timeline.advance(frame)
        shown.append(frame.snapshot)
    return shown


def test_live_it_shows_the_last_seconds(servo):
    timeline = Timeline(servo)
    ticks = timeline.window(0.5)
    assert len(ticks) == 501
    assert ticks["time"][-1] == pytest.approx(2.999)
    servo.give(1.0)
    assert timeline.window(0.5)["time"][-1] == pytest.approx(3.999)
    assert timeline.is_live
    assert timeline.snapshot() is None


def test_held_it_stands_while_the_loop_goes_on(servo):
    timeline = Timeline(servo)
    timeline.hold()
    shown = seen(servo, timeline, times=30)
    assert not timeline.is_live
    assert timeline.at == timeline.length == pytest.approx(2.999)
    assert timeline.window(1.0)["time"][-1] == pytest.approx(2.999)
    # There was no snapshot before it was held: the last one is shown.
    assert shown[0] is not None
    timeline.go_live()
    assert timeline.window(1.0)["time"][-1] == pytest.approx((servo.ticks - 1) / RATE)


def test_everything_goes_where_the_slider_is(servo):
    timeline = Timeline(servo)
    seen(servo, timeline, times=30)
    timeline.hold()
    timeline.move_to(1.25)
    snapshot = seen(servo, timeline, times=1)[0]
    tick = ticks_at(1250, 1)[0]
    assert snapshot.time == pytest.approx(1.25)
    np.testing.assert_allclose(snapshot.tool_pose, tick["tool_pose"])
    np.testing.assert_allclose(snapshot.device_wrench, tick["device_wrench"])
    assert timeline.window(0.5)["time"][-1] == pytest.approx(1.25)
    assert timeline.window(0.5)["time"][0] == pytest.approx(0.75)
    timeline.move_to(99.0)
    assert timeline.at == timeline.length
    timeline.move_to(-1.0)
    assert timeline.snapshot().time == 0.0


def test_only_the_last_seconds_are_kept(servo):
    servo.give(HELD_SECONDS + 5.0)
    timeline = Timeline(servo)
    timeline.hold()
    assert timeline.length == pytest.approx(HELD_SECONDS, abs=2e-3)
    assert timeline.everything()["time"][-1] == pytest.approx((servo.ticks - 1) / RATE)


def test_it_plays_at_a_speed_and_stops_at_the_end(servo):
    timeline = Timeline(servo)
    timeline.hold()
    timeline.move_to(0.5)
    timeline.speed = 0.25
    timeline.play()
    seen(servo, timeline, times=31)
    assert timeline.at == pytest.approx(0.75, abs=1e-6)
    timeline.speed = 10.0
    seen(servo, timeline, times=31)
    assert timeline.at == timeline.length
    assert not timeline.playing
    timeline.play()  # from the end: once more
    assert timeline.at == 0.0


def test_a_recording_is_read_as_it_is_looked_at(tmp_path):
    ticks = ticks_at(0, 4000)
    with RecordingWriter(tmp_path / "recording.h5", {"dt": 1e-3}) as writer:
        writer.add_rows({name: ticks[name] for name in ticks.dtype.names})
    kept = RecordedTicks(tmp_path / "recording.h5")
    assert (kept.count, kept.length) == (4000, pytest.approx(3.999))
    np.testing.assert_array_equal(kept.ticks(1000, 1010), ticks[1000:1010])
    assert kept.index(1.2345) == TicksInMemory(ticks).index(1.2345) == 1234
    timeline = Timeline(rate=RATE)
    timeline.show(kept, lambda i: empty_snapshot(), "a recording")
    timeline.move_to(2.0)
    assert timeline.snapshot().time == pytest.approx(2.0)
    np.testing.assert_array_equal(timeline.window(1.0), ticks[1000:2001])
    timeline.go_live()  # there is no now
    assert not timeline.is_live
    kept.close()
    kept.close()


def test_ticks_that_were_left_out_do_not_stretch_a_window(servo):
    ticks = ticks_at(servo.ticks, 4000)[::4]
    servo.history.add(ticks)
    window = Timeline(servo).window(1.0)
    assert window["time"][-1] - window["time"][0] == pytest.approx(1.0)
    assert len(window) == 251
