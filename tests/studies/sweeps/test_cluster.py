"""Sweeps on real schedulers and processes, some of which are killed in the middle."""

import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
from clusters import DEADLY, environment, running_scheduler, wait_for, worker_processes

from asperity import AsperityError
from asperity.cli import main
from asperity.scene.document import write_toml
from asperity.studies.sweeps import dispatch
from asperity.studies.sweeps.batch import DONE, FAILED
from asperity.studies.sweeps.run import run_sweep
from asperity.studies.sweeps.store import open_sweep
from asperity.studies.sweeps.study import read_study

SPACING = {"from": 0.5e-3, "to": 3.5e-3, "count": 25, "scale": "log"}
STUDY = {
    "schema": 1,
    "kind": "drag",
    "keep": ["max_acceleration", "band_rms"],
    "vary": {
        "spacing": SPACING, "diameter": [2e-3, 3e-3, 4e-3], "normal_force": [0.3, 0.6],
        "speed": [0.05, 0.07, 0.1, 0.15],
    },
}  # fmt: skip
SIZE = 600


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "whole.zarr"
    run_sweep(read_study(STUDY), path, workers=0)
    return open_sweep(path)


def same(path, whole):
    data = open_sweep(path)
    assert (data["state"] == DONE).all()
    # Dimensions have the order of the file, in which lists come before tables.
    data = data.transpose(*whole.sizes)
    return all(data[name].identical(whole[name]) for name in whole.variables)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    with running_scheduler(tmp_path_factory.mktemp("dask")) as (address, process):
        yield address, process


def test_a_worker_killed_in_the_middle_costs_nothing(whole, tmp_path):
    path, killed = tmp_path / "a.zarr", []

    def kill(now):
        if now.done and not killed:
            victim = worker_processes()[0]
            victim.send_signal(signal.SIGKILL)
            killed.append(victim.pid)

    written = []
    done = run_sweep(
        read_study(STUDY), path, workers=2, progress=lambda now: (kill(now), written.append(now))
    )
    assert killed
    assert (done.done, done.computed) == (SIZE, SIZE)
    assert same(path, whole)
    wait_for(lambda: not worker_processes())
    # Each block is written once: what was done before the kill is not done again.
    counts = [now.done for now in written]
    assert counts == sorted(counts)
    assert len([c for c in counts if c]) == len(list(path.glob("state/c/*/*/*/*")))


# Slow: minutes on a busy machine. The kill of a worker and the tests of the store guard it.
@pytest.mark.slow
def test_a_running_scheduler_gives_the_same_to_the_bit(scheduler, whole, tmp_path, capsys):
    address, _ = scheduler
    study, out = tmp_path / "study.toml", tmp_path / "a.zarr"
    study.write_text(write_toml(STUDY))
    assert main(["sweep", str(study), "--scheduler", address, "--out", str(out)]) == 0
    assert f"{SIZE} combinations, {SIZE} done, 0 failed" in capsys.readouterr().out
    assert same(out, whole)
    with pytest.raises(AsperityError, match="give only one of"):
        run_sweep(study, out, scheduler=address, workers=2)


def test_a_combination_that_kills_its_worker_is_found_and_recorded(scheduler, tmp_path):
    address, _ = scheduler
    vary = {"spacing": SPACING | {"count": 8}, "speed": [0.05, DEADLY]}
    study = read_study(STUDY | {"vary": vary})
    done = run_sweep(study, tmp_path / "a.zarr", scheduler=address)
    assert (done.done, done.failed) == (8, 8)
    data = open_sweep(tmp_path / "a.zarr")
    assert (data["state"].sel(speed=DEADLY) == FAILED).all()
    assert set(data["error"].sel(speed=DEADLY).values) == {"every worker that ran it died"}
    assert np.isfinite(data["band_rms"].sel(speed=0.05)).all()


def test_no_scheduler_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(dispatch, "_PATIENCE", 4.0)
    with pytest.raises(AsperityError, match=r"no scheduler answers at 'tcp://127\.0\.0\.1:9'"):
        run_sweep(read_study(STUDY), tmp_path / "a.zarr", scheduler="tcp://127.0.0.1:9")


