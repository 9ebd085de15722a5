"""Columns of poses in `.npy` and `.npz`: one array of all, or arrays that names tell apart."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.files import reading
from asperity._core.units import ANGLES, LENGTHS, TIMES, named_unit
from asperity.errors import AsperityError

_VALID = (
    "valid: times (n,) and poses (n, 7), (n, 3, 4) or (n, 4, 4); or times, positions (n, 3) and "
    "quaternions (n, 4)"
)
_ORDERS = ("xyzw", "wxyz")


def array_columns(path: Path) -> tuple[tuple[str, ...] | None, Array, tuple[str, ...]]:
    """Return the names of the columns, None without, the columns (n, k), and notes.

    Raises
    ------
    AsperityError
        A file that cannot be read, or whose arrays do not belong together; one line.
    """
    with reading(path, "poses", (".npy", ".npz")) as suffix, open(path, "rb") as stream:
        loaded: Any = np.load(stream, allow_pickle=False)
        if suffix == ".npz":
            found = {name: loaded[name] for name in loaded}
            if {"times", "poses"} <= {*found}:
                loaded = _times_and_poses(path, found["times"], found["poses"])
            elif len(found) == 1:
                (loaded,) = found.values()
            else:
                return _by_names(path, found)
        if loaded.dtype.names:
            return _by_names(path, {name: loaded[name] for name in loaded.dtype.names})
        return None, _numbers(path, loaded), ()


def _numbers(path: Path, values: NDArray[Any]) -> Array:
    if values.dtype.kind not in "uif":
        raise AsperityError(f"{path} holds {values.dtype} values; valid: real numbers")
    return np.array(values, dtype=np.float64)


def _times_and_poses(path: Path, times: NDArray[Any], poses: NDArray[Any]) -> NDArray[Any]:
    flat = poses.reshape(len(poses), -1) if poses.ndim == 3 else poses
    if times.ndim != 1 or flat.shape not in [(len(times), k) for k in (7, 12, 16)]:
        raise AsperityError(f"{path} has times {times.shape} and poses {poses.shape}; {_VALID}")
    return np.column_stack([times, flat])


def _by_names(
    path: Path, arrays: Mapping[str, NDArray[Any]]
) -> tuple[tuple[str, ...], Array, tuple[str, ...]]:
    """Return the columns of arrays of one length, named as those of a text would be."""
    lengths = [len(values) for values in arrays.values() if values.ndim]
    count = max(lengths, key=lengths.count, default=0)
    names: list[str] = []
    columns: list[Array] = []
    notes: list[str] = []
    for name, values in arrays.items():
        if values.ndim and len(values) == count > 0 and values.dtype.kind in "uif":
            own = [*names_of(name, values.shape[1:], notes)]
            names += own
            columns += [*_numbers(path, values).reshape(count, -1).T] if own else []
    if not columns:
        shown = ", ".join(f"{name} {values.shape}" for name, values in arrays.items())
        raise AsperityError(f"{path} holds {shown[:100]}; {_VALID}")
    return tuple(names), np.stack(columns, axis=1), tuple(notes)


def names_of(name: str, shape: tuple[int, ...], notes: list[str]) -> Iterator[str]:
    """Yield the names of an array's columns; none for a shape that is of no pose."""
    unit = next(filter(None, (named_unit(name, u) for u in (LENGTHS, ANGLES, TIMES))), None)
    word = unit[0] if unit else ""
    bare = name.removesuffix(word).rstrip("_ ") if word else name
    stated = re.search("|".join(_ORDERS), bare, re.IGNORECASE)
    if stated:
        bare = (bare[: stated.start()] + bare[stated.end() :]).strip("_ ") or "q"
    bare = re.sub(r"(?<=[a-z]{3})s$", "", bare)  # of several: positions
    behind = f"_{word}" if word else ""
    if shape in ((), (1,)):
        yield name
    elif shape == (3,):
        yield from (f"{bare}_{axis}{behind}" for axis in "xyz")
    elif shape in ((4,), (7,)):
        order = stated.group().lower() if stated else "wxyz"
        if not stated:
            notes.append(
                f"no name states the order of {name!r}: its quaternion is taken as qw, qx, qy, qz; "
                f"the name {name}_xyzw, or order=, changes that"
            )
        if shape == (7,):
            yield from (f"{axis}{behind}" for axis in "xyz")
        yield from (f"q{axis}" for axis in order)
    elif shape == (16,):  # by rows or by columns: its 0 0 0 1 shows that
        yield from (f"{bare}[{k}]" for k in range(16))
    elif shape in ((3, 3), (3, 4), (4, 4)):
        yield from (f"t{i}{j}" for i in range(shape[0]) for j in range(shape[1]))
