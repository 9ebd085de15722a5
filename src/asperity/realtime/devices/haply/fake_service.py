"""A stand-in for the Haply Inverse service, for trying without hardware and for tests.

It listens on 127.0.0.1 and speaks what `haply_messages` describes, written from Haply's public
documentation: an inventory on connecting; then exactly one frame of state for each message; forces
in either spelling; the forces of several clients add up; a command lasts only for a moment, so that
a client that stops sending leaves the device idle and without force. How short that moment is in
the real service is not documented; here it is `command_seconds`.

What can go wrong can be made to: `silent`, `frozen`, `unplugged`, `delay`, `replies` (raw texts
sent instead of frames), `refuse_clients`, and `disconnect()`.

    python -m asperity.realtime.devices.haply.fake_service [still]

prints its address, serves, and ends when its standard input does.
"""

from __future__ import annotations

import contextlib
import json
import math
import selectors
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from asperity.realtime.devices.haply.cursor import Cursor, Point, still_hand, stroking_hand

_NO_FORCE: Point = (0.0, 0.0, 0.0)
_WAIT = 0.02


class FakeService:
    """The service, one Inverse3 and one grip. A context manager; runs in a thread of its own.

    Parameters
    ----------
    hand : callable
        Where the hand that holds the device wants to be [m] at a time since the start [s].
    grip : str
        `wireless`, `wired` or `none`.
    command_seconds : float
        How long a command lasts.
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
        """How many messages came."""
        self.last_message: dict[str, Any] = {}
        self.sessions: list[dict[str, Any]] = []
        """What the clients' first messages configured."""
        self.largest_force = 0.0
        """The largest force that was commanded [N]; nan if one was not finite."""
        self._clock, self._start = clock, clock()
        self._command_seconds = command_seconds
        self._lock = threading.Lock()
        self._stop = self._drop_all = False
        self._clients: list[_Client] = []
        self._frozen_state: dict[str, Any] | None = None
        self._session_count = 0
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.setblocking(False)
        self.uri = f"ws://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve, name="fake Haply service", daemon=True)

    def start(self) -> FakeService:
        """Begin to serve."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """Drop every client and end."""
        self._stop = True
        if self._thread.is_alive():
            self._thread.join(5.0)
        self._listener.close()

    def disconnect(self) -> None:
        """Cut every client's connection, as a cable that is pulled or a service that is killed."""
        self._drop_all = True

    def force(self) -> Point:
        """Return the force that the device exerts now [N]: the sum of what still lasts."""
        now = self._clock()
        with self._lock:
            lasting = [
                c.force for c in self._clients if now - c.commanded_at < self._command_seconds
            ]
        return (
            sum(f[0] for f in lasting), sum(f[1] for f in lasting), sum(f[2] for f in lasting)
        )  # fmt: skip

    def __enter__(self) -> FakeService:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _serve(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ, None)
            while not self._stop:
                for key, _ in selector.select(_WAIT if not self.delay else 0.001):
                    if key.data is None:
                        self._welcome(selector)
                    else:
                        key.data.receive()
                for client in list(self._clients):
                    self._attend(client)
                    if client.gone or self._drop_all:
                        selector.unregister(client.socket)
                        client.socket.close()
                        with self._lock:
                            self._clients.remove(client)
                self._drop_all = False
            for client in self._clients:
                client.socket.close()
            self._clients.clear()

    def _welcome(self, selector: selectors.BaseSelector) -> None:
        connection, _ = self._listener.accept()
        if self.refuse_clients:
            connection.close()
            return
        self._session_count += 1
        client = _Client(connection, self._session_count)
        with self._lock:
            self._clients.append(client)
        selector.register(connection, selectors.EVENT_READ, client)

    def _attend(self, client: _Client) -> None:
        """Obey the messages of a client, and answer those that are due."""
        now = self._clock()
        if client.greeted and not client.told_inventory:
            client.told_inventory = True
            client.send(json.dumps(self._frame(now, client.session, full=True)))
        while client.inbox:
            full = self._obey(client, client.inbox.popleft(), now)
            client.due.append((now + self.delay, full))
        while client.due and client.due[0][0] <= now:
            _, full = client.due.popleft()
            if self.silent:
                continue
            said = self.replies.popleft() if self.replies else None
            client.send(said if said is not None else json.dumps(self._frame(now, 0, full=full)))
        client.flush()

    def _obey(self, client: _Client, text: bytes, now: float) -> bool:
        """Do what a message says; return whether it asks for the whole inventory."""
        self.messages += 1
        try:
            message = json.loads(text)
            session = message.get("session", {})
            if "configure" in session:
                self.sessions.append(session["configure"])
            for entry in message.get("inverse3", []):
                told = entry["commands"].get("set_cursor_force")
                if told is not None and entry["device_id"] == self.device_id:
                    wanted = told.get("vector", told.get("values"))
                    self._command(client, wanted, now)
        except (ValueError, KeyError, TypeError, AttributeError):
            return False
        self.last_message = message
        return "force_render_full_state" in session

    def _command(self, client: _Client, wanted: dict[str, float], now: float) -> None:
        force = (float(wanted["x"]), float(wanted["y"]), float(wanted["z"]))
        # Until now the old force acted.
        self.cursor.advance(now - self._start, self.force())
        with self._lock:
            client.force, client.commanded_at = force, now
        size = math.hypot(*force)
        self.largest_force = size if math.isnan(size) else max(self.largest_force, size)

    def _frame(self, now: float, session: int, *, full: bool) -> dict[str, Any]:
        """Return a frame of state; with `full` the configuration as well."""
        force = self.force()
        self.cursor.advance(now - self._start, force)
        frame: dict[str, Any] = {"session_id": session} if full else {}
        state = self._state(force)
        if self.frozen:
            state = self._frozen_state = self._frozen_state or state
        else:
            self._frozen_state = None
        entry: dict[str, Any] = {
            "device_id": self.device_id,
            "state": state,
            "status": {"calibrated": True, "in_use": True, "power_supply": True, "ready": True,
                       "started": True},
        }  # fmt: skip
        if full:
            entry["config"] = {
                "type": "inverse3", "port": "fake", "handedness": "right", "preset": "defaults",
                "basis": {"permutation": "XYZ"},
                "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
            }  # fmt: skip
        frame["inverse3"] = [] if self.unplugged else [entry]
        w, x, y, z = self.orientation
        turned = {"w": w, "x": x, "y": y, "z": z}
        a, b, c = self.buttons
        wireless = {"orientation": turned, "buttons": {"a": a, "b": b, "c": c}, "hall": 0}
        wired = {"orientation": turned, "button": a, "hall": 0}
        frame["wireless_verse_grip"] = (
            [{"device_id": "61576", "state": wireless}] if self.grip == "wireless" else []
        )
        frame["verse_grip"] = (
            [{"device_id": "61577", "state": wired}] if self.grip == "wired" else []
        )
        return frame

    def _state(self, force: Point) -> dict[str, Any]:
        idle = force == _NO_FORCE
        return {
            "cursor_position": _xyz(self.cursor.position),
            "cursor_velocity": _xyz(self.cursor.velocity),
            "current_cursor_force": _xyz(force),
            "current_cursor_position": _xyz(_NO_FORCE),
            "angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
            "angular_velocity": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
            "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
            "control_domain": "cartesian",
            "control_mode": "idle" if idle else "force",
            "transform": {},
        }


