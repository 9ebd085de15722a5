"""Disk cache of convex pieces, keyed by mesh, settings and version of CoACD."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core import kernels

Array = NDArray[np.float64]


def cache_file(
    points: Array,
    faces: NDArray[np.int64],
    settings: dict[str, Any],
    folder: str | os.PathLike[str] | None,
) -> Path:
    """Return the cache file of a mesh, named by a hash of all inputs."""
    try:
        tool = version("coacd")
    except ImportError:
        tool = "none"
    digest = hashlib.sha256(f"{tool} {sorted(settings.items())}".encode())
    digest.update(points.tobytes())
    digest.update(faces.tobytes())
    # Beside the compiled kernels' folders, which are named by sources: pieces outlive edits.
    root = kernels.cache_folder().parent / "convex-pieces" if folder is None else Path(folder)
    return root / f"{digest.hexdigest()[:32]}.npz"


def read_pieces(file: Path) -> list[Array] | None:
    """Return the pieces in a file; None if it is missing or damaged."""
    try:
        with np.load(file, allow_pickle=False) as archive:
            pieces = [archive[f"arr_{k}"] for k in range(len(archive.files))]
    except Exception:  # any exception on a damaged file: the pieces are computed again
        return None
    good = [p.ndim == 2 and p.shape[1] == 3 and p.dtype == float for p in pieces]
    return pieces if pieces and all(good) and np.isfinite(np.concatenate(pieces)).all() else None


def write_pieces(file: Path, pieces: list[Array]) -> None:
    """Write pieces atomically, so that no other process reads a partial file."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=file.parent, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as stream:
                np.savez(stream, *pieces)
            os.replace(temporary, file)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        logging.getLogger(__name__).warning("convex pieces are not kept: %s", error)
