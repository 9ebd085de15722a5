"""A recording that begins and ends while ticks continue."""

import json

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import TICK
from asperity.realtime.servo.parameters import LiveParameters, attributes_of
from asperity.realtime.servo.recorder import RecorderOnRequest
from asperity.realtime.servo.replay import scene_of_recording
from asperity.runs.recording import read_recording
from asperity.scene.builtin import load_scene


def test_all_ticks_that_are_handed_on_are_in_the_file_from_time_zero(tmp_path):
    scene = load_scene("probe-plate")
    parameters = LiveParameters(1000.0, 321.0, 0.25, scene.coupling)
    attributes = attributes_of(scene, parameters, source="probe-plate", device="a hand")
    recorder = RecorderOnRequest(tmp_path / "recording.h5", attributes, 1000.0)
    ticks = np.random.default_rng(1).random((3000, 30)).view(TICK)[:, 0]
    ticks["time"] = 77.0 + np.arange(3000) * 1e-3
    for part in np.array_split(ticks, 170):
        recorder.add(part)
    result = recorder.finish()
    assert result == {"ticks": 3000, "error": "", "ticks_lost": 0}
    assert recorder.seconds == pytest.approx(2.999)
    assert not recorder.is_alive
    found = read_recording(tmp_path / "recording.h5")
    np.testing.assert_allclose(found.time, np.arange(3000) * 1e-3, atol=1e-9)
    np.testing.assert_array_equal(found.contact_wrench, ticks["contact_wrench"])
    np.testing.assert_array_equal(found.penetration_depth, ticks["penetration_depth"])
    assert found.attributes["device"] == "a hand"
    assert ticks["time"][0] == 77.0  # what was handed on is not changed

    # The scene is found as it was, with what had been changed while it ran.
    again = scene_of_recording(found.attributes)
    assert (again.force.stiffness, again.force.friction) == (321.0, 0.25)
    assert json.loads(found.attributes["document"])["force"]["stiffness"] == 321.0
    scene.save(tmp_path / "scene")
    beside = scene_of_recording(found.attributes, beside=tmp_path)
    assert beside.force.stiffness == 321.0


def test_a_file_that_is_there_is_not_touched(tmp_path):
    (tmp_path / "recording.h5").write_text("mine")
    with pytest.raises(AsperityError, match="exists; give another name"):
        RecorderOnRequest(tmp_path / "recording.h5", {}, 1000.0)
    assert (tmp_path / "recording.h5").read_text() == "mine"
