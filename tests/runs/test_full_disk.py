"""A disk that is full: HDF5 does not learn of it, and one line tells."""

import resource
import subprocess
import sys

import numpy as np
import pytest

from asperity.errors import OutputError
from asperity.runs.recording import RecordingWriter
from asperity.runs.recording_file import RecordingFile

_CHILD = """
import resource, sys
sys.dont_write_bytecode = True
import numpy as np
from pathlib import Path
from asperity.errors import OutputError
from asperity.runs.recording import RecordingWriter
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
rows = {
    "time": np.arange(500) * 1e-3, "handle_pose": np.ones((500, 7)), "tool_pose": np.ones((500, 7)),
    "contact_wrench": np.ones((500, 6)), "device_wrench": np.ones((500, 6)),
    "contact_count": np.ones(500), "flags": np.ones(500), "penetration_depth": np.ones(500),
}
try:
    with RecordingWriter(Path(sys.argv[1])) as writer:
        for _ in range(8):
            writer.add_rows(rows)
except OutputError as error:
    print(error)
"""


@pytest.mark.parametrize("room", [
    0, 20_000, 900_000,
    *(pytest.param(room, marks=pytest.mark.slow) for room in (2000, 100_000, 400_000)),
])  # fmt: skip
def test_it_is_one_line_and_no_signal(room, tmp_path):
    path = tmp_path / "a.h5"
    done = subprocess.run(
        [sys.executable, "-c", _CHILD, str(path), str(room)], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout == f"cannot write to {path}: File too large\n"


def test_a_file_that_exists_is_refused(tmp_path):
    (tmp_path / "a.h5").write_text("mine")
    with pytest.raises(OutputError, match="File exists"):
        RecordingWriter(tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_text() == "mine"
    with RecordingFile(tmp_path / "b.h5") as file:
        file.write(np.arange(3))
        file.check()
    assert resource.getrlimit(resource.RLIMIT_FSIZE)
