"""Haply Inverse3 through Haply's Inverse service (WebSocket, JSON).

The service answers each message with one frame of state and says nothing unasked. So `write` sends
the force of this tick, and `read` takes whatever frames have come since: the pose of a tick is the
answer to the force of the tick before. Neither waits (`haply_link`).

- *One frame a message* would pile up messages before a slow service, each a force of the past. At
  most `_MOST_UNANSWERED` are under way; while so many are, no other is sent, except that a force
  of zero after one that was not always goes out.
- *When writes stop*, the service is asked nothing. Its commands are documented as non-persistent:
  it then idles and the device's force ends. After how long is not documented.
- *A frame that repeats* a position bit for bit, and tells of a velocity that would have led 2 mm
  away by now, is a frozen one: it does not count as new, and `age` grows. A frozen frame without
  velocity cannot be told from a hand that holds still.
- *A lost connection* is made anew in the background with a growing pause; `read` says so once and
  `age` grows meanwhile.

Never tried on hardware: it is tested against `haply_fake`, written from the same documentation.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from asperity.devices.haply_link import Link
from asperity.devices.haply_messages import (
    GRIPS,
    SPELLINGS,
    State,
    device_ids,
    first_part,
    force_message,
    read_state,
)
from asperity.devices.orientation import TurnRate
from asperity.devices.presets import PRESETS
from asperity.devices.protocol import Limits, Reading
from asperity.devices.wrenches import REFUSED, ZERO, taken
from asperity.errors import AsperityError, require_choice

URI = "ws://localhost:10001"
_MOST_UNANSWERED = 3
_SILENCE = 0.25
"""Unanswered for so long [s], messages count as lost, and the connection as dead after 4 times."""
_FROZEN_TRAVEL = 2e-3
_STALE = 0.05
_OPENING = 3.0


class HaplyServiceDevice:
    """An Inverse3, with a VerseGrip or without, behind the Inverse service.

    Parameters
    ----------
    uri : str
        Of the service.
    device_id : str, optional
        Which Inverse3. Default: the first listed.
    spelling : str
        `vector` (service 3.5) or `values` (3.1).
    grip : str
        Which VerseGrip gives orientation and buttons: `auto` (wireless before wired), `wireless`,
        `wired`, `none`. Without one the orientation stays that of the base.
    profile : str
        Name of this program that the service is told. Empty: none.
    limits : Limits
        What is known of the device.
    clock : callable
        Monotonic time [s].
    """

    name = "haply"

    def __init__(
        self,
        *,
        uri: str = URI,
        device_id: str | None = None,
        spelling: str = "vector",
        grip: str = "auto",
        profile: str = "asperity",
        limits: Limits = PRESETS["inverse3"],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.limits = limits
        self._uri = uri
        self._wanted_id = device_id
        self._spelling = require_choice("spelling", spelling, SPELLINGS)
        self._grip = require_choice("grip", grip, GRIPS)
        self._first = first_part(profile, spelling) if profile else ""
        self._clock = clock
        self._link: Link | None = None
        self._rate = TurnRate()
        self._error = ""
        self._sent: tuple[float, ...] = ZERO
        self._device_id: str | None = None
        self._greeting = self._first
        self._state: State | None = None
        self._measured_at = self._moved_at = -math.inf
        self._asked_at = 0.0
        self._unanswered = self._openings = 0
        self._frozen = False

    def open(self) -> None:
        """Connect, and wait for the first frame that tells of the device."""
        if self._link is not None:
            return
        try:
            link = Link(self._uri, self._clock)
        except ImportError:
            raise AsperityError(
                "the Haply service needs websockets: pip install 'asperity[haply]'"
            ) from None
        reason = ""
        deadline = time.monotonic() + _OPENING
        while time.monotonic() < deadline:
            for text in link.poll():
                try:
                    state = read_state(text, self._wanted_id, self._grip)
                except ValueError as error:
                    reason = _with_ids(str(error), device_ids(text))
                    continue
                self._link, self._openings = link, link.openings
                self._take(state, self._clock())
                return
            link.wait(0.02)
        reason = reason or link.error or "nothing was said"
        link.close()
        raise AsperityError(
            f"no Inverse3 at {self._uri}: {reason}; start Haply Hub or the "
            "Inverse service, and see 'asperity devices'"
        )

    def read(self, out: Reading) -> bool:
        """Fill the newest frame's pose, twist and buttons; return whether there was a new one."""
        link = self._link
        if link is None:
            out.age, out.error = float("inf"), "the device is not open"
            return False
        try:
            new = self._collect(link)
        except Exception as error:  # a device's read does not raise, whatever comes
            new = False
            self._error = f"reading failed: {error!r}"
        self._fill(out)
        return new

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Send the force [N]; the device has no torque. Never waits or raises."""
        values = taken(wrench)
        if values is None:
            values, self._error = ZERO, REFUSED
        link = self._link
        if link is None or not link.is_open or self._device_id is None:
            return
        stopping = values[:3] == ZERO[:3] and self._sent[:3] != ZERO[:3]
        if self._unanswered >= _MOST_UNANSWERED and not stopping:
            return
        message = force_message(self._device_id, values, self._spelling, self._greeting)
        if link.send(message):
            if self._unanswered == 0:
                self._asked_at = self._clock()
            self._sent, self._greeting = values, ""
            self._unanswered += 1
        elif not stopping:
            self._error = "the service takes no messages"

    def close(self) -> None:
        """Send a force of zero, and disconnect."""
        link, self._link = self._link, None
        if link is None:
            return
        try:
            if link.is_open and self._device_id is not None:
                link.send(force_message(self._device_id, ZERO, self._spelling))
        finally:
            link.close()

    def _forget(self) -> None:
        """Forget all that belongs to one connection."""
        self._device_id, self._greeting = None, self._first
        self._sent, self._unanswered = ZERO, 0
        self._moved_at, self._frozen = -math.inf, False
        self._rate.forget()

    def _collect(self, link: Link) -> bool:
        """Take in the frames that came; return whether one of them told something new."""
        was_open = link.is_open
        texts = link.poll()
        now = self._clock()
        if link.openings != self._openings:
            self._openings = link.openings
            self._forget()
        if was_open and not link.is_open:
            self._error = f"lost the service: {link.error}"
        self._watch_silence(link, now, bool(texts))
        if not texts:
            return False
        self._unanswered = max(0, self._unanswered - len(texts))
        self._asked_at = now
        try:
            return self._take(read_state(texts[-1], self._wanted_id, self._grip), now)
        except ValueError as error:
            self._error = str(error)
            return False

    def _watch_silence(self, link: Link, now: float, heard: bool) -> None:
        """Count messages that nobody answers as lost, and then the connection."""
        if heard or not self._unanswered or not link.is_open:
            return
        silent = now - self._asked_at
        if silent > 4.0 * _SILENCE:
            link.drop("it went silent")
            self._error = "lost the service: it went silent"
        elif silent > _SILENCE and self._unanswered >= _MOST_UNANSWERED:
            self._unanswered = _MOST_UNANSWERED - 1  # asks once more
            self._error = "the service does not answer"

    def _take(self, state: State, now: float) -> bool:
        """Keep a frame's state; return whether it is news."""
        self._device_id = state.device_id
        last = self._state
        still = last is not None and state.position == last.position
        if not still:
            self._moved_at = now
        # By its own velocity it would have gone this far since.
        travel = math.hypot(*state.velocity) * (now - self._moved_at)
        frozen = still and travel > _FROZEN_TRAVEL
        if frozen:
            if not self._frozen:
                self._error = "the service repeats one frame"
            self._frozen = True
            return False
        self._frozen = False
        self._state, self._measured_at = state, now
        if state.orientation is not None:
            self._rate.add(now, state.orientation)
        return True

    def _fill(self, out: Reading) -> None:
        state = self._state
        if state is not None:
            pose, twist = out.pose, out.twist
            pose[0], pose[1], pose[2] = state.position
            twist[0], twist[1], twist[2] = state.velocity
            if state.orientation is not None:
                pose[3], pose[4], pose[5], pose[6] = state.orientation
                twist[3], twist[4], twist[5] = self._rate.rate
            out.buttons = state.buttons
        out.age = self._clock() - self._measured_at
        if out.age > _STALE:  # where it was, is known; how fast it moves, no longer
            out.twist[:] = 0.0
        out.error, self._error = self._error, ""


def attached(uri: str = URI, patience: float = 0.5) -> list[str]:
    """Return the ids of the Inverse3 devices that a service lists; empty if there is none.

    It connects and reads the inventory, and sends no command.
    """
    link = Link(uri, time.monotonic)
    deadline = time.monotonic() + patience
    try:
        while time.monotonic() < deadline:
            for text in link.poll():
                return device_ids(text)
            link.wait(0.02)
        return []
    finally:
        link.close()


def _with_ids(reason: str, ids: list[str]) -> str:
    return f"{reason} It lists: {', '.join(ids)}" if ids else reason
