"""`asperity run --device`, `record` and `replay`: whole sessions, with nobody there."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from asperity._core.cores import usable_cores
from asperity.cli import main
from asperity.realtime.servo.replay import replay, scene_of_recording
from asperity.runs.recording import read_recording
from asperity.runs.run_scene import run_scene
from asperity.scene.builtin import load_scene


def summary_in(folder):
    return json.loads((folder / "summary.json").read_text("utf-8"))


def given_while_late(recording):
    """Return what the hand got out in ticks of more than a millisecond and a half [J].

    A loop that other programs keep from ticking holds its wrench, and sees only then what that
    has given. It pays that back, but it cannot help it.
    """
    out = (recording.device_wrench[:-1, :3] * np.diff(recording.handle_pose[:, :3], axis=0)).sum(1)
    return np.maximum(out, 0.0)[np.diff(recording.time) > 1.5e-3].sum()


@pytest.mark.parametrize("seconds", [2, pytest.param(5, marks=pytest.mark.slow)])
def test_some_seconds_in_a_simulated_hand_and_once_more(seconds, small_pictures, tmp_path, capsys):
    out = tmp_path / "felt"
    options = ["--device", "simulated", "--force-n", "0.5", "--max-force-n", "2"]
    options += ["--seconds", str(seconds)]
    assert main(["run", "probe-plate", *options, "--out", str(out)]) == 0
    names = {path.name for path in out.iterdir()}
    assert {"summary.json", "recording.h5", "picture.png", "force.png", "spectrum.svg"} <= names
    summary, recording = summary_in(out), read_recording(out / "recording.h5")
    timing = summary["timing"]
    assert 1000 * seconds <= timing["ticks_due"] < 1000 * seconds + 500  # the last tick may be late
    assert summary["ticks"] == timing["ticks"] == len(recording.time)
    assert summary["recorder"] == {"ticks": len(recording.time), "error": "", "ticks_lost": 0}
    assert summary["ended"] == "its time was over"
    assert summary["trajectory"]["device"] == "simulated"
    # At 83 mm/s a stiff tool hops over the waves.
    assert summary["contacts"]["ticks_in_contact"] > 0.6 * summary["ticks"]
    assert summary["tick_us"]["median"] > 0.0
    assert set(timing["stages_us"]) >= {"read", "tool", "write", "publish", "tick"}
    force = np.linalg.norm(recording.device_wrench[:, :3], axis=1)
    assert np.isfinite(recording.device_wrench).all()
    assert 0.2 < force.max() <= 2.0 * (1 + 1e-9)
    assert summary["safety"]["max_force_n"] == 2.0
    assert summary["passivity"]["gained_j"] < 1e-4 + 2.0 * given_while_late(recording)
    assert f"{seconds}.0 s on simulated" in capsys.readouterr().out
    asked = summary["real_time"]
    # On a machine that is busy with others contacts may have looked too slow to share a core.
    assert ("recorder" in asked) == ("contacts" in asked)
    busy = "contacts" in asked and usable_cores() > 1
    assert asked["between_ticks"] == ("its core is kept busy" if busy else "asleep")

    again = tmp_path / "again"
    assert main(["replay", str(out), "--out", str(again)]) == 0
    replayed = summary_in(again)["replay"]
    assert replayed["ticks"] >= len(recording.time) - 2
    assert replayed["device_wrench"]["rms_force_n"] < 1.0
    assert "the device force differs by at most" in capsys.readouterr().out
    played = read_recording(again / "recording.h5")
    # Where nothing was in the way, the loop felt what the simulation feels.
    row = np.rint((recording.time - recording.time[0]) / 1e-3).astype(int)
    there = (row < len(played.time)) & (recording.time > 0.5)
    apart = played.device_wrench[row[there], :3] - recording.device_wrench[there, :3]
    assert np.median(np.linalg.norm(apart, axis=1)) < 0.1


@pytest.mark.parametrize("name", ["probe-plate", "hammer-blocks", "file-cad"])
@pytest.mark.parametrize("seconds", [6, pytest.param(20, marks=pytest.mark.slow)])
def test_seconds_of_each_scene_in_a_simulated_hand(name, seconds, tmp_path):
    """However busy the machine is, every tick that was done is on disk, and none is too strong."""
    out = tmp_path / "felt"
    assert main(["record", name, "--seconds", str(seconds), "--out", str(out)]) == 0
    summary, recording = summary_in(out), read_recording(out / "recording.h5")
    timing = summary["timing"]
    assert 1000 * seconds <= timing["ticks_due"] < 1050 * seconds
    assert timing["ticks"] == len(recording.time) == summary["recorder"]["ticks"]
    assert summary["recorder"]["ticks_lost"] == 0
    assert timing["ticks"] + timing["ticks_skipped"] == timing["ticks_due"]
    assert summary["ended"] == "its time was over"
    for wrench in (recording.device_wrench, recording.contact_wrench):
        assert np.isfinite(wrench).all()
    force = np.linalg.norm(recording.device_wrench[:, :3], axis=1)
    assert 0.1 < force.max() <= summary["safety"]["max_force_n"] * (1 + 1e-9)
    # The hand does not lean on a device whose force is still coming up.
    height = recording.handle_pose[:, 2]
    begun, later = height[recording.time < 0.3], height[recording.time > 0.3]
    assert begun.min() > later.min() - 1e-4
    if timing["fallbacks_percent"] > 1.0:
        return  # too busy for what follows: contacts were late
    assert np.count_nonzero(recording.contact_count) > 0.8 * timing["ticks"]
    # Pressed at rest, the tool stays where it is, and the hand feels all of the force.
    rest = recording.time > 0.5 * seconds
    assert np.ptp(height[rest]) < 1e-5
    np.testing.assert_allclose(recording.device_wrench[rest, 2], 0.58, atol=0.02)


def test_two_thousand_ticks_a_second_are_there_on_request(tmp_path):
    out = tmp_path / "felt"
    options = ["--seconds", "1", "--rate-hz", "2000", "--out", str(out)]
    assert main(["record", "probe-plate", *options]) == 0
    recording = read_recording(out / "recording.h5")
    assert 2000 <= summary_in(out)["timing"]["ticks_due"] < 2400
    assert recording.attributes["dt"] == pytest.approx(5e-4)
    steps = np.diff(recording.time) / 5e-4
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
    assert np.median(steps) == pytest.approx(1.0)


def test_ctrl_c_ends_a_session_well(tmp_path):
    out = tmp_path / "felt"
    # Longer than the busiest machine takes to see that it runs.
    options = ["--seconds", "300", "--out", str(out)]
    command = [sys.executable, "-m", "asperity", "record", "probe-plate", *options]
    session = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # Tests that run in the background of a shell have a Ctrl-C that is ignored, and pass it on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    try:
        # Until some ticks are on disk: it is not before the loop runs that Ctrl-C ends it well.
        file, sizes, end = out / "recording.h5", set(), time.monotonic() + 60.0
        while len(sizes) < 4 and time.monotonic() < end:
            sizes |= {file.stat().st_size} if file.exists() else set()
            time.sleep(0.05)
        session.send_signal(signal.SIGINT)
        printed, complained = session.communicate(timeout=60.0)
    finally:
        session.kill()
    assert session.returncode == 0, complained
    assert "ended: stopped" in printed
    summary, recording = summary_in(out), read_recording(out / "recording.h5")
    assert summary["ended"] == "stopped"
    assert len(recording.time) == summary["timing"]["ticks"] > 100


def test_a_loop_can_be_set_to_sleep(tmp_path):
    options = ["--device", "simulated", "--seconds", "0.5", "--no-busy-wait"]
    assert main(["record", "probe-plate", *options, "--out", str(tmp_path / "felt")]) == 0
    assert summary_in(tmp_path / "felt")["real_time"]["between_ticks"] == "asleep"


def test_a_device_with_a_service_has_a_core_left_for_it(tmp_path):
    pytest.importorskip("websockets")
    options = ["--device", "haply-fake", "--seconds", "0.5"]
    assert main(["record", "probe-plate", *options, "--out", str(tmp_path / "felt")]) == 0
    asked = summary_in(tmp_path / "felt")["real_time"]
    busy = "contacts" in asked and usable_cores() > 2
    assert asked["between_ticks"] == ("its core is kept busy" if busy else "asleep")


@pytest.fixture(scope="module")
def headless(tmp_path_factory):
    """A run in simulated time."""
    scene = load_scene("probe-plate").changed(
        coupling={"mode": "implicit"}, trajectory={"seconds": 0.3}
    )
    path = tmp_path_factory.mktemp("headless") / "recording.h5"
    run_scene(scene, path)
    return path


def test_a_run_in_simulated_time_is_replayed_as_it_was(headless, tmp_path):
    recording = read_recording(headless)
    scene = scene_of_recording(recording.attributes)
    assert scene.coupling.mode == "implicit"
    replayed = replay(recording, scene, tmp_path / "again.h5").summary["replay"]
    assert replayed["ticks"] == replayed["ticks_untouched"] == 301
    assert replayed["device_wrench"]["largest_force_n"] < 1e-9
    assert replayed["contact_wrench"]["largest_torque_n_m"] < 1e-9


def test_another_scene_differs(headless, tmp_path):
    recording = read_recording(headless)
    scene = scene_of_recording(recording.attributes, "probe-plate-grating")
    replayed = replay(recording, scene, tmp_path / "again.h5").summary["replay"]
    assert replayed["contact_wrench"]["largest_force_n"] > 0.01


def test_recorded_poses_are_a_device_too(headless, tmp_path, capsys):
    out = tmp_path / "out"
    device = f"replay:{headless}"
    assert main(["record", "probe-plate", "--device", device, "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {"summary.json", "recording.h5"}
    recording = read_recording(out / "recording.h5")
    assert recording.attributes["trajectory"] == "device"
    first = read_recording(headless)
    np.testing.assert_allclose(recording.handle_pose[-1], first.handle_pose[-1], atol=1e-3)
    # What was felt is kept: the same command again writes beside it.
    capsys.readouterr()
    assert main(["record", "probe-plate", "--device", device, "--out", str(out)]) == 0
    assert "out-2: " in capsys.readouterr().out
    assert (tmp_path / "out-2" / "recording.h5").is_file()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", "probe-plate", "--rate-hz", "2000"], "options of the servo loop need --device"),
        (
            ["run", "probe-plate", "--device", "touch", "--speed-mm-s", "9"],
            "--speed-mm-s: the user's hand moves the device touch; leave them out",
        ),
        (
            ["run", "probe-plate", "--device", "tuch"],
            "unknown device 'tuch' (did you mean 'touch'?)",
        ),
        (
            ["run", "probe-plate", "--device", "simulated", "--rate-hz", "20"],
            "--rate-hz must lie between 100 and 20000 Hz, got 20.0",
        ),
        (
            ["record", "probe-plate", "--device-option", "motion"],
            "--device-option must be KEY=VALUE, got 'motion'",
        ),
        (["replay", "nothing.h5"], "no such recording: nothing.h5"),
    ],
)
def test_bad_input_is_reported_in_one_line(arguments, expected, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    printed = capsys.readouterr().err
    assert expected in printed
    assert printed.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
