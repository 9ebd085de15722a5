"""The page's server: viser, the panels, and a thread that updates them 30 times a second."""

from __future__ import annotations

import contextlib
import io
import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from asperity.errors import AsperityError
from asperity.viewer.link import LinkRequests
from asperity.viewer.panels.panel import Frame, Panel, ViewModel
from asperity.viewer.server.access import TokenGate, guarded, is_local, own_origin, require_address
from asperity.viewer.server.pace import UpdatePace, step_back
from asperity.viewer.server.uploads import bound_uploads
from asperity.viewer.servo_client import ServoClient

if TYPE_CHECKING:
    import viser

LOCAL = "127.0.0.1"
_WAITING = (
    '<div role="status" style="padding:0.3em 1em;font-size:0.9em">'
    "The scene is being made ready ...</div>"
)
MISSING = "the page needs viser: pip install 'asperity[view]'"


def require_viser() -> Any:
    """Return the package viser; raise AsperityError if it is not installed."""
    try:
        import viser
    except ImportError:
        raise AsperityError(MISSING) from None
    return viser


def start_server(
    host: str,
    port: int,
    label: str,
    gate: TokenGate | None = None,
    links: LinkRequests | None = None,
) -> viser.ViserServer:
    """Start and return viser, guarded; see `Page` for the arguments and what is raised."""
    viser = require_viser()
    require_address(host, port)
    check = links.watching(gate or own_origin) if links else gate or own_origin
    guard = guarded(check, **(gate.limits if gate else {}))
    # viser prints to standard output, which belongs to the command.
    with guard, contextlib.redirect_stdout(io.StringIO()):
        server: Any = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    bound_uploads(server)
    server.gui.configure_theme(
        control_width="large", show_logo=False, show_share_button=False,
        brand_color=(0, 114, 178),
    )  # fmt: skip
    return server


class OpenServer:
    """A server that browsers can open, before there is a page: a line shows that it is being made.

    So browsers load, which takes them seconds, while scene and page are made.

    Parameters
    ----------
    host, port, label, links
        As of `Page`.

    Raises
    ------
    AsperityError
        viser is not installed, or the address cannot be used.
    """

    def __init__(
        self, host: str = LOCAL, port: int = 8080, label: str = "asperity",
        links: LinkRequests | None = None,
    ) -> None:  # fmt: skip
        self._gate = None if is_local(host) else TokenGate()
        self.links, self._closed = links, False
        self.viser: Any = start_server(host, port, label, self._gate, links)
        self._waiting = self.viser.gui.add_html(_WAITING)
        # An empty page costs a browser nothing, but for viser's own axes and reflections.
        self.viser.scene.world_axes.visible = False
        self.viser.scene.configure_default_lights(False)
        self.viser.scene.configure_environment_map(None)

    @property
    def url(self) -> str:
        """Address of the page, with the token if one is required."""
        host, port = self.viser.get_host(), self.viser.get_port()
        return self._gate.url(host, port) if self._gate else f"http://{host}:{port}"

    @property
    def notice(self) -> str:
        """What is printed at the start if other computers can reach the page, else ""."""
        host, port = self.viser.get_host(), self.viser.get_port()
        return self._gate.notice(host, port) if self._gate else ""

    @contextlib.contextmanager
    def building(self) -> Iterator[None]:
        """Show all that is built within the block at once, in place of the line."""
        with self.viser.atomic():
            yield
            self._waiting.remove()

    def close(self) -> None:
        """Take the server down; may be called twice."""
        if not self._closed:
            self._closed = True
            stop_server(self.viser)


def stop_server(server: viser.ViserServer) -> None:
    """Stop viser, which would print that it has."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


class Page:
    """A server with panels for a servo client.

    Parameters
    ----------
    servo : ServoClient
        Started.
    panels : sequence of Panel
    host, port : str, int
        Port 0: any that is free. At any address but the loopback, a token is required.
    label : str
        Title of the page.
    links : LinkRequests, optional
        Notes links that browsers open.
    at : OpenServer, optional
        In place of host, port, label and links.

    Raises
    ------
    AsperityError
        viser is not installed, or the address cannot be used.
    """

    def __init__(
        self,
        servo: ServoClient,
        panels: Sequence[Panel],
        *,
        host: str = LOCAL,
        port: int = 8080,
        label: str = "asperity",
        links: LinkRequests | None = None,
        at: OpenServer | None = None,
    ) -> None:
        self.servo, self.panels = servo, list(panels)
        self._at = at or OpenServer(host, port, label, links)
        self.server = self._at.viser
        self.updates = 0
        """Number of updates of the panels."""
        self.pace = UpdatePace()
        """How often the panels are updated."""
        self._view_model = ViewModel(servo)
        self._stopping, self._paused = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="asperity-page", daemon=True)
        try:
            with self._at.building():
                self._build()
        except BaseException:
            self._at.close()
            raise
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page, with the token if one is required."""
        return self._at.url

    @property
    def notice(self) -> str:
        """What is printed at the start if other computers can reach the page, else ""."""
        return self._at.notice

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the page is closed, at most `seconds` [s]; return whether it is."""
        return self._stopping.wait(seconds)

    def pause(self, paused: bool = True) -> None:
        """Freeze the page or let it continue; the loop ticks in either case."""
        (self._paused.set if paused else self._paused.clear)()

    def close(self) -> None:
        """Take the page down; the servo client stays."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(2.0)
        for panel in self.panels:
            panel.close()
        self._at.close()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _build(self) -> None:
        gui = self.server.gui
        titles = list(dict.fromkeys(panel.title for panel in self.panels if panel.title))
        tabs = {}
        if titles:
            group = gui.add_tab_group()
            tabs = {title: group.add_tab(title) for title in titles}
        for panel in self.panels:
            if panel.title:
                with tabs[panel.title]:
                    panel.build(self.server, self.servo)
            else:
                panel.build(self.server, self.servo)

    def _run(self) -> None:
        step_back()
        due = time.perf_counter()
        well = list(self.panels)
        while not self._stopping.is_set():
            if self._paused.is_set():
                self._stopping.wait(0.05)
                continue
            frame = self._view_model.frame(time.perf_counter())
            with self.server.atomic():
                for panel in tuple(well):
                    if not _updated(panel, frame):
                        well.remove(panel)
            self.updates += 1
            interval = self.pace.interval(frame, self.servo.parameters.rate)
            due = max(due + interval, time.perf_counter())
            self._stopping.wait(due - time.perf_counter())


def _updated(panel: Panel, frame: Frame) -> bool:
    """Update a panel; return whether it succeeded."""
    try:
        panel.update(frame)
    except Exception:  # a failing panel must not stop the others
        logging.getLogger(__name__).exception("a part of the page failed: %s", panel.title)
        return False
    return True


def serve(
    servo: ServoClient,
    make_panels: Callable[[], Sequence[Panel]],
    *,
    host: str = LOCAL,
    port: int = 8080,
    links: LinkRequests | None = None,
    at: OpenServer | None = None,
) -> Page:
    """Start and return the page of a servo client, as `Page`. Close it when done."""
    scene = servo.config.scene.name
    label = f"asperity: {scene}"
    return Page(servo, make_panels(), host=host, port=port, label=label, links=links, at=at)
