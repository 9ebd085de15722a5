"""`asperity fit`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.ranges import Between, check_ranges
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from asperity.vibrotactile.model import TextureModel
    from asperity.vibrotactile.signals import Exploration

_FOR_SCENES = ("speeds_mm_s", "forces_n", "seconds", "rate_khz")
_HELD = 0.25
"""The last part of a recording is held out, where no other is."""


@dataclass
class FitCommand:
    """Make a vibration model of a texture, for devices that can only vibrate.

    From a scene, whose tool is then moved at a grid of speeds and forces, or from recordings. Says
    how well spectrum and size are reproduced on runs that the model was not made of. Writes
    model.xml (as the Penn Haptic Texture Toolkit has it), fit.json and figures.
    """

    sources: Annotated[Positional[tuple[str, ...]], arg(metavar="SOURCE")]
    """A scene (a name, or a folder), or recordings (recording.h5, or the folders they are in)."""
    held_out: tuple[Path, ...] = ()
    """Recordings to judge the model by. Default: the last quarter of each, or, of a scene, runs
    between the grid's speeds and forces."""
    model: Path | None = None
    """A model file of HaTT, or of this command: judge that one instead of fitting."""
    speeds_mm_s: Annotated[tuple[float, ...] | None, Between(1.0, 1000.0)] = None
    """Of a scene's grid [mm/s]. Default: 30, 60, 100, 150."""
    forces_n: Annotated[tuple[float, ...] | None, Between(1e-3, 20.0)] = None
    """Of a scene's grid [N]. Default: 0.3, 0.6, 1.2."""
    seconds: Annotated[float | None, Between(0.3, 600.0)] = None
    """Of each run of a scene. Default: 1.5."""
    rate_khz: Annotated[float | None, Between(0.1, 100.0)] = None
    """At which a scene is run [kHz]. Default: 2, so that vibration up to 1 kHz is there."""
    mass_kg: Annotated[float, Between(1e-4, 10.0)] = 0.05
    """The mass that the texture's force accelerates [kg]."""
    order: Annotated[int | None, Between(1, 60)] = None
    """AR coefficients. Default: by the criterion, up to 20."""
    criterion: str = "bic"
    """bic or aic."""
    bandwidth_hz: Annotated[float, Between(0.1, 100.0)] = 4.0
    """No resonance is narrower [Hz]."""
    wav: bool = False
    """Write vibration.wav as well: strokes to and fro, at half the largest force."""
    seed: Annotated[int, Between(0, 2**31 - 1)] = 0
    """Of the noise that drives the model."""
    out: Path = Path("out/fit")
    """Folder for the results."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Run or read, fit, judge, write, and say how well it does."""
        check_ranges(self)
        from asperity._core.output import result_folder
        from asperity.vibrotactile.ar import CRITERIA
        from asperity.vibrotactile.fit import FitSettings, fit, judge
        from asperity.vibrotactile.hatt import read_hatt
        from asperity.vibrotactile.summary import in_words, summary_of

        require_choice("--criterion", self.criterion, CRITERIA)
        if not self.sources:
            raise AsperityError("give a scene (a name, or a folder), or recordings to fit to")
        settings = FitSettings(
            order=self.order, criterion=self.criterion, bandwidth=self.bandwidth_hz
        )
        given = None if self.model is None else read_hatt(self.model)
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            training, held = self._data(given)
            fitted = None
            if given is None:
                fitted = fit(training, settings, name=self._name())
                model = fitted.model
            else:
                model = self._at_rate_of(given, held)
            judged = judge(model, held, settings, seed=self.seed)
            summary = summary_of(model, fitted, judged) | {
                "sources": list(self.sources), "mass_kg": self.mass_kg, "seed": self.seed,
            }  # fmt: skip
            self._write(folder, model, fitted, judged, summary)
        print(in_words(summary))
        print(f"{self.out}: {', '.join(summary['files'])}")

    def _name(self) -> str:
        return Path(self.sources[0]).name if len(self.sources) == 1 else f"{len(self.sources)} runs"

    def _at_rate_of(self, model: TextureModel, held: list[Exploration]) -> TextureModel:
        from asperity.vibrotactile.rates import at_rate

        lowest = min(one.rate for one in held)
        if lowest > model.rate:
            raise AsperityError(
                f"the model runs at {model.rate:g} Hz and the recording at {lowest:g} Hz; give "
                "recordings at the model's rate or below"
            )
        return at_rate(model, lowest)

    def _data(self, given: TextureModel | None) -> tuple[list[Exploration], list[Exploration]]:
        """Return explorations to fit to, and those that are held out."""
        recordings = [_recording_at(Path(source)) for source in self.sources]
        if not any(recordings):
            if len(self.sources) > 1:
                raise AsperityError(
                    f"one scene, or recordings: {', '.join(self.sources)} are {len(self.sources)}"
                )
            if self.held_out:
                raise AsperityError("--held-out is for recordings; a scene runs its own")
            return self._of_scene(given)
        options = [name for name in _FOR_SCENES if getattr(self, name) is not None]
        if options:
            option = options[0].replace("_", "-")
            raise AsperityError(f"--{option} is for a scene; recordings have their own")
        missing = [s for s, file in zip(self.sources, recordings, strict=True) if file is None]
        if missing:
            raise AsperityError(
                f"no such recording: {missing[0]}; give recording.h5, or the folder it is in"
            )
        files = [file for file in recordings if file is not None]
        whole = [self._read(file) for file in files]
        if given is not None:
            return [], whole
        others = [_recording_at(file) or file for file in self.held_out]
        twice = {file.resolve() for file in files} & {file.resolve() for file in others}
        if twice:
            raise AsperityError(f"--held-out: the model would be made of {twice.pop().name} itself")
        if self.held_out:
            return whole, [self._read(file) for file in others]
        ends = [int((1.0 - _HELD) * one.vibration.size) for one in whole]
        return (
            [one.part(0, end) for one, end in zip(whole, ends, strict=True)],
            [one.part(end, one.vibration.size) for one, end in zip(whole, ends, strict=True)],
        )

    def _read(self, file: Path) -> Exploration:
        from asperity.runs.recording import read_recording
        from asperity.vibrotactile.signals import explored

        run = read_recording(file)
        return explored(
            run.time, run.tool_pose, run.contact_wrench, run.contact_count, mass=self.mass_kg,
            name=str(file),
        )  # fmt: skip

    def _of_scene(self, given: TextureModel | None) -> tuple[list[Exploration], list[Exploration]]:
        from asperity.cli.progress import progress_bars
        from asperity.scene.builtin import load_scene
        from asperity.simulation.tool_contact import announce_compiling
        from asperity.vibrotactile.explore import explore, geometric_means

        scene = load_scene(self.sources[0])
        speeds = [1e-3 * v for v in self.speeds_mm_s or (30.0, 60.0, 100.0, 150.0)]
        forces = list(self.forces_n or (0.3, 0.6, 1.2))
        seconds = 1.5 if self.seconds is None else self.seconds
        rate = 2000.0 if self.rate_khz is None else 1e3 * self.rate_khz
        if given is not None and self.rate_khz is None:
            rate = given.rate
        middle = geometric_means(speeds), geometric_means(forces)
        announce_compiling()
        runs = [middle] if given is not None else [(speeds, forces), middle]
        total = sum(len(v) * len(f) for v, f in runs) * round(seconds * rate)
        with progress_bars() as bars:
            task = bars.add_task(scene.name, total=total)
            made: list[Any] = [
                explore(
                    scene, v, f, rate=rate, seconds=seconds, mass=self.mass_kg,
                    on_tick=lambda n: bars.advance(task, n),
                )
                for v, f in runs
            ]  # fmt: skip
        return ([], made[0]) if given is not None else (made[0], made[1])

    def _write(
        self, folder: Path, model: TextureModel, fitted: Any, held: list[Any],
        summary: dict[str, Any],
    ) -> None:  # fmt: skip
        import json

        from asperity.drawing import figure_style
        from asperity.vibrotactile import figures
        from asperity.vibrotactile.hatt import write_hatt

        title = f"{model.name}: what it makes of runs that it was not made of"
        files = []
        if fitted is not None:
            write_hatt(model, folder / "model.xml")
            files += ["model.xml"]
            told = f"{model.name}: {fitted.recorded} fitted models"
            made = figure_style.save(figures.plane_figure(fitted, held, told), folder, "plane")
            files += [path.name for path in made]
        if held:
            for figure in (figures.spectra_figure, figures.waves_figure):
                name = figure.__name__.removesuffix("_figure")
                made = figure_style.save(figure(model, held, title), folder, name)
                files += [path.name for path in made]
        if self.wav:
            self._sound(model, folder / "vibration.wav", summary)
            files.append("vibration.wav")
        summary["files"] = ["fit.json", *files]
        text = json.dumps(summary, indent=2, allow_nan=False)
        (folder / "fit.json").write_text(text + "\n", "utf-8")

    def _sound(self, model: TextureModel, path: Path, summary: dict[str, Any]) -> None:
        from asperity.runs.sound import from_acceleration
        from asperity.vibrotactile.rates import raised
        from asperity.vibrotactile.summary import stroking
        from asperity.vibrotactile.synthesis import Synthesiser

        samples = Synthesiser(model, seed=self.seed).block(*stroking(model))
        fine = 8 * round(model.rate)
        sound = from_acceleration(raised(samples, round(model.rate), fine), 1.0 / fine)
        sound.write(path)
        summary["wav_full_scale_m_s2"] = sound.gain


def _recording_at(place: Path) -> Path | None:
    """Return the recording at a place, or None."""
    if place.is_dir():
        inside = place / "recording.h5"
        return inside if inside.is_file() else None
    return place if place.suffix in (".h5", ".hdf5", ".nc") else None
