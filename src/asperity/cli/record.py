"""`asperity record` and `asperity replay`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import OmitArgPrefixes, Positional, arg

from asperity.cli.ranges import Between, check_ranges
from asperity.cli.realtime_run import DeviceOptions


@dataclass
class RecordCommand:
    """Record what a hand feels of a scene, until Ctrl-C.

    As `asperity run SCENE --device NAME`, without figures: recording.h5 and summary.json.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """As for `asperity run`."""
    device: str = "simulated"
    """simulated, replay:FILE, haply, touch, ...: see `asperity devices`."""
    seconds: Annotated[float | None, Between(0.01, 86400.0)] = None
    """How long. Default: until Ctrl-C."""
    options: OmitArgPrefixes[DeviceOptions] = field(default_factory=DeviceOptions)
    coupling: str | None = None
    """direct, implicit, semi-implicit, static. Default: as the scene says, else implicit."""
    seed: Annotated[int | None, Between(0, 2**31 - 1)] = None
    """Of textures that have one. Default: as the scene says."""
    out: Path = Path("out/record")
    """Folder for the results."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Record."""
        check_ranges(self.options)
        check_ranges(self)
        from asperity.cli.realtime_run import feel, servo_spec, with_coupling
        from asperity.scene.builtin import load_scene

        scene = with_coupling(load_scene(self.scene, seed=self.seed), self.coupling)
        spec = servo_spec(scene, self.device, self.options, self.seconds, None)
        feel(spec, self.out, source=self.scene, figures=False, overwrite=self.overwrite)


@dataclass
class ReplayCommand:
    """Look at a recording: the page of `asperity view`, with a slider through its time.

    With --out, play its handle through its scene again instead, in simulated time: writes a new
    recording and figures, and says how far the wrenches differ. To play it in real time, to feel
    nothing but be recorded again: asperity run SCENE --device replay:FILE.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """recording.h5, or the folder it is in."""
    scene: str | None = None
    """Another scene to play it in. Default: the recording's."""
    port: Annotated[int, Between(0, 65535)] = 8080
    """Of the page; 0 is any that is free."""
    no_open: bool = False
    """Do not open a browser; only say where the page is."""
    out: Path | None = None
    """Folder for the results of playing it through the scene again; no page then."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Show the page, or play, write, and say how far it differs."""
        check_ranges(self)
        from asperity.runs.recording import recording_file

        file = recording_file(self.file)
        if self.out is None:
            self._show(file)
        else:
            self._play(file, self.out)

    def _show(self, file: Path) -> None:
        from asperity.viewer.replayed import ReplayPage

        with ReplayPage(file, self.scene, port=self.port) as page:
            print(f"{page.url}  ({file}; Ctrl-C ends it)", flush=True)
            if not self.no_open:
                import webbrowser

                webbrowser.open(page.url)
            try:
                while not page.wait(0.2):
                    pass
            except KeyboardInterrupt:
                print("ended")

    def _play(self, file: Path, out: Path) -> None:
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.realtime.servo.replay import replay, scene_of_recording
        from asperity.runs.recording import read_recording
        from asperity.runs.run_scene import take_pictures, write_figures, write_summary
        from asperity.simulation.simulation import announce_compiling

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
        apart = done.summary["replay"]
        felt, contact = apart["device_wrench"], apart["contact_wrench"]
        print(
            f"{out}: {apart['ticks']} ticks of {file} in {scene.name}; the hand's force "
            f"differs by at most {felt['largest_force_n']:.3g} N (at {felt['at_s']:.3f} s), "
            f"{felt['rms_force_n']:.3g} N rms, and by {felt['largest_force_untouched_n']:.3g} N in "
            f"the {apart['ticks_untouched']} ticks that nothing was done to; the contact's by "
            f"{contact['largest_force_n']:.3g} N"
        )
