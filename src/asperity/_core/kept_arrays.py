"""Arrays that take long to compute, kept in the user's cache folder."""

from __future__ import annotations

import logging
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core import kernels


def kept_folder(kind: str) -> Path:
    """Return the folder of one kind of arrays, as `convex-pieces`.

    It lies beside the compiled kernels' folders, which are named by sources: it outlives edits.
    """
    return kernels.cache_folder().parent / kind


def read_arrays(file: Path) -> dict[str, Any] | None:
    """Return the arrays in a file by name; None if it is missing or damaged, or one is of objects.

    Whether they have the shapes that are expected is to be checked.
    """
    try:
        with np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except Exception:  # any exception on a damaged file: the arrays are computed again
        return None


def write_arrays(file: Path, arrays: dict[str, Any], what: str) -> None:
    """Write arrays atomically, so that no other process reads a partial file.

    If that is not possible they are not kept, with a warning that names `what` they are.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=file.parent, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as stream:
                np.savez(stream, **arrays)
            os.replace(temporary, file)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        logging.getLogger(__name__).warning("%s are not kept: %s", what, error)
