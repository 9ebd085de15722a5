"""What a process can ask of the operating system to be on time; each answer is reported.

Only sharper timers, and that loop and quick contacts have one core and keep it busy, are asked for
without being told to: they need no rights. Priority, a core of one's own and locked
memory are asked for on request. Linux is what is tested; what is done on Windows and macOS is
written from their documentation, and untested.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

PRIORITY = 40
"""Of SCHED_FIFO, 1 to 99: above ordinary work, below what the kernel itself needs."""
_GROUPS = Path("/sys/fs/cgroup")
_QUOTAS: tuple[tuple[Path, Path | None], ...] = (
    (_GROUPS / "cpu.max", None),
    (_GROUPS / "cpu" / "cpu.cfs_quota_us", _GROUPS / "cpu" / "cpu.cfs_period_us"),
)
"""Where Linux tells how much of a period a container may compute, of version 2 and of 1 [us]."""
_PR_SET_TIMERSLACK = 29
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_WINDOWS_HIGH_PRIORITY = 0x80


@dataclass(frozen=True)
class RealTime:
    """What to ask for.

    Parameters
    ----------
    priority : bool
        Run before all ordinary processes.
    core : int, optional
        Run on this core only.
    lock_memory : bool
        Never let memory be swapped out.
    share_core : bool
        Have the loop and its contacts on one core where contacts are quick, unless priority or a
        core is asked for; and the recorder on another one.
    busy_wait : bool
        Keep such a core busy: the loop watches the clock between ticks and does not sleep. Only
        where there is another core, and one more for devices that others work for.
    """

    priority: bool = False
    core: int | None = None
    lock_memory: bool = False
    share_core: bool = True
    busy_wait: bool = True


def ask(wanted: RealTime) -> dict[str, str]:
    """Ask for sharper timers and what is wanted; return what came of each, in words."""
    told = {"timers": _tried(sharpen_timers)}
    if wanted.priority:
        told["priority"] = _tried(_raise_priority)
    if wanted.core is not None:
        core = wanted.core
        told["core"] = _tried(lambda: _stay_on(core))
    if wanted.lock_memory:
        told["memory"] = _tried(_lock_memory)
    return told


def any_core() -> int | None:
    """Return the number of a core that this process may use; None where the system has no word."""
    if not hasattr(os, "sched_getaffinity"):
        return None
    cores = sorted(os.sched_getaffinity(0))
    return cores[os.getpid() % len(cores)]  # two loops on one machine are not to meet always


def usable_cores() -> int:
    """Return how many cores this process may use, all of their time; 1 if the system has no word.

    A container may have many cores and the time of one: who is busy then stops all others.
    """
    if not hasattr(os, "sched_getaffinity"):
        return 1
    cores = float(len(os.sched_getaffinity(0)))
    for quota, period in _QUOTAS:
        try:
            given = [*quota.read_text().split(), *(period.read_text().split() if period else ())]
            if float(given[0]) > 0.0:
                cores = min(cores, float(given[0]) / float(given[1]))
        except (OSError, ValueError, IndexError, ZeroDivisionError):
            continue  # not there, or "max": no limit
    return max(int(cores), 1)


def keep_off(core: int, process: int) -> str:
    """Have a process leave a core to the loop, if it has others; return what came of it."""

    def leave() -> str:
        rest = os.sched_getaffinity(process) - {core}
        if not rest:
            raise OSError(0, "there is no other core")
        os.sched_setaffinity(process, rest)
        return f"not on core {core}"

    return _tried(leave)


def share_core(core: int, threads: Sequence[int]) -> str:
    """Have threads of this process run on one core; return what came of it.

    Handing over to a thread on another core wakes that core first, and finds its caches cold. On a
    virtual machine of two cores, the same contact took 0.3 ms beside the loop and 0.1 ms alone; of
    the probe's contacts in the hand 2 to 3 % came too late on two cores, 0.3 to 0.8 % on one, and
    0 to 0.02 % on one that never sleeps and that the recorder keeps off.
    """
    return _tried(lambda: f"on {_stay_on(core, threads)}, with the loop")


def sharpen_timers() -> str:
    """Have sleeping end when it was to end, not up to 50 us (Linux) or 15 ms (Windows) later."""
    if sys.platform == "linux":
        if ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        return "slack of 1 ns"
    if sys.platform == "win32":
        ctypes.windll.winmm.timeBeginPeriod(1)
        return "period of 1 ms"
    return "as they are"


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
    """Keep threads, 0 being this one, on a core."""
    if not hasattr(os, "sched_setaffinity"):
        raise OSError(0, "this system has no way to ask")
    for thread in threads:
        os.sched_setaffinity(thread, {core})
    return f"core {core}"


def _lock_memory() -> str:
    if sys.platform == "win32":
        raise OSError(0, "not asked for on Windows")
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return "locked"


def _tried(what: Callable[[], str]) -> str:
    """Return what an attempt says, or why it was refused."""
    try:
        return what()
    except (OSError, AttributeError, ValueError) as error:
        return f"refused: {getattr(error, 'strerror', None) or error}"
