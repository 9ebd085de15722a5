"""Pages of other origins can neither read the page nor drive the tool."""

import pytest

from asperity.viewer.server.access import refusal

PORT = 8080


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "127.0.0.1:8080"},
        {"Host": "localhost:8080", "Origin": "http://localhost:8080"},
        {"Host": "LOCALHOST:8080", "Origin": "http://localhost:8080"},
        {"Host": "[::1]:8080", "Origin": "http://[::1]:8080"},
    ],
)
def test_the_page_itself_and_programs_are_answered(headers):
    assert refusal(headers, PORT) == ""


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Host": "evil.example:8080"},  # a name that was made to point here
        {"Host": "evil.example:8080", "Origin": "http://evil.example:8080"},
        {"Host": "127.0.0.1:8080", "Origin": "http://evil.example"},
        {"Host": "127.0.0.1:8080", "Origin": "http://127.0.0.1:9999"},
        {"Host": "127.0.0.1:8080", "Origin": "http://localhost:8080"},
        {"Host": "127.0.0.1:8080", "Origin": "null"},
        {"Host": "127.0.0.1:8080", "Origin": ""},
        {"Host": "127.0.0.1:8080", "Origin": "file://127.0.0.1:8080"},
        {"Host": "127.0.0.1", "Origin": "http://127.0.0.1"},
    ],
)
def test_others_are_refused(headers):
    assert refusal(headers, PORT) != ""


def test_a_websocket_of_another_origin_is_refused_by_the_server_itself():
    viser = pytest.importorskip("viser")
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    from asperity.viewer.server.access import guarded, own_origin

    with guarded(own_origin):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        url = f"ws://127.0.0.1:{server.get_port()}"
        protocol = [f"viser-v{viser.__version__}"]
        with pytest.raises(InvalidStatus) as caught:
            connect(url, origin="http://evil.example", subprotocols=protocol)
        assert caught.value.response.status_code == 403
        own = f"http://127.0.0.1:{server.get_port()}"
        with connect(url, origin=own, subprotocols=protocol) as socket:
            assert len(socket.recv(timeout=10.0)) > 0
    finally:
        server.stop()
