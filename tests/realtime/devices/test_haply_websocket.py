"""The connection itself: fragments, servers that are none, floods."""

import contextlib
import socket
import threading
import time

import pytest
from clocks import Clock
from websockets.sync.server import serve

from asperity.realtime.devices.haply import websocket as haply_link
from asperity.realtime.devices.haply.websocket import WebSocketClient


def texts_of(link, count, patience=10.0):
    """Return the texts that come until there are `count`."""
    found, end = [], time.monotonic() + patience
    while len(found) < count:
        assert time.monotonic() < end, f"{found} so far; {link.error}"
        found += link.poll()
        link.wait(0.01)
    return found


@contextlib.contextmanager
def server(handler):
    with serve(handler, "127.0.0.1", 0, compression=None) as serving:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        yield f"ws://127.0.0.1:{serving.socket.getsockname()[1]}"
        serving.shutdown()


def test_messages_in_pieces_and_many_at_once_come_whole_and_in_order():
    def handler(connection):
        connection.send(["in ", "three ", "pieces"])
        for i in range(200):
            connection.send(str(i))
        connection.ping()
        connection.send(connection.recv())

    with server(handler) as uri:
        link = WebSocketClient(uri, time.monotonic)
        found = texts_of(link, 201)
        assert found == ["in three pieces", *map(str, range(200))]
        assert link.send(b"and back")
        assert texts_of(link, 1) == ["and back"]
        link.close()
        assert not link.send(b"more")


@pytest.mark.parametrize(
    "answer", [b"HTTP/1.1 404 Not Found\r\n\r\n", b"SSH-2.0-OpenSSH\r\n", b"\0" * 9000, b""]
)
def test_what_speaks_no_websocket_is_reported_and_left(answer):
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def speak():
            with contextlib.suppress(OSError):
                while True:
                    connection, _ = listener.accept()
                    connection.recv(4096)
                    connection.sendall(answer)
                    connection.close()

        threading.Thread(target=speak, daemon=True).start()
        link = WebSocketClient(f"ws://127.0.0.1:{listener.getsockname()[1]}", time.monotonic)
        end = time.monotonic() + 5.0
        while link.error == "not connected yet" and time.monotonic() < end:
            assert link.poll() == []
            link.wait(0.01)
        assert not link.is_open
        assert link.error not in ("", "not connected yet")
        assert "\n" not in link.error
        link.close()


def test_an_answer_that_never_comes_is_given_up():
    clock = Clock()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        link = WebSocketClient(f"ws://127.0.0.1:{listener.getsockname()[1]}", clock)
        for _ in range(200):
            link.poll()
            link.wait(0.0)
        assert not link.is_open
        clock.now += haply_link.PATIENCE + 0.1
        link.poll()
        assert "does not answer" in link.error
        clock.now += haply_link.RETRY + 0.01
        link.poll()  # tries anew
        assert link._socket is not None
        link.close()


def test_every_address_of_a_host_is_tried(monkeypatch):
    def handler(connection):
        connection.send("hello")

    with server(handler) as uri:
        port = int(uri.rpartition(":")[2])
        with socket.create_server(("127.0.0.1", 0)) as nobody:
            dead = nobody.getsockname()
        found = [(socket.AF_INET, 1, 6, "", dead), (socket.AF_INET, 1, 6, "", ("127.0.0.1", port))]
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
        link = WebSocketClient(f"ws://localhost:{port}", time.monotonic)
        assert texts_of(link, 1) == ["hello"]
        link.close()
