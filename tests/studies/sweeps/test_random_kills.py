"""Fifty kills at random moments of each: a sweep, its workers, its scheduler.

What comes of it in the end is to the bit what an undisturbed sweep gives. Fifty kills of sessions:
tests/psychophysics/test_random_session_kills.py.
"""

import multiprocessing
import os
import random
import shutil
import signal
import threading
import time

import pytest
from clusters import running_scheduler, worker_processes

from asperity import AsperityError
from asperity.studies.sweeps.batch import DONE
from asperity.studies.sweeps.run import run_sweep
from asperity.studies.sweeps.store import open_sweep
from asperity.studies.sweeps.study import read_study

pytestmark = pytest.mark.slow

KILLS = 50
STUDY = {
    "schema": 1, "kind": "drag", "keep": ["max_acceleration", "band_rms"],
    "vary": {
        "spacing": {"from": 0.5e-3, "to": 3.5e-3, "count": 60, "scale": "log"},
        "diameter": [2e-3, 3e-3, 4e-3], "normal_force": [0.3, 0.6],
        "speed": [0.05, 0.07, 0.1, 0.15],
    },
    "zip": {"person": {"hand": {"mass": [0.05, 0.1], "stiffness": [300.0, 500.0]}}},
}  # fmt: skip


@pytest.fixture(scope="module")
def study():
    return read_study(STUDY)


@pytest.fixture(scope="module")
def whole(study, tmp_path_factory):
    path, begun = tmp_path_factory.mktemp("whole") / "whole.zarr", time.perf_counter()
    run_sweep(study, path, workers=0)
    return open_sweep(path), time.perf_counter() - begun


def check(path, whole):
    """Compare a finished store with the undisturbed one, and remove it."""
    data = open_sweep(path)
    assert (data["state"] == DONE).all()
    assert all(data[name].identical(whole[name]) for name in whole.variables)
    shutil.rmtree(path)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_of_the_sweep(study, whole, tmp_path):
    path, dice, kills, finished = tmp_path / "a.zarr", random.Random(1), 0, 0
    fork = multiprocessing.get_context("fork")
    while kills < KILLS or path.exists():
        process = fork.Process(target=run_sweep, args=(study, path), kwargs={"workers": 0})
        process.start()
        if kills < KILLS:
            time.sleep(dice.uniform(0.0, 0.4 * whole[1]))
            if process.is_alive():
                os.kill(process.pid, signal.SIGKILL)
                kills += 1
        process.join()
        if process.exitcode == 0:
            check(path, whole[0])
            finished += 1
    assert finished > 2


def test_of_its_workers(study, whole, tmp_path):
    path, dice, kills, said = tmp_path / "a.zarr", random.Random(2), 0, []
    over = threading.Event()

    def kill():
        nonlocal kills
        while not over.wait(dice.uniform(0.05, 1.5)):
            workers = worker_processes()
            if workers and kills < KILLS:
                dice.choice(workers).send_signal(signal.SIGKILL)
                kills += 1

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        while kills < KILLS:
            try:
                run_sweep(study, path, workers=2)
            except AsperityError as error:  # killed while they started
                said.append(str(error))
            else:
                check(path, whole[0])
    finally:
        over.set()
        killer.join()
    assert not any("\n" in line for line in said)


def test_of_its_scheduler(study, whole, tmp_path):
    path, dice, said = tmp_path / "a.zarr", random.Random(3), []
    for i in range(KILLS):
        folder = tmp_path / str(i)
        folder.mkdir()
        with running_scheduler(folder) as (address, process):
            timer = threading.Timer(dice.uniform(0.05, 0.6 * whole[1]), process.kill)
            timer.start()
            try:
                run_sweep(study, path, scheduler=address)
            except AsperityError as error:
                said.append(str(error))
            else:
                check(path, whole[0])
            finally:
                timer.join()
    # How many are killed before the sweep has found them depends on the machine.
    assert len(said) > KILLS // 4
    for line in said:
        assert "\n" not in line
        assert "the scheduler went away" in line or "no scheduler answers" in line
    run_sweep(study, path, workers=0)
    check(path, whole[0])
