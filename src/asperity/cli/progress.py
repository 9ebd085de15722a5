"""Progress bars of long commands, on stderr."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

FIRST_LINE, LINES = 2.0, 10.0
"""Without a terminal: time until the first line, and between lines [s]."""


@contextmanager
def progress_bars(*, remaining: bool = False) -> Iterator[Progress]:
    """Give a display to which tasks are added, bars on a terminal, and else a line now and then.

    With `remaining` it also estimates the remaining time.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns: list[ProgressColumn] = [
        TextColumn("{task.description:<28}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    ]
    if remaining:
        columns += [TextColumn("left"), TimeRemainingColumn()]
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not console.is_terminal) as display:
        if console.is_terminal:
            yield display
            return
        with _lines(display):
            yield display


@contextmanager
def _lines(display: Progress) -> Iterator[None]:
    """Print the state of the first unfinished task on stderr, from a thread, until the end."""
    ended = threading.Event()

    def tell() -> None:
        wait = FIRST_LINE
        while not ended.wait(wait):
            wait = LINES
            # Not `finished`: a task of several steps counts to its end more than once.
            tasks = list(display.tasks)
            open_tasks = [one for one in tasks if one.total is None or one.completed < one.total]
            if open_tasks:
                task = open_tasks[0]
                share = f", {task.percentage:.0f} %" if task.total else ""
                what = " ".join(task.description.split())
                since = f", {task.elapsed or 0.0:.0f} s so far"
                print(f"asperity: {what}{share}{since}", file=sys.stderr, flush=True)

    thread = threading.Thread(target=tell, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def compile_notice(what: str, *kernels: tuple[str, str]) -> str:
    """Return the description of a bar, which mentions that a kernel has to be compiled first.

    `kernels` are their modules and names, as for `is_compiled`.
    """
    from asperity._core.kernels import is_compiled

    is_ready = all(is_compiled(module, name) for module, name in kernels)
    return what if is_ready else f"{what} (compiling first)"
