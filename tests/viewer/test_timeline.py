"""The time that the page shows: now, held, and through what was kept."""

import numpy as np
import pytest
from fake_link import PLACES, RATE, FakeLink, rows_at

from asperity.realtime.servo.tick_row import columns
from asperity.runs.recording import RecordingWriter
from asperity.viewer.replayed_contacts import empty_moment
from asperity.viewer.row_buffer import KeptRecording, KeptRows
from asperity.viewer.timeline import LOOKED_BACK, ShownLink, Timeline
from asperity.viewer.view_model import Frames


@pytest.fixture
def link():
    link = FakeLink()
    link.give(3.0)
    return link


def seen(link, timeline, *, times, step=1 / 30):
    """Update as the page does, with the loop going on; return the moments that it showed."""
    frames, shown = Frames(ShownLink(link, timeline)), []
    for i in range(times):
        link.give(step)
        frame = frames.take(i * step)
        timeline.advance(frame)
        shown.append(frame.moment)
    return shown


def test_live_it_shows_the_last_seconds(link):
    timeline = Timeline(link)
    rows = timeline.window(0.5)
    assert len(rows) == 501
    assert rows[-1, 0] == pytest.approx(2.999)
    link.give(1.0)
    assert timeline.window(0.5)[-1, 0] == pytest.approx(3.999)
    assert timeline.is_live
    assert timeline.moment() is None


def test_held_it_stands_while_the_loop_goes_on(link):
    timeline = Timeline(link)
    timeline.hold()
    shown = seen(link, timeline, times=30)
    assert not timeline.is_live
    assert timeline.at == timeline.length == pytest.approx(2.999)
    assert timeline.window(1.0)[-1, 0] == pytest.approx(2.999)
    # Nobody had seen a moment before it was held: the one there was is shown.
    assert shown[0] is not None
    timeline.go_live()
    assert timeline.window(1.0)[-1, 0] == pytest.approx((link.ticks - 1) / RATE)


def test_everything_goes_where_the_slider_is(link):
    timeline = Timeline(link)
    seen(link, timeline, times=30)
    timeline.hold()
    timeline.move_to(1.25)
    moment = seen(link, timeline, times=1)[0]
    row = rows_at(1250, 1)[0]
    assert moment.time == pytest.approx(1.25)
    np.testing.assert_allclose(moment.tool_pose, row[PLACES["tool_pose"]])
    np.testing.assert_allclose(moment.device_wrench, row[PLACES["device_wrench"]])
    assert timeline.window(0.5)[-1, 0] == pytest.approx(1.25)
    assert timeline.window(0.5)[0, 0] == pytest.approx(0.75)
    timeline.move_to(99.0)
    assert timeline.at == timeline.length
    timeline.move_to(-1.0)
    assert timeline.moment().time == 0.0


def test_only_the_last_seconds_are_kept(link):
    link.give(LOOKED_BACK + 5.0)
    timeline = Timeline(link)
    timeline.hold()
    assert timeline.length == pytest.approx(LOOKED_BACK, abs=2e-3)
    assert timeline.everything()[-1, 0] == pytest.approx((link.ticks - 1) / RATE)


def test_it_plays_at_a_speed_and_stops_at_the_end(link):
    timeline = Timeline(link)
    timeline.hold()
    timeline.move_to(0.5)
    timeline.speed = 0.25
    timeline.play()
    seen(link, timeline, times=31)
    assert timeline.at == pytest.approx(0.75, abs=1e-6)
    timeline.speed = 10.0
    seen(link, timeline, times=31)
    assert timeline.at == timeline.length
    assert not timeline.playing
    timeline.play()  # from the end: once more
    assert timeline.at == 0.0


def test_a_recording_is_read_as_it_is_looked_at(tmp_path):
    rows = rows_at(0, 4000)
    with RecordingWriter(tmp_path / "recording.h5", {"dt": 1e-3}) as writer:
        writer.add_rows(columns(rows))
    kept = KeptRecording(tmp_path / "recording.h5")
    assert (kept.count, kept.length) == (4000, pytest.approx(3.999))
    np.testing.assert_array_equal(kept.rows(1000, 1010), rows[1000:1010])
    assert kept.index(1.2345) == KeptRows(rows).index(1.2345) == 1234
    timeline = Timeline(rate=RATE)
    timeline.show(kept, lambda i: empty_moment(), "a recording")
    timeline.move_to(2.0)
    assert timeline.moment().time == pytest.approx(2.0)
    np.testing.assert_array_equal(timeline.window(1.0), rows[1000:2001])
    timeline.go_live()  # there is no now
    assert not timeline.is_live
    kept.close()
    kept.close()


def test_ticks_that_were_left_out_do_not_stretch_a_window(link):
    rows = rows_at(link.ticks, 4000)[::4]
    link.history.add(rows)
    window = Timeline(link).window(1.0)
    assert window[-1, 0] - window[0, 0] == pytest.approx(1.0)
    assert len(window) == 251
