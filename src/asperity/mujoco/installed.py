"""Functions of the module `mujoco` that feel the textures of some models, while they are installed.

MuJoCo's passive callback is set while a function works on such a model, and only then: with a
callback of Python's set, MuJoCo compiles no model.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator
from typing import Any

import mujoco

STEPS = ("mj_step", "mj_step1", "mj_forward", "mj_forwardSkip", "mj_inverse", "mj_inverseSkip")
"""Functions that find contacts. (`mj_step2` goes on from what `mj_step1` has found.)"""
Passive = Callable[[mujoco.MjModel, mujoco.MjData], None]

_active: list[tuple[mujoco.MjModel, Passive]] = []
_originals: dict[str, Callable[..., Any]] = {}


@contextlib.contextmanager
def callback(model: mujoco.MjModel, passive: Passive) -> Iterator[None]:
    """Let MuJoCo call `passive` for `model`, and after it what it has called before.

    What `passive` raises is raised at the end: some versions of MuJoCo end the process otherwise.
    """
    before = mujoco.get_mjcb_passive()
    errors: list[Exception] = []

    def both(called: mujoco.MjModel, data: mujoco.MjData) -> None:
        if called is model and not errors:
            try:
                passive(called, data)
            except Exception as error:
                errors.append(error)
        if before is not None:
            before(called, data)

    mujoco.set_mjcb_passive(both)
    try:
        yield
    finally:
        mujoco.set_mjcb_passive(before)
    if errors:
        raise errors[0]


@contextlib.contextmanager
def replaced_functions(model: mujoco.MjModel, passive: Passive) -> Iterator[None]:
    """Replace the functions of `mujoco` by such as call `passive` for `model`; may be nested."""
    entry = (model, passive)
    if not _active:
        for name in STEPS:
            original = _originals[name] = getattr(mujoco, name)
            setattr(mujoco, name, _with_textures(original))
    _active.append(entry)
    try:
        yield
    finally:
        _active.remove(entry)
        if not _active:
            for name, original in _originals.items():
                setattr(mujoco, name, original)
            _originals.clear()


def original(name: str) -> Callable[..., Any]:
    """Return MuJoCo's own function of a name, whether it is replaced or not."""
    return _originals.get(name) or getattr(mujoco, name)


def _with_textures(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that calls another one, with the textures of its model."""

    @functools.wraps(function)
    def wrapped(*args: Any, **named: Any) -> Any:
        model = named["m"] if "m" in named else args[0] if args else None
        for known, passive in reversed(_active):
            if known is model:
                with callback(known, passive):
                    return function(*args, **named)
        return function(*args, **named)

    return wrapped
