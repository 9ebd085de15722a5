"""The servo process as it is: a scene, a device with faults, a viewer, a recorder, and signals.

Nothing here depends on how quick the machine is: what is tested is what reached the device.
"""

import functools
import os
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import fake_device
import numpy as np
import pytest
from fake_device import Fault, Written

from asperity.errors import AsperityError
from asperity.realtime.servo.process import ServoSpec
from asperity.realtime.servo.running import Servo
from asperity.runs.recording import read_recording
from asperity.scene.builtin import load_scene
from asperity.simulation.tool_contact import SILENT

HERE = Path(__file__).parent
FAULTS = (
    Fault("disconnect", 0.8, 0.1), Fault("stale", 1.2, 0.1), Fault("nan", 1.6, 0.1),
    Fault("nan-twist", 2.0, 0.1), Fault("huge", 2.4, 0.1), Fault("raise", 2.8, 0.1),
    Fault("stall", 3.2, 0.1), Fault("far", 3.8, 0.1),
)  # fmt: skip
VIEWER = textwrap.dedent("""
    import sys
    from pathlib import Path
    from asperity.realtime.servo.snapshot import SnapshotReader
    reader = SnapshotReader(Path(sys.argv[1]))
    print("begun", flush=True)
    while True:
        reader.read()
""")


def scene():
    return load_scene("probe-plate").changed(coupling={"mode": "implicit"})


def spec(log, faults=(), **options):
    return ServoSpec(scene(), functools.partial(fake_device.make, log, faults), **options)


def until(what, seconds=20.0):
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_faults_of_the_device_and_a_viewer_that_is_killed(tmp_path):
    log, path = tmp_path / "log", tmp_path / "recording.h5"
    with Servo(spec(log, FAULTS), path, {"scene": "probe-plate"}) as servo:
        ready = servo.start()
        assert ready["device"] == "fake"
        viewer = subprocess.Popen(
            [sys.executable, "-c", VIEWER, str(servo.snapshot_path)], stdout=subprocess.PIPE
        )
        viewer.stdout.readline()
        time.sleep(0.2)
        viewer.send_signal(signal.SIGKILL)
        viewer.communicate()
        assert servo.snapshot_path.exists()
        before = servo.snapshot()
        until(lambda: servo.snapshot().ticks > before.ticks)
        until(lambda: servo.snapshot().time > 4.3)
        result = servo.finish()
    written = Written.read(log)
    written.assert_safe()
    assert written.closed
    assert not written.wrench[-1].any()
    assert written.force.max() > 0.1
    # Some while into each fault that leaves the device silent it is sent zero.
    for fault in FAULTS:
        # (What is known by the time it is written lags the reading by less than a tick.)
        during = (written.time > fault.begin + 0.03) & (written.time < fault.begin + fault.length)
        if fault.kind in ("disconnect", "stale", "nan", "nan-twist", "raise"):
            assert not written.wrench[during].any(), fault.kind
    after = (written.time > 2.3) & (written.time < 2.4)
    assert written.force[after].max(initial=1.0) > 0.1
    safety = result["safety"]
    assert safety["silences"] >= 5
    assert safety["bad_readings"] > 10
    assert safety["workspace_clamps"] > 5
    assert safety["errors"] > 10
    assert result["timing"]["ticks_skipped"] > 200
    recording = read_recording(path)
    assert len(recording.time) == result["recorder"]["ticks"] == result["timing"]["ticks"]
    assert np.isfinite(recording.device_wrench).all()
    assert np.isfinite(recording.handle_pose).all()
    assert np.count_nonzero(recording.flags & SILENT) > 100
    assert np.diff(recording.time).max() > 0.2
    assert recording.time[-1] == pytest.approx((result["timing"]["ticks_due"] - 1) * 1e-3)
    assert result["ended"] == "stopped"


