"""The one door through which compiled kernels are made.

Numba's disk cache keys a compiled function by the source of *its own* file: edit a function
that it calls in another file and the cache silently returns the old machine code, with wrong
numbers. So every module of kernels has its own cache folder, named by a hash of its source
and of all that it imports from the package, directly or not. An edit compiles anew what stands
on it, and nothing else. What a function imports for itself, as the readers of files, and what is
imported for types alone does not count: kernels stand at the top of their modules
(`tests/core/test_kernels.py`), and see only what is imported there.

A kernel may be handed a structure (a `NamedTuple`) without importing it. Machine code knows its
fields by their numbers alone, and the cache finds it by its name and place. So the names of all
structures of the package and of their fields, in order, are part of every hash.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import re
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

_PACKAGE = Path(__file__).parents[1]
_PREFIX = "asperity-"
_IMPORT = re.compile(
    r"^(?:from[ ]asperity(?P<of>[\w.]*)[ ]import[ ](?P<names>\([^)]*\)|[^\n#]*)"
    r"|import[ ]asperity(?P<module>[\w.]*))",
    re.MULTILINE,
)
_STRUCTURE = re.compile(
    r"^class (?P<name>\w+)\(NamedTuple\):\n(?P<body>(?:[ \t].*\n|\n)*)", re.MULTILINE
)
_FIELD = re.compile(r"^    (\w+)\s*:", re.MULTILINE)
F = TypeVar("F", bound=Callable[..., Any])


@functools.cache
def _files() -> dict[str, Path]:
    """Return the source files of the package by their modules, such as `.contact.solver`."""
    files = {}
    for file in sorted(_PACKAGE.rglob("*.py")):
        parts = file.relative_to(_PACKAGE).with_suffix("").parts
        files["".join("." + part for part in parts if part != "__init__")] = file
    return files


@functools.cache
def _source(path: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Return the digest of a source file, and the files of the package that it imports."""
    text, known = path.read_text("utf-8"), _files()
    imported: dict[Path, None] = {}
    for found in _IMPORT.finditer(text):
        base = (found["of"] or found["module"] or "").rstrip(".")
        for name in (
            base,
            *(f"{base}.{part}" for part in re.findall(r"\w+", found["names"] or "")),
        ):
            if name in known:
                imported[known[name]] = None
    return hashlib.sha256(text.encode()).digest(), tuple(imported)


@functools.cache
def _structures() -> bytes:
    """Return a digest of which structures the package has, where, and of their fields' names."""
    digest = hashlib.sha256()
    for module, file in _files().items():
        text = file.read_text("utf-8")
        for found in _STRUCTURE.finditer(text) if "(NamedTuple):" in text else ():
            fields = _FIELD.findall(found["body"])
            digest.update(f"{module} {found['name']} {fields}\n".encode())
    return digest.digest()


@functools.cache
def source_hash(path: Path) -> str:
    """Return 16 hex digits that change with a source file, all that it imports, and structures.

    Of a file outside the package: with all of the package, and with the files beside it.
    """
    seen, waiting = {path}, [path]
    if _PACKAGE not in path.parents:
        seen |= {*_files().values(), *path.parent.glob("*.py")}
        waiting = []
    while waiting:
        fresh = set(_source(waiting.pop())[1]) - seen
        seen |= fresh
        waiting += fresh
    digest = hashlib.sha256(_structures())
    for file in sorted(seen, key=str):
        digest.update(file.name.encode() + _source(file)[0])
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Return the folder that holds the machine code for this Numba and Python.

    It lies in `NUMBA_CACHE_DIR` where the user has set that, else in the user's cache folder
    (`XDG_CACHE_HOME`, `LOCALAPPDATA`, or `~/.cache`).
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen and Path(chosen).name.startswith(_PREFIX):
        # Set by a parent process: stay beside its folder, not inside it.
        root = Path(chosen).parent
    elif chosen:
        root = Path(chosen)
    else:
        base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
        home = os.path.expanduser("~")
        # A user without a home has no cache either: nothing can lie below the null device.
        root = Path(base or (os.devnull if home == "~" else home + "/.cache")) / "asperity"
    versions = hashlib.sha256(f"{version('numba')} {sys.version}".encode())
    return root / (_PREFIX + versions.hexdigest()[:16])


def kernel_folder(path: Path) -> Path:
    """Return the folder that holds the machine code of a source file's kernels."""
    return Path(os.environ["NUMBA_CACHE_DIR"]) / f"{path.stem}-{source_hash(path)}"


def is_compiled(module: str, name: str) -> bool:
    """Return whether machine code of a kernel is kept, as of `("contact.geom_tick", "tick")`."""
    folder = kernel_folder(_PACKAGE.joinpath(*module.split(".")).with_suffix(".py"))
    return any(folder.rglob(f"*.{name}-*.nbc"))


