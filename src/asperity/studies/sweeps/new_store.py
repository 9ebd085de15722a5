"""The empty store of a sweep, its blocks, and what of a finished store another study has.

Combinations are numbered in C order, the last axis fastest. A block is cut along one axis; it has
one place of each axis before that one and all places of those after it. So the numbers of its
combinations are consecutive, and it is one chunk of every array, written at once.
"""

from __future__ import annotations

import itertools
import json
import math
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.studies.sweeps.batch import WAITING, program
from asperity.studies.sweeps.study import SweepStudy

if TYPE_CHECKING:
    import xarray as xr


SCHEMA = 1
"""Version of the store's layout, its attribute `asperity_sweep`."""
MORE = "more"
"""Group of the numbers that are stored, but not named under `keep`."""


def create_store(
    path: Path, study: SweepStudy, block_size: int, fill: Callable[[Path], None] = lambda _: None
) -> None:
    """Create the store of a study at `path`, in place of an existing one.

    It is empty but for what `fill` writes into it before it gets its name.
    """
    fresh = Path(tempfile.mkdtemp(prefix=".asperity-", dir=path.parent))
    try:
        fresh.chmod(0o755)
        _create_arrays(fresh, study, block_size)
        fill(fresh)
        if path.exists():
            old = fresh.with_name(fresh.name + "-old")
            path.rename(old)
            fresh.rename(path)
            shutil.rmtree(old)
        else:
            fresh.rename(path)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _create_arrays(path: Path, study: SweepStudy, block_size: int) -> None:
    """Write the attributes and coordinates of a study, and the metadata of its arrays."""
    import xarray as xr
    import zarr
    from zarr.codecs import ZstdCodec

    design = study.design
    attributes = {
        "asperity_sweep": SCHEMA,
        "title": study.title,
        "kind": study.kind,
        "keep": list(study.keep),
        "design": design.kind,
        "study": study.text,
        "files": json.dumps(dict(study.files)),
        "fingerprint": study.fingerprint,
        "basis": study.basis,
        "program": program(),
        "sessions": "[]",
    }
    coordinates = {
        key: (axis.name, column(values), study.attributes(key))
        for axis in design.axes
        for key, values in ({axis.name: list(range(axis.size))} | axis.columns).items()
    }
    dataset = xr.Dataset(coords=coordinates, attrs=attributes)
    chunks = block_shape(design.shape, block_size)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # texts are not part of Zarr 3 yet
        dataset.to_zarr(path, mode="w", zarr_format=3, consolidated=False)
        group = zarr.open_group(str(path), mode="r+")

        def create_array(name: str, dtype: Any, empty: Any, attributes: dict[str, Any]) -> None:
            group.create_array(
                name, shape=design.shape, chunks=chunks, dtype=dtype, fill_value=empty,
                compressors=[ZstdCodec(level=1, checksum=True)],
                dimension_names=[axis.name for axis in design.axes], attributes=attributes,
            )  # fmt: skip

        for name in study.keep:
            create_array(name, "f8", np.nan, study.attributes(name))
        for name in study.more:
            create_array(f"{MORE}/{name}", "f8", np.nan, study.attributes(name))
        states = {"long_name": "0 waiting, 1 done, 2 failed", "units": "1"}
        create_array("state", "i1", WAITING, states)
        create_array("error", str, "", {"long_name": "why a combination failed"})
    consolidate(group)


def column(values: list[Any]) -> NDArray[Any]:
    """Return the values of a coordinate: numbers as they are, all others as texts."""
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        return np.array(values)
    return np.array([_label(value) for value in values], dtype=object)


def _label(value: Any) -> str:
    """Return a value of TOML as text: `true`, and lists without brackets."""
    if isinstance(value, list | tuple):
        return ", ".join(map(_label, value))
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else f"{value:g}"


def consolidate(group: Any) -> None:
    """Gather the metadata of all arrays in one file, from which readers open the store faster."""
    import zarr

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # consolidated metadata are not part of Zarr 3 yet
        zarr.consolidate_metadata(group.store)


class SweepBlock(NamedTuple):
    """One chunk of every array."""

    slices: tuple[slice, ...]
    """Its places on each axis."""
    first: int
    """Number of its first combination."""
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """How many combinations it has."""
        return math.prod(self.shape)

    @property
    def places(self) -> slice:
        """The numbers of its combinations."""
        return slice(self.first, self.first + self.size)


def block_shape(shape: tuple[int, ...], most: int) -> tuple[int, ...]:
    """Return the shape of blocks of at most `most` combinations, and at least one."""
    out, room = [1] * len(shape), max(most, 1)
    for i in reversed(range(len(shape))):
        if shape[i] > room:
            out[i] = math.ceil(shape[i] / math.ceil(shape[i] / room))
            break
        out[i] = shape[i]
        room //= shape[i]
    return tuple(out)


def blocks(shape: tuple[int, ...], chunk: tuple[int, ...]) -> Iterator[SweepBlock]:
    """Yield the blocks of arrays of a shape, in the order of their combinations."""
    first = 0
    for starts in itertools.product(
        *(range(0, n, size) for n, size in zip(shape, chunk, strict=True))
    ):
        slices = tuple(
            slice(start, min(start + size, n))
            for start, size, n in zip(starts, chunk, shape, strict=True)
        )
        block = SweepBlock(slices, first, tuple(s.stop - s.start for s in slices))
        yield block
        first += block.size


def places_in(data: xr.Dataset, study: SweepStudy) -> list[NDArray[np.int64]]:
    """Return for each axis of a study where its places are in older results; -1: not there.

    Raises
    ------
    AsperityError
        The older results are of another study than one with other values.
    """
    attributes: Mapping[str, Any] = data.attrs
    older = json.loads(attributes["files"])
    names = [axis.name for axis in study.design.axes]
    problem = ""
    if attributes.get("basis") != study.basis:
        problem = "its kind, fixed parameters, function or seed are others"
    elif set(data.sizes) != set(names):
        problem = f"it has the axes {', '.join(map(str, data.sizes))}, not {', '.join(names)}"
    elif any(older.get(name, digest) != digest for name, digest in study.files.items()):
        problem = "files that it names have changed"
    elif any(name not in data for name in study.keep):
        problem = "it lacks numbers that are to be kept now"
    if problem:
        raise AsperityError(f"the store cannot be extended to this study: {problem}")
    found = []
    for axis in study.design.axes:
        now = {key: column(values).tolist() for key, values in axis.columns.items()}
        rows = zip(*(data[key].values.tolist() for key in now), strict=True)
        known = {row: i for i, row in enumerate(rows)}
        wanted = zip(*now.values(), strict=True)
        found.append(np.array([known.get(row, -1) for row in wanted], dtype=np.int64))
    return found
