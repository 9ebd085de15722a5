"""Methods by name, or from a Python file of one's own."""

from __future__ import annotations

import runpy
from collections.abc import Iterable
from pathlib import Path

from asperity.errors import AsperityError
from asperity.studies.baselines import METHODS, Method, choose_methods


def find_methods(names: Iterable[str]) -> list[Method]:
    """Return methods by name, and those that Python files define; all of `METHODS` by default.

    Parameters
    ----------
    names : iterable of str
        Keys of `METHODS`, or paths that end in `.py`. A file is run; every `Method` among its
        global variables counts.

    Raises
    ------
    AsperityError
        For an unknown name, and for a file that is missing, fails, or defines no method.
    """
    names = list(names)
    own = [method for name in names if name.endswith(".py") for method in _defined_in(Path(name))]
    known = [name for name in names if not name.endswith(".py")]
    return [*(choose_methods(known) if known or not own else []), *own]


def _defined_in(path: Path) -> list[Method]:
    """Return the methods among the global variables of a Python file."""
    if not path.is_file():
        raise AsperityError(f"--method: no such file: {path}")
    try:
        values = runpy.run_path(str(path)).values()
    except Exception as error:  # whatever the file does wrong is one line
        raise AsperityError(f"--method: {path} failed: {type(error).__name__}: {error}") from error
    found = {one.name: one for one in values if isinstance(one, Method)}
    if not found:
        raise AsperityError(f"--method: {path} defines no instance of asperity's Method")
    taken = sorted(set(found) & set(METHODS))
    if taken:
        raise AsperityError(f"--method: {path} defines {taken[0]!r}, which is a built-in method")
    return list(found.values())
