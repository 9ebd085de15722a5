"""Choose the figures of a sweep from the parameters it varies and the options given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_choice
from asperity.studies.sweeps.batch import DONE

VIEWS = ("curve", "map", "effects")
_CURVE = 4
"""Least number of values of a parameter that is an axis of a figure."""
_COLOURS = 6
"""Largest number of levels that colours and markers can show."""


@dataclass(frozen=True)
class SweepView:
    """One figure: a metric, and the parameters on its axes."""

    kind: str
    metric: str
    x: str = ""
    y: str = ""
    colour: str = ""


def parameter_names(data: xr.Dataset) -> list[str]:
    """Return the parameters that vary: all coordinates except the numbers of samples and rows."""
    along = [(str(name), data[name].dims[0]) for name in data.coords if data[name].ndim == 1]
    numbers = {axis for name, axis in along if name != axis}
    return [name for name, _ in along if name not in numbers]


def is_number(data: xr.Dataset, name: str) -> bool:
    """Return whether a parameter's values are numbers."""
    return bool(data[name].dtype.kind in "fiu")


def choose_views(
    data: xr.Dataset,
    *,
    view: str | None = None,
    metrics: Sequence[str] = (),
    x: str | None = None,
    y: str | None = None,
    colour: str | None = None,
) -> list[SweepView]:
    """Return the views to draw.

    By default, for each metric: its curve over the axis with most values, preferably the spacing;
    its map over the two axes with most values; effects, if several parameters vary.

    Parameters
    ----------
    data : xarray.Dataset
        As `open_sweep` returns it.
    view : {"curve", "map", "effects"}, optional
    metrics : sequence of str
        Default: the first that was kept.
    x, y, colour : str, optional
        Parameters.
    """
    names = parameter_names(data)
    if view is not None:
        require_choice("view", view, VIEWS)
    for metric in metrics:
        require_choice("metric", metric, data.attrs["keep"])
    options = {"x": x, "y": y, "colour": colour}
    for option, name in options.items():
        if name is not None:
            require_choice(f"parameter for {option}", name, names)
    numeric = [name for name in names if is_number(data, name)]
    axes = [n for n in numeric if data[n].dims == (n,) and data.sizes[n] >= _CURVE]
    axes.sort(key=lambda n: (n != "spacing", -data.sizes[n]))
    for option in ("x", "y"):
        name = options[option]
        if name is not None and name not in numeric:
            raise AsperityError(f"{option} must be a parameter with numbers, got {name!r}")
    across = x or (axes[0] if axes else None)
    up = y or next((n for n in axes if n != across), None)
    few = [n for n in names if data[n].dims == (n,) and 1 < data.sizes[n] <= _COLOURS]
    most = max((n for n in few if n != across), key=lambda n: data.sizes[n], default="")
    found = []
    for metric in metrics or data.attrs["keep"][:1]:
        if view == "curve" or (view is None and across is not None):
            found.append(SweepView("curve", metric, _given("x", across), colour=colour or most))
        if view == "map" or (view is None and across and up and colour is None):
            found.append(SweepView("map", metric, _given("x", across), _given("y", up)))
        if view == "effects" or (view is None and len(names) > 1 and not (x or y or colour)):
            found.append(SweepView("effects", metric))
    if not found:
        found = [SweepView("effects", metric) for metric in metrics or data.attrs["keep"][:1]]
    return found


def _given(option: str, name: str | None) -> str:
    if name is None:
        raise AsperityError(
            f"no parameter has {_CURVE} values or more for {option}; name one with --{option}"
        )
    return name


def completed_table(
    data: xr.Dataset, metric: str
) -> tuple[dict[str, NDArray[np.generic]], NDArray[np.float64]]:
    """Return the values of parameters and metric, a row for each combination that is done."""
    whole = data[metric]
    done = data["state"].values == DONE
    columns = {
        name: data[name].broadcast_like(whole).transpose(*whole.dims).values[done]
        for name in parameter_names(data)
    }
    return columns, whole.values[done].astype(np.float64)
