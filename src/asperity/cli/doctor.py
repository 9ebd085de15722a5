"""`asperity doctor`: a report on this machine."""

from __future__ import annotations

import os
import platform
import shutil
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from asperity import __version__
from asperity.cli.result import print_result

_PACKAGES = (
    "mujoco", "numba", "numpy", "scipy", "xarray", "h5netcdf", "h5py", "matplotlib", "tyro", "rich",
)  # fmt: skip
_TICK, _TICKS = 1e-3, 300
"""Period of the deadlines of `timer_jitter` [s], and their number."""


@dataclass
class DoctorCommand:
    """Print what this machine provides: versions, compile cache, graphics, timer, devices."""

    def run(self) -> None:
        """Print the report."""
        found = report()
        print_result([f"{subject + ':':16}{finding}" for subject, finding in found], dict(found))


def report() -> list[tuple[str, str]]:
    """Return the report as pairs (subject, finding)."""
    return [
        ("asperity", __version__),
        ("python", f"{platform.python_version()} ({sys.platform}, {platform.machine()})"),
        ("packages", _versions(_PACKAGES)),
        ("processor", f"{_cores()} cores usable, load {_load()}"),
        ("compiled cache", _cache()),
        ("bytecode", _bytecode()),
        ("graphics", _graphics()),
        ("timer jitter", _jitter_line(timer_jitter())),
        ("priority", _priority()),
        ("devices", _devices()),
    ]


def timer_jitter(
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
    ticks: int = _TICKS,
) -> list[float]:
    """Return how late each of `ticks` successive 1 ms deadlines was met [s]."""
    lateness = []
    start = clock()
    for i in range(1, ticks + 1):
        deadline = start + i * _TICK
        wait = deadline - clock()
        if wait > 0.0:
            sleep(wait)
        lateness.append(clock() - deadline)
    return lateness


def _jitter_line(lateness: list[float]) -> str:
    ordered = sorted(lateness)
    median = statistics.median(ordered) * 1e6
    p99 = ordered[int(0.99 * (len(ordered) - 1))] * 1e6
    return (
        f"a 1 ms deadline is met {median:.0f} µs late (median), {p99:.0f} µs (p99), "
        f"{ordered[-1] * 1e6:.0f} µs (worst of {len(ordered)})"
    )


def _versions(names: tuple[str, ...]) -> str:
    found = []
    for name in names:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} missing")
    return ", ".join(found)


def _cores() -> int:
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _load() -> str:
    try:
        return f"{os.getloadavg()[0]:.2f}"
    except (AttributeError, OSError):
        return "unknown"


def _cache() -> str:
    from asperity._core.kernels import cache_state

    folder, count = cache_state()
    home = os.path.expanduser("~")
    shown = str(folder).replace(home, "~", 1) if home != os.sep else str(folder)
    state = f"{count} compiled functions" if count else "empty: the first run compiles"
    return f"{state}, in {shown}"


def _bytecode() -> str:
    if sys.dont_write_bytecode:
        return "not kept (PYTHONDONTWRITEBYTECODE): every start takes about two seconds longer"
    return "kept"


def _graphics() -> str:
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    screen = f"display {display}" if display else "no display"
    card = "render node /dev/dri" if os.path.isdir("/dev/dri") else "no render node"
    nvidia = "nvidia-smi found" if shutil.which("nvidia-smi") else "no NVIDIA driver"
    return f"{screen}; {card}; {nvidia}. Figures need neither"


def _priority() -> str:
    try:
        policy = os.sched_getscheduler(0)
        names = {0: "normal", 1: "FIFO", 2: "round robin", 3: "batch", 5: "idle"}
        current = f"{names.get(policy, policy)} scheduling, nice {os.nice(0)}"
    except (AttributeError, OSError):
        return "unknown on this system"
    return f"{current}; real-time scheduling is {'' if _may_be_real_time() else 'not '}permitted"


def _may_be_real_time() -> bool:
    """Return whether this process may take real-time priority, by trying and reverting."""
    try:
        policy, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, policy, parameter)
    except (AttributeError, OSError):
        return False
    return True


def _devices() -> str:
    from asperity.realtime.devices.catalogue import ENTRIES, is_installed

    installed = [entry.name for entry in ENTRIES.values() if is_installed(entry)]
    others = [entry.name for entry in ENTRIES.values() if not is_installed(entry)]
    missing = f"; not installed: {', '.join(others)}" if others else ""
    return f"{', '.join(installed)}{missing}; see 'asperity devices'"
