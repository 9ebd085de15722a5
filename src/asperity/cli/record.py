"""`asperity record` and `asperity replay`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command
from asperity.cli.realtime_run import DeviceOptions
from asperity.cli.result import announce, print_result


@command
@dataclass
class RecordCommand:
    """Record a real-time session with a device until Ctrl-C.

    As `asperity run SCENE --device NAME`, but without figures: writes recording.h5 and
    summary.json.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """As for `asperity run`."""
    device: str = "simulated"
    """simulated, replay:FILE, haply, touch, ...: see `asperity devices`."""
    seconds: Annotated[float | None, Range(0.01, 86400.0, "s")] = None
    """Duration. Default: until Ctrl-C; of a simulated or replayed motion, its own."""
    options: Annotated[DeviceOptions, arg(name="")] = field(default_factory=DeviceOptions)
    coupling: str | None = None
    """Virtual coupling: direct, implicit, semi-implicit, static. Default: the scene's, else
    implicit."""
    seed: Annotated[int | None, Range(0, 2**31 - 1)] = None
    """Seed of random textures. Default: the scene's."""
    out: Path = Path("out/record")
    """Folder for the results."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Record."""
        from asperity.cli.realtime_run import run_on_device, servo_spec, with_coupling
        from asperity.scene.builtin import load_scene

        scene = with_coupling(load_scene(self.scene, seed=self.seed), self.coupling)
        spec = servo_spec(scene, self.device, self.options, self.seconds, None)
        run_on_device(spec, self.out, source=self.scene, figures=False, overwrite=self.overwrite)


@command
@dataclass
class ReplayCommand:
    """Show a recording in the browser, or play its handle motion through a scene again.

    Without --out: the page of `asperity view`, with a slider through the recording's time. With
    --out: no page; the recorded handle motion is simulated again, a new recording and figures are
    written, and the difference between the wrenches is printed. To replay on a real-time loop:
    `asperity run SCENE --device replay:FILE`.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """recording.h5, or the folder that contains it."""
    scene: str | None = None
    """Another scene for the motion. Default: the recording's."""
    port: Annotated[int, Range(0, 65535)] = 8080
    """Port of the page; 0: any free port."""
    no_open: bool = False
    """Print the address of the page without opening a browser."""
    out: Path | None = None
    """Simulate the motion again, with the results in this folder, instead of showing a page."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Show the page, or simulate the motion again."""
        from asperity.runs.recording import recording_file

        file = recording_file(self.file)
        if self.out is None:
            self._show(file)
        else:
            self._simulate(file, self.out)

    def _show(self, file: Path) -> None:
        from asperity.viewer.replayed import recording_page

        with recording_page(file, self.scene, port=self.port) as page:
            print_result(
                f"{page.url}  ({file}; Ctrl-C ends it)", {"url": page.url, "recording": file}
            )
            if not self.no_open:
                import webbrowser

                webbrowser.open(page.url)
            try:
                while not page.wait(0.2):
                    pass
            except KeyboardInterrupt:
                announce("ended")

    def _simulate(self, file: Path, out: Path) -> None:
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.realtime.servo.replay import replay, scene_of_recording
        from asperity.runs.recording import read_recording
        from asperity.runs.run_scene import take_pictures, write_figures, write_summary
        from asperity.simulation.tool_contact import announce_compiling

        recording = read_recording(file)
        scene = scene_of_recording(recording.attributes, self.scene, beside=file.parent)
        announce_compiling()
        with result_folder(out, overwrite=self.overwrite) as folder, progress_bars() as bars:
            task = bars.add_task(scene.name, total=len(recording.time))

            def show(i: int, rollout: Any) -> None:
                if i % 25 == 0 or i + 1 == len(rollout.time):
                    bars.update(task, completed=i + 1, total=len(rollout.time))

            done = replay(recording, scene, folder / "recording.h5", on_tick=show)
            write_summary(done, folder / "summary.json")
            write_figures(done, take_pictures(done, scene), folder)
        difference = done.summary["replay"]
        device, contact = difference["device_wrench"], difference["contact_wrench"]
        print_result(
            f"{out}: {difference['ticks']} ticks of {file} in {scene.name}; the device force "
            f"differs by at most {device['largest_force_n']:.3g} N (at {device['at_s']:.3f} s), "
            f"{device['rms_force_n']:.3g} N rms, and by at most "
            f"{device['largest_force_untouched_n']:.3g} N in the {difference['ticks_untouched']} "
            f"ticks without passivity correction or limit; the contact force differs by at most "
            f"{contact['largest_force_n']:.3g} N",
            difference,
        )
