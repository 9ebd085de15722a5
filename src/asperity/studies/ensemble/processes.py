"""One function over many items, on several processes; and verdicts as short texts."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError

_MOST = 4
Item = TypeVar("Item")
Found = TypeVar("Found")


def over_items(
    function: Callable[[Item], Found],
    items: Sequence[Item],
    *,
    processes: int | None = None,
    progress: Callable[[], None] | None = None,
) -> list[Found]:
    """Return the results of a function for each item, in the order of the items.

    Parameters
    ----------
    function : callable
        Can be pickled: a function of a module, or a `functools.partial` of one.
    items : sequence
    processes : int, optional
        Number of processes; by default one a core, at most four. 1 starts none. More than 1 needs
        a script that guards its start by `if __name__ == "__main__"`.
    progress : callable, optional
        Called after each item.
    """
    if processes is not None and processes < 1:
        raise AsperityError(f"processes must be at least 1, got {processes}")
    advance = progress or (lambda: None)
    count = min(processes or min(os.cpu_count() or 1, _MOST), len(items))
    if count <= 1:
        results = []
        for item in items:
            results.append(function(item))
            advance()
        return results
    found: dict[int, Found] = {}
    # Spawned: a fork would copy the threads of the display of progress.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=context) as pool:
        futures = {pool.submit(function, item): i for i, item in enumerate(items)}
        for future in as_completed(futures):
            found[futures[future]] = future.result()
            advance()
    return [found[i] for i in range(len(items))]


def as_text(holds: NDArray[np.bool_]) -> str:
    """Return verdicts as a text of 0 and 1, the last axis running fastest."""
    return "".join("01"[one] for one in holds.ravel().tolist())


def as_texts(
    holds: NDArray[np.bool_], metrics: Iterable[str], ids: Sequence[str]
) -> dict[str, dict[str, str]]:
    """Return verdicts (hands, plates, metrics, ids) as texts by metric and by id."""
    return {
        metric: {one: as_text(holds[:, :, i, j]) for j, one in enumerate(ids)}
        for i, metric in enumerate(metrics)
    }


def from_texts(
    stored: Mapping[str, Mapping[str, str]], hands: int, plates: int
) -> NDArray[np.bool_]:
    """Return the verdicts of `as_texts` for so many hands and plates."""
    holds = [[from_text(text, (hands, plates)) for text in row.values()] for row in stored.values()]
    return np.moveaxis(np.array(holds), (0, 1), (2, 3))


def from_text(text: str, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return the verdicts of `as_text` in a shape."""
    if len(text) != int(np.prod(shape)) or set(text) - set("01"):
        raise AsperityError(
            f"verdicts must be {int(np.prod(shape))} characters of 0 and 1, got {len(text)}: "
            f"{text[:20]!r}"
        )
    return np.array([one == "1" for one in text]).reshape(shape)
