"""Haply Inverse3, through Haply's Inverse service (WebSocket, JSON).

The service answers each message with one frame of state and sends nothing else. A `PollingThread`
sends the newest force, waits for its frame, and waits for the next force. So there is never more
than one force on the way, however slow the service is, and the pose of a tick answers the force of
the previous tick. Why a thread: docs/design/servo.md.

- *When writes stop*, the thread sends zero after 20 ms. If the process is killed, nothing is sent
  any more: commands are documented as non-persistent, the service then idles and the force ends.
  After how long is not documented.
- *Zero during a wait*: if zero becomes due while a frame is awaited, it is sent at once.
- *A repeated frame*, with the same position to the bit although its velocity would have moved it by
  2 mm, is frozen: it does not count as new, and `age` grows. A frozen frame without velocity cannot
  be distinguished from a hand at rest.
- *A lost connection* is retried with increasing pauses; `read` reports the loss, and `age` grows.

Never tried on hardware: it is tested against `fake_service`, written from the same documentation.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from typing import Any

from asperity.errors import AsperityError, require_choice
from asperity.realtime.devices.haply.messages import (
    GRIPS,
    SPELLINGS,
    device_ids,
    first_part,
    force_message,
    read_state,
)
from asperity.realtime.devices.orientation import TurnRate
from asperity.realtime.devices.polling_thread import (
    Measurement,
    PolledDevice,
    PollingThread,
    UnusableError,
)
from asperity.realtime.devices.presets import PRESETS
from asperity.realtime.devices.protocol import ZERO, Limits

URI = "ws://localhost:10001"
_SILENCE = 0.25
"""Time limit for a frame [s]."""
_LOOK = 0.002
"""Time between two checks during the wait whether zero is due [s]."""
_FROZEN_TRAVEL = 2e-3
_OPENING, _REOPENING, _RETRY = 1.0, 0.5, 0.05


class HaplyServiceDevice(PolledDevice):
    """An Inverse3, with or without a VerseGrip, behind the Inverse service.

    Parameters
    ----------
    uri : str
        Address of the service.
    device_id : str, optional
        Which Inverse3. Default: the first listed.
    spelling : str
        `vector` (service 3.5) or `values` (3.1).
    grip : str
        Which VerseGrip gives orientation and buttons: `auto` (wireless before wired), `wireless`,
        `wired`, `none`. Without one the orientation stays that of the base.
    profile : str
        Name of this program for the service. Empty: none is sent.
    limits : Limits
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
        self._link: Any = None
        self._greeting = ""
        self._rate = TurnRate()
        self._device_id = ""
        self._position = (0.0, 0.0, 0.0)
        self._moved_at = -math.inf

    def open(self) -> None:
        """Connect, and wait for the first frame with the device."""
        if self._poller is not None:
            return
        _require_address(self._uri)
        try:
            self._connect(_OPENING)
        except OSError as error:
            self._drop()
            raise AsperityError(
                f"no Inverse3 at {self._uri}: {error}; start Haply Hub or the Inverse service, and "
                "see 'asperity devices'"
            ) from None
        self._poller = PollingThread(self._transact, reopen=self._reopen, clock=self._clock)
        self._poller.start()

    def close(self) -> None:
        """Send zero, and disconnect."""
        poller, self._poller = self._poller, None
        if poller is not None:
            poller.stop()
        self._drop()

    def _connect(self, patience: float) -> None:
        """Connect, and find the device in the inventory; raise OSError if that fails."""
        self._link = _connected(self._uri, patience)
        self._greeting = self._first
        with _errors(""):
            text = self._frame(patience)
        if text is None:
            raise OSError("the service sent nothing")
        try:
            # Once found, the device stays the same: no force goes to another.
            state = read_state(text, self._device_id or self._wanted_id, self._grip)
        except ValueError as error:
            ids = device_ids(text)
            raise OSError(f"{error} It lists: {', '.join(ids)}" if ids else str(error)) from None
        self._device_id = state.device_id
        self._moved_at = -math.inf
        self._rate.forget()

    def _reopen(self) -> None:
        if self._link is None:
            self._connect(_REOPENING)

    def _drop(self) -> None:
        link, self._link = self._link, None
        if link is not None:
            link.close()

    def _transact(self, wrench: tuple[float, ...]) -> Measurement:
        """Send a force and return the measurement in the frame that answers it."""
        try:
            with _errors("lost the Haply service"):
                text = self._answer(wrench)
        except OSError:
            self._drop()
            raise
        return self._measurement(text)

    def _answer(self, wrench: tuple[float, ...]) -> bytes:
        while self._frame(0.0) is not None:
            pass  # frames that are late
        self._send(wrench)
        deadline = time.monotonic() + _SILENCE
        while time.monotonic() < deadline:
            text = self._frame(_LOOK)
            if text is not None:
                return text
            if wrench[:3] != ZERO[:3] and self._zero_is_wanted():
                wrench = ZERO
                self._send(wrench)
        raise OSError("it went silent")

    def _frame(self, seconds: float) -> bytes | None:
        """Return the next frame; None if there is none within a time [s]."""
        if self._link is None:
            raise OSError("it is not connected")
        try:
            frame: bytes = self._link.recv(seconds, decode=False)
        except TimeoutError:
            return None
        return frame

    def _send(self, force: tuple[float, ...]) -> None:
        message = force_message(self._device_id, force, self._spelling, self._greeting)
        self._link.send(message, text=True)
        self._greeting = ""

    def _zero_is_wanted(self) -> bool:
        return self._poller is not None and self._poller.wanted()[:3] == ZERO[:3]

    def _measurement(self, text: bytes) -> Measurement:
        try:
            state = read_state(text, self._device_id, self._grip)
        except ValueError as error:
            raise UnusableError(str(error)) from None
        now = self._clock()
        if state.position != self._position:
            self._moved_at, self._position = now, state.position
        # It would have moved this far by its own velocity.
        elif math.hypot(*state.velocity) * (now - self._moved_at) > _FROZEN_TRAVEL:
            raise UnusableError("the Haply service repeats one frame")
        if state.orientation is not None:
            self._rate.add(now, state.orientation)
        return Measurement(
            state.position, state.velocity, state.orientation, self._rate.rate, state.buttons
        )


