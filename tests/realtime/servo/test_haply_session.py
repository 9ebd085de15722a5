"""A session through the real Haply client, on a service that fails it in every way it can."""

import functools
import time

import numpy as np
import pytest

pytest.importorskip("websockets")

from asperity.errors import AsperityError
from asperity.realtime.devices.catalogue import device
from asperity.realtime.devices.haply.fake_service import FakeService
from asperity.realtime.devices.haply.messages import HOME
from asperity.realtime.servo.process import ServoSpec
from asperity.realtime.servo.running import Servo
from asperity.realtime.servo.safety import SafetySettings
from asperity.runs.recording import read_recording
from asperity.scene.builtin import load_scene
from asperity.simulation.tool_contact import SILENT

MOST = 2.0
"""[N]"""


def until(what, fault, seconds=30.0):
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, fault
        time.sleep(5e-3)


def test_whatever_the_service_does_no_force_stays_and_none_is_too_strong(tmp_path):
    path = tmp_path / "recording.h5"
    scene = load_scene("probe-plate").changed(coupling={"mode": "implicit"})

    def pushes():
        return np.linalg.norm(service.force()) > 0.05

    def rests():
        return not any(service.force())

    down = [0.0]

    def stroking(t):
        x, y, z = HOME
        return x + 0.02 * np.sin(0.5 * np.pi * t), y, z - down[0]

    with FakeService(stroking) as service:
        make = functools.partial(device, "haply", uri=service.uri)
        spec = ServoSpec(scene, make, safety=SafetySettings(max_force=MOST))
        with Servo(spec, path, {"scene": "probe-plate"}) as servo:
            servo.start()
            down[0] = 0.01  # from wherever it began, onto the plate
            for fault in ("disconnect", "silent", "unplugged", "frozen"):
                # The velocity in a frozen frame distinguishes it from a hand at rest.
                until(lambda: pushes() and abs(service.cursor.velocity[0]) > 0.015, fault)
                if fault == "disconnect":
                    before = len(service.sessions)
                    service.disconnect()
                    until(lambda n=before: len(service.sessions) > n, fault)  # it is back
                    continue
                setattr(service, fault, True)
                until(rests, fault)
                time.sleep(0.1)
                assert rests(), fault
                setattr(service, fault, False)
            until(pushes, "no force after the faults")
            servo.process.kill()
            until(rests, "force after SIGKILL")
            time.sleep(0.1)
            assert rests()
            with pytest.raises(AsperityError, match="SIGKILL"):
                servo.finish()
        assert service.largest_force <= MOST * (1.0 + 1e-9)  # nor was one not finite
    recording = read_recording(path)
    assert np.isfinite(recording.device_wrench).all()
    assert np.linalg.norm(recording.device_wrench[:, :3], axis=1).max() <= MOST * (1.0 + 1e-9)
    assert np.count_nonzero(recording.flags & SILENT) > 100