class _Client:
    """One connection to the service."""

    def __init__(self, connection: socket.socket, session: int) -> None:
        from websockets.server import ServerProtocol

        self.socket = connection
        self.socket.setblocking(False)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.session = session
        self.force: Point = _NO_FORCE
        self.commanded_at = -math.inf
        self.inbox: deque[bytes] = deque()
        self.due: deque[tuple[float, bool]] = deque()
        self.greeted = self.told_inventory = self.gone = False
        self._protocol = ServerProtocol()
        self._outgoing = bytearray()

    def receive(self) -> None:
        try:
            data = self.socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            self.gone = True
            return
        if not data:
            self.gone = True
            return
        self._protocol.receive_data(data)
        for event in self._protocol.events_received():
            if not self.greeted:
                self._protocol.send_response(self._protocol.accept(event))
                self.greeted = self._protocol.handshake_exc is None
            elif event.opcode == 1:
                self.inbox.append(bytes(event.data))
        self.flush()

    def send(self, text: str | bytes) -> None:
        with contextlib.suppress(Exception):  # a client that has just said goodbye
            self._protocol.send_text(text.encode() if isinstance(text, str) else text)
        self.flush()

    def flush(self) -> None:
        for data in self._protocol.data_to_send():
            self._outgoing += data
            if not data:
                self.gone = True
        try:
            while self._outgoing:
                del self._outgoing[: self.socket.send(self._outgoing)]
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True


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
