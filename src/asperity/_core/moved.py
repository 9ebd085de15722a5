"""Modules that have moved: their old names still work for one version, with a warning.

`install` adds a finder behind those of Python, which sees only names that no other finder
knows. A module under its old name hands on every attribute of the one that took its place.
"""

from __future__ import annotations

import functools
import importlib
import importlib.machinery
import importlib.util
import sys
import tomllib
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any


@functools.cache
def tables() -> dict[str, dict[str, str]]:
    """Return old and new names of packages, modules, names and public names, from `moved.toml`."""
    return tomllib.loads(Path(__file__).with_name("moved.toml").read_text("utf-8"))


def renamed(name: str) -> Any:
    """Return what `asperity.name` was until now, with a warning; None if it is not an old name."""
    if name not in (public := tables()["public"]):
        return None
    module, _, new = f"asperity.{public[name]}".rpartition(".")
    warnings.warn(
        f"asperity.{name} is deprecated: use {module}.{new}", DeprecationWarning, stacklevel=3
    )
    return getattr(importlib.import_module(module), new)


def new_name(name: str) -> str | None:
    """Return the present name of a module that had the name `name`; None if there was none."""
    old = name.removeprefix("asperity.")
    package, _, rest = old.partition(".")
    modules, packages = tables()["modules"], tables()["packages"]
    if old in modules:
        return f"asperity.{modules[old]}"
    if package in packages:
        return f"asperity.{packages[package]}" + (f".{rest}" if rest else "")
    return None


def forwarded(old: str, new: str) -> Callable[[str], Any]:
    """Return a `__getattr__` for the module `old` that takes names from the module `new`."""

    def get(name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(f"module {old!r} has no attribute {name!r}")
        key = f"{old.removeprefix('asperity.')}.{name}"
        names = tables()["names"]
        place = f"asperity.{names[key]}" if key in names else f"{new}.{name}"
        module, _, now = place.rpartition(".")
        value = getattr(importlib.import_module(module), now)
        warnings.warn(
            f"{old}.{name} has moved: use {module}.{now}", DeprecationWarning, stacklevel=2
        )
        return value

    return get


class _Finder:
    """Finds modules under their old names."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return a spec for an old name; None for all others."""
        new = new_name(name) if name.startswith("asperity.") else None
        if new is None or importlib.util.find_spec(new) is None:
            return None
        return importlib.machinery.ModuleSpec(name, self, is_package=True)  # type: ignore[arg-type]

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> None:
        """Leave making the module to Python."""

    def exec_module(self, module: ModuleType) -> None:
        """Have the module hand on what the new one has."""
        new = new_name(module.__name__)
        assert new is not None
        module.__doc__ = f"Moved to `{new}`."
        module.__dict__["__getattr__"] = forwarded(module.__name__, new)


def install() -> None:
    """Let modules be imported under their old names."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())
