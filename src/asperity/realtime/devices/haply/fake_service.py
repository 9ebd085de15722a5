"""A simulated Haply Inverse service, for trying without hardware and for tests.

It listens on 127.0.0.1 and speaks the protocol of `messages`, written from Haply's public
documentation: an inventory on connecting; then exactly one frame of state for each message; forces
in either spelling; the forces of several clients add up; a command lasts for a short time only, so
that a client that stops sending leaves the device idle and without force. How short that time is in
the real service is not documented; here it is `command_seconds`.

Faults can be provoked: `silent`, `frozen`, `unplugged`, `delay`, `replies` (raw texts sent instead
of frames), `refuse_clients`, and `disconnect()`.

    python -m asperity.realtime.devices.haply.fake_service [still]

prints its address, serves, and ends when its standard input does.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from asperity.realtime.devices.haply.messages import HOME

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response

Point = tuple[float, float, float]
_ZERO: Point = (0.0, 0.0, 0.0)
_STEP = 0.25e-3
"""Step of the simulated end effector [s]."""
_LONGEST_CATCH_UP = 0.05
_READY_STATUS = dict.fromkeys(("calibrated", "in_use", "power_supply", "ready", "started"), True)


def stroking_hand(time: float) -> Point:
    """Return the target of a hand that strokes 40 mm to and fro in 4 s and presses at times [m]."""
    phase = 2.0 * math.pi * time / 4.0
    x, y, z = HOME
    down = 4e-3 * (0.5 - 0.5 * math.cos(phase / 2.0))
    return x + 0.02 * math.sin(phase), y, z - down


def still_hand(_: float) -> Point:
    """Return the target of a hand that keeps still [m]."""
    return HOME


class Cursor:
    """The end effector: a mass that a hand holds by a spring and a damper, and the motors push.

        m x'' = F_motor + k (x_hand(t) - x) - b x'

    It is integrated semi-implicitly with a fixed step of 0.25 ms.

    Parameters
    ----------
    hand : callable
        Target of the hand [m] at a time [s].
    mass, stiffness, damping : float
        Mass of hand and device [kg]; stiffness [N/m] and damping [N s/m] of the hand.
    """

    def __init__(
        self,
        hand: Callable[[float], Point] = stroking_hand,
        *,
        mass: float = 0.2,
        stiffness: float = 300.0,
        damping: float = 6.0,
    ) -> None:
        self.hand = hand
        self._mass, self._stiffness, self._damping = mass, stiffness, damping
        self._time = 0.0
        self.position = list(hand(0.0))
        self.velocity = [0.0, 0.0, 0.0]

    def advance(self, time: float, force: Point) -> None:
        """Advance to `time` [s] under the motors' force [N]; after a gap, only its last 50 ms."""
        self._time = max(self._time, time - _LONGEST_CATCH_UP)
        x, v = self.position, self.velocity
        while self._time + _STEP <= time:
            self._time += _STEP
            target = self.hand(self._time)
            for i in range(3):
                pull = self._stiffness * (target[i] - x[i]) - self._damping * v[i]
                v[i] += _STEP / self._mass * (force[i] + pull)
                x[i] += _STEP * v[i]


