"""`asperity view`."""

from __future__ import annotations

import importlib.util
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command
from asperity.cli.realtime_run import DeviceOptions
from asperity.cli.result import announce, print_result
from asperity.errors import AsperityError

if TYPE_CHECKING:
    from asperity.viewer.server.server import OpenServer
    from asperity.viewer.session_config import SessionConfig

FIRST = "probe-plate"
"""Scene that is shown first by default."""
LOCAL = "127.0.0.1"
_PICTURES = (".png", ".jpg", ".jpeg")


@command
@dataclass
class ViewCommand:
    """Open a page in the browser on a running simulation: view it, move the tool, change settings.

    Without a device, the mouse moves the tool. By default only this computer can open the page.
    With --simulate a MuJoCo model moves by itself. Ends with Ctrl-C.
    """

    scene: Annotated[Positional[str | None], arg(metavar="SCENE")] = None
    """As for `asperity run`. Default: probe-plate; the others can be chosen in the page."""
    device: str = "mouse"
    """mouse, haply, touch, ...: see `asperity devices`."""
    port: Annotated[int, Range(0, 65535)] = 8080
    """Port of the page; 0: any free port. If it is in use, the next free one is taken."""
    host: str = LOCAL
    """Network address of the page. Any other lets other computers open it, with a token; a warning
    lists what that exposes."""
    out: Path = Path("out/view")
    """Folder for recordings."""
    no_open: bool = False
    """Print the address of the page without opening a browser."""
    triangles: Annotated[int, Range(1000, 2_000_000)] = 50_000
    """Largest number of triangles shown."""
    seconds: Annotated[float | None, Range(0.1, 86400.0, "s")] = None
    """Duration. Default: until Ctrl-C."""
    screenshot: Path | None = None
    """Write a picture of the page (PNG or JPEG), taken by a headless browser, and end."""
    options: Annotated[DeviceOptions, arg(name="")] = field(default_factory=DeviceOptions)
    coupling: str | None = None
    """Virtual coupling: direct, implicit, semi-implicit, static. Default: the scene's, else
    implicit."""
    seed: Annotated[int | None, Range(0, 2**31 - 1)] = None
    """Seed of random textures. Default: the scene's."""
    simulate: bool = False
    """SCENE is the file of a MuJoCo model, which runs by its own dynamics with the textures that it
    carries, or that textures.toml beside it gives it."""

    def run(self) -> None:
        """Serve the page until the end."""
        if self.screenshot is not None and self.screenshot.suffix.lower() not in _PICTURES:
            raise AsperityError(f"--screenshot must be a .png or .jpg file, got {self.screenshot}")
        if importlib.util.find_spec("viser") is None:
            raise AsperityError("the page needs viser: pip install 'asperity[view]'")
        if self.simulate:
            self._simulate()
            return
        if self.screenshot is not None:
            from asperity.viewer.browser import require_browser

            require_browser()  # before half a minute of start
        if self.screenshot is not None:
            self._take_picture(self._config(), self.screenshot)
        else:
            self._show()

    def _show(self) -> None:
        """Serve the page until the end.

        Browsers load, which takes them seconds, while the page is made.
        """
        config = self._config()
        from asperity.simulation.tool_contact import announce_compiling
        from asperity.viewer.link import LinkRequests
        from asperity.viewer.server.server import OpenServer
        from asperity.viewer.servo_client import ServoClient

        with ExitStack() as ending:
            title = f"asperity: {config.scene.name}"
            server = OpenServer(self.host, self.port, title, LinkRequests())
            ending.callback(server.close)
            if config.is_mouse:  # which cannot be absent
                self._invite(server, config, config.device)
            from asperity.viewer.app import live_page

            announce_compiling()
            servo = ServoClient(config)
            ending.callback(servo.close)
            shown = live_page(servo, self.out, self.triangles, at=server)
            # The picture first: the loop, which compiles or loads, would take a core from it.
            page = ending.enter_context(shown)
            servo.start()
            if not config.is_mouse:
                self._invite(server, config, servo.device)
            try:
                page.wait(self.seconds)
            except KeyboardInterrupt:
                announce("ended")

    def _invite(self, server: OpenServer, config: SessionConfig, device: str) -> None:
        """Print the address of the page, and open it in the browser."""
        if server.notice:
            announce(server.notice)
        name = config.scene.name
        print_result(
            f"{server.url}  ({name}, {device}; Ctrl-C ends it)",
            {"url": server.url, "scene": name, "device": device},
        )
        if not self.no_open:
            import webbrowser

            webbrowser.open(server.url)

    def _simulate(self) -> None:
        """Show a MuJoCo model that runs in real time."""
        from asperity.mujoco.page import ModelPage, run_on_page, surfaces_of_file

        if self.scene is None or self.host != LOCAL or self.screenshot is not None:
            raise AsperityError("--simulate needs a model file, without --host and --screenshot")
        model = Path(self.scene)
        surfaces = surfaces_of_file(model)
        with ModelPage(surfaces, port=self.port, triangles=self.triangles) as page:
            print_result(
                [*surfaces.notes, f"{page.url}  ({model.name}; Ctrl-C ends it)"],
                {"url": page.url, "model": model, "notes": list(surfaces.notes)},
            )
            if not self.no_open:
                import webbrowser

                webbrowser.open(page.url)
            lasted = run_on_page(surfaces, page, self.seconds)
        announce(f"ended after {lasted:.2f} s of the model's time")

    def _take_picture(self, config: SessionConfig, picture: Path) -> None:
        """Write a picture of the page; an interruption reports whether it was written."""
        from asperity.viewer.app import live_page
        from asperity.viewer.browser import take_picture
        from asperity.viewer.servo_client import ServoClient

        before = _version(picture)
        try:
            with (
                ServoClient(config) as servo,
                live_page(servo, self.out, self.triangles, host=self.host, port=self.port) as page,
            ):
                take_picture(page, picture)
                print_result(
                    f"{picture}: {servo.config.scene.name}",
                    {"picture": picture, "scene": servo.config.scene.name},
                )
        except KeyboardInterrupt:
            # Also while the browser was being closed, after it had written the picture.
            taken = _version(picture) not in (None, before)
            raise KeyboardInterrupt(f"{picture} is written" if taken else "") from None

    def _config(self) -> SessionConfig:
        """Return the session that the page starts with."""
        from asperity.cli.realtime_run import parse_device_options
        from asperity.dynamics.virtual_coupling.settings import COUPLING_MODES
        from asperity.errors import require_choice
        from asperity.scene.builtin import load_scene
        from asperity.viewer.changes import on_coupling
        from asperity.viewer.session_config import SessionConfig

        if self.coupling is not None:
            require_choice("--coupling", self.coupling, COUPLING_MODES)
        source = self.scene or FIRST
        return SessionConfig(
            on_coupling(load_scene(source, seed=self.seed), self.coupling),
            source,
            self.device,
            options=parse_device_options(self.options.device_option),
            **self.options.session(),
        )


def _version(file: Path) -> int | None:
    """Return what changes when a file is written; None if there is none."""
    return file.stat().st_mtime_ns if file.is_file() else None
