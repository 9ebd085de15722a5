"""Results on disk: whole or not at all."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from asperity.errors import OutputError

_LIST = ".asperity.json"
"""File in a result folder that lists the files that asperity wrote there."""


@contextmanager
def result_folder(folder: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Give a fresh folder to write files into; they come to stand in `folder` when all went well.

    If the block raises or is interrupted, nothing new is left behind. Files that a former call
    wrote, and nobody changed since, are replaced. With `overwrite`, all files of the same names
    are; whatever else stands in `folder` stays.

    Raises
    ------
    OutputError
        `folder` is no folder, holds something else and `overwrite` is false, or cannot be written.
    """
    folder = Path(os.path.realpath(folder))
    with output_errors(folder), ExitStack() as undo:
        _refuse_foreign(folder, overwrite)
        for parent in reversed(folder.parents):
            if not parent.exists():
                parent.mkdir()
                undo.callback(_remove_if_empty, parent)
        fresh = Path(tempfile.mkdtemp(prefix=".asperity-", dir=folder.parent))
        undo.callback(shutil.rmtree, fresh, ignore_errors=True)
        fresh.chmod(0o755)
        yield fresh
        _move_in(fresh, folder)


def growing_folder(folder: Path, *, overwrite: bool = False) -> Path:
    """Return a folder for results that are worth having before they are whole: recordings.

    It is made if need be. What a person has felt is not replaced unasked: if the folder holds
    something, and not `overwrite`, it is the next free one, `folder-2` and so on.
    """
    folder = Path(os.path.realpath(folder))
    with output_errors(folder):
        _refuse_file(folder)
        name = folder.name
        tries = (folder.with_name(f"{name}-{n}") for n in range(2, 10**6))
        while not overwrite and folder.exists() and (folder.is_file() or any(folder.iterdir())):
            folder = next(tries)
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def write_page(page: Path, text: str, *, overwrite: bool = False) -> None:
    """Write a page into a folder of other things, as `result_folder` writes files."""
    refuse_foreign_page(page, overwrite=overwrite)
    write_whole(page, text)
    files = _written_files(page.parent) | {page.name: _state(page)}
    write_whole(page.parent / _LIST, json.dumps({"files": files}) + "\n")


def refuse_foreign_page(page: Path, *, overwrite: bool = False) -> None:
    """Raise `OutputError` if a page exists that asperity did not write, or that was changed."""
    if not page.exists() or overwrite:
        return
    if _written_files(page.parent).get(page.name) != _state(page):
        raise OutputError(f"{page} exists; give --overwrite, or another folder with --out")


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Turn an `OSError` into an `OutputError`, one line that names `path`."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write to {path}: {error.strerror or error}") from None


def _refuse_file(folder: Path) -> None:
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    if not nearest.is_dir():
        raise OutputError(
            f"cannot write to {folder}: {nearest} is a file; give a folder with --out"
        )


def _refuse_foreign(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that holds anything but unchanged results of asperity's."""
    _refuse_file(folder)
    if overwrite or not folder.is_dir():
        return
    written = _written_files(folder)
    for path in sorted(_files_in(folder)):
        state = written.get(path)
        if state != _state(folder / path):
            what = "was not written by asperity" if state is None else "was changed since"
            raise OutputError(
                f"{folder} is not empty, and {path} in it {what}; give --overwrite, or another "
                "folder with --out"
            )


def _files_in(folder: Path) -> list[str]:
    """Return the files in a folder and below, relative to it, without the list of them."""
    paths = (path.relative_to(folder) for path in folder.rglob("*") if not path.is_dir())
    return [path.as_posix() for path in paths if path.as_posix() != _LIST]


def _written_files(folder: Path) -> dict[str, list[int]]:
    """Return the files that asperity wrote into a folder, and the state they were left in."""
    try:
        files = json.loads((folder / _LIST).read_text("utf-8"))["files"]
    except (OSError, ValueError, TypeError, KeyError):
        return {}
    return files if isinstance(files, dict) else {}


def _state(file: Path) -> list[int]:
    """Return size and time of change of a file; a changed file has another."""
    state = file.lstat()
    return [state.st_size, state.st_mtime_ns]


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _move_in(fresh: Path, folder: Path) -> None:
    """Move the files in `fresh` into `folder`, and remove those of the last time."""
    new = _files_in(fresh)
    for name in new:
        if (folder / name).is_dir():
            raise OutputError(f"{folder / name} is a folder in the way of a file")
    old = _written_files(folder)
    states = {name: _state(fresh / name) for name in new}
    # A file of the last time that was changed since is the user's.
    gone = [name for name in old if name not in states and _is_unchanged(folder / name, old[name])]
    kept = {name: state for name, state in old.items() if name not in gone}
    (fresh / _LIST).write_text(json.dumps({"files": kept | states}) + "\n", "utf-8")
    if not folder.exists():
        fresh.rename(folder)
        return
    for name in [*new, _LIST]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (fresh / name).replace(folder / name)
    for name in gone:
        (folder / name).unlink()
        if (folder / name).parent != folder:
            _remove_if_empty((folder / name).parent)


def _is_unchanged(file: Path, state: list[int]) -> bool:
    return file.exists() and _state(file) == state


def write_whole(path: Path, text: str) -> None:
    """Write a text file in one go: a reader sees the old one or the new one."""
    part = path.with_name(f".{path.name}.part")
    with output_errors(path):
        try:
            part.write_text(text, "utf-8")
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink()


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON; NaN and infinite numbers are refused with `ValueError`."""
    text = json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False)
    path.write_text(text + "\n", "utf-8")
