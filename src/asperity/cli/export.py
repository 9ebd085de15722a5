"""`asperity export`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command
from asperity.cli.result import print_result


@command
@dataclass
class ExportCommand:
    """Convert a recording to CSV (units in the header), WAV (acceleration) and PNG (plots)."""

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """recording.h5, or the folder that contains it."""
    kinds: tuple[Literal["csv", "wav", "png"], ...] = ("csv", "wav", "png")
    """Formats to write."""
    start: Annotated[float, Range(0.0, 1e6, "s")] = 0.0
    """Start of the exported part."""
    seconds: Annotated[float | None, Range(0.05, 1e6, "s")] = None
    """Duration of the exported part. Default: to the end; a WAV file holds at most 600 s."""
    rate: Annotated[int, Range(1000, 192000, "Hz")] = 44100
    """Sampling rate of the WAV file."""
    out: Path = Path("out/export")
    """Folder for the results."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Write the files and print their names."""
        from asperity._core.output import result_folder
        from asperity.runs import export
        from asperity.runs.dataset import open_recording

        written = []
        with open_recording(self.file) as whole:
            data = export.part_of(whole, self.start, self.seconds)
            title = str(data.attrs.get("scene", "recording"))
            with result_folder(self.out, overwrite=self.overwrite) as folder:
                if "csv" in self.kinds:
                    ticks = export.write_csv(data, folder / "recording.csv")
                    written.append(f"recording.csv ({ticks} ticks)")
                traces = export.traces_of(data) if {"wav", "png"} & set(self.kinds) else None
                if traces is not None and "wav" in self.kinds:
                    sound = export.sound_of(traces, rate=self.rate, source=title)
                    sound.write(folder / "acceleration.wav")
                    length = sound.samples.size / sound.rate
                    written.append(
                        f"acceleration.wav ({length:.2f} s, full scale is {sound.gain:.3g} m/s²)"
                    )
                if traces is not None and "png" in self.kinds:
                    for name, figure in export.figures(traces, title).items():
                        figure.savefig(folder / f"{name}.png")
                        written.append(f"{name}.png")
                prescribed = traces is not None and export.is_prescribed(data)
        lines = [f"{self.out}: {', '.join(written)}"]
        if prescribed:
            lines.append(
                "  the tool followed a prescribed motion and could not yield, so its acceleration "
                "and the sound contain no texture; record with asperity run SCENE --hand"
            )
        print_result(lines, {"out": self.out, "files": written, "prescribed": prescribed})