class FakeService:
    """The service with one Inverse3 and one grip, in a thread. A context manager.

    Parameters
    ----------
    hand : callable
        Target of the hand that holds the device [m] at a time since the start [s].
    grip : str
        `wireless`, `wired` or `none`.
    device_id : str
    command_seconds : float
        How long a command lasts [s].
    clock : callable
        Time of the simulated hand [s].
    port : int
        0: any that is free.
    """

    def __init__(
        self,
        hand: Callable[[float], Point] = stroking_hand,
        *,
        grip: str = "wireless",
        device_id: str = "FA4E",
        command_seconds: float = 0.02,
        clock: Callable[[], float] = time.monotonic,
        port: int = 0,
    ) -> None:
        self.cursor = Cursor(hand)
        self.device_id = device_id
        self.grip = grip
        self.orientation = (1.0, 0.0, 0.0, 0.0)
        self.buttons: tuple[bool, bool, bool] = (False, False, False)
        self.silent = self.frozen = self.unplugged = self.refuse_clients = False
        self.delay = 0.0
        self.replies: deque[str | bytes] = deque()
        self.messages = 0
        """Number of messages received."""
        self.last_message: dict[str, Any] = {}
        self.sessions: list[dict[str, Any]] = []
        """Configurations in the clients' first messages."""
        self.largest_force = 0.0
        """Norm of the largest force commanded [N]; NaN if one was not finite."""
        self._clock, self._start = clock, clock()
        self._command_seconds = command_seconds
        self._commands: dict[ServerConnection, tuple[float, Point]] = {}
        self._frozen_state: dict[str, Any] | None = None
        self._session_count = 0
        self._listener = socket.create_server(("127.0.0.1", port))
        self.uri = f"ws://127.0.0.1:{self._listener.getsockname()[1]}"
        self._loop = asyncio.new_event_loop()
        self._stopping = asyncio.Event()
        self._server: Server | None = None
        self._thread = threading.Thread(target=self._run, name="fake Haply service", daemon=True)

    def start(self) -> FakeService:
        """Start serving."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """Disconnect all clients and end."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stopping.set)
            self._thread.join(5.0)
        self._listener.close()

    def disconnect(self) -> None:
        """Cut all connections, as when a cable is pulled or the service is killed."""
        self._loop.call_soon_threadsafe(self._abort_connections)

    def force(self) -> Point:
        """Return the force that the device exerts now [N]: the sum of the lasting commands."""
        now = self._clock()
        lasting = [f for at, f in list(self._commands.values()) if now - at < self._command_seconds]
        return (
            sum(f[0] for f in lasting), sum(f[1] for f in lasting), sum(f[2] for f in lasting)
        )  # fmt: skip

    def __enter__(self) -> FakeService:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.close()

    async def _serve(self) -> None:
        from websockets.asyncio.server import serve

        logger = logging.getLogger(f"{__name__}.websockets")
        logger.setLevel(logging.CRITICAL)  # connections that are cut are no errors here
        async with serve(
            self._attend, sock=self._listener, process_request=self._admit, compression=None,
            ping_interval=None, close_timeout=0.1, logger=logger,
        ) as self._server:  # fmt: skip
            await self._stopping.wait()
            self._abort_connections()

    def _abort_connections(self) -> None:
        for connection in self._server.connections if self._server is not None else ():
            connection.transport.abort()

    def _admit(self, connection: ServerConnection, _: Request) -> Response | None:
        if self.refuse_clients:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "no clients\n")
        return None

    async def _attend(self, connection: ServerConnection) -> None:
        """Send the inventory to a client; then obey and answer its messages."""
        from websockets.exceptions import ConnectionClosed

        self._session_count += 1
        replies: set[asyncio.Task[None]] = set()
        with contextlib.suppress(ConnectionClosed):
            await connection.send(json.dumps(self._frame(self._session_count, full=True)))
            async for text in connection:
                full = self._obey(connection, text)
                if self.delay:  # later messages are obeyed meanwhile
                    task = asyncio.create_task(self._reply(connection, full))
                    replies.add(task)
                    task.add_done_callback(replies.discard)
                else:
                    await self._reply(connection, full)
        self._commands.pop(connection, None)

    async def _reply(self, connection: ServerConnection, full: bool) -> None:
        from websockets.exceptions import ConnectionClosed

        if self.delay:
            await asyncio.sleep(self.delay)
        if self.silent:
            return
        text = self.replies.popleft() if self.replies else json.dumps(self._frame(0, full=full))
        with contextlib.suppress(ConnectionClosed):
            await connection.send(text, text=True)

    def _obey(self, connection: ServerConnection, text: str | bytes) -> bool:
        """Carry out a message; return whether it requests the full state."""
        self.messages += 1
        try:
            message = json.loads(text)
            session = message.get("session", {})
            if "configure" in session:
                self.sessions.append(session["configure"])
            for entry in message.get("inverse3", []):
                force = entry["commands"].get("set_cursor_force")
                if force is not None and entry["device_id"] == self.device_id:
                    self._command(connection, force.get("vector", force.get("values")))
        except (ValueError, KeyError, TypeError, AttributeError):
            return False
        self.last_message = message
        return "force_render_full_state" in session

    def _command(self, connection: ServerConnection, vector: dict[str, float]) -> None:
        now = self._clock()
        force = (float(vector["x"]), float(vector["y"]), float(vector["z"]))
        self.cursor.advance(now - self._start, self.force())  # under the old force
        self._commands[connection] = now, force
        size = math.hypot(*force)
        self.largest_force = size if math.isnan(size) else max(self.largest_force, size)

    def _frame(self, session: int, *, full: bool) -> dict[str, Any]:
        """Return a frame of state; if `full`, with the configuration."""
        force = self.force()
        self.cursor.advance(self._clock() - self._start, force)
        state = self._state(force)
        self._frozen_state = (self._frozen_state or state) if self.frozen else None
        entry: dict[str, Any] = {
            "device_id": self.device_id,
            "state": self._frozen_state or state,
            "status": _READY_STATUS,
        }
        if full:
            entry["config"] = {
                "type": "inverse3", "port": "fake", "handedness": "right", "preset": "defaults",
                "basis": {"permutation": "XYZ"},
                "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
            }  # fmt: skip
        orientation = dict(zip("wxyz", self.orientation, strict=True))
        a, b, c = self.buttons
        grips: dict[str, list[dict[str, Any]]] = {"wireless_verse_grip": [], "verse_grip": []}
        if self.grip == "wireless":
            grip = {"orientation": orientation, "buttons": {"a": a, "b": b, "c": c}, "hall": 0}
            grips["wireless_verse_grip"].append({"device_id": "61576", "state": grip})
        elif self.grip == "wired":
            grip = {"orientation": orientation, "button": a, "hall": 0}
            grips["verse_grip"].append({"device_id": "61577", "state": grip})
        head = {"session_id": session} if full else {}
        return {**head, "inverse3": [] if self.unplugged else [entry], **grips}

    def _state(self, force: Point) -> dict[str, Any]:
        return {
            "cursor_position": _xyz(self.cursor.position),
            "cursor_velocity": _xyz(self.cursor.velocity),
            "current_cursor_force": _xyz(force),
            "current_cursor_position": _xyz(_ZERO),
            "angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
            "angular_velocity": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
            "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
            "control_domain": "cartesian",
            "control_mode": "idle" if force == _ZERO else "force",
            "transform": {},
        }


def _xyz(values: Any) -> dict[str, float]:
    return {"x": values[0], "y": values[1], "z": values[2]}


def main() -> None:
    """Serve until standard input ends; print the address first."""
    still = "still" in sys.argv[1:]
    with FakeService(still_hand if still else stroking_hand) as service:
        print(service.uri, flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
