"""Creating the empty store of a sweep: attributes, coordinates, and arrays without chunks."""

from __future__ import annotations

import json
import shutil
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.studies.sweeps.batch import WAITING, program
from asperity.studies.sweeps.blocks import block_shape
from asperity.studies.sweeps.study import SweepStudy

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
