"""`asperity sound`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command, in_si, with_options
from asperity.cli.result import print_result


@command
@dataclass
class SoundCommand:
    """Write the acceleration of a study's run as a WAV file, for ears or voice-coil actuators.

    Writes sound.wav, normalised to 1 dB below full scale, and sound.json with the acceleration
    that full scale stands for.
    """

    run_file: Annotated[Positional[Path], arg(metavar="FILE")]
    """A dataset that `asperity study` or `asperity demo` wrote, such as diameter.nc."""
    spacing_mm: Annotated[float | None, Range(1e-3, 1e3, "mm")] = None
    """Spacing of a study; the nearest is taken. Default: where the middle level is largest."""
    level: int | None = None
    """Level of the study's factor, or probe on a real surface, from 0. Default: the middle one."""
    seconds: Annotated[float | None, Range(0.05, 60.0, "s")] = None
    """Duration. Default: 2 s of a periodic motion, the whole of any other."""
    rate: Annotated[int, Range(1000, 192000, "Hz")] = 44100
    """Sampling rate."""
    out: Path = Path("out/sound")
    """Folder for sound.wav and sound.json."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Write both files and print what full scale stands for."""
        from asperity._core.output import result_folder, write_json
        from asperity.cli.data_files import open_dataset
        from asperity.runs.sound import from_run

        sound = with_options(from_run, in_si(self), data=open_dataset(self.run_file))
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            sound.write(folder / "sound.wav")
            facts = {
                "source": sound.source, "rate_hz": sound.rate,
                "seconds": sound.samples.size / sound.rate, "full_scale_m_per_s2": sound.gain,
            }  # fmt: skip
            write_json(folder / "sound.json", facts)
        print_result(
            f"{self.out / 'sound.wav'}: {sound.source}; full scale is {sound.gain:.3g} m/s², "
            f"{facts['seconds']:.2f} s at {sound.rate} Hz",
            facts,
        )
