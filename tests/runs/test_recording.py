"""The recording: any reader opens it, also after its writer was killed."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import h5py
import numpy as np
import pytest
import xarray as xr

from asperity.errors import AsperityError
from asperity.runs.recording import RecordingWriter, read_recording, write_recording
from asperity.simulation.simulation import Rollout
from asperity.simulation.tool_contact import FLAGS

VARIABLES = (
    "time", "handle_pose", "tool_pose", "contact_wrench", "device_wrench", "contact_count",
    "flags",
)  # fmt: skip


def made_up(n, seed=0):
    draw = np.random.default_rng(seed)
    return Rollout(
        time=np.arange(n) * 1e-3,
        handle_pose=draw.random((n, 7)),
        tool_pose=draw.random((n, 7)),
        contact_wrench=draw.random((n, 6)),
        device_wrench=draw.random((n, 6)),
        contact_count=draw.integers(0, 5, n),
        flags=draw.integers(0, 31, n),
        tick_seconds=draw.random(n),
        statuses=np.zeros(3, np.int64),
    )


def row(rollout, i):
    return {name: getattr(rollout, name)[i] for name in VARIABLES}


def test_what_is_written_is_read(tmp_path):
    rollout = made_up(2500)
    write_recording(rollout, tmp_path / "r.h5", {"scene": "a", "dt": 1e-3})
    read = read_recording(tmp_path / "r.h5")
    for name in VARIABLES:
        np.testing.assert_array_equal(getattr(read, name), getattr(rollout, name))
    assert read.attributes == {"schema": 1, "scene": "a", "dt": 1e-3}


def test_xarray_reads_it_with_its_dimensions_and_units(tmp_path):
    rollout = made_up(30)
    write_recording(rollout, tmp_path / "r.h5")
    with xr.open_dataset(tmp_path / "r.h5", engine="h5netcdf") as data:
        assert data.attrs["schema"] == 1
        assert dict(data.sizes) == {"time": 30, "pose": 7, "wrench": 6}
        assert {*VARIABLES, "penetration_depth"} - {"time"} == set(data.data_vars)
        for name in VARIABLES:
            assert data[name].attrs["units"]
        np.testing.assert_array_equal(data["contact_wrench"].sel(wrench="fz"),
                                      rollout.contact_wrench[:, 2])  # fmt: skip
        assert list(data["flags"].attrs["flag_masks"]) == list(FLAGS)
        assert len(data["flags"].attrs["flag_meanings"].split()) == len(FLAGS)
    with h5py.File(tmp_path / "r.h5") as file:
        assert file["handle_pose"].dims[0][0].name == "/time"


def test_rows_come_one_by_one_and_are_flushed_every_half_second(tmp_path):
    rollout, now = made_up(40), [0.0]
    writer = RecordingWriter(tmp_path / "r.h5", clock=lambda: now[0])
    seen = []
    writer._file.flush, flush = lambda: (seen.append(now[0]), flush()), writer._file.flush
    for i in range(40):
        now[0] = i * 0.1
        writer.add(**row(rollout, i))
    writer.close()
    np.testing.assert_allclose(seen, [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5], atol=1e-9)
    np.testing.assert_array_equal(read_recording(tmp_path / "r.h5").time, rollout.time)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal here")
def test_a_killed_writer_leaves_a_file_that_opens(tmp_path):
    script = textwrap.dedent("""
        import sys, time
        sys.path.insert(0, sys.argv[2])
        from test_recording import made_up, row
        from asperity.runs.recording import RecordingWriter
        rollout = made_up(1000)
        with RecordingWriter(sys.argv[1]) as writer:
            i = 0
            while True:
                writer.add(**row(rollout, i % 1000))
                time.sleep(0.0005)
                i += 1
    """)
    path = tmp_path / "r.h5"
    here = os.path.dirname(os.path.abspath(__file__))
    process = subprocess.Popen([sys.executable, "-c", script, str(path), here])
    try:
        for _ in range(1200):  # a busy machine takes long to start Python
            time.sleep(0.05)
            if path.exists() and path.stat().st_size > 60_000:
                break
        time.sleep(0.8)
    finally:
        process.kill()
        process.wait()
    read = read_recording(path)
    assert len(read.time) > 100
    rows = np.arange(len(read.time)) % 1000
    np.testing.assert_array_equal(read.contact_wrench, made_up(1000).contact_wrench[rows])


def test_files_that_are_no_recordings_are_refused(tmp_path):
    with pytest.raises(AsperityError, match="no such recording"):
        read_recording(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("no HDF5")
    with pytest.raises(AsperityError, match=r"text\.h5 cannot be read as HDF5"):
        read_recording(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["schema"] = 1
    with pytest.raises(AsperityError, match=r"other\.h5 is no recording.*no time"):
        read_recording(tmp_path / "other.h5")
    write_recording(made_up(3), tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5", "a") as file:
        file.attrs["schema"] = 2
    with pytest.raises(AsperityError, match="schema 2, valid: 1"):
        read_recording(tmp_path / "r.h5")
    with pytest.raises(AsperityError, match="exists"):
        write_recording(made_up(3), tmp_path / "r.h5")
