"""How many cores a process may use."""

from __future__ import annotations

import os
from pathlib import Path

_GROUPS = Path("/sys/fs/cgroup")
_QUOTAS: tuple[tuple[Path, Path | None], ...] = (
    (_GROUPS / "cpu.max", None),
    (_GROUPS / "cpu" / "cpu.cfs_quota_us", _GROUPS / "cpu" / "cpu.cfs_period_us"),
)
"""Files with a container's CPU quota and period [us], for cgroups version 2 and 1."""


def usable_cores() -> int:
    """Return how many cores' full time this process may use; 1 if the system does not say.

    A container may see many cores and have the time of one: a busy process then stops all others.
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
            continue  # no such file, or "max": no limit
    return max(int(cores), 1)
