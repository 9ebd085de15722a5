"""A disk that is full: one clear line, and the same command goes on."""

import subprocess
import sys

import pytest
from clusters import environment

from asperity.scene.document import write_toml
from asperity.studies.sweeps.batch import DONE
from asperity.studies.sweeps.run import run_sweep
from asperity.studies.sweeps.store import open_sweep
from asperity.studies.sweeps.study import read_study

# Python would write the byte code of what it imports later, and keep what fits.
_CHILD = """
import resource, sys
sys.dont_write_bytecode = True
from asperity.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), resource.RLIM_INFINITY))
sys.exit(main(["sweep", sys.argv[1], "--out", sys.argv[2], "--workers", "0"]))
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    vary = {"spacing": {"from": 0.5e-3, "to": 3.5e-3, "count": 10}, "speed": [0.05, 0.1, 0.2]}
    file = folder / "study.toml"
    file.write_text(write_toml({"schema": 1, "kind": "drag", "keep": ["band_rms"], "vary": vary}))
    run_sweep(read_study(file), folder / "whole.zarr", workers=0)
    return file, folder / "whole.zarr"


@pytest.mark.parametrize(
    "part", [0.0, 0.96, *(pytest.param(part, marks=pytest.mark.slow) for part in (0.1, 0.9, 0.99))]
)
def test_it_is_one_line_and_goes_on(made, part, tmp_path):
    file, whole = made
    # The largest file is that of the attributes, which grows with what is known of each run.
    room = int(part * (whole / "zarr.json").stat().st_size)
    path = tmp_path / "a.zarr"
    done = subprocess.run(
        [sys.executable, "-c", _CHILD, str(file), str(path), str(room)],
        capture_output=True, text=True, env=environment(),
    )  # fmt: skip
    lines = [line for line in done.stderr.splitlines() if "%" not in line]
    assert done.returncode == 2, done.stderr
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith(f"asperity: error: cannot write to {tmp_path}")
    assert lines[0].endswith("File too large")
    run_sweep(read_study(file), path, workers=0)
    one, other = open_sweep(path), open_sweep(whole)
    assert (one["state"] == DONE).all()
    assert all(one[name].identical(other[name]) for name in other.variables)
