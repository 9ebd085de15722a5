"""Progress bars of long commands, on stderr."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress


@contextmanager
def progress_bars(*, remaining: bool = False) -> Iterator[Progress]:
    """Give a display to which tasks are added; it shows nothing if stderr is not a terminal.

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
        yield display


def compile_notice(what: str, module: str, function: str) -> str:
    """Return the description of a bar, which mentions that a kernel has to be compiled first."""
    from asperity._core.kernels import is_compiled

    return what if is_compiled(module, function) else f"{what} (compiling first)"
