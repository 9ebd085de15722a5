"""Who may use the page: browsers on this computer that show it, and elsewhere those with a token.

A page of any other origin can open a websocket to 127.0.0.1; the browser permits it and only states
the origin in the header `Origin`. A foreign host name can even be made to resolve to this computer,
which shows in the header `Host`. So `own_origin` answers a request only if its host is a known name
of the page and its origin, if it has one, is that same host.

At an address that other computers reach, a `TokenGate` answers. A browser that comes with the
printed address, which contains the token, gets a cookie for this server only (HttpOnly,
SameSite=Strict) and is sent on to the page. Without the cookie every request is answered with 401.
A websocket, which moves the tool, is opened only with the cookie and only for a page of this very
address. Sizes, connections and times are limited. There is no TLS: see `EXPOSED`.
"""

from __future__ import annotations

import contextlib
import hmac
import ipaddress
import logging
import secrets
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from asperity.errors import AsperityError

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

    Check = Callable[[ServerConnection, Request], Response | None]

LOCAL_HOSTS = ("127.0.0.1", "localhost", "[::1]")
LARGEST_IN = 16 * 2**20
"""Largest message from a browser elsewhere [bytes]; files are sent in pieces of half a MiB."""
CONNECTIONS = 8
"""Largest number of websockets at a time from elsewhere."""
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
_WELCOME = (
    '<!doctype html><meta http-equiv="refresh" content="0;url=/"><title>asperity</title>'
    '<a href="/">asperity</a>'
)

EXPOSED = (
    "The page is open to other computers on {host}, port {port}. Whoever has the address below can "
    "see the scene, move the tool, and with it a device in somebody's hand, change every setting, "
    "send files to be read as textures, and download recordings. The connection is not encrypted: "
    "who can read this network's traffic can read the token and do the same. Use it in a network "
    "that you trust, or through a tunnel (ssh -L). It ends with this program."
)


def is_local(host: str) -> bool:
    """Return whether an address can be reached from this computer only."""
    if host == "localhost":
        return True
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return False