def test_parameters_are_swapped_whole_and_sigterm_sends_zero(tmp_path):
    log = tmp_path / "log"
    with Servo(spec(log)) as servo:
        servo.start()
        until(lambda: servo.snapshot() is not None and servo.snapshot().time > 0.7)
        with pytest.raises(AsperityError, match="friction"):
            servo.set(friction=-1.0)
        stiff = float(np.median(Written.read(log).force[-50:]))
        servo.set(
            stiffness=2.0 * servo.parameters.stiffness, rate=500.0,
            coupling=replace(servo.parameters.coupling, stiffness=500.0),
        )  # fmt: skip
        ticks = servo.snapshot().ticks
        until(lambda: servo.snapshot().ticks > ticks + 200)
        soft = float(np.median(Written.read(log).force[-50:]))
        written = Written.read(log)
        sent, last = len(written.time), written.time[-1]
        os.kill(servo.process.pid, signal.SIGTERM)
        until(lambda: servo.wait(0.05))
        result = servo.finish()
    assert soft > 0.1
    assert stiff > 1.5 * soft
    assert result["ended"] == "SIGTERM"
    written = Written.read(log)
    written.assert_safe()
    assert not written.wrench[-1].any()
    assert written.closed
    # Two ticks of 500 Hz, and what a busy machine may take.
    assert written.time[sent:][written.force[sent:] > 0.0].max(initial=last) < last + 0.1


def test_killed_the_recording_is_whole_and_said_to_be_cut(tmp_path):
    log, path = tmp_path / "log", tmp_path / "recording.h5"
    with Servo(spec(log), path) as servo:
        servo.start()
        until(lambda: servo.snapshot() is not None and servo.snapshot().time > 1.0)
        ticks = servo.snapshot().ticks
        servo.process.kill()
        with pytest.raises(AsperityError, match=r"the servo process ended \(killed by SIGKILL\)"):
            servo.finish()
    Written.read(log).assert_safe()
    recording = read_recording(path)
    # The recorder outlives it, and takes the ring to its end.
    assert len(recording.time) >= ticks
    steps = np.diff(recording.time) / 1e-3
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
    assert steps.min() > 0.5
    assert recording.contact_count.max() == 1


PARENT = textwrap.dedent("""
    import functools, sys, time
    from pathlib import Path
    sys.path.insert(0, sys.argv[1])
    import fake_device
    from asperity.scene.builtin import load_scene
    from asperity.realtime.servo.process import ServoSpec
    from asperity.realtime.servo.running import Servo
    if __name__ == "__main__":
        scene = load_scene("probe-plate").changed(coupling={"mode": "direct"})
        made = functools.partial(fake_device.make, Path(sys.argv[2]) / "log")
        with Servo(ServoSpec(scene, made), Path(sys.argv[2]) / "recording.h5") as servo:
            servo.start()
            print(servo.process.pid, servo.recorder.pid, servo.snapshot_path.parent, flush=True)
            time.sleep(60)
""")


def test_without_a_parent_it_sends_zero_and_ends(tmp_path):
    (tmp_path / "parent.py").write_text(PARENT)
    parent = subprocess.Popen(
        [sys.executable, str(tmp_path / "parent.py"), str(HERE), str(tmp_path)],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    servo, recorder, folder = parent.stdout.readline().split()
    try:
        until(lambda: len(Written.read(tmp_path / "log").time) > 800)
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.communicate()
    for pid in (servo, recorder):
        until(lambda pid=pid: not _is_alive(int(pid)))
    written = Written.read(tmp_path / "log")
    written.assert_safe()
    assert written.closed
    assert not written.wrench[-1].any()
    assert written.force.max() > 0.1
    recording = read_recording(tmp_path / "recording.h5")
    assert len(recording.time) > 500
    assert not Path(folder).exists()


def _is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_what_keeps_the_loop_from_beginning_is_reported(tmp_path):
    (tmp_path / "log").write_text("in the way")
    with Servo(spec(tmp_path / "log")) as servo:
        with pytest.raises(AsperityError, match="the servo loop failed: FileExistsError"):
            servo.start()
        folder = servo.snapshot_path.parent
    assert not folder.exists()
