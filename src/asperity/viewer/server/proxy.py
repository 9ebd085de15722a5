"""The page for other computers: a small proxy that requires a token.

viser serves anyone who reaches it, so it stays on 127.0.0.1. The proxy stands before it on another
address:

    browser --> token, cookie, origin, limits --> viser on 127.0.0.1

A browser that comes with the printed address, which contains the token, gets a cookie for this
server only (HttpOnly, SameSite=Strict) and is sent on to the page. Without the cookie every request
is answered with 401. A websocket, which moves the tool, is opened only with the cookie and only for
a page of this very address. Sizes, connections and times are limited.

There is no TLS: see `EXPOSED`.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import http
import http.client
import ipaddress
import logging
import secrets
import threading
import urllib.parse
from concurrent.futures import Future
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Any

from asperity.errors import AsperityError

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

LARGEST_IN = 16 * 2**20
"""Largest message from a browser [bytes]; files are sent in pieces of half a MiB."""
LARGEST_OUT = 64 * 2**20
"""Largest message or file from viser [bytes]."""
CONNECTIONS = 8
"""Largest number of websockets at a time."""
REQUESTS = 16
"""Largest number of file requests at a time."""
_PATIENCE = 10.0
_PASSED_ON = ("Content-Type", "Content-Encoding")
_LOG = logging.getLogger(__name__)

EXPOSED = (
    "The page is open to other computers on {where}. Whoever has the address below can see the "
    "scene, move the tool, and with it a device in somebody's hand, change every setting, send "
    "files to be read as textures, and download recordings. The connection is not encrypted: "
    "who can read this network's traffic can read the token and do the same. Use it in a network "
    "that you trust, or through a tunnel (ssh -L); other users of this computer reach the page "
    "without a token. It ends with this program."
)


def is_local(host: str) -> bool:
    """Return whether an address can be reached from this computer only."""
    if host == "localhost":
        return True
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return False


class Proxy:
    """A server in its own thread, before a viser server on this computer.

    Parameters
    ----------
    host, port : str, int
        Where to serve; port 0: any that is free.
    upstream : int
        Port of viser on 127.0.0.1.
    token : str, optional
        Default: 256 random bits.

    Raises
    ------
    AsperityError
        The address cannot be used.
    """

    def __init__(self, host: str, port: int, upstream: int, *, token: str | None = None) -> None:
        self.host, self.port = host, port
        self.token = token or secrets.token_urlsafe(32)
        self._session = secrets.token_urlsafe(32)
        self._upstream = upstream
        self._open = self._fetching = 0
        self._loop = asyncio.new_event_loop()
        self._stopping: asyncio.Event | None = None
        self._ready: Future[int] = Future()
        self._thread = threading.Thread(target=self._run, name="asperity-proxy", daemon=True)
        self._thread.start()
        try:
            self.port = self._ready.result(_PATIENCE)
        except OSError as error:
            reason = error.strerror or error
            raise AsperityError(f"cannot serve on {host}:{port}: {reason}") from None

    @property
    def url(self) -> str:
        """Address with the token, for a browser."""
        return f"http://{_address(self.host)}:{self.port}/?token={self.token}"

    @property
    def notice(self) -> str:
        """What is printed at the start: what the proxy exposes, and the address."""
        where = f"{self.host}, port {self.port}"
        return f"{EXPOSED.format(where=where)}\n\n    {self.url}\n"

    def close(self) -> None:
        """End the server and all its connections."""
        if self._stopping is not None and not self._loop.is_closed():
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._stopping.set)
            self._thread.join(_PATIENCE)

    def __enter__(self) -> Proxy:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- the server ----------------------------------------------------------------------------

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except OSError as error:
            if not self._ready.done():
                self._ready.set_exception(error)
        finally:
            self._loop.close()

    async def _serve(self) -> None:
        from websockets.asyncio.server import serve

        self._stopping = asyncio.Event()
        async with serve(
            self._bridge, self.host, self.port,
            process_request=self._answer,
            select_subprotocol=lambda _, offered: offered[0] if offered else None,
            max_size=LARGEST_IN, max_queue=16, compression=None, open_timeout=_PATIENCE,
            close_timeout=1.0, server_header=None, logger=_quiet(),
        ) as server:  # fmt: skip
            self._ready.set_result(next(iter(server.sockets)).getsockname()[1])
            await self._stopping.wait()

    async def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a file; accept or refuse a websocket."""
        target = urllib.parse.urlsplit(request.path)
        given = urllib.parse.parse_qs(target.query).get("token", [""])[0]
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return self._refused_socket(request)
        if given:
            if _same(given, self.token):
                return self._welcomed()
            return _plain(http.HTTPStatus.UNAUTHORIZED, "The token is wrong.")
        if not self._is_known(request):
            return _plain(
                http.HTTPStatus.UNAUTHORIZED,
                "Open the address that asperity printed: it holds the token.",
            )
        if self._fetching >= REQUESTS:
            return _plain(http.HTTPStatus.SERVICE_UNAVAILABLE, "Too many requests at once.")
        self._fetching += 1
        try:
            return await asyncio.to_thread(self._fetched, request)
        finally:
            self._fetching -= 1

    def _refused_socket(self, request: Request) -> Response | None:
        """Return the refusal of a websocket, or None if it is accepted."""
        if not self._is_known(request):
            return _plain(http.HTTPStatus.UNAUTHORIZED, "No token.")
        origins = request.headers.get_all("Origin")
        host = request.headers.get("Host", "")
        mine = {f"http://{host}", f"https://{host}"}
        if len(origins) != 1 or origins[0] not in mine:
            return _plain(http.HTTPStatus.FORBIDDEN, "Not for pages of another origin.")
        if self._open >= CONNECTIONS:
            return _plain(http.HTTPStatus.SERVICE_UNAVAILABLE, "Too many connections.")
        return None

    @property
    def _cookie(self) -> str:
        # All servers of a host share cookies, whatever their ports.
        return f"asperity-{self.port}"

    def _is_known(self, request: Request) -> bool:
        """Return whether a request has the cookie."""
        for text in request.headers.get_all("Cookie"):
            with contextlib.suppress(CookieError):
                morsel = SimpleCookie(text).get(self._cookie)
                if morsel is not None and _same(morsel.value, self._session):
                    return True
        return False

    def _welcomed(self) -> Response:
        """Set the cookie, and lead on to the page, whose address has no token.

        By a page and not by a redirect, as a browser coming from another site would not send a
        strict cookie along with a redirect.
        """
        page = (
            '<!doctype html><meta http-equiv="refresh" content="0;url=/"><title>asperity</title>'
            '<a href="/">asperity</a>'
        )
        cookie = f"{self._cookie}={self._session}; Path=/; HttpOnly; SameSite=Strict"
        return _response(
            http.HTTPStatus.OK, page.encode(),
            {"Content-Type": "text/html; charset=utf-8", "Set-Cookie": cookie},
        )  # fmt: skip

    def _fetched(self, request: Request) -> Response:
        """Return viser's answer to a request for a file."""
        upstream = http.client.HTTPConnection("127.0.0.1", self._upstream, timeout=_PATIENCE)
        try:
            accepted = request.headers.get("Accept-Encoding", "identity")
            upstream.request("GET", request.path, headers={"Accept-Encoding": accepted})
            answer = upstream.getresponse()
            body = answer.read(LARGEST_OUT + 1)
        except (OSError, http.client.HTTPException):
            return _plain(http.HTTPStatus.BAD_GATEWAY, "The page does not answer.")
        finally:
            upstream.close()
        if len(body) > LARGEST_OUT:
            return _plain(http.HTTPStatus.BAD_GATEWAY, "Too large.")
        headers = {name: answer.headers[name] for name in _PASSED_ON if name in answer.headers}
        return _response(http.HTTPStatus(answer.status), body, headers)

    async def _bridge(self, browser: ServerConnection) -> None:
        """Pass messages both ways until one end is gone."""
        from websockets.asyncio.client import connect
        from websockets.exceptions import ConnectionClosed, WebSocketException

        # Counted here and not on acceptance, as the browser may leave between the two.
        if self._open >= CONNECTIONS:
            await browser.close(1013, "too many connections")
            return
        self._open += 1
        offered = [browser.subprotocol] if browser.subprotocol else None
        here = f"127.0.0.1:{self._upstream}"
        try:
            async with connect(
                f"ws://{here}", origin=f"http://{here}",
                subprotocols=offered, max_size=LARGEST_OUT, max_queue=16, compression=None,
                open_timeout=_PATIENCE, close_timeout=1.0, proxy=None,
            ) as page:  # fmt: skip
                ways = [
                    asyncio.create_task(_pass_on(browser, page)),
                    asyncio.create_task(_pass_on(page, browser)),
                ]
                _, waiting = await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                for way in waiting:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        except (OSError, WebSocketException, ConnectionClosed, TimeoutError) as error:
            _LOG.debug("a connection through the proxy ended: %s", error)
        finally:
            self._open -= 1
            await browser.close()