def require_address(host: str, port: int) -> None:
    """Raise AsperityError if nothing can be served at an address; viser would wait for ever."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.create_server((host, 0), family=family).close()
    except OSError as error:
        reason = error.strerror or error
        raise AsperityError(f"cannot serve on {host}:{port}: {reason}") from None


@contextlib.contextmanager
def guarded(check: Check, **limits: Any) -> Iterator[None]:
    """Make a server that viser starts within the block answer only requests that pass a check.

    viser has no option for this. It passes its own `process_request` to websockets, which is called
    here after `check`.

    Parameters
    ----------
    check : callable
        Returns the answer to a request that is refused, and None to others.
    **limits
        Options of `websockets.asyncio.server.serve` in place of viser's.

    Raises
    ------
    AsperityError
        The server was started in another way, so nobody would check.
    """
    import websockets.asyncio.server as module

    usual, guards = module.serve, []

    def serve(handler: Any, host: Any, port: Any, **options: Any) -> Any:
        page: Check | None = options.pop("process_request", None)
        guards.append(check)

        def process_request(connection: ServerConnection, request: Request) -> Response | None:
            answer = check(connection, request)
            return page(connection, request) if answer is None and page is not None else answer

        options = {**options, **limits, "process_request": process_request}
        return usual(handler, host, port, **options)

    module.serve = serve
    try:
        yield
    finally:
        module.serve = usual
    if not guards:
        raise AsperityError("this version of viser cannot be guarded; install viser 1.1")


def refusal(headers: Mapping[str, str], port: int, hosts: Iterable[str] = LOCAL_HOSTS) -> str:
    """Return why a request is not from this very page, or "" if it is.

    Parameters
    ----------
    headers : mapping
        Of the request; names in any case.
    port : int
        At which it arrived.
    hosts : iterable of str
        Host names of the page.
    """
    host = headers.get("Host", "")
    known = {f"{name}:{port}" for name in hosts}
    if port == 80:
        known |= set(hosts)
    if host.lower() not in known:
        return "this page is not known under that name"
    origin = headers.get("Origin")
    if origin is None:  # not a browser
        return ""
    parts = urlsplit(origin)
    if parts.scheme not in ("http", "https") or parts.netloc.lower() != host.lower():
        return "pages of other origins may not use this one"
    return ""


def own_origin(connection: ServerConnection, request: Request) -> Response | None:
    """Refuse requests as `refusal` does."""
    why = refusal(request.headers, int(connection.local_address[1]))
    return connection.respond(HTTPStatus.FORBIDDEN, f"{why}\n") if why else None


class TokenGate:
    """Lets in browsers that have opened the address with the token.

    Attributes
    ----------
    token : str
        256 random bits.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(32)
        self._session = secrets.token_urlsafe(32)

    @property
    def limits(self) -> dict[str, Any]:
        """Options of the server: sizes and times, and no log of what strangers send."""
        logger = logging.getLogger(f"{__name__}.websockets")
        logger.setLevel(logging.CRITICAL)
        return {
            "max_size": LARGEST_IN, "max_queue": 16, "open_timeout": 10.0, "close_timeout": 1.0,
            "server_header": None, "logger": logger, "process_response": _protected,
        }  # fmt: skip

    def url(self, host: str, port: int) -> str:
        """Return the address with the token; if it is all addresses, by this computer's name."""
        if host in ("0.0.0.0", "::", ""):
            host = socket.gethostname()
        return f"http://{f'[{host}]' if ':' in host else host}:{port}/?token={self.token}"

    def notice(self, host: str, port: int) -> str:
        """Return what is printed at the start: what the page exposes, and its address."""
        return f"{EXPOSED.format(host=host, port=port)}\n\n    {self.url(host, port)}\n"

    def __call__(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the answer to a request that may not reach the page, and None to others."""
        # All servers of a host share cookies, whatever their ports.
        cookie = f"asperity-{connection.local_address[1]}"
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return self._refused_socket(connection, request, cookie)
        given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        if given and _same(given, self.token):
            # By a page and not by a redirect, as a browser coming from another site would not send
            # a strict cookie along with a redirect.
            answer = connection.respond(HTTPStatus.OK, _WELCOME)
            del answer.headers["Content-Type"]
            answer.headers["Content-Type"] = "text/html; charset=utf-8"
            answer.headers["Set-Cookie"] = (
                f"{cookie}={self._session}; Path=/; HttpOnly; SameSite=Strict"
            )
            return answer
        if given:
            return connection.respond(HTTPStatus.UNAUTHORIZED, "The token is wrong.\n")
        if not self._has_cookie(request, cookie):
            text = "Open the address that asperity printed: it holds the token.\n"
            return connection.respond(HTTPStatus.UNAUTHORIZED, text)
        return None

    def _refused_socket(
        self, connection: ServerConnection, request: Request, cookie: str
    ) -> Response | None:
        if not self._has_cookie(request, cookie):
            return connection.respond(HTTPStatus.UNAUTHORIZED, "No token.\n")
        host = request.headers.get("Host", "")
        if request.headers.get_all("Origin") not in ([f"http://{host}"], [f"https://{host}"]):
            return connection.respond(HTTPStatus.FORBIDDEN, "Not for pages of another origin.\n")
        if len(connection.server.connections) >= CONNECTIONS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "Too many connections.\n")
        return None

    def _has_cookie(self, request: Request, name: str) -> bool:
        for text in request.headers.get_all("Cookie"):
            with contextlib.suppress(CookieError):
                morsel = SimpleCookie(text).get(name)
                if morsel is not None and _same(morsel.value, self._session):
                    return True
        return False


def _protected(_: ServerConnection, __: Request, answer: Response) -> None:
    """Add the headers that keep the page out of caches, frames and referrers."""
    answer.headers.update(_HEADERS)


def _same(given: str, right: str) -> bool:
    """Compare in a time that does not depend on how much of the text is right."""
    return hmac.compare_digest(given.encode(), right.encode())
