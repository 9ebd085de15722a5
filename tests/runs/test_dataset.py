"""A recording as a dataset: labelled, in single units, read when it is looked at."""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_recording import made_up

import asperity
from asperity.errors import AsperityError
from asperity.runs.dataset import dataset_of, open_recording
from asperity.runs.recording import RecordingWriter, read_recording, variables_of, write_recording

UNITS = {
    "handle_position": "m", "handle_orientation": "1", "tool_position": "m",
    "tool_orientation": "1", "contact_force": "N", "contact_torque": "N m", "device_force": "N",
    "device_torque": "N m", "penetration_depth": "m", "contact_count": "1", "flags": "1",
}  # fmt: skip


@pytest.fixture
def rollout():
    return made_up(2500)


def test_everything_is_there_under_one_unit_each(rollout, tmp_path):
    write_recording(rollout, tmp_path / "recording.h5", {"scene": "a", "dt": 1e-3, "source": ""})
    with asperity.open_recording(tmp_path) as data:
        assert {name: data[name].attrs["units"] for name in data.data_vars} == UNITS
        assert data["time"].attrs["units"] == "s"
        assert dict(data.sizes) == {"time": 2500, "axis": 3, "quaternion": 4}
        assert data.attrs == {"schema": 1, "scene": "a", "dt": 1e-3}
        assert data.contact_force.attrs["frame"] == "world"
        np.testing.assert_array_equal(data.time, rollout.time)
        np.testing.assert_array_equal(data.tool_position, rollout.tool_pose[:, :3])
        np.testing.assert_array_equal(
            data.tool_orientation.sel(quaternion="w"), rollout.tool_pose[:, 3]
        )
        np.testing.assert_array_equal(data.device_torque.sel(axis="z"), rollout.device_wrench[:, 5])
        np.testing.assert_array_equal(data.flags, rollout.flags)
        assert len(data.flags.attrs["flag_meanings"].split()) == len(data.flags.attrs["flag_masks"])


def test_nothing_is_read_before_it_is_looked_at(rollout, tmp_path):
    write_recording(rollout, tmp_path / "recording.h5")
    with open_recording(tmp_path / "recording.h5") as data:
        part = data.sel(time=slice(0.5, 0.6)).contact_force
        assert not part.variable._in_memory
        assert part.sizes == {"time": 101, "axis": 3}
        np.testing.assert_array_equal(part.values, rollout.contact_wrench[500:601, :3])


def test_arrays_in_memory_make_the_same_dataset(rollout, tmp_path):
    write_recording(rollout, tmp_path / "recording.h5", {"scene": "a"})
    made = dataset_of(variables_of(rollout), {"scene": "a", "schema": 1})
    with open_recording(tmp_path) as read:
        for name in set(UNITS) - {"penetration_depth"}:
            np.testing.assert_array_equal(made[name], read[name])
            assert made[name].attrs["units"] == read[name].attrs["units"]
        assert made.attrs == read.attrs


def test_a_file_whose_writer_was_killed_amid_a_flush_opens_as_far_as_it_got(rollout, tmp_path):
    write_recording(rollout, tmp_path / "recording.h5")
    with h5py.File(tmp_path / "recording.h5", "a") as file:
        for name in ("flags", "handle_pose"):
            file[name].resize(2600, axis=0)
    with open_recording(tmp_path) as data:
        assert data.sizes["time"] == 2500
        np.testing.assert_array_equal(data.flags, rollout.flags)


def test_an_older_recording_has_no_depth_and_opens(rollout, tmp_path):
    write_recording(rollout, tmp_path / "recording.h5")
    with h5py.File(tmp_path / "recording.h5", "a") as file:
        del file["penetration_depth"]
    with open_recording(tmp_path) as data:
        assert "penetration_depth" not in data
    assert np.isnan(read_recording(tmp_path / "recording.h5").penetration_depth).all()


def test_what_is_no_recording_is_refused_in_a_line(tmp_path):
    with pytest.raises(AsperityError, match=r"no such recording: .*recording\.h5; give"):
        open_recording(tmp_path)
    (tmp_path / "text.h5").write_text("no HDF5")
    with pytest.raises(AsperityError, match="cannot be read as HDF5"):
        open_recording(tmp_path / "text.h5")


def test_a_depth_that_is_known_is_kept(tmp_path):
    depth = np.linspace(0.0, 1e-3, 50)
    rows = {**variables_of(made_up(50)), "penetration_depth": depth}
    with RecordingWriter(tmp_path / "recording.h5", {"document": json.dumps({})}) as writer:
        writer.add_rows(rows)
    with open_recording(tmp_path) as data:
        np.testing.assert_array_equal(data.penetration_depth, depth)
