"""The states of a session before each of the user's changes, so that changes can be undone."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, fields
from typing import Any

from asperity.errors import AsperityError
from asperity.realtime.servo.parameters import LiveParameters
from asperity.viewer.session_config import SessionConfig

_MOST = 50
_TOGETHER = 1.5
"""A slider's movements less apart than this are one change [s]."""


@dataclass(frozen=True, eq=False)
class State:
    """What a session ran with before a change.

    Parameters
    ----------
    before : str
        Name of the change.
    config : SessionConfig
    parameters : LiveParameters
        As the loop had them.
    """

    before: str
    config: SessionConfig
    parameters: LiveParameters


class ChangeHistory:
    """The last states, at most 50."""

    def __init__(self) -> None:
        self._states: deque[State] = deque(maxlen=_MOST)
        self._last = "", -_TOGETHER

    def __len__(self) -> int:
        return len(self._states)

    def note(self, state: State, now: float | None = None) -> None:
        """Add the state before a change.

        Parameters
        ----------
        state : State
        now : float, optional
            Time of a change that may continue the last one of the same name [s].
        """
        what, when = self._last
        goes_on = now is not None and what == state.before and now - when < _TOGETHER
        self._last = ("", 0.0) if now is None else (state.before, now)
        if not goes_on:
            self._states.append(state)

    def pop(self) -> State:
        """Remove and return the last state; AsperityError if there is none."""
        self._last = "", -_TOGETHER
        if not self._states:
            raise AsperityError("nothing has been changed, so there is nothing to undo")
        return self._states.pop()


def changed_parameters(old: LiveParameters, new: LiveParameters) -> dict[str, Any]:
    """Return the parameters that differ, by name, with their new values."""
    names = (field.name for field in fields(new))
    return {name: getattr(new, name) for name in names if getattr(new, name) != getattr(old, name)}