@functools.cache
def _can_be_written(folder: Path) -> bool:
    """Return whether files can be put into `folder`, which is made if need be.

    Remembered, since Numba checks it for each function: a tenth of a second for those of a scene.
    """
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
from numba.core import caching  # noqa: E402

from asperity._core.compile_time import (  # noqa: E402
    SeparateCompiler,
    compilers,
    is_tested,
)

# Numba may have been imported before us; then the variable alone comes too late.
numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]
_COMPILER, _INNER_COMPILER = compilers()
_SEPARATE = sys.platform == "linux" and is_tested()
"""Calls between the machine code of kernels were tested on Linux only."""

# Numba names the folder of a function by the place of its source too, so that each clone and each
# environment would compile anew what has the same content. Older versions offer no choice.
_LOCATED = hasattr(numba.config, "CACHE_LOCATOR_CLASSES") and hasattr(
    caching, "UserProvidedCacheLocator"
)
if _LOCATED:

    class ContentLocator(caching.UserProvidedCacheLocator):
        """The place of machine code in the cache: wherever the source is, the same."""

        def ensure_cache_path(self) -> None:
            """Make the folder; raise OSError where files cannot be put into it."""
            if not _can_be_written(Path(self.get_cache_path())):
                raise OSError(f"cannot write to {self.get_cache_path()}")

        @classmethod
        def get_suitable_cache_subpath(cls, py_file: str) -> str:
            """Return the name of a folder in `kernel_folder`."""
            return Path(py_file).parent.name


_OPTIONS = {"cache": _CACHED, "nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


def _compiled(function: F, **options: Any) -> F:
    """Return the function to be compiled at its first call, with the cache folder of its file."""
    path, usual = Path(function.__code__.co_filename), os.environ["NUMBA_CACHE_DIR"]
    by_content = _CACHED and path.is_file()
    _configure(str(kernel_folder(path)) if by_content else usual, by_content)
    try:
        return numba.njit(**options)(function)
    finally:
        _configure(usual, False)


def _configure(folder: str, by_content: bool) -> None:
    """Set where Numba keeps the functions that are made next."""
    numba.config.CACHE_DIR = folder
    if _LOCATED:
        numba.config.CACHE_LOCATOR_CLASSES = f"{__name__}.ContentLocator" if by_content else ""


def kernel(function: F) -> F:
    """Compile `function` at its first call: cached on disk, without the interpreter's lock."""
    return _compiled(function, pipeline_class=_COMPILER, **_OPTIONS)


_INNER = _OPTIONS | {
    "pipeline_class": _INNER_COMPILER,
    "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False,
}  # fmt: skip


def inner_kernel(function: F) -> F:
    """Compile `function` as `kernel` does, to be called by other kernels only.

    A way in from Python is left out: for arguments of many arrays it takes longer to compile
    than the function itself. (Called from Python it crashes.) References to arrays are not
    counted: counting is atomic, and took a third of a tick. So such a function makes no arrays,
    nor does it return one: it writes to what it is given, and what it needs for itself are
    `asperity._core.stack.stack_array`s.
    """
    return _compiled(function, **_INNER)


def separate_kernel(function: F) -> F:
    """Compile `function` as `inner_kernel` does, but once for all its callers.

    For a large part of a tick: callers jump to its machine code, while that of an inner kernel is
    linked into each kernel called from Python and optimised with it.
    """
    if not _SEPARATE:
        return inner_kernel(function)
    compiler = SeparateCompiler.of(source_hash(Path(function.__code__.co_filename)))
    return _compiled(function, **(_INNER | {"pipeline_class": compiler}))


def small_kernel(function: F) -> F:
    """Compile `function` as `inner_kernel` does, and as part of whatever calls it.

    For what takes less time than its call would: an array is handed over as seven numbers.
    """
    return _compiled(function, forceinline=True, **_INNER)


class Repeated:
    """A kernel that is called again and again with arguments of the same types.

    Numba asks for the types of all arguments in every call, of structures part by part: for those
    of a tick that takes twice as long as its sums. Here they are inferred at the first call only.
    Whoever calls sees to it that they stay: an array of another layout would be read wrongly.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._kernel: Any = function
        self._enter: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel."""
        if self._enter is not None:
            return self._enter(*arguments)
        result = self._kernel(*arguments)
        # Numba may be switched off, to look for an error: then it is a function of Python.
        compiled = getattr(self._kernel, "compile", None)
        types = tuple(numba.typeof(argument) for argument in arguments)
        self._enter = compiled(types) if compiled is not None else self._kernel
        return result


@inner_kernel
def clear(values):  # type: ignore[no-untyped-def]
    """Set a row of numbers to zero.

    A slice that is assigned to compiles much more slowly.
    """
    for i in range(values.size):
        values[i] = 0.0
