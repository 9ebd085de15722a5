"""Trajectories of the handle from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.files import reading
from asperity.errors import AsperityError
from asperity.scene.trajectory import Trajectory


def read_poses(path: str | Path) -> Trajectory:
    """Return a trajectory from a CSV, `.npy` or `.npz` file.

    CSV: columns time [s], x, y, z [m], qw, qx, qy, qz, separated by commas, semicolons, tabs or
    spaces, with an optional header line; lines that start with # are skipped. `.npy`: an array
    (n, 8) of the same columns. `.npz`: arrays `times` (n,) and `poses` (n, 7).

    Raises
    ------
    AsperityError
        The file does not exist, cannot be read, or holds invalid poses or times.
    """
    path = Path(path)
    if not path.exists():
        raise AsperityError(f"no such file of poses: {path}")
    if path.is_dir():
        raise AsperityError(f"{path} is a folder; give a file of poses (.csv, .npy, .npz)")
    if path.suffix.lower() in (".npy", ".npz"):
        table = _read_arrays(path)
        origins: tuple[str, ...] = ()
    else:
        table, origins = _read_csv(path)
    return Trajectory(table[:, 0], table[:, 1:], path.name, origins)


def _read_arrays(path: Path) -> Array:
    with reading(path, "poses", (".npy", ".npz")) as suffix, open(path, "rb") as stream:
        loaded = np.load(stream, allow_pickle=False)
        if suffix == ".npz":
            if not {"times", "poses"} <= set(loaded):
                raise AsperityError(f"{path} needs the arrays times (n,) and poses (n, 7)")
            loaded = np.column_stack([loaded["times"], loaded["poses"]])
        table = np.asarray(loaded, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 8 or len(table) == 0:
        raise AsperityError(
            f"{path} has shape {table.shape}; valid: (n, 8), columns time, x, y, z, qw, qx, qy, qz"
        )
    return table


def _read_csv(path: Path) -> tuple[Array, tuple[str, ...]]:
    try:
        lines = path.read_text("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise AsperityError(f"{path} is not text; valid: .csv, .npy or .npz of poses") from None
    rows: list[list[float]] = []
    origins: list[str] = []
    for number, line in enumerate(lines, start=1):
        words = line.replace(",", " ").replace(";", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            if not rows and not any(_is_number(word) for word in words):
                continue  # the header
            raise AsperityError(f"{path}, line {number}: not numbers: {line.strip()!r}") from None
        if len(values) != 8:
            raise AsperityError(
                f"{path}, line {number}: {len(values)} numbers; valid: 8 "
                "(time, x, y, z, qw, qx, qy, qz)"
            )
        rows.append(values)
        origins.append(f"line {number}")
    if not rows:
        raise AsperityError(f"{path} has no poses; each line needs time, x, y, z, qw, qx, qy, qz")
    return np.array(rows), tuple(origins)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
