"""The page of a recording."""

import http.client

import numpy as np
import pytest

pytest.importorskip("viser", reason="needs viser (asperity[view])")
from fake_client import ticks_at

from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import TICK
from asperity.runs.recording import RecordingWriter
from asperity.viewer.replayed import recording_page


def recorded(folder, ticks):
    path = folder / "recording.h5"
    writer = RecordingWriter(path, {"scene": "probe-plate", "source": "probe-plate", "dt": 1e-3})
    if len(ticks):
        writer.add_rows({name: ticks[name] for name in TICK.names})
    writer.close()
    return path


def test_a_recording_is_shown_from_its_beginning(tmp_path):
    ticks = ticks_at(0, 500)
    with recording_page(recorded(tmp_path, ticks), port=0) as page:
        timeline = next(p._timeline for p in page.panels if hasattr(p, "_timeline"))
        assert (timeline.is_live, timeline.at) == (False, 0.0)
        assert timeline.length == pytest.approx(0.499)
        np.testing.assert_array_equal(timeline.everything()["time"], ticks["time"])
        timeline.move_to(0.25)
        snapshot = page.servo.latest()
        np.testing.assert_allclose(snapshot.tool_pose, ticks["tool_pose"][250])
        connection = http.client.HTTPConnection("127.0.0.1", page.server.get_port(), timeout=10)
        connection.request("GET", "/")
        assert connection.getresponse().status == 200
    assert not page.server.get_clients()


def test_a_recording_without_ticks_is_refused(tmp_path):
    path = recorded(tmp_path, ticks_at(0, 0))
    with pytest.raises(AsperityError, match="has no ticks"), recording_page(path, port=0):
        pass
