"""Who may talk to the page: browsers that show this very page, and programs of this computer.

A page of any other origin can open a websocket to 127.0.0.1 as well as ours can; the browser lets
it, and only says so in the header `Origin`. A name of its own may even be made to point here, which
the header `Host` tells. So a request is answered only if its host is one of those that the page has
been given, and if its origin, where it has one, is that same host.
"""

from __future__ import annotations

import contextlib
import http
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any
from urllib.parse import urlsplit

LOCAL_HOSTS = ("127.0.0.1", "localhost", "[::1]")


def refusal(headers: Mapping[str, str], port: int, hosts: Iterable[str] = LOCAL_HOSTS) -> str:
    """Return why a request is not answered, or nothing if it is.

    Parameters
    ----------
    headers : mapping
        Of the request, whatever the case of its names.
    port : int
        That it came to.
    hosts : iterable of str
        Names under which the page is known.
    """
    host = headers.get("Host", "")
    known = {f"{name}:{port}" for name in hosts}
    if port == 80:
        known |= set(hosts)
    if host.lower() not in known:
        return "this page is not known under that name"
    origin = headers.get("Origin")
    if origin is None:  # no browser
        return ""
    parts = urlsplit(origin)
    if parts.scheme not in ("http", "https") or parts.netloc.lower() != host.lower():
        return "pages of other origins may not use this one"
    return ""


@contextlib.contextmanager
def own_origin_only(hosts: Iterable[str] = LOCAL_HOSTS) -> Iterator[None]:
    """Let a server that viser starts within the block answer only what `refusal` lets through.

    viser has no option for this; it hands its own `process_request` to websockets, which is asked
    here after ours.
    """
    import websockets.asyncio.server as module

    usual = module.serve
    known = tuple(hosts)

    def serve(handler: Any, host: Any, port: Any, **options: Any) -> Any:
        answer = options.pop("process_request", None)
        return usual(handler, host, port, process_request=_asked(answer, known), **options)

    module.serve = serve
    try:
        yield
    finally:
        module.serve = usual


def _asked(answer: Callable[..., Any] | None, hosts: tuple[str, ...]) -> Callable[..., Any]:
    def process_request(connection: Any, request: Any) -> Any:
        port = int(connection.local_address[1])
        why = refusal(request.headers, port, hosts)
        if why:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{why}\n")
        return None if answer is None else answer(connection, request)

    return process_request
