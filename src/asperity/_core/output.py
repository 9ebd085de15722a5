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


@contextmanager
def result_folder(folder: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Give a fresh folder to write files into; they come to stand in `folder` when all went well.

    If the block raises or is interrupted, nothing new is left behind. With `overwrite`, files of
    the same names are replaced; whatever else stands in `folder` stays.

    Raises
    ------
    OutputError
        `folder` is no folder, holds something and `overwrite` is false, or cannot be written.
    """
    folder = Path(os.path.realpath(folder))
    with output_errors(folder), ExitStack() as undo:
        _refuse_taken(folder, overwrite)
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

    It is made if need be. Otherwise as `result_folder`.
    """
    folder = Path(os.path.realpath(folder))
    with output_errors(folder):
        _refuse_taken(folder, overwrite)
        folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Turn an `OSError` into an `OutputError`, one line that names `path`."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write to {path}: {error.strerror or error}") from None


def _refuse_taken(folder: Path, overwrite: bool) -> None:
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    if not nearest.is_dir():
        raise OutputError(
            f"cannot write to {folder}: {nearest} is a file; give a folder with --out"
        )
    if nearest == folder and any(folder.iterdir()) and not overwrite:
        raise OutputError(f"{folder} is not empty; give --overwrite, or another folder with --out")


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _move_in(fresh: Path, folder: Path) -> None:
    """Give `fresh` the name `folder`, or, where that stands already, move its files there."""
    if not folder.exists():
        fresh.rename(folder)
        return
    files = list(fresh.iterdir())
    for file in files:
        if (folder / file.name).is_dir():
            raise OutputError(f"{folder / file.name} is a folder in the way of a file")
    for file in files:
        file.replace(folder / file.name)


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
