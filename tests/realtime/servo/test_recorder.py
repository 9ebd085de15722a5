"""The recorder: every tick, whatever happens to whom."""

import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest

from asperity.realtime.servo.ipc import TICK, TickRing
from asperity.realtime.servo.recorder import record
from asperity.runs.recording import read_recording


class Report:
    """The end of a pipe."""

    def send(self, what):
        self.what = what


def filled(path, ticks, capacity=20_000):
    ring = TickRing(path, capacity)
    for n in range(ticks):
        ring.push(tick(n))
    return ring


def tick(n):
    """Return a tick all of whose numbers are `n`."""
    out = np.zeros((), TICK)
    for name in TICK.names:
        out[name] = n
    return out


def test_it_writes_what_is_in_the_ring_and_ends(tmp_path):
    ring = filled(tmp_path / "ring", 3000)
    ring.close()
    report = Report()
    record(tmp_path / "ring", tmp_path / "r.h5", {"scene": "a"}, report)
    recording = read_recording(tmp_path / "r.h5")
    np.testing.assert_array_equal(recording.time, np.arange(3000))
    np.testing.assert_array_equal(recording.handle_pose[:, 6], np.arange(3000))
    np.testing.assert_array_equal(recording.flags, np.arange(3000))
    assert recording.attributes["scene"] == "a"
    assert report.what == {"ticks": 3000, "error": ""}


RECORDER = textwrap.dedent("""
    import sys, resource
    sys.dont_write_bytecode = True
    from pathlib import Path
    import asperity.realtime.servo.recorder as recorder
    class Report:
        def send(self, what):
            print(what, flush=True)
    if sys.argv[3] != "0":
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), int(sys.argv[3])))
    print("begun", flush=True)
    recorder.record(Path(sys.argv[1]), Path(sys.argv[2]), {}, Report())
""")


def started(ring, path, *, file_size=0):
    process = subprocess.Popen(
        [sys.executable, "-c", RECORDER, str(ring), str(path), str(file_size)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "begun\n"
    return process


def test_killed_amid_writing_it_leaves_a_file_up_to_the_last_second(tmp_path):
    ring = TickRing(tmp_path / "ring", 20_000)
    process = started(tmp_path / "ring", tmp_path / "r.h5")
    begun, n = time.monotonic(), 0
    pushed = []
    while time.monotonic() - begun < 2.0:
        ring.push(tick(n))
        pushed.append(time.monotonic())
        n += 1
        time.sleep(1e-3)
    process.send_signal(signal.SIGKILL)
    killed = time.monotonic()
    process.communicate()
    recording = read_recording(tmp_path / "r.h5")
    assert len(recording.time) > 0
    np.testing.assert_array_equal(recording.time, np.arange(len(recording.time)))
    # A second, and what a busy machine may take to begin.
    assert killed - pushed[len(recording.time) - 1] < 1.8


@pytest.mark.parametrize(("limit", "waiting"), [(4_200_000, 15_000), (8_000_000, 5000)])
def test_a_full_disk_is_reported_and_the_file_opens(tmp_path, limit, waiting):
    """As a limit to the size of files, which the system refuses in the same places."""
    ring = filled(tmp_path / "ring", waiting)
    process = started(tmp_path / "ring", tmp_path / "r.h5", file_size=limit)
    pushed, until = waiting, time.monotonic() + 20.0
    while time.monotonic() < until and process.poll() is None:
        for _ in range(50):
            pushed += ring.push(tick(pushed))
        time.sleep(5e-3)
    printed, complained = process.communicate(timeout=10)
    assert process.returncode == 0
    assert "no room for" in printed
    assert "File too large; recording stopped" in complained
    # No ticks are taken any more: the ring fills and drops some, and the loop does not notice.
    for _ in range(25_000):
        ring.push(tick(0))
    assert ring.lost > 0
    recording = read_recording(tmp_path / "r.h5")
    assert len(recording.time) == int(printed.split("'ticks': ")[1].split(",")[0])
    assert len(recording.time) == 0 if waiting > 5000 else len(recording.time) >= 5000
    np.testing.assert_array_equal(recording.time, np.arange(len(recording.time)))


def test_it_ends_when_its_parent_is_gone(tmp_path):
    """Parent and recorder are two processes; the parent is killed, nobody closes the ring."""
    filled(tmp_path / "ring", 2000)
    code = textwrap.dedent("""
        import subprocess, sys, time
        child = subprocess.Popen([sys.executable, "-c", *sys.argv[1:]], stdout=subprocess.PIPE)
        child.stdout.readline()
        print(child.pid, flush=True)
        time.sleep(60)
    """)
    arguments = [RECORDER, str(tmp_path / "ring"), str(tmp_path / "r.h5"), "0"]
    parent = subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, text=True
    )
    child = int(parent.stdout.readline())
    time.sleep(0.5)
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    until = time.monotonic() + 20.0
    while time.monotonic() < until and _is_alive(child):
        time.sleep(0.05)
    assert not _is_alive(child)
    assert len(read_recording(tmp_path / "r.h5").time) == 2000


def _is_alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
