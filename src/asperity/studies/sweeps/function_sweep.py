"""`asperity.sweep`: a function of the user's over a grid of its arguments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.errors import AsperityError
from asperity.studies.sweeps import function_runs
from asperity.studies.sweeps.design import MOST, Axis, SweepDesign
from asperity.studies.sweeps.run import run_sweep
from asperity.studies.sweeps.store import open_sweep
from asperity.studies.sweeps.study import SweepStudy

if TYPE_CHECKING:
    import xarray as xr


def sweep(
    function: Callable[..., Any],
    axes: Mapping[str | tuple[str, ...], Iterable[Any]],
    store: str | Path,
    **options: Any,
) -> xr.Dataset:
    """Call a function for every combination of its arguments, and keep its numbers in a store.

    What is in the store already is not computed again: a sweep that was stopped goes on.

    Parameters
    ----------
    function : callable
        Called with each combination as keyword arguments; returns a number, or a mapping of names
        to numbers. It must depend on its arguments alone. What it raises is kept as the reason of a
        failed combination. The first combination is called once here, to learn the names.
    axes : mapping
        Argument -> its values: numbers or texts. A tuple of arguments -> rows of values goes along
        together, as one axis called by the names joined with `_`:
        ``{("m", "k", "b"): [(0.1, 300, 2), (0.2, 400, 3)], "seed": range(10)}``.
    store : path
        The Zarr store, which is created or resumed.
    **options
        Those of `run_sweep`: `workers`, `scheduler`, `client`, `limit`, `extend`, `overwrite`,
        `retry_failed`, `any_version`, `progress`.

    Returns
    -------
    xarray.Dataset
        As of `open_sweep`.

    Raises
    ------
    AsperityError
        Axes that are not valid; as `run_sweep`.
    """
    design = SweepDesign("grid", 0, tuple(_axis(names, values) for names, values in axes.items()))
    if not design.axes:
        raise AsperityError("axes is empty: give at least one argument with its values")
    if design.size > MOST:
        raise AsperityError(f"the sweep has {design.size} combinations; valid: {MOST} at most")
    first = {key: column[0] for key, column in design.columns([0]).items()}
    try:
        keep = tuple(function_runs.outputs(function(**first)))
    except AsperityError:
        raise
    except Exception as error:
        raise AsperityError(
            f"the function raised {type(error).__name__} at its first combination {first}: {error}"
        ) from error
    fixed = function_runs.described(function)
    text = f"# {fixed['function']} over {', '.join(axis.name for axis in design.axes)}\n"
    study = SweepStudy(
        fixed["function"], "function", keep, fixed, design, Path.cwd(), text, {},
        {"pickle": function_runs.packed(function)},
    )  # fmt: skip
    run_sweep(study, store, **options)
    return open_sweep(store)


def _axis(names: str | tuple[str, ...], values: Iterable[Any]) -> Axis:
    keys = (names,) if isinstance(names, str) else tuple(names)
    rows = [(value,) if isinstance(names, str) else tuple(value) for value in values]
    label = "_".join(keys)
    if not rows or any(len(row) != len(keys) for row in rows):
        raise AsperityError(f"axes[{names!r}] needs at least one row of {len(keys)} values")
    plain = [tuple(v.item() if isinstance(v, np.generic) else v for v in row) for row in rows]
    for value in (value for row in plain for value in row):
        if not isinstance(value, bool | int | float | str):
            raise AsperityError(f"axes[{names!r}] must hold numbers or texts, got {value!r:.80}")
    if len(set(plain)) != len(plain):
        raise AsperityError(f"axes[{names!r}] has a value twice")
    return Axis(label, {key: [row[i] for row in plain] for i, key in enumerate(keys)})
