"""Real processes for the tests: a scheduler and its workers, and what they are killed with."""

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import psutil

SOURCES = Path(__file__).resolve().parents[3] / "src"
DEADLY = 0.1234
"""A speed that kills the worker: see `_KILLER`."""
_KILLER = f"""
import asperity.studies.sweeps.drag_runs as drags, os
if not hasattr(drags, "plain_numbers"):  # Dask loads this more than once
    drags.plain_numbers = drags.DragRuns.numbers
def deadly(self, varied, keep, more):
    if varied.get("speed") == {DEADLY}:
        os._exit(9)
    return drags.plain_numbers(self, varied, keep, more)
drags.DragRuns.numbers = deadly
"""


def environment(**more):
    return os.environ | {"PYTHONPATH": str(SOURCES)} | more


@contextmanager
def running_scheduler(folder):
    """Give the address of a scheduler in a process of its own, with two worker processes.

    What runs in its workers dies of the speed `DEADLY`, and of once: nothing is tried again.
    """
    from distributed import Client

    killer = folder / "killer.py"
    killer.write_text(_KILLER)
    env = environment(DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0")
    scheduler_file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": env}
    common = ["--scheduler-file", str(scheduler_file)]
    module = "distributed.cli.dask_scheduler"
    scheduler = subprocess.Popen(
        [sys.executable, "-m", module, "--host", "127.0.0.1", "--port", "0",
         "--dashboard-address", "127.0.0.1:0", *common], **quiet, cwd=folder,
    )  # fmt: skip
    workers = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_worker", *common, "--nworkers", "2",
         "--nthreads", "1", "--no-dashboard", "--local-directory", str(folder),
         "--preload", str(killer)],
        **quiet, cwd=folder,
    )  # fmt: skip
    try:
        wait_for(scheduler_file.is_file)
        address = json.loads(scheduler_file.read_text())["address"]
        with Client(address, timeout=120) as client:
            client.wait_for_workers(2, timeout=300)
        yield address, scheduler
    finally:
        for process in (workers, scheduler):
            for child in psutil.Process(process.pid).children(recursive=True):
                child.kill()
            process.kill()
            process.wait()


def wait_for(condition, seconds=300.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.02)


def worker_processes(pid=None):
    """Return the processes in which Dask's local workers run."""
    return [
        child
        for child in psutil.Process(pid).children(recursive=True)
        if "spawn_main" in " ".join(child.cmdline())
    ]
