"""What the operating system can do for a punctual loop; the outcome of each request is reported.

Sharper timers are requested always, and one busy core for the loop and quick contacts unless it is
declined: they need no rights. Priority, a fixed core and locked memory are requested on demand.
Linux is tested; the paths for Windows and macOS follow their documentation and are untested.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

PRIORITY = 40
"""SCHED_FIFO priority, 1 to 99: above ordinary processes, below the kernel's own threads."""
_PR_SET_TIMERSLACK = 29
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_WINDOWS_HIGH_PRIORITY = 0x80


@dataclass(frozen=True)
class RealTime:
    """What to request of the operating system.

    Parameters
    ----------
    priority : bool
        Run before all ordinary processes.
    core : int, optional
        Run on this core only.
    lock_memory : bool
        Prevent memory from being swapped out.
    share_core : bool
        Run the loop and its contacts on one core, and the recorder on another, where contacts are
        quick; not together with `priority` or `core`.
    busy_wait : bool
        Keep that core busy: poll the clock between ticks instead of sleeping. Takes effect only if
        there is a second core, and a third for devices with a thread or service.
    """

    priority: bool = False
    core: int | None = None
    lock_memory: bool = False
    share_core: bool = True
    busy_wait: bool = True


def request(wanted: RealTime) -> dict[str, str]:
    """Request sharper timers and what is wanted; return the outcome of each in words."""
    outcomes = {"timers": _attempt(sharpen_timers)}
    if wanted.priority:
        outcomes["priority"] = _attempt(_raise_priority)
    if wanted.core is not None:
        core = wanted.core
        outcomes["core"] = _attempt(lambda: _stay_on(core))
    if wanted.lock_memory:
        outcomes["memory"] = _attempt(_lock_memory)
    return outcomes


def pick_core() -> int | None:
    """Return the number of a core that this process may use; None where unsupported."""
    if not hasattr(os, "sched_getaffinity"):
        return None
    cores = sorted(os.sched_getaffinity(0))
    return cores[os.getpid() % len(cores)]  # so that two loops rarely choose the same core


def keep_off_core(core: int, process: int) -> str:
    """Keep a process off the loop's core, if there is another; return the outcome."""

    def leave() -> str:
        rest = os.sched_getaffinity(process) - {core}
        if not rest:
            raise OSError(0, "there is no other core")
        os.sched_setaffinity(process, rest)
        return f"not on core {core}"

    return _attempt(leave)


def share_core(core: int, threads: Sequence[int]) -> str:
    """Run threads of this process on one core; return the outcome.

    Handing over to a thread on another core first wakes that core, whose caches are cold; what that
    costs: docs/design/servo.md.
    """
    return _attempt(lambda: f"on {_stay_on(core, threads)}, with the loop")


def sharpen_timers() -> str:
    """Make sleeps end on time, not up to 50 us (Linux) or 15 ms (Windows) late."""
    if sys.platform == "linux":
        if ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        return "slack of 1 ns"
    if sys.platform == "win32":
        ctypes.windll.winmm.timeBeginPeriod(1)
        return "period of 1 ms"
    return "unchanged"


def _raise_priority() -> str:
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        if not kernel.SetPriorityClass(kernel.GetCurrentProcess(), _WINDOWS_HIGH_PRIORITY):
            raise OSError(kernel.GetLastError(), "SetPriorityClass failed")
        return "high priority class"
    if not hasattr(os, "sched_setscheduler"):
        raise OSError(0, "this system has no way to ask")
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    return f"SCHED_FIFO {PRIORITY}"


def _stay_on(core: int, threads: Sequence[int] = (0,)) -> str:
    """Bind threads to a core; 0 is the calling thread."""
    if not hasattr(os, "sched_setaffinity"):
        raise OSError(0, "this system has no way to ask")
    for thread in threads:
        os.sched_setaffinity(thread, {core})
    return f"core {core}"


def _lock_memory() -> str:
    if sys.platform == "win32":
        raise OSError(0, "not supported on Windows")
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return "locked"


def _attempt(what: Callable[[], str]) -> str:
    """Return the outcome of a request, or why it was refused."""
    try:
        return what()
    except (OSError, AttributeError, ValueError) as error:
        return f"refused: {getattr(error, 'strerror', None) or error}"