async def _pass_on(source: Any, sink: Any) -> None:
    """Pass messages on as they come; a slow sink delays the source."""
    async for message in source:
        await sink.send(message)


def _same(given: str, right: str) -> bool:
    """Compare in a time that does not depend on how much of the text is right."""
    return hmac.compare_digest(given.encode(), right.encode())


def _plain(status: http.HTTPStatus, text: str) -> Response:
    return _response(status, f"{text}\n".encode(), {"Content-Type": "text/plain; charset=utf-8"})


def _response(status: http.HTTPStatus, body: bytes, headers: dict[str, str]) -> Response:
    from websockets.datastructures import Headers
    from websockets.http11 import Response as Answer

    all_headers = {
        **headers,
        "Content-Length": str(len(body)),
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
        "Connection": "close",
    }
    return Answer(status.value, status.phrase, Headers(all_headers), body)


def _address(host: str) -> str:
    """Return a host as part of an address; for all addresses, this computer's name."""
    if host in ("0.0.0.0", "::", ""):
        import socket

        return socket.gethostname()
    return f"[{host}]" if ":" in host else host


def _quiet() -> logging.Logger:
    """Return a silent logger: what strangers send does not concern the user."""
    logger = logging.getLogger(f"{__name__}.websockets")
    logger.setLevel(logging.CRITICAL)
    return logger