def attached(uri: str = URI, patience: float = 0.5) -> list[str]:
    """Return the ids of the Inverse3 devices that a service lists; empty if there is none.

    It connects and reads the inventory, and sends no command.
    """
    _require_address(uri)
    try:
        with _errors(""), _connected(uri, patience) as link:
            return device_ids(link.recv(patience, decode=False))
    except OSError:
        return []


def _require_address(uri: str) -> None:
    """Raise AsperityError if an address is not one, or there is no package to reach it."""
    try:
        from websockets.exceptions import InvalidURI
        from websockets.uri import parse_uri
    except ImportError:
        raise AsperityError(
            "the Haply service needs websockets: pip install 'asperity[haply]'"
        ) from None
    try:
        secure = parse_uri(uri).secure
    except InvalidURI:
        raise AsperityError(f"{uri!r} is not an address; valid: ws://HOST:PORT") from None
    if secure:
        raise AsperityError(f"{uri!r}: the service speaks ws, not wss")


def _connected(uri: str, patience: float) -> Any:
    """Return a connection; OSError if none is accepted within a time [s]."""
    from websockets.sync.client import connect

    deadline = time.monotonic() + patience
    while True:
        try:
            with _errors(""):
                return connect(
                    uri, open_timeout=patience, close_timeout=0.1, ping_interval=None,
                    compression=None, proxy=None,
                )  # fmt: skip
        except OSError:
            if time.monotonic() + _RETRY > deadline:
                raise
            time.sleep(_RETRY)


@contextlib.contextmanager
def _errors(what: str) -> Iterator[None]:
    """Turn whatever a connection raises into an OSError of one line that begins with `what`."""
    from websockets.exceptions import WebSocketException

    try:
        yield
    except (OSError, EOFError, WebSocketException) as error:
        text = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise OSError(": ".join(filter(None, (what, " ".join(text.split()))))) from None
