"""Ring, snapshot and mailbox: what one process leaves for another."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.realtime.servo.contact_worker import MAX_SHOWN, ShownContacts
from asperity.realtime.servo.ipc import MAX_TEXT, TICK, Mailbox, TickRecord, TickRing
from asperity.realtime.servo.snapshot import SnapshotReader, SnapshotWriter
from asperity.realtime.shared_file import shared_folder


def tick(n):
    """Return a tick all of whose numbers are `n`."""
    out = np.zeros((), TICK)
    for name in TICK.names:
        out[name] = n
    return out


def numbers(ticks):
    """Return the numbers of ticks, one row each."""
    return ticks.view(np.float64).reshape(len(ticks), -1)


def test_ticks_come_out_as_they_went_in_and_in_order(tmp_path):
    ring, other = TickRing(tmp_path / "ring", 100), None
    other = TickRing(tmp_path / "ring")
    assert other.capacity == 100
    taken, n = [], 0
    draw = np.random.default_rng(1)
    while n < 5000:
        for _ in range(draw.integers(0, 100)):
            assert ring.push(tick(n))
            n += 1
        taken.append(other.take())
    rows = numbers(np.concatenate(taken))
    np.testing.assert_array_equal(rows, np.arange(n)[:, None] * np.ones(rows.shape[1]))
    assert rows.shape[1] == 30
    assert ring.lost == other.lost == 0


def test_a_full_ring_loses_the_new_ticks_counts_them_and_goes_on(tmp_path):
    ring = TickRing(tmp_path / "ring", 10)
    kept = [n for n in range(25) if ring.push(tick(n))]
    assert kept == list(range(10))
    assert ring.lost == 15
    assert ring.take()["time"].tolist() == kept
    assert ring.push(tick(99))
    assert ring.take()["time"].tolist() == [99]


def test_a_writer_and_a_reader_at_the_same_time(tmp_path):
    ring, other = TickRing(tmp_path / "ring", 64), TickRing(tmp_path / "ring")
    pushed = []

    def write():
        for n in range(20_000):
            if ring.push(tick(n)):
                pushed.append(n)
        ring.close()

    thread = threading.Thread(target=write)
    thread.start()
    taken = []
    while not other.is_closed:
        taken.append(other.take())
    taken.append(other.take())
    thread.join()
    rows = numbers(np.concatenate(taken))
    assert (rows == rows[:, :1]).all()
    assert rows[:, 0].astype(int).tolist() == pushed
    assert len(pushed) + ring.lost == 20_000


def test_a_tick_has_the_fields_of_a_recording():
    one = TickRecord()
    one.time[...], one.flags[...], one.tool_pose[:] = 1.5, 96, np.arange(7)
    fields = np.stack([one.record, one.record])
    assert fields["time"].tolist() == [1.5, 1.5]
    assert fields["flags"].tolist() == [96, 96]
    np.testing.assert_array_equal(fields["tool_pose"][1], np.arange(7))
    assert fields["device_wrench"].shape == (2, 6)


def shown(count, value):
    out = ShownContacts()
    out.count = count
    for part in (out.point, out.normal, out.force, out.depth):
        part[:count] = value
    return out


def test_a_snapshot_is_the_latest_tick(tmp_path):
    writer = SnapshotWriter(tmp_path / "snapshot")
    reader = SnapshotReader(tmp_path / "snapshot")
    assert reader.read() is None
    one = TickRecord()
    one.time[...], one.contact_count[...], one.handle_pose[:] = 2.0, 3, np.arange(7)
    for value in (1.0, 2.0):
        one.flags[...] = value
        writer.write(
            one,
            np.full(6, 7.0),
            np.full(6, 8.0),
            (1, 2, 3, 4, 5, 6, 7, 8.5, 9.5),
            shown(3, value),
        )
    snapshot = reader.read()
    assert (snapshot.time, snapshot.flags, snapshot.contact_count) == (2.0, 2, 3)
    assert snapshot[9:18] == (1, 2, 3, 4, 5, 6, 7, 8.5, 9.5)
    np.testing.assert_array_equal(snapshot.handle_pose, np.arange(7))
    np.testing.assert_array_equal(snapshot.point, np.full((3, 3), 2.0))
    np.testing.assert_array_equal(snapshot.depth, np.full(3, 2.0))
    assert snapshot.handle_twist[0], snapshot.tool_twist[0] == (7.0, 8.0)


def test_no_reader_ever_sees_two_halves(tmp_path):
    """A writer in another process as fast as it can; whoever reads sees one number everywhere."""
    code = textwrap.dedent("""
        import sys, numpy as np
        from pathlib import Path
        from asperity.realtime.servo.contact_worker import ShownContacts
        from asperity.realtime.servo.ipc import TickRecord
        from asperity.realtime.servo.snapshot import SnapshotWriter
        writer, tick = SnapshotWriter(Path(sys.argv[1])), TickRecord()
        numbers, shown = tick.numbers, ShownContacts()
        shown.count = 16
        print("begun", flush=True)
        n = 0
        while True:
            n += 1
            numbers[:] = n
            for part in (shown.point, shown.normal, shown.force, shown.depth):
                part[:] = n
            writer.write(tick, numbers[:6], numbers[:6], (n,) * 9, shown)
    """)
    path = tmp_path / "snapshot"
    process = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
    try:
        process.stdout.readline()
        reader = SnapshotReader(path)
        seen, until = [], time.monotonic() + 20.0
        while len({snapshot.time for snapshot in seen if snapshot}) < 100:
            seen += [reader.read() for _ in range(20)]
            time.sleep(2e-4)  # on one core, the writer's turn
            assert time.monotonic() < until
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
    seen = [snapshot for snapshot in seen if snapshot is not None]
    for snapshot in seen:
        parts = [np.ravel(part) for part in snapshot]
        assert len(snapshot.depth) == MAX_SHOWN
        assert len(np.unique(np.concatenate(parts))) == 1
    # The writer was killed: perhaps amid writing. Nobody hangs.
    reader.read()


def test_a_snapshot_of_nothing_or_of_something_else_is_refused(tmp_path):
    with pytest.raises(AsperityError, match="no snapshot of a servo loop at"):
        SnapshotReader(tmp_path / "none")
    (tmp_path / "other").write_bytes(bytes(100))
    with pytest.raises(AsperityError, match="has 100 bytes, a snapshot has"):
        SnapshotReader(tmp_path / "other")


def test_parameters_arrive_whole_once_and_the_last_ones(tmp_path):
    above, below = Mailbox(tmp_path / "box", create=True), Mailbox(tmp_path / "box")
    assert below.news() is None
    above.send({"stiffness": 1.0})
    above.send({"stiffness": 2.0, "text": "µ" * 100})
    assert below.news() == {"stiffness": 2.0, "text": "µ" * 100}
    assert below.news() is None
    with pytest.raises(AsperityError, match=f"there is room for {MAX_TEXT}"):
        above.send({"text": "x" * MAX_TEXT})
    assert not below.must_stop
    above.stop()
    assert below.must_stop


def test_shared_files_lie_in_memory_where_there_is_such_a_place():
    folder = shared_folder()
    try:
        if os.access("/dev/shm", os.W_OK):
            assert folder.is_relative_to("/dev/shm")
    finally:
        folder.rmdir()
