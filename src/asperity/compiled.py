"""The one door through which compiled kernels are made.

Numba's disk cache keys a compiled function by the source of *its own* file: edit a function
that it calls in another file and the cache silently returns the old machine code, with wrong
numbers. So before Numba is imported, `NUMBA_CACHE_DIR` is pointed at a folder named by a hash of
all of the package's sources and the versions of Numba and Python; any edit starts a fresh cache.
"""

from __future__ import annotations

import hashlib
import logging
import os
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

_PACKAGE = Path(__file__).parent
_PREFIX = "asperity-"
F = TypeVar("F", bound=Callable[..., Any])


def source_hash(package: Path = _PACKAGE) -> str:
    """Return 16 hex digits that change when any source file, Numba or Python changes."""
    digest = hashlib.sha256(f"{version('numba')} {sys.version}".encode())
    for path in sorted(package.rglob("*.py")):
        digest.update(str(path.relative_to(package)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Return the folder that holds the machine code of this very version of the sources.

    It lies in `NUMBA_CACHE_DIR` where the user has set that, else in the user's cache folder
    (`XDG_CACHE_HOME`, `LOCALAPPDATA`, or `~/.cache`).
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen and Path(chosen).name.startswith(_PREFIX):
        # Set by a parent process of ours: stay beside its folder, not inside it.
        root = Path(chosen).parent
    elif chosen:
        root = Path(chosen)
    else:
        base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
        home = os.path.expanduser("~")
        # A user without a home has no cache either: nothing can lie below the null device.
        root = Path(base or (os.devnull if home == "~" else home + "/.cache")) / "asperity"
    return root / (_PREFIX + source_hash())


def _can_be_written(folder: Path) -> bool:
    """Return whether files can be put into `folder`, which is made if need be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def cache_state() -> tuple[Path, int]:
    """Return the cache folder and how many compiled functions lie in it."""
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    return folder, sum(1 for _ in folder.rglob("*.nbc")) if folder.is_dir() else 0


os.environ["NUMBA_CACHE_DIR"] = str(cache_folder())
# Numba would fall back to folders that are not keyed by the sources: better no cache than that.
_CACHED = _can_be_written(Path(os.environ["NUMBA_CACHE_DIR"]))
if not _CACHED:
    logging.getLogger(__name__).warning(
        "cannot write to %s: every run compiles anew; name another folder with NUMBA_CACHE_DIR",
        os.environ["NUMBA_CACHE_DIR"],
    )

import numba  # noqa: E402  (the folder has to be known to Numba when it is imported)

# Numba may have been imported before us; then the variable alone comes too late.
numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]


_OPTIONS = {"cache": _CACHED, "nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


def kernel(function: F) -> F:
    """Compile `function` at its first call: cached on disk, without the interpreter's lock."""
    return numba.njit(**_OPTIONS)(function)


_INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True} | _OPTIONS


def inner_kernel(function: F) -> F:
    """Compile `function` as `kernel` does, to be called by other kernels only.

    A way in from Python is left out: for arguments of many arrays it takes longer to compile
    than the function itself. (Called from Python it crashes.)
    """
    return numba.njit(**_INNER)(function)


def lean_kernel(function: F) -> F:
    """Compile `function` as `inner_kernel` does, without counting references to arrays.

    Counting is atomic, and took half the time of the search. Such a function, and what it calls,
    makes no arrays: it writes to what it is given.
    """
    return numba.njit(_nrt=False, **_INNER)(function)


def small_kernel(function: F) -> F:
    """Compile `function` as `lean_kernel` does, and as part of whatever calls it.

    For what takes less time than its call would: an array is handed over as seven numbers.
    """
    return numba.njit(forceinline=True, _nrt=False, **_INNER)(function)


@lean_kernel
def clear(values):  # type: ignore[no-untyped-def]
    """Set a row of numbers to zero.

    A slice that is assigned to compiles much more slowly.
    """
    for i in range(values.size):
        values[i] = 0.0
