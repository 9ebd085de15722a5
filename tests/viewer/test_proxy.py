"""The proxy before the page: who comes in, and who does not."""

import http.client
import time

import pytest

pytest.importorskip("viser", reason="needs viser (asperity[view])")
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from asperity.errors import AsperityError
from asperity.viewer.server import proxy as proxy_module
from asperity.viewer.server.proxy import Proxy


@pytest.fixture(scope="module")
def viser_server():
    import viser

    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    server.gui.add_markdown("behind the proxy")
    yield server
    server.stop()


@pytest.fixture
def proxy(viser_server):
    with Proxy("127.0.0.1", 0, viser_server.get_port()) as proxy:
        yield proxy


def get(proxy, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", proxy.port, timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def cookie_of(proxy):
    answer, _ = get(proxy, f"/?token={proxy.token}")
    assert answer.status == 200
    return answer.headers["Set-Cookie"].split(";")[0]


def opened(proxy, origin, **headers):
    import viser

    return connect(
        f"ws://127.0.0.1:{proxy.port}/", origin=origin, additional_headers=headers,
        subprotocols=[f"viser-v{viser.__version__}"], max_size=None, proxy=None,
    )  # fmt: skip


def own(proxy):
    return f"http://127.0.0.1:{proxy.port}"


@pytest.mark.parametrize("path", ["/", "/index.html", "/?token=", "/?token=wrong", "/?token=%00"])
def test_without_the_token_there_is_no_page(proxy, path):
    answer, body = get(proxy, path)
    assert answer.status == 401
    assert len(body) < 200
    assert "Set-Cookie" not in answer.headers


def test_a_made_up_cookie_opens_nothing(proxy):
    for cookie in (f"asperity-{proxy.port}=made-up", f"asperity-{proxy.port}={proxy.token}", "=;;"):
        assert get(proxy, "/", Cookie=cookie)[0].status == 401
        with pytest.raises(InvalidStatus, match="401"):
            opened(proxy, own(proxy), Cookie=cookie)


def test_the_token_gives_a_cookie_that_other_sites_cannot_use(proxy):
    answer, body = get(proxy, f"/?token={proxy.token}")
    assert answer.status == 200
    assert "HttpOnly" in answer.headers["Set-Cookie"]
    assert "SameSite=Strict" in answer.headers["Set-Cookie"]
    # Neither the page that it gives nor the cookie holds the token.
    assert proxy.token not in body.decode() + answer.headers["Set-Cookie"]
    assert answer.headers["Referrer-Policy"] == "no-referrer"


def test_with_the_cookie_the_page_is_there(proxy):
    answer, body = get(proxy, "/", Cookie=cookie_of(proxy))
    assert answer.status == 200
    assert b"viser" in body.lower()
    assert answer.headers["X-Frame-Options"] == "DENY"
    assert get(proxy, "/none.js", Cookie=cookie_of(proxy))[0].status == 404


def test_a_websocket_needs_the_cookie_and_this_origin(proxy):
    with pytest.raises(InvalidStatus, match="401"):
        opened(proxy, own(proxy))
    cookie = cookie_of(proxy)
    for origin in ("http://elsewhere.example", f"http://localhost:{proxy.port}", "null", None):
        with pytest.raises(InvalidStatus, match="403"):
            opened(proxy, origin, Cookie=cookie)


def test_through_it_viser_speaks_and_is_spoken_to(proxy, viser_server):
    import msgspec
    import zstandard

    field = viser_server.gui.add_text("Field", "before")
    with opened(proxy, own(proxy), Cookie=cookie_of(proxy)) as socket:
        heard = b""
        while b"behind the proxy" not in heard:
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


def test_connections_and_sizes_are_limited(proxy, monkeypatch):
    cookie = cookie_of(proxy)
    monkeypatch.setattr(proxy_module, "CONNECTIONS", 1)
    with opened(proxy, own(proxy), Cookie=cookie) as socket:
        with pytest.raises(InvalidStatus, match="503"):
            opened(proxy, own(proxy), Cookie=cookie)
        # Too large a message ends the connection.
        with pytest.raises(ConnectionClosed):
            flooded(socket)


def flooded(socket):
    socket.send(bytes(proxy_module.LARGEST_IN + 1))
    while True:
        socket.recv(timeout=10)


def test_it_says_what_it_exposes(proxy):
    message = proxy.notice
    for word in ("move the tool", "not encrypted", "token", "tunnel", proxy.url):
        assert word in message


def test_an_address_that_is_not_ours_is_refused_in_one_line(viser_server):
    with pytest.raises(AsperityError, match=r"^cannot serve on 192\.0\.2\.1:0: .+$"):
        Proxy("192.0.2.1", 0, viser_server.get_port())


def test_it_ends(viser_server):
    proxy = Proxy("127.0.0.1", 0, viser_server.get_port())
    proxy.close()
    with pytest.raises(ConnectionRefusedError):
        get(proxy)
    assert not proxy._thread.is_alive()
    proxy.close()
