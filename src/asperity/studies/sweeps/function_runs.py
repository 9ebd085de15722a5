"""Combinations of kind "function": each is one call of a function of the user's."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.studies.sweeps.study import Runner, hash_content


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
