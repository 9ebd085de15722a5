"""Taking over from a finished store what another study, with more or other values, has of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.studies.sweeps.new_store import column
from asperity.studies.sweeps.study import SweepStudy

if TYPE_CHECKING:
    import xarray as xr


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
