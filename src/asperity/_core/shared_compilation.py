"""Compilation shared by several processes: each inner kernel is compiled by one of them.

The first force after an installation waits for hundreds of kernels, and Numba compiles one at a
time: most of the work is done in Python, under one lock. So a process that has many kernels to
compile starts helpers, which compile the same kernel called from Python, as far as the kernels that
it calls. Whoever compiles an inner kernel holds a lock on a file beside its machine code. A process
that meets a kernel held by another goes on with the next call; when nothing else is left, it
compiles what that kernel calls, or waits for it and loads it from the cache. A process waits for
kernels that its own kernel calls, never for one that calls it, so there is no deadlock.
"""

from __future__ import annotations

import importlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numba.core import event

from asperity._core.cores import usable_cores
from asperity._core.file_lock import lock_file

HELPERS = "ASPERITY_COMPILE_HELPERS"
"""Environment variable: the number of helpers, 0 for none."""
_MOST_HELPERS = 3
_WORTH_HELP = 8
"""Kernels that a process compiles before it starts helpers, which need seconds to start."""
_START = "from asperity._core.shared_compilation import help_parent; help_parent()"


class CompiledElsewhereError(Exception):
    """All that a kernel calls is compiled, and the kernel itself is left to another process."""


_held: set[Path] = set()
_left: set[tuple[str, str]] = set()
"""Modules and names of kernels whose own compilation is left to another process."""


@contextmanager
def claimed(kernel: Any) -> Iterator[bool]:
    """Hold the right to compile a kernel; yield False if another process holds it.

    Parameters
    ----------
    kernel : numba.core.dispatcher.Dispatcher
    """
    folder = kernel.stats.cache_path
    file = None if folder is None else Path(folder, f"{kernel.py_func.__qualname__}.lock")
    if file is None or file in _held:
        yield True
        return
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError:  # a cache that cannot be written: everybody compiles for himself
        yield True
        return
    try:
        granted = lock_file(descriptor) is not False
        if granted:
            _held.add(file)
        yield granted
    finally:
        _held.discard(file)
        os.close(descriptor)


@contextmanager
def left_to_others(kernel: Any) -> Iterator[None]:
    """Compile within this block what a kernel calls, but not the kernel itself."""
    name = (kernel.py_func.__module__, kernel.py_func.__qualname__)
    _left.add(name)
    try:
        with suppress(CompiledElsewhereError):
            yield
    finally:
        _left.discard(name)


def stop_if_left(module: str, name: str) -> None:
    """Raise `CompiledElsewhereError` for a kernel that is left to another process."""
    if (module, name) in _left:
        raise CompiledElsewhereError


class _StartHelpers(event.Listener):
    """Starts helpers for a kernel called from Python that needs many others, and ends them."""

    def __init__(self) -> None:
        self._depth, self._compiled = 0, 0
        self._kernel: dict[str, Any] = {}
        self._helpers: list[subprocess.Popen[bytes]] = []

    def on_start(self, started: Any) -> None:
        """Count the kernels that are compiled for the outermost one."""
        if self._depth == 0:
            self._kernel, self._compiled = started.data, 0
        self._depth += 1
        self._compiled += 1
        if self._compiled == _WORTH_HELP:
            self._helpers = [helper for _ in range(helpers()) if (helper := self._start())]

    def on_end(self, _: Any) -> None:
        """End the helpers with the outermost kernel."""
        self._depth -= 1
        if self._depth == 0:
            for helper in self._helpers:
                helper.kill()
                helper.communicate()
            self._helpers = []

    def _start(self) -> subprocess.Popen[bytes] | None:
        function = self._kernel["dispatcher"].py_func
        name = (function.__module__, function.__qualname__)
        try:
            task = pickle.dumps((sys.path, *name, tuple(self._kernel["args"])))
            helper = subprocess.Popen(
                [sys.executable, "-c", _START], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, env=os.environ | {HELPERS: "0"},
            )  # fmt: skip
            if helper.stdin is not None:
                helper.stdin.write(task)
                helper.stdin.flush()
        except (OSError, pickle.PicklingError, AttributeError, TypeError):
            return None  # help is never needed
        return helper


def helpers() -> int:
    """Return how many helpers a process starts: one less than its cores, 3 at most."""
    given = os.environ.get(HELPERS, "")
    if given.isdecimal():
        return int(given)
    # A program with Python inside would be started again as a whole.
    if not Path(sys.executable or "").name.startswith("python"):
        return 0
    return min(usable_cores() - 1, _MOST_HELPERS)


def help_parent() -> None:
    """Compile what the kernel calls that standard input names, until the parent process ends."""
    sys.path[:], module, name, arguments = pickle.load(sys.stdin.buffer)

    def end_with_parent() -> None:
        sys.stdin.buffer.read()
        os._exit(0)

    threading.Thread(target=end_with_parent, daemon=True).start()
    kernel = getattr(importlib.import_module(module), name)
    with left_to_others(kernel):
        kernel.compile(arguments)


event.register("numba:compile", _StartHelpers())
