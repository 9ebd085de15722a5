"""Sweeps that start at the same moment into one store: one runs, the others say so."""

import subprocess
import sys

import pytest
from clusters import environment

from asperity._core import lock
from asperity.errors import OutputError
from asperity.scene.document import write_toml
from asperity.studies.sweeps.store import open_sweep

_CHILD = """
import sys, time
from pathlib import Path
from asperity.errors import AsperityError
from asperity.studies.sweeps import store
from asperity.studies.sweeps.study import read_study
study = read_study(sys.argv[2])
print("ready", flush=True)
sys.stdin.readline()
try:
    with store.open_store(Path(sys.argv[1]), study, block_size=16):
        print("runs", flush=True)
        sys.stdin.readline()
except AsperityError as error:
    print(error, flush=True)
"""


@pytest.mark.parametrize("sweeps", [8, pytest.param(20, marks=pytest.mark.slow)])
def test_of_many_that_start_at_once_one_runs(sweeps, tmp_path):
    path, children = tmp_path / "a.zarr", []
    for i in range(sweeps):
        # Every second one has another study.
        study = tmp_path / f"{i}.toml"
        vary = {"speed": [0.05, 0.1], "spacing": [1e-3, 2e-3 + i % 2 * 1e-3]}
        study.write_text(write_toml({"schema": 1, "kind": "drag", "vary": vary}))
        children.append(
            subprocess.Popen(
                [sys.executable, "-c", _CHILD, str(path), str(study)], text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                env=environment(),
            )
        )  # fmt: skip
    for child in children:
        assert child.stdout.readline() == "ready\n"
    for child in children:
        child.stdin.write("\n")
        child.stdin.flush()
    said = [child.stdout.readline() for child in children]
    assert said.count("runs\n") == 1
    assert all("another sweep writes to" in line for line in said if line != "runs\n")
    winner = said.index("runs\n")
    for child in children:
        assert child.communicate("\n")[1] == ""
    assert open_sweep(path)["spacing"].values[1] == 2e-3 + winner % 2 * 1e-3
    assert sorted(p.name for p in tmp_path.iterdir() if p.suffix != ".toml") == ["a.zarr"]


def test_a_lock_of_a_killed_sweep_is_none(tmp_path):
    (tmp_path / ".a.zarr.lock").write_text("")
    study = tmp_path / "a.toml"
    study.write_text(write_toml({"schema": 1, "kind": "drag", "vary": {"speed": [0.05, 0.1]}}))
    child = subprocess.Popen(
        [sys.executable, "-c", _CHILD, str(tmp_path / "a.zarr"), str(study)], text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment(),
    )  # fmt: skip
    child.stdin.write("\n\n")
    child.stdin.flush()
    assert child.stdout.read() == "ready\nruns\n"
    assert child.wait() == 0
    assert not (tmp_path / ".a.zarr.lock").exists()


def test_without_locks_of_the_file_system_a_file_is_the_lock(tmp_path, monkeypatch):
    monkeypatch.setattr(lock, "lock_file", lambda descriptor: None)
    refused = pytest.raises(OutputError, match=r"taken \(process \d+ on .*has no locks")
    again = lock.locked(tmp_path / "a", "taken")
    with lock.locked(tmp_path / "a", "taken"), refused, again:
        pass
    with lock.locked(tmp_path / "a", "taken"):
        pass
    assert not list(tmp_path.iterdir())
