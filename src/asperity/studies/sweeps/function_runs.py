"""Combinations of kind "function": each is one call of a function of the user's."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.errors import AsperityError
from asperity.studies.sweeps.design import MOST, Axis, SweepDesign
from asperity.studies.sweeps.run import run_sweep
from asperity.studies.sweeps.store import open_sweep
from asperity.studies.sweeps.study import Runner, SweepStudy, hash_content

if TYPE_CHECKING:
    import xarray as xr


def described(function: Callable[..., Any]) -> dict[str, str]:
    """Return what a store keeps of a function: its name, and a hash of its source."""
    try:
        source = inspect.getsource(function)
    except (OSError, TypeError):  # of an interactive session, or a callable object
        code = getattr(function, "__code__", None)
        source = repr((code.co_code.hex(), code.co_consts)) if code else repr(type(function))
    return {
        "function": getattr(function, "__qualname__", type(function).__qualname__),
        "source": hash_content(source)[:16],
    }


def packed(function: Callable[..., Any]) -> bytes:
    """Return a function as bytes, also one that is defined in a script or a notebook."""
    import cloudpickle  # type: ignore[import-untyped,unused-ignore]

    try:
        return bytes(cloudpickle.dumps(function))
    except Exception as error:  # of any object that it refers to
        raise AsperityError(
            f"{described(function)['function']} cannot be sent to workers: {error}; "
            "give a function that refers to no open files, locks or the like"
        ) from None


def outputs(result: Any) -> dict[str, float]:
    """Return what a function returned as numbers by name; one number is called `value`."""
    table = dict(result) if isinstance(result, Mapping) else {"value": result}
    try:
        return {str(name): float(value) for name, value in table.items()}
    except (TypeError, ValueError):
        raise AsperityError(
            f"the function must return a number, or numbers by name, got {result!r:.80}"
        ) from None


@dataclass
class FunctionRuns(Runner):
    """Calls the function."""

    BATCH = (1, 256)
    """Nothing is known of how long a call takes."""
    _function: Callable[..., Any] | None = field(default=None, init=False)

    @staticmethod
    def checked(values: Mapping[str, Any], where: str, folder: Path) -> dict[str, Any]:
        """Refuse: a study of a function has no TOML file."""
        raise AsperityError(
            'kind = "function" is for asperity.sweep(function, axes) in Python only'
        )

    def numbers(
        self, varied: Mapping[str, Any], keep: Sequence[str], more: Sequence[str] = ()
    ) -> list[float]:
        """Call the function once and return its numbers `keep`; there are no others."""
        if self._function is None:
            self._function = pickle.loads(self.fixed["pickle"])
        found = outputs(self._function(**varied))
        missing = [name for name in keep if name not in found]
        if missing:
            raise AsperityError(f"the function returned no {missing[0]}")
        return [found[name] for name in keep]


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
        keep = tuple(outputs(function(**first)))
    except AsperityError:
        raise
    except Exception as error:
        raise AsperityError(
            f"the function raised {type(error).__name__} at its first combination {first}: {error}"
        ) from error
    fixed = described(function)
    text = f"# {fixed['function']} over {', '.join(axis.name for axis in design.axes)}\n"
    study = SweepStudy(
        fixed["function"], "function", keep, fixed, design, Path.cwd(), text, {},
        {"pickle": packed(function)},
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
