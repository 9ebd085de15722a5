"""Whether the process that started this one is still there."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import sys
from pathlib import Path

from asperity.realtime.shared_file import PREFIX

_EVERY = 5
"""Looks between two real ones, where looking is not almost free."""


class Parent:
    """The process that started this one."""

    def __init__(self) -> None:
        self._number = os.getppid()
        self._looks = 0

    def is_gone(self) -> bool:
        """Return whether it has ended, however."""
        if sys.platform != "win32":
            # An orphan is given to another parent.
            return os.getppid() != self._number
        self._looks += 1
        parent = multiprocessing.parent_process()
        return self._looks % _EVERY == 0 and parent is not None and not parent.is_alive()


def clear_up(folder: Path) -> None:
    """Remove a shared folder that its maker can no longer remove."""
    if folder.name.startswith(PREFIX):
        shutil.rmtree(folder, ignore_errors=True)
