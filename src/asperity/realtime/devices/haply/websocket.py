"""A WebSocket client whose every step is non-blocking.

A thread that exchanges forces with a service has to react at once to other requests: to send zero,
or to end. So this client is one non-blocking socket with the protocol of the `websockets` package
but without that package's input and output: `poll` does whatever can be done now and returns,
`wait` sleeps until something can be done. Connecting, the handshake and reconnecting after a loss
are all steps of `poll`.

    closed --(time to try)--> connecting --> handshake --> open --(loss)--> closed
"""

from __future__ import annotations

import contextlib
import errno
import select
import socket
import time
from collections.abc import Callable
from typing import Any

from asperity.errors import AsperityError

RETRY = 0.05
"""Pause between attempts to connect [s]."""
PATIENCE = 2.0
"""Time limit for one attempt [s]."""
_MAX_QUEUED = 64 * 1024
_MAX_READS = 16
_NOTHING: list[str] = []


class WebSocketClient:
    """One connection, reconnected when it is lost.

    Parameters
    ----------
    uri : str
        `ws://host:port`.
    clock : callable
        Monotonic time [s].

    Attributes
    ----------
    is_open : bool
        Whether messages can be sent.
    error : str
        Why it is not open; empty while it is.
    openings : int
        How often it has been opened.
    """

    def __init__(self, uri: str, clock: Callable[[], float]) -> None:
        from websockets.exceptions import InvalidURI
        from websockets.uri import parse_uri

        try:
            self._uri = parse_uri(uri)
        except InvalidURI:
            raise AsperityError(f"{uri!r} is not an address; valid: ws://HOST:PORT") from None
        if self._uri.secure:
            raise AsperityError(f"{uri!r}: the service speaks ws, not wss")
        try:
            # Host names are looked up only here, as that can block.
            found = socket.getaddrinfo(self._uri.host, self._uri.port, type=socket.SOCK_STREAM)
        except OSError as error:
            raise AsperityError(f"no such host: {self._uri.host} ({error})") from None
        self._addresses = [(family, address) for family, _, _, _, address in found]
        self._clock = clock
        self._socket: socket.socket | None = None
        self._protocol: Any = None
        self._connected = False
        self._outgoing = bytearray()
        self._view = memoryview(bytearray(65536))
        self._parts: list[bytes] = []
        self._attempt = 0
        self._retry_at = -float("inf")
        self._give_up_at = 0.0
        self.is_open = False
        self.error = "not connected yet"
        self.openings = 0

    def poll(self) -> list[str]:
        """Send and receive what can be moved now; return the texts received, oldest first."""
        try:
            if self._socket is None:
                if self._clock() >= self._retry_at:
                    self._begin()
                return _NOTHING
            if not self._connected and not self._finish_connecting():
                return _NOTHING
            texts = self._receive()
            self._flush()
            if not self.is_open and self._clock() > self._give_up_at:
                self._lose("it does not answer as a WebSocket")
            return texts
        except Exception as error:  # whatever a socket or a peer does
            self._lose(_one_line(error))
            return _NOTHING

    def send(self, text: bytes) -> bool:
        """Queue a text message; return False if the connection cannot take it now."""
        if not self.is_open or len(self._outgoing) > _MAX_QUEUED:
            return False
        try:
            self._protocol.send_text(text)
            self._flush()
        except Exception as error:
            self._lose(_one_line(error))
            return False
        return True

    def wait(self, seconds: float) -> None:
        """Sleep until something can be moved, at most `seconds` [s]."""
        if self._socket is None:
            time.sleep(min(seconds, max(0.0, self._retry_at - self._clock())))
        else:
            writing = [self._socket] if not self._connected or self._outgoing else []
            select.select([self._socket], writing, [], seconds)

    def drop(self, reason: str) -> None:
        """Close the connection at once; it will be reopened."""
        self._lose(reason)

    def close(self) -> None:
        """Close the connection for good. Never raises."""
        with contextlib.suppress(Exception):
            if self.is_open:
                self._protocol.send_close(1000)
                self._flush()
        self._lose("closed")
        self._retry_at = float("inf")

    def _begin(self) -> None:
        from websockets.client import ClientProtocol

        family, address = self._addresses[self._attempt % len(self._addresses)]
        self._attempt += 1
        self._protocol = ClientProtocol(self._uri)
        self._connected = False
        self._give_up_at = self._clock() + PATIENCE
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        state = self._socket.connect_ex(address)
        if state not in (0, errno.EINPROGRESS, errno.EWOULDBLOCK):
            raise OSError(state, errno.errorcode.get(state, "cannot connect"))

    def _finish_connecting(self) -> bool:
        """Return whether the socket is connected; if it has just connected, send the handshake."""
        assert self._socket is not None
        _, writable, failed = select.select([], [self._socket], [self._socket], 0.0)
        if not writable and not failed:
            if self._clock() > self._give_up_at:
                self._lose("no answer")
            return False
        state = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if state:
            raise ConnectionRefusedError(state, "the connection was refused")
        self._connected = True
        self._protocol.send_request(self._protocol.connect())
        return True

    def _receive(self) -> list[str]:
        assert self._socket is not None
        texts = _NOTHING
        for _ in range(_MAX_READS):
            try:
                data = bytes(self._view[: self._socket.recv_into(self._view)])
            except BlockingIOError:
                break
            if data:
                self._protocol.receive_data(data)
            else:
                self._protocol.receive_eof()
            for event in self._protocol.events_received():
                text = self._take(event)
                if text is not None:
                    texts = [*texts, text]
            if not data:
                self._lose("the other side closed the connection")
                break
            failure = self._protocol.handshake_exc or self._protocol.parser_exc
            if failure is not None:
                raise failure
        return texts

    def _take(self, event: Any) -> str | None:
        """Return the text that an event of the protocol completes, if any."""
        if not self.is_open:  # the answer to the handshake
            self.is_open, self.error = True, ""
            self.openings += 1
            self._attempt = 0
            return None
        if event.opcode > 2:  # ping, pong, close: handled by the protocol
            return None
        if event.fin and not self._parts:
            return bytes(event.data).decode("utf-8", "replace")
        self._parts.append(bytes(event.data))
        if not event.fin:
            return None
        whole = b"".join(self._parts)
        self._parts.clear()
        return whole.decode("utf-8", "replace")

    def _flush(self) -> None:
        if self._socket is None:
            return
        for data in self._protocol.data_to_send():
            self._outgoing += data
        while self._outgoing:
            try:
                sent = self._socket.send(self._outgoing)
            except BlockingIOError:
                return
            del self._outgoing[:sent]

    def _lose(self, reason: str) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
        self._socket, self._connected, self.is_open = None, False, False
        self._outgoing.clear()
        self._parts.clear()
        self.error = reason
        # All of the host's addresses are tried before a pause.
        pause = 0.0 if self._attempt % len(self._addresses) else RETRY
        self._retry_at = self._clock() + pause


def _one_line(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())
