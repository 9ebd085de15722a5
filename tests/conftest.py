"""Shared by all tests: where the real data lie, and one compile cache for all processes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

# Each test process has a core: threads of linear algebra would only wait for each other, busily.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# The test processes already share what they compile; helpers would only crowd the cores.
os.environ.setdefault("ASPERITY_COMPILE_HELPERS", "0")

_WAITING = (
    "cli/test_devices.py", "cli/test_json.py", "psychophysics/", "viewer/", "realtime/",
    "studies/sweeps/",
)  # fmt: skip
"""Tests that wait for threads and processes beside them, or for a browser."""
_LONG = (
    "viewer", "cli/test_json.py", "contact/test_real_meshes.py", "contact/test_reference_mesh.py",
    "cli/test_report.py", "dynamics/test_on_the_surface.py", "test_package.py",
    "contact/test_accuracy.py", "realtime/servo/test_session.py", "realtime/servo/test_timing.py",
    "psychophysics/test_compare_conditions.py", "studies/sweeps/test_cluster.py",
    "baking/test_folder.py", "studies/baselines/test_contact_levels.py",
    "mujoco/test_as_contacts.py", "cli/test_run.py", "contact/test_own_mesh.py",
    "psychophysics/test_whole_procedures.py", "contact/test_mesh_properties.py",
    "dynamics/test_energy.py", "studies/stability/test_resting_point.py",
    "contact/deformable/test_elastic_bodies.py", "cli/test_bake.py",
    "core/test_shared_compilation.py", "mujoco/test_exploration.py",
)  # fmt: skip
"""Files (and the page's folder) that take 20 s or more, longest first; their few tests would bring
them to the end, where one of them leaves the other process with nothing to do."""
_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder of real data beside the project, or skip the test."""
    if not _DATA.is_dir():
        pytest.skip("the folder shared/data is not beside the project")
    return _DATA


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Have one process do a file's tests, which share what is made once, and one all of the page.

    Two pages with their loops and browsers are more than two cores. By the names of the files, as
    `--dist loadgroup` of pytest-xdist 3.8 does nothing in pytest 9.2. Long files come first.
    """
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _assign_work_unit(self, node) -> None:
            long = (f"tests/{name}" for name in _LONG)
            first = next((file for file in long if file in self.workqueue), None)
            if first is not None:
                self.workqueue.move_to_end(first, last=False)
            super()._assign_work_unit(node)

        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "tests/viewer" if file.startswith("tests/viewer/") else file

    return ByFile(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Have what waits for others run once more if it fails: a fault fails twice, and is told.

    A machine that holds a core for seconds makes any such test fail now and then; those that are
    about timing have clocks of their own.
    """
    here = Path(__file__).parent
    for item in items:
        if here not in item.path.parents:
            continue
        if item.path.relative_to(here).as_posix().startswith(_WAITING):
            item.add_marker(pytest.mark.flaky(reruns=1))


@pytest.fixture
def small_pictures(monkeypatch):
    """Draw a run's pictures with a 25th of their pixels: they take most of a short run's time."""
    from asperity.drawing.renderer import contact
    from asperity.runs.run_scene import take_pictures

    monkeypatch.setitem(take_pictures.__kwdefaults__, "rows", 124)
    monkeypatch.setattr(contact, "_SHADOW", 180)


@pytest.fixture(autouse=True)
def no_lines_of_progress(monkeypatch):
    """Keep progress off stderr: how long a test takes depends on the machine."""
    monkeypatch.setattr("asperity.cli.progress.FIRST_LINE", 1e6)
