"""Kernels compiled by several processes: each once, and the numbers are right."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from asperity._core import shared_compilation
from asperity._core.shared_compilation import claimed, helpers

pytest.importorskip("fcntl", reason="without flock nothing is shared")

_KERNELS = 12

_MODULE = """
from asperity._core.kernels import inner_kernel, kernel

{inner}

@kernel
def total(x):
    s = 0.0
{calls}
    return s
"""

_MAIN = """
import sys, time
sys.path.insert(0, sys.argv[1])
from numba.core import event
import many

class Count(event.Listener):
    lowered = 0
    def on_start(self, e):
        pass
    def on_end(self, e):
        function = e.data["dispatcher"].py_func
        # Those that were left to another process end without an overload.
        if function.__module__ == "many" and e.data["args"] in e.data["dispatcher"].overloads:
            Count.lowered += 1

event.register("numba:compile", Count())
print(many.total(2.0), Count.lowered)
"""


def _kernel(folder: Path, name: str = "f") -> SimpleNamespace:
    """Return what `claimed` reads of a kernel."""
    return SimpleNamespace(
        stats=SimpleNamespace(cache_path=str(folder)), py_func=SimpleNamespace(__qualname__=name)
    )


def _run(folder: Path, helping: int) -> subprocess.Popen[str]:
    variables = os.environ | {
        "NUMBA_CACHE_DIR": str(folder / "cache"), "ASPERITY_COMPILE_HELPERS": str(helping)
    }  # fmt: skip
    return subprocess.Popen(
        [sys.executable, str(folder / "main.py"), str(folder)], stdout=subprocess.PIPE, text=True,
        env=variables, start_new_session=True,
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a program whose kernel calls twelve others, each of which calls one more."""
    inner = "\n".join(
        f"@inner_kernel\ndef leaf_{i}(x):\n    return x + {i}.0\n\n"
        f"@inner_kernel\ndef twice_{i}(x):\n    return 2.0 * leaf_{i}(x)\n"
        for i in range(_KERNELS)
    )
    calls = "\n".join(f"    s += twice_{i}(x)" for i in range(_KERNELS))
    (tmp_path / "many.py").write_text(_MODULE.format(inner=inner, calls=calls))
    (tmp_path / "main.py").write_text(_MAIN)
    return tmp_path


_SUM = sum(2.0 * (2.0 + i) for i in range(_KERNELS))


def test_two_processes_compile_each_inner_kernel_once(folder):
    processes = [_run(folder, 0) for _ in range(2)]
    results = [process.communicate(timeout=300)[0].split() for process in processes]
    assert [float(result[0]) for result in results] == [_SUM, _SUM]
    # The outermost kernel is compiled by whoever calls it before it is in the cache.
    assert 2 * _KERNELS + 1 <= sum(int(result[1]) for result in results) <= 2 * _KERNELS + 2


@pytest.mark.parametrize("helping", [0, 3, pytest.param(1, marks=pytest.mark.slow)])
def test_helpers_change_nothing(folder, helping):
    process = _run(folder, helping)
    result = process.communicate(timeout=300)[0].split()
    assert process.returncode == 0
    assert float(result[0]) == _SUM
    assert int(result[1]) <= 2 * _KERNELS + 1
    # A second start loads everything.
    assert _run(folder, helping).communicate(timeout=300)[0].split() == [result[0], "0"]


def test_a_kernel_is_claimed_by_one_process_until_it_ends(tmp_path):
    code = (
        "import sys, time\nfrom types import SimpleNamespace as S\n"
        "from asperity._core.shared_compilation import claimed\n"
        "k = S(stats=S(cache_path=sys.argv[1]), py_func=S(__qualname__='f'))\n"
        "with claimed(k) as granted:\n    print(granted, flush=True)\n    time.sleep(600)\n"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == "True\n"
        with claimed(_kernel(tmp_path)) as granted:
            assert not granted
        with claimed(_kernel(tmp_path, "g")) as granted:
            assert granted
    finally:
        other.send_signal(signal.SIGKILL)
        other.wait()
    with claimed(_kernel(tmp_path)) as granted:
        assert granted
        with claimed(_kernel(tmp_path)) as again:
            assert again


def test_a_cache_that_cannot_be_written_stops_nothing(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with claimed(_kernel(blocked / "below")) as granted:
        assert granted


def test_number_of_helpers(monkeypatch):
    monkeypatch.delenv("ASPERITY_COMPILE_HELPERS", raising=False)
    monkeypatch.setattr(sys, "executable", "/somewhere/bin/python3")
    for cores, expected in ((1, 0), (2, 1), (4, 3), (64, 3)):
        monkeypatch.setattr(shared_compilation, "usable_cores", lambda cores=cores: cores)
        assert helpers() == expected
    # A program with Python inside must not be started again.
    monkeypatch.setattr(sys, "executable", "/somewhere/bin/robot")
    assert helpers() == 0
    monkeypatch.setenv("ASPERITY_COMPILE_HELPERS", "2")
    assert helpers() == 2


def _members(group: int) -> int:
    listed = subprocess.run(["ps", "-eo", "pgid="], capture_output=True, text=True, check=True)
    return listed.stdout.split().count(str(group))


def test_a_helper_ends_with_its_parent(folder):
    process = _run(folder, 1)
    until = time.monotonic() + 120.0
    while _members(process.pid) < 2 and process.poll() is None:
        time.sleep(0.01)
        assert time.monotonic() < until
    process.kill()
    process.wait()
    while _members(process.pid):
        time.sleep(0.1)
        assert time.monotonic() < until


def test_a_process_that_is_stopped_holds_up_no_other(folder):
    (folder / "main.py").write_text(
        "import asperity._core.compile_time as compile_time\ncompile_time._PATIENCE = 0.2\n" + _MAIN
    )
    stopped = _run(folder, 0)
    locks = folder / "cache"
    until = time.monotonic() + 120.0
    while not any(locks.rglob("twice_*.lock")) and stopped.poll() is None:
        assert time.monotonic() < until
    stopped.send_signal(signal.SIGSTOP)
    try:
        result = _run(folder, 0).communicate(timeout=300)[0].split()
        assert float(result[0]) == _SUM
    finally:
        stopped.kill()
        stopped.wait()
