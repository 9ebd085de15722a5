"""The connection itself: fragments, servers that are none, floods."""

import contextlib
import json
import socket
import threading
import time

import numpy as np
import pytest
from clocks import until
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

from asperity.errors import AsperityError
from asperity.realtime.devices.haply.service import HaplyServiceDevice, attached
from asperity.realtime.devices.protocol import Reading


def frame(x=0.0, device_id="049D"):
    place, still = {"x": x, "y": -0.12, "z": 0.15}, {"x": 0.0, "y": 0.0, "z": 0.0}
    state = {"cursor_position": place, "cursor_velocity": still}
    return json.dumps({"inverse3": [{"device_id": device_id, "state": state}]})


@contextlib.contextmanager
def server(handler):
    with serve(handler, "127.0.0.1", 0, compression=None) as serving:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        yield f"ws://127.0.0.1:{serving.socket.getsockname()[1]}"
        serving.shutdown()


def test_messages_in_pieces_and_many_at_once_come_whole_and_in_order():
    sent = []

    def handler(connection):
        whole = frame()
        connection.send([whole[:10], whole[10:50], whole[50:]])
        with contextlib.suppress(ConnectionClosed):
            for number in range(1, 100_000):
                sent.append(json.loads(connection.recv()))
                connection.ping()
                text = frame(1e-6 * number)
                connection.send([text[:5], text[5:]])
                if number == 20:
                    for _ in range(200):  # late ones, which are left
                        connection.send(text)

    with server(handler) as uri:
        assert attached(uri) == ["049D"]
        device, reading, places = HaplyServiceDevice(uri=uri), Reading.empty(), []
        device.open()

        def many():
            device.write(np.array([0.0, 0.0, 0.5, 0.0, 0.0, 0.0]))
            if device.read(reading):
                assert reading.error == ""
                places.append(reading.pose[0])
            return len(places) > 100

        assert until(many, 10.0)
        device.close()
    assert places == sorted(places)
    force = {"vector": {"x": 0.0, "y": 0.0, "z": 0.5}}
    assert any(m["inverse3"][0]["commands"]["set_cursor_force"] == force for m in sent)
    assert not device.read(reading)


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
        uri = f"ws://127.0.0.1:{listener.getsockname()[1]}"
        with pytest.raises(AsperityError, match=f"^no Inverse3 at {uri}: .+; start") as caught:
            HaplyServiceDevice(uri=uri).open()
        assert "\n" not in str(caught.value)
        assert attached(uri) == []


def test_an_answer_that_never_comes_is_given_up():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        uri = f"ws://127.0.0.1:{listener.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(AsperityError, match="timed out"):
            HaplyServiceDevice(uri=uri).open()
        assert 0.9 < time.monotonic() - began < 10.0
        assert attached(uri) == []


def test_every_address_of_a_host_is_tried(monkeypatch):
    def handler(connection):
        connection.send(frame(device_id="hello"))

    with server(handler) as uri:
        port = int(uri.rpartition(":")[2])
        with socket.create_server(("127.0.0.1", 0)) as nobody:
            dead = nobody.getsockname()
        found = [(socket.AF_INET, 1, 6, "", dead), (socket.AF_INET, 1, 6, "", ("127.0.0.1", port))]
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
        assert attached(f"ws://localhost:{port}") == ["hello"]
