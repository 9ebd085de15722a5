"""Results on disk: whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
    folder = Path(os.path.abspath(folder))
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder} is a file; give a folder with --out")
    if folder.is_dir() and any(folder.iterdir()) and not overwrite:
        raise OutputError(f"{folder} is not empty; give --overwrite, or another folder with --out")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
        fresh.chmod(0o755)
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {error.strerror or error}") from None
    try:
        yield fresh
        _move_in(fresh, folder)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _move_in(fresh: Path, folder: Path) -> None:
    """Give `fresh` the name `folder`, or, where that stands already, move its files there."""
    try:
        if not folder.exists():
            fresh.rename(folder)
            return
        files = list(fresh.iterdir())
        for file in files:
            if (folder / file.name).is_dir():
                raise OutputError(f"{folder / file.name} is a folder in the way of a file")
        for file in files:
            file.replace(folder / file.name)
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {error.strerror or error}") from None


def write_whole(path: Path, text: str) -> None:
    """Write a text file in one go: a reader sees the old one or the new one."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(text, "utf-8")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
