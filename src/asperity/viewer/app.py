"""The live page as a whole: all panels on a link; for others than this computer with a token."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from asperity.viewer.panels.all_panels import live_panels
from asperity.viewer.panels.instruments import instruments
from asperity.viewer.server.proxy import Proxy, is_local
from asperity.viewer.server.server import LOCAL, Page, serve
from asperity.viewer.servo_client import ServoClient


@contextmanager
def live_page(
    link: ServoClient, folder: Path, triangles: int, *, host: str = LOCAL, port: int = 8080
) -> Iterator[Page]:
    """Give the page of a link that has been started, until the block ends.

    Parameters
    ----------
    link : Link
    folder : Path
        Where recordings go.
    triangles : int
        Shown at most.
    host, port : str, int
        On any address but this computer's own, a `Proxy` stands before the page; what that
        exposes, and the address with its token, is printed.
    """
    shown, panels = instruments(link, folder)
    local = is_local(host)
    link_: Any = shown  # has all that a link has
    with serve(
        link_,
        lambda: [*live_panels(triangles), *panels],
        host=host if local else LOCAL,
        port=port if local else 0,
    ) as page:
        if local:
            yield page
            return
        with Proxy(host, port, page.server.get_port()) as proxy:
            print(proxy.told, flush=True)
            yield page
