"""`asperity sound`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from asperity.cli.ranges import Between, check_ranges


@dataclass
class SoundCommand:
    """Write the acceleration of a run as a WAV file, for ears and for voice-coil actuators."""

    run_file: Annotated[Positional[Path], "file"]
    """A dataset that `asperity study` or `asperity demo` wrote, such as diameter.nc."""
    spacing_mm: Annotated[float | None, Between(1e-3, 1e3)] = None
    """Of a study: the nearest spacing is taken. Default: where the middle level is largest."""
    level: int | None = None
    """Level of the study's factor, or the probe of a rub, from 0. Default: the middle one."""
    seconds: Annotated[float | None, Between(0.05, 60.0)] = None
    """Length. Default: 2 s of a periodic motion, the whole of another."""
    rate: Annotated[int, Between(1000, 192000)] = 44100
    """Samples per second."""
    out: Path = Path("out/sound")
    """Folder for the WAV file and its sidecar, sound.json."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Write sound.wav and sound.json, and say what full scale stands for."""
        import json

        check_ranges(self)
        from asperity._core.output import result_folder
        from asperity.cli.data_files import open_dataset
        from asperity.runs.sound import from_run

        data = open_dataset(self.run_file)
        sound = from_run(
            data,
            spacing=None if self.spacing_mm is None else self.spacing_mm * 1e-3,
            level=self.level,
            rate=self.rate,
            seconds=self.seconds,
        )
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            sound.write(folder / "sound.wav")
            facts = {
                "source": sound.source,
                "rate_hz": sound.rate,
                "seconds": sound.samples.size / sound.rate,
                "full_scale_m_per_s2": sound.gain,
            }
            (folder / "sound.json").write_text(json.dumps(facts, indent=2) + "\n")
        print(
            f"{self.out / 'sound.wav'}: {sound.source}; full scale is {sound.gain:.3g} m/s², "
            f"{facts['seconds']:.2f} s at {sound.rate} Hz"
        )
