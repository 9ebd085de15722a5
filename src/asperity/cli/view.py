"""`asperity view`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from asperity.cli.ranges import Between, check_ranges
from asperity.cli.realtime_run import DeviceOptions
from asperity.errors import AsperityError

if TYPE_CHECKING:
    from asperity.viewer.session_config import SessionConfig

FIRST = "probe-plate"
"""What is shown first if nothing is said."""

_PICTURES = (".png", ".jpg", ".jpeg")


@dataclass
class ViewCommand:
    """Open a page in the browser on a scene that is being felt: see it, move it, change it.

    Without a device, the mouse moves the tool. The page is for this computer alone, unless
    --host says otherwise. Ends with Ctrl-C.
    """

    scene: Annotated[Positional[str | None], arg(metavar="SCENE")] = None
    """As for `asperity run`. Default: probe-plate; the page offers the others."""
    device: str = "mouse"
    """mouse, haply, touch, ...: see `asperity devices`."""
    port: Annotated[int, Between(0, 65535)] = 8080
    """Of the page; 0: any that is free. If it is taken, the next that is free."""
    host: str = "127.0.0.1"
    """Another address opens the page to other computers, with a token; says what that exposes."""
    out: Path = Path("out/view")
    """Folder for recordings."""
    no_open: bool = False
    """Do not open a browser; only say where the page is."""
    triangles: Annotated[int, Between(1000, 2_000_000)] = 50_000
    """Shown at most."""
    seconds: Annotated[float | None, Between(0.1, 86400.0)] = None
    """How long. Default: until Ctrl-C."""
    screenshot: Path | None = None
    """Write a picture of the page as a PNG or JPEG, by a browser without a window, and end."""
    options: OmitArgPrefixes[DeviceOptions] = field(default_factory=DeviceOptions)
    coupling: str | None = None
    """direct, implicit, semi-implicit, static. Default: as the scene says, else implicit."""
    seed: Annotated[int | None, Between(0, 2**31 - 1)] = None
    """Of textures that have one. Default: as the scene says."""

    def run(self) -> None:
        """Serve the page until it is over."""
        check_ranges(self.options)
        check_ranges(self)
        if self.screenshot is not None and self.screenshot.suffix.lower() not in _PICTURES:
            raise AsperityError(f"--screenshot must be a .png or .jpg file, got {self.screenshot}")
        from asperity.viewer.server.server import require_viser

        require_viser()
        choice = self._choice()
        from asperity.simulation.simulation import announce_compiling
        from asperity.viewer.app import live_page
        from asperity.viewer.servo_client import ServoClient

        announce_compiling()
        if self.screenshot is not None:
            self._take(choice, self.screenshot)
            return
        with (
            ServoClient(choice) as link,
            live_page(link, self.out, self.triangles, host=self.host, port=self.port) as page,
        ):
            print(f"{page.url}  ({choice.scene.name}, {link.device}; Ctrl-C ends it)", flush=True)
            if not self.no_open:
                import webbrowser

                webbrowser.open(page.url)
            try:
                page.wait(self.seconds)
            except KeyboardInterrupt:
                print("ended")

    def _take(self, choice: SessionConfig, picture: Path) -> None:
        """Write a picture of the page; whoever stops it is told whether there is one."""
        from asperity.viewer.app import live_page
        from asperity.viewer.browser import take_picture
        from asperity.viewer.servo_client import ServoClient

        taken = False
        try:
            with (
                ServoClient(choice) as link,
                live_page(link, self.out, self.triangles, host=self.host, port=self.port) as page,
            ):
                take_picture(page, picture)
                taken = True
                print(f"{picture}: {link.choice.scene.name}")
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"{picture} is written" if taken else "") from None

    def _choice(self) -> SessionConfig:
        """Return what to begin with."""
        from asperity.cli.realtime_run import key_values
        from asperity.dynamics.virtual_coupling.settings import MODES
        from asperity.errors import require_choice
        from asperity.realtime.servo.safety import SafetySettings
        from asperity.scene.builtin import load_scene
        from asperity.viewer.changes import on_coupling
        from asperity.viewer.session_config import SessionConfig

        if self.coupling is not None:
            require_choice("--coupling", self.coupling, MODES)
        source = self.scene or FIRST
        options = self.options
        return SessionConfig(
            on_coupling(load_scene(source, seed=self.seed), self.coupling),
            source,
            self.device,
            options=key_values(options.device_option),
            rate=options.rate_hz,
            passivity=not options.no_passivity,
            mapping={
                "scale": options.scale, "force_scale": options.force_scale,
                "clutch_button": options.clutch_button,
            },
            safety=SafetySettings(max_force=options.max_force_n),
            real_time=options.real_time,
        )  # fmt: skip
