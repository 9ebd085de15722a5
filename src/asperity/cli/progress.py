"""Progress bars for long work."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress


@contextmanager
def progress_bars(*, remaining: bool = False) -> Iterator[Progress]:
    """Give a display on stderr to which tasks are added; silent where stderr is no terminal.

    With `remaining` it estimates the time that is left, too.
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


def compile_notice() -> str:
    """Return a description for work that may have to compile first."""
    from asperity._core.kernels import is_compiled

    return (
        "studies"
        if is_compiled("dynamics.dragged_hand.integrator", "force_at")
        else "studies (compiling first)"
    )