def start(study, out, *options):
    return subprocess.Popen(
        [sys.executable, "-m", "asperity", "sweep", str(study), "--out", str(out), *options],
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def blocks_done(out):
    return {f: f.stat().st_mtime_ns for f in out.glob("state/c/**/*") if f.is_file()}


def end(process, family):
    """Kill a sweep's client; its workers follow by themselves."""
    process.send_signal(signal.SIGKILL)
    process.communicate()
    wait_for(lambda: not any(child.is_running() for child in family), 60.0)


# Slow: minutes on a busy machine. The kill of a worker and the tests of the store guard it.
@pytest.mark.slow
def test_a_client_killed_in_the_middle_goes_on_with_the_same_command(whole, tmp_path):
    study, out = tmp_path / "study.toml", tmp_path / "a.zarr"
    study.write_text(write_toml(STUDY))
    process = start(study, out, "--workers", "2")
    wait_for(lambda: len(blocks_done(out)) >= 2)
    family = psutil.Process(process.pid).children(recursive=True)
    end(process, family)
    before = {f: stamp for f, stamp in blocks_done(out).items() if f.suffix != ".partial"}
    known = int((open_sweep(out)["state"] == DONE).sum())
    assert known > 0
    process = start(study, out, "--workers", "2")
    said, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert f"{SIZE - known} computed now" in said
    assert same(out, whole)
    after = blocks_done(out)
    assert all(after[f] == stamp for f, stamp in before.items())


# Slow: minutes on a busy machine. The kill of a worker and the tests of the store guard it.
@pytest.mark.slow
def test_ctrl_c_says_how_far_it_is_and_leaves_no_process(tmp_path):
    study, out = tmp_path / "study.toml", tmp_path / "a.zarr"
    vary = STUDY["vary"] | {"spacing": SPACING | {"count": 500}}
    study.write_text(write_toml(STUDY | {"vary": vary}))
    process = start(study, out, "--workers", "2")
    wait_for(lambda: len(blocks_done(out)) >= 1)
    family = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, signal.SIGINT)
    said, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    # Before it may stand lines of progress, as without a terminal.
    lines = errors.strip().splitlines()
    assert lines[-1].startswith("asperity: interrupted; "), errors
    assert all("%" in line for line in lines[:-1]), errors
    assert "of 12000 combinations are in" in lines[-1]
    assert said == ""
    wait_for(lambda: not any(child.is_running() for child in family), 30.0)


def test_a_scheduler_that_goes_away_costs_nothing_that_is_written(scheduler, whole, tmp_path):
    """The last one in the module: it takes the scheduler away."""
    address, process = scheduler
    path, study = tmp_path / "a.zarr", read_study(STUDY)
    with pytest.raises(AsperityError, match="the scheduler went away"):
        run_sweep(study, path, scheduler=address, progress=lambda now: now.done and process.kill())
    left = int((open_sweep(path)["state"] != DONE).sum())
    assert 0 < left < SIZE
    assert run_sweep(study, path, workers=0).computed == left
    assert same(path, whole)


@pytest.mark.slow
def test_a_client_killed_twenty_times_at_random_loses_and_repeats_nothing(whole, tmp_path):
    study, out = tmp_path / "study.toml", tmp_path / "a.zarr"
    vary = STUDY["vary"] | {"spacing": SPACING | {"count": 4000}}
    study.write_text(write_toml(STUDY | {"vary": vary}))
    dice, stamps = random.Random(1), {}
    for _ in range(20):
        process = start(study, out, "--workers", "2")
        begun = len(blocks_done(out))
        wait_for(lambda n=begun, p=process: len(blocks_done(out)) > n or p.poll() is not None)
        time.sleep(dice.uniform(0.0, 0.3))
        assert process.poll() is None, "done before it could be killed: give it more to do"
        family = psutil.Process(process.pid).children(recursive=True)
        end(process, family)
        now = {f: t for f, t in blocks_done(out).items() if f.suffix != ".partial"}
        assert all(now[f] == stamp for f, stamp in stamps.items())
        stamps = now
    process = start(study, out, "--workers", "2")
    process.communicate(timeout=300)
    assert process.returncode == 0
    run_sweep(read_study(study), tmp_path / "b.zarr", workers=0)
    assert same(out, open_sweep(tmp_path / "b.zarr"))
