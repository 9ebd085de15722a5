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
from asperity.realtime.servo.contact_worker import SHOWN, Shown
from asperity.realtime.servo.mailbox import ROOM, Mailbox
from asperity.realtime.servo.ring import TickRing
from asperity.realtime.servo.snapshot import SnapshotReader, SnapshotWriter
from asperity.realtime.servo.tick_row import WIDTH, TickRow, columns
from asperity.realtime.shared_file import shared_folder


def row(n):
    return np.full(WIDTH, float(n))


def test_rows_come_out_as_they_went_in_and_in_order(tmp_path):
    ring, other = TickRing(tmp_path / "ring", 100), None
    other = TickRing(tmp_path / "ring")
    assert other.capacity == 100
    taken, n = [], 0
    draw = np.random.default_rng(1)
    while n < 5000:
        for _ in range(draw.integers(0, 100)):
            assert ring.push(row(n))
            n += 1
        taken.append(other.take())
    rows = np.concatenate(taken)
    np.testing.assert_array_equal(rows, np.arange(n)[:, None] * np.ones(WIDTH))
    assert ring.lost == other.lost == 0


def test_a_full_ring_loses_the_new_rows_counts_them_and_goes_on(tmp_path):
    ring = TickRing(tmp_path / "ring", 10)
    kept = [n for n in range(25) if ring.push(row(n))]
    assert kept == list(range(10))
    assert ring.lost == 15
    assert ring.take()[:, 0].tolist() == kept
    assert ring.push(row(99))
    assert ring.take()[:, 0].tolist() == [99]


def test_a_writer_and_a_reader_at_the_same_time(tmp_path):
    ring, other = TickRing(tmp_path / "ring", 64), TickRing(tmp_path / "ring")
    pushed = []

    def write():
        for n in range(20_000):
            if ring.push(row(n)):
                pushed.append(n)
        ring.close()

    thread = threading.Thread(target=write)
    thread.start()
    taken = []
    while not other.is_closed:
        taken.append(other.take())
    taken.append(other.take())
    thread.join()
    rows = np.concatenate(taken)
    assert (rows == rows[:, :1]).all()
    assert rows[:, 0].astype(int).tolist() == pushed
    assert len(pushed) + ring.lost == 20_000


def test_a_row_has_the_fields_of_a_recording():
    one = TickRow()
    one.time[0], one.flags[0], one.tool_pose[:] = 1.5, 96, np.arange(7)
    fields = columns(np.stack([one.values, one.values]))
    assert fields["time"].tolist() == [1.5, 1.5]
    assert fields["flags"].tolist() == [96, 96]
    np.testing.assert_array_equal(fields["tool_pose"][1], np.arange(7))
    assert fields["device_wrench"].shape == (2, 6)


def shown(count, value):
    out = Shown()
    out.count = count
    for part in (out.point, out.normal, out.force, out.depth):
        part[:count] = value
    return out


def test_a_snapshot_tells_the_latest_moment(tmp_path):
    writer = SnapshotWriter(tmp_path / "snapshot")
    reader = SnapshotReader(tmp_path / "snapshot")
    assert reader.read() is None
    one = TickRow()
    one.time[0], one.contact_count[0], one.handle_pose[:] = 2.0, 3, np.arange(7)
    for value in (1.0, 2.0):
        one.flags[0] = value
        writer.write(
            one.values,
            np.full(6, 7.0),
            np.full(6, 8.0),
            (1, 2, 3, 4, 5, 6, 7, 8.5, 9.5),
            shown(3, value),
        )
    moment = reader.read()
    assert (moment.time, moment.flags, moment.contact_count) == (2.0, 2, 3)
    assert moment[9:18] == (1, 2, 3, 4, 5, 6, 7, 8.5, 9.5)
    np.testing.assert_array_equal(moment.handle_pose, np.arange(7))
    np.testing.assert_array_equal(moment.point, np.full((3, 3), 2.0))
    np.testing.assert_array_equal(moment.depth, np.full(3, 2.0))
    assert moment.handle_twist[0], moment.tool_twist[0] == (7.0, 8.0)


def test_no_reader_ever_sees_two_halves(tmp_path):
    """A writer in another process as fast as it can; whoever reads sees one number everywhere."""
    code = textwrap.dedent("""
        import sys, numpy as np
        from pathlib import Path
        from asperity.realtime.servo.contact_worker import Shown
        from asperity.realtime.servo.tick_row import Row
        from asperity.realtime.servo.snapshot import SnapshotWriter
        writer, row, shown = SnapshotWriter(Path(sys.argv[1])), Row(), Shown()
        shown.count = 16
        print("begun", flush=True)
        n = 0
        while True:
            n += 1
            row.values[:] = n
            for part in (shown.point, shown.normal, shown.force, shown.depth):
                part[:] = n
            writer.write(row.values, row.values[:6], row.values[:6], (n,) * 9, shown)
    """)
    path = tmp_path / "snapshot"
    process = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
    try:
        process.stdout.readline()
        reader = SnapshotReader(path)
        seen, until = [], time.monotonic() + 20.0
        while len({moment.time for moment in seen if moment}) < 100:
            seen += [reader.read() for _ in range(20)]
            time.sleep(2e-4)  # on one core, the writer's turn
            assert time.monotonic() < until
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
    seen = [moment for moment in seen if moment is not None]
    for moment in seen:
        parts = [np.ravel(part) for part in moment]
        assert len(moment.depth) == SHOWN
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
    with pytest.raises(AsperityError, match=f"there is room for {ROOM}"):
        above.send({"text": "x" * ROOM})
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
