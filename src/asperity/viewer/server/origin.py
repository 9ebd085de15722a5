"""Access control by origin: browsers that show this very page, and programs on this computer.

A page of any other origin can open a websocket to 127.0.0.1; the browser permits it and only states
the origin in the header `Origin`. A foreign host name can even be made to resolve to this computer,
which shows in the header `Host`. So a request is answered only if its host is a known name of the
page and its origin, if it has one, is that same host.
"""

from __future__ import annotations

import contextlib
import http
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any
from urllib.parse import urlsplit

LOCAL_HOSTS = ("127.0.0.1", "localhost", "[::1]")


def refusal(headers: Mapping[str, str], port: int, hosts: Iterable[str] = LOCAL_HOSTS) -> str:
    """Return why a request is refused, or "" if it is not.

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


@contextlib.contextmanager
def own_origin_only(hosts: Iterable[str] = LOCAL_HOSTS) -> Iterator[None]:
    """Make a server that viser starts within the block refuse requests as `refusal` does.

    viser has no option for this. It passes its own `process_request` to websockets, which is called
    here after `refusal`.
    """
    import websockets.asyncio.server as module

    usual = module.serve
    known = tuple(hosts)

    def serve(handler: Any, host: Any, port: Any, **options: Any) -> Any:
        answer = options.pop("process_request", None)
        return usual(handler, host, port, process_request=_after_refusal(answer, known), **options)

    module.serve = serve
    try:
        yield
    finally:
        module.serve = usual


def _after_refusal(answer: Callable[..., Any] | None, hosts: tuple[str, ...]) -> Callable[..., Any]:
    def process_request(connection: Any, request: Any) -> Any:
        port = int(connection.local_address[1])
        why = refusal(request.headers, port, hosts)
        if why:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{why}\n")
        return None if answer is None else answer(connection, request)

    return process_request
