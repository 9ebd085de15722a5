"""`asperity export`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from asperity.cli.ranges import Between, check_ranges


@dataclass
class ExportCommand:
    """Write a recording as CSV (units in the header), WAV (acceleration) and PNG (plots)."""

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """recording.h5, or the folder it is in."""
    kinds: tuple[Literal["csv", "wav", "png"], ...] = ("csv", "wav", "png")
    """Which of csv, wav, png."""
    start: Annotated[float, Between(0.0, 1e6)] = 0.0
    """From this time of the recording on [s]."""
    seconds: Annotated[float | None, Between(0.05, 1e6)] = None
    """How much. Default: to the end; a WAV file holds at most 600 s."""
    rate: Annotated[int, Between(1000, 192000)] = 44100
    """Of the WAV file [Hz]."""
    out: Path = Path("out/export")
    """Folder for the results."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Write the files and name them."""
        check_ranges(self)
        from asperity._core.output import result_folder
        from asperity.runs import export
        from asperity.runs.dataset import open_recording

        told = []
        with open_recording(self.file) as whole:
            data = export.part_of(whole, self.start, self.seconds)
            title = str(data.attrs.get("scene", "recording"))
            with result_folder(self.out, overwrite=self.overwrite) as folder:
                if "csv" in self.kinds:
                    ticks = export.write_csv(data, folder / "recording.csv")
                    told.append(f"recording.csv ({ticks} ticks)")
                shown = export.traces_of(data) if {"wav", "png"} & set(self.kinds) else None
                if shown is not None and "wav" in self.kinds:
                    sound = export.sound_of(shown, rate=self.rate, source=title)
                    sound.write(folder / "acceleration.wav")
                    length = sound.samples.size / sound.rate
                    told.append(
                        f"acceleration.wav ({length:.2f} s, full scale is {sound.gain:.3g} m/s²)"
                    )
                if shown is not None and "png" in self.kinds:
                    for name, figure in export.figures(shown, title).items():
                        figure.savefig(folder / f"{name}.png")
                        told.append(f"{name}.png")
                stiff = shown is not None and export.is_prescribed(data)
        print(f"{self.out}: {', '.join(told)}")
        if stiff:
            print(
                "  the tool moved as prescribed and could not yield: there is no texture in its "
                "acceleration, nor in the sound; record with asperity run SCENE --hand"
            )
