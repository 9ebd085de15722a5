"""The page for other computers: who comes in, and who does not."""

import http.client
import time

import pytest

pytest.importorskip("viser", reason="needs viser (asperity[view])")
from fake_client import FakeServoClient
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from asperity.errors import AsperityError
from asperity.viewer.server import access
from asperity.viewer.server.access import TokenGate, guarded
from asperity.viewer.server.server import Page


class Gated:
    """A viser server behind a gate, at an address that the tests reach."""

    def __init__(self):
        import viser

        self.gate = TokenGate()
        with guarded(self.gate, **self.gate.limits):
            self.server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self.server.gui.add_markdown("behind the gate")
        self.port, self.token = self.server.get_port(), self.gate.token


@pytest.fixture(scope="module")
def gated():
    made = Gated()
    yield made
    made.server.stop()


def get(gated, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", gated.port, timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def cookie_of(gated):
    answer, _ = get(gated, f"/?token={gated.token}")
    assert answer.status == 200
    return answer.headers["Set-Cookie"].split(";")[0]


def opened(gated, origin, **headers):
    import viser

    return connect(
        f"ws://127.0.0.1:{gated.port}/", origin=origin, additional_headers=headers,
        subprotocols=[f"viser-v{viser.__version__}"], max_size=None, proxy=None,
    )  # fmt: skip


def own(gated):
    return f"http://127.0.0.1:{gated.port}"


@pytest.mark.parametrize("path", ["/", "/index.html", "/?token=", "/?token=wrong", "/?token=%00"])
def test_without_the_token_there_is_no_page(gated, path):
    answer, body = get(gated, path)
    assert answer.status == 401
    assert len(body) < 200
    assert "Set-Cookie" not in answer.headers


def test_a_made_up_cookie_opens_nothing(gated):
    for cookie in (f"asperity-{gated.port}=made-up", f"asperity-{gated.port}={gated.token}", "=;;"):
        assert get(gated, "/", Cookie=cookie)[0].status == 401
        with pytest.raises(InvalidStatus, match="401"):
            opened(gated, own(gated), Cookie=cookie)


def test_the_token_gives_a_cookie_that_other_sites_cannot_use(gated):
    answer, body = get(gated, f"/?token={gated.token}")
    assert answer.status == 200
    assert "HttpOnly" in answer.headers["Set-Cookie"]
    assert "SameSite=Strict" in answer.headers["Set-Cookie"]
    # Neither the page that it gives nor the cookie holds the token.
    assert gated.token not in body.decode() + answer.headers["Set-Cookie"]
    assert answer.headers["Referrer-Policy"] == "no-referrer"


def test_with_the_cookie_the_page_is_there(gated):
    answer, body = get(gated, "/", Cookie=cookie_of(gated))
    assert answer.status == 200
    assert b"viser" in body.lower()
    assert answer.headers["X-Frame-Options"] == "DENY"
    assert get(gated, "/none.js", Cookie=cookie_of(gated))[0].status == 404


def test_a_websocket_needs_the_cookie_and_this_origin(gated):
    with pytest.raises(InvalidStatus, match="401"):
        opened(gated, own(gated))
    cookie = cookie_of(gated)
    for origin in ("http://elsewhere.example", f"http://localhost:{gated.port}", "null", None):
        with pytest.raises(InvalidStatus, match="403"):
            opened(gated, origin, Cookie=cookie)


def test_through_it_viser_speaks_and_is_spoken_to(gated):
    import msgspec
    import zstandard

    field = gated.server.gui.add_text("Field", "before")
    with opened(gated, own(gated), Cookie=cookie_of(gated)) as socket:
        heard = b""
        while b"behind the gate" not in heard:
            # Two sizes, then what is said, compressed, then arrays.
            message = socket.recv(timeout=10)
            size = int.from_bytes(message[8:16], "little")
            heard = zstandard.ZstdDecompressor().decompress(message[16 : 16 + size])
        typed = {"type": "GuiUpdateMessage", "uuid": field._impl.uuid, "updates": {"value": "now"}}
        socket.send(msgspec.msgpack.encode(typed))
        until = time.monotonic() + 10.0
        while field.value != "now" and time.monotonic() < until:
            time.sleep(0.02)
        assert field.value == "now"


def test_connections_and_sizes_are_limited(gated, monkeypatch):
    cookie = cookie_of(gated)
    monkeypatch.setattr(access, "CONNECTIONS", 1)
    with opened(gated, own(gated), Cookie=cookie) as socket:
        with pytest.raises(InvalidStatus, match="503"):
            opened(gated, own(gated), Cookie=cookie)
        # Too large a message ends the connection.
        with pytest.raises(ConnectionClosed):
            flooded(socket)


def flooded(socket):
    socket.send(bytes(access.LARGEST_IN + 1))
    while True:
        socket.recv(timeout=10)


def test_a_page_for_other_computers_says_what_it_exposes_and_asks_for_the_token(capsys):
    with Page(FakeServoClient(), [], host="0.0.0.0", port=0, label="open") as page:
        for word in ("move the tool", "not encrypted", "token", "tunnel", page.url):
            assert word in page.notice
        assert page.url.startswith("http://")
        assert "0.0.0.0" not in page.url
        page.port = page.server.get_port()
        assert get(page)[0].status == 401
        assert get(page, page.url[page.url.index("/?token") :])[0].status == 200
    with pytest.raises(ConnectionRefusedError):
        get(page)


def test_a_page_for_this_computer_exposes_nothing():
    with Page(FakeServoClient(), [], port=0) as page:
        assert page.notice == ""
        assert "token" not in page.url


def test_an_address_that_is_not_ours_is_refused_in_one_line():
    with pytest.raises(AsperityError, match=r"^cannot serve on 192\.0\.2\.1:0: .+$"):
        Page(FakeServoClient(), [], host="192.0.2.1", port=0)


def test_a_server_that_nobody_guards_is_an_error():
    with pytest.raises(AsperityError, match="cannot be guarded"), guarded(TokenGate()):
        pass
