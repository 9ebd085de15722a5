"""Progress bars of long commands, on stderr."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, Task

FIRST_LINE, LINES = 2.0, 10.0
"""Without a terminal: time until the first line, and between lines [s]."""


@contextmanager
def progress_bars(*, remaining: bool = False) -> Iterator[Progress]:
    """Give a display to which tasks are added, bars on a terminal, and else a line now and then.

    The first unfinished task names the number of kernels compiled while it waits for them. With
    `remaining` the display also estimates the remaining time.
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
    from rich.text import Text

    label = labels()

    class Label(ProgressColumn):
        max_refresh = 0.5  # [s]: files are counted for it

        def render(self, task: Task) -> Text:
            return Text(f"{label(display.tasks, task):<28}")

    columns: list[ProgressColumn] = [
        Label(),
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
        with _lines(display, label):
            yield display


def labels() -> Callable[[Sequence[Task], Task], str]:
    """Return what gives the label of a task, from all tasks and that one.

    The first unfinished task may wait for kernels. Threads and other processes compile them, so
    those are counted that came into the cache since that task is the first.
    """
    from asperity._core.kernels import cache_state

    since: dict[int, int] = {}

    def label(tasks: Sequence[Task], task: Task) -> str:
        what = " ".join(task.description.split())
        first = next((one for one in tasks if not _is_done(one)), None)
        if task is not first or task.completed:
            return what
        count = cache_state()[1]
        compiled = count - since.setdefault(task.id, count)
        return f"{what} (kernels compiled: {compiled})" if compiled > 0 else what

    return label


def _is_done(task: Task) -> bool:
    # Not `finished`: a task of several steps counts to its end more than once.
    return task.total is not None and task.completed >= task.total


@contextmanager
def _lines(display: Progress, label: Callable[[Sequence[Task], Task], str]) -> Iterator[None]:
    """Print the state of the first unfinished task on stderr, from a thread, until the end."""
    ended = threading.Event()

    def tell() -> None:
        wait = FIRST_LINE
        while not ended.wait(wait):
            wait = LINES
            tasks = list(display.tasks)
            task = next((one for one in tasks if not _is_done(one)), None)
            if task is not None:
                share = f", {task.percentage:.0f} %" if task.total else ""
                since = f", {task.elapsed or 0.0:.0f} s so far"
                print(f"asperity: {label(tasks, task)}{share}{since}", file=sys.stderr, flush=True)

    thread = threading.Thread(target=tell, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
