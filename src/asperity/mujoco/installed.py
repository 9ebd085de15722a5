"""Temporary replacement of functions of the module `mujoco` by ones with textures.

MuJoCo's passive callback is set only during a call for a textured model: with a Python callback
set, MuJoCo cannot compile models.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator
from typing import Any

import mujoco

STEPS = ("mj_step", "mj_step1", "mj_forward", "mj_forwardSkip", "mj_inverse", "mj_inverseSkip")
"""Functions that find contacts. (`mj_step2` continues with those of `mj_step1`.)"""
Passive = Callable[[mujoco.MjModel, mujoco.MjData], None]

_active: list[tuple[mujoco.MjModel, Passive]] = []
_originals: dict[str, Callable[..., Any]] = {}


class _Hook:
    """The passive callback for one model with textures."""

    __slots__ = ("_before", "_model", "_passive", "errors")

    def __init__(self, model: mujoco.MjModel, passive: Passive, before: Any) -> None:
        self._model, self._passive, self._before = model, passive, before
        self.errors: list[Exception] = []

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Call `passive` for the model, then the previous callback."""
        if model is self._model and not self.errors:
            try:
                self._passive(model, data)
            except Exception as error:
                self.errors.append(error)
        if self._before is not None:
            self._before(model, data)


@contextlib.contextmanager
def callback(model: mujoco.MjModel, passive: Passive) -> Iterator[None]:
    """Set MuJoCo's passive callback to `passive` for `model`, followed by the previous callback.

    Exceptions of `passive` are raised at the end: in some versions of MuJoCo they would end the
    process.
    """
    before = mujoco.get_mjcb_passive()
    hook = _Hook(model, passive, before)
    mujoco.set_mjcb_passive(hook)
    try:
        yield
    finally:
        mujoco.set_mjcb_passive(before)
    if hook.errors:
        raise hook.errors[0]


def call(
    model: mujoco.MjModel, passive: Passive, function: Callable[..., Any], *args: Any, **named: Any
) -> Any:
    """Call a function of MuJoCo's within `callback`; return its result.

    (The generator of `callback` would take longer than the rest.)
    """
    before = mujoco.get_mjcb_passive()
    hook = _Hook(model, passive, before)
    mujoco.set_mjcb_passive(hook)
    try:
        out = function(*args, **named)
    finally:
        mujoco.set_mjcb_passive(before)
    if hook.errors:
        raise hook.errors[0]
    return out


@contextlib.contextmanager
def replaced_functions(model: mujoco.MjModel, passive: Passive) -> Iterator[None]:
    """Replace the functions of `mujoco` by ones that call `passive` for `model`; may be nested."""
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
    """Return MuJoCo's original function of a name."""
    return _originals.get(name) or getattr(mujoco, name)


def _with_textures(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function with the textures of the model in its arguments."""

    @functools.wraps(function)
    def wrapped(*args: Any, **named: Any) -> Any:
        model = named["m"] if "m" in named else args[0] if args else None
        for known, passive in reversed(_active):
            if known is model:
                return call(known, passive, function, *args, **named)
        return function(*args, **named)

    return wrapped
