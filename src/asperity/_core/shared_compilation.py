"""Compilation shared by several processes: each inner kernel is compiled by one of them.

The first force after an installation waits for hundreds of kernels, and Numba compiles one at a
time: most of the work is done in Python, under one lock. So a process that has many kernels to
compile starts helpers, which compile the same kernel called from Python, as far as the kernels that
it calls. They stay for the next ones, because starting takes them two seconds. Whoever compiles an
inner kernel holds a lock on a file beside its machine code. A process that meets a kernel held by
another goes on with the next call; when nothing else is left, it compiles what that kernel calls,
or waits for it and loads it from the cache. A process waits for kernels that its own kernel calls,
never for one that calls it, so there is no deadlock.
"""

from __future__ import annotations

import atexit
import importlib
import os
import pickle
import queue
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
_IDLE_TIME = 10.0
"""Time without work after which a helper ends [s]."""
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


class _Helper:
    """A process that compiles what this one asks for; it ends with this one, or without work."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, env=os.environ | {HELPERS: "0"},
        )  # fmt: skip

    def take(self, task: bytes) -> bool:
        """Hand on a task; return False if the helper has ended."""
        if self._process.poll() is not None or self._process.stdin is None:
            return False
        try:
            self._process.stdin.write(task)
            self._process.stdin.flush()
        except OSError:
            return False
        return True

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()


class _AskHelpers(event.Listener):
    """Asks helpers for the kernels that one called from Python needs, if there are many."""

    def __init__(self) -> None:
        self._depth, self._compiled, self._owner = 0, 0, 0
        self._kernel: dict[str, Any] = {}
        self._helpers: list[_Helper] = []

    def on_start(self, started: Any) -> None:
        """Count the kernels that are compiled for the outermost one."""
        if self._depth == 0:
            self._kernel, self._compiled = started.data, 0
        self._depth += 1
        self._compiled += 1
        if self._compiled == _WORTH_HELP:
            with suppress(OSError, pickle.PicklingError, AttributeError, TypeError):
                self._ask()  # help is never needed

    def on_end(self, _: Any) -> None:
        """Note the end of a kernel."""
        self._depth -= 1

    def _ask(self) -> None:
        if self._owner != os.getpid():  # a fork leaves them to the process that started them
            self._owner, self._helpers = os.getpid(), []
        function = self._kernel["dispatcher"].py_func
        package = function.__module__.partition(".")[0]
        modules = [name for name in sys.modules if name.partition(".")[0] == package]
        names = (function.__module__, function.__qualname__)
        task = pickle.dumps((sys.path, *names, tuple(self._kernel["args"]), modules))
        self._helpers = [helper for helper in self._helpers if helper.take(task)]
        while len(self._helpers) < helpers():
            self._helpers.append(_Helper())
            self._helpers[-1].take(task)

    def end(self) -> None:
        """End the helpers of this process."""
        if self._owner == os.getpid():
            for helper in self._helpers:
                helper.end()


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
    """Compile what the kernels call that standard input names, one after the other.

    Returns when there was no task for `_IDLE_TIME` seconds. Ends with the parent process.
    """
    tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def receive() -> None:
        with suppress(EOFError):
            while True:
                tasks.put(pickle.load(sys.stdin.buffer))
        os._exit(0)

    threading.Thread(target=receive, daemon=True).start()
    with suppress(queue.Empty):
        while True:
            sys.path[:], module, name, arguments, modules = tasks.get(timeout=_IDLE_TIME)
            with suppress(Exception):  # the parent meets it too
                kernel = getattr(importlib.import_module(module), name)
                with left_to_others(kernel):
                    kernel.compile(arguments)
            for loaded in modules:  # the next kernel is likely to be in one of them
                with suppress(Exception):
                    importlib.import_module(loaded)


_ask_helpers = _AskHelpers()
event.register("numba:compile", _ask_helpers)
atexit.register(_ask_helpers.end)
