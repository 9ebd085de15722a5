"""`asperity fit`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command, in_si, with_options
from asperity.cli.result import print_result
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from asperity.vibrotactile.model import TextureModel
    from asperity.vibrotactile.signals import Exploration

_SPEEDS, _FORCES = (0.03, 0.06, 0.1, 0.15), (0.3, 0.6, 1.2)
"""Default grid of a scene: speeds [m/s] and normal forces [N]."""
_SECONDS, _RATE = 1.5, 2000.0
"""Default duration [s] and tick rate [Hz] of a scene's runs."""
_FOR_SCENES = ("speeds_mm_s", "forces_n", "seconds", "rate_khz")
_HELD_OUT = 0.25
"""Last part of each recording that is held out if no recordings are."""


@command
@dataclass
class FitCommand:
    """Fit a vibration model of a texture, for devices that can only vibrate.

    To a scene, whose tool is then moved at a grid of speeds and forces, or to recordings. Prints
    the periods that were found, recordings without a model, and how well spectrum and amplitude
    are reproduced on data held out of the fit. Writes model.json, model.xml (format of the Penn
    Haptic Texture Toolkit, HaTT, which has no periods), fit.json and figures.
    """

    sources: Annotated[Positional[tuple[str, ...]], arg(metavar="SOURCE")]
    """A scene (a name, or a folder), or recordings (recording.h5, or their folders)."""
    held_out: tuple[Path, ...] = ()
    """Recordings to judge the model by. Default: the last quarter of each recording; for a scene,
    runs between the grid's speeds and forces."""
    model: Path | None = None
    """A model file of HaTT or of this command, to judge instead of fitting one."""
    kind: str = "harmonic"
    """harmonic: what repeats over distance as sines locked to position, the remainder as noise.
    noise: all as noise, as in HaTT."""
    speeds_mm_s: Annotated[tuple[float, ...] | None, Range(1.0, 1000.0, "mm/s")] = None
    """Speeds of a scene's grid. Default: 30, 60, 100, 150."""
    forces_n: Annotated[tuple[float, ...] | None, Range(1e-3, 20.0, "N")] = None
    """Normal forces of a scene's grid. Default: 0.3, 0.6, 1.2."""
    seconds: Annotated[float | None, Range(0.3, 600.0, "s")] = None
    """Duration of each run of a scene. Default: 1.5."""
    rate_khz: Annotated[float | None, Range(0.1, 100.0, "kHz")] = None
    """Tick rate of a scene's runs. Default: 2, for vibration up to 1 kHz."""
    mass_kg: Annotated[float, Range(1e-4, 10.0, "kg")] = 0.05
    """Mass that the texture force accelerates."""
    order: Annotated[int | None, Range(1, 60)] = None
    """Number of AR coefficients. Default: chosen by the criterion, at most 20."""
    criterion: str | None = None
    """Information criterion for the order: bic or aic. Default: aic, and bic for noise."""
    bandwidth_hz: Annotated[float, Range(0.1, 100.0, "Hz")] = 4.0
    """Smallest bandwidth of a resonance."""
    wav: bool = False
    """Also write vibration.wav: back-and-forth strokes at half the largest force."""
    seed: Annotated[int, Range(0, 2**31 - 1)] = 0
    """Seed of the noise that drives the model."""
    out: Path = Path("out/fit")
    """Folder for the results."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Run or read, fit, judge, write, and print the errors."""
        from asperity._core.output import result_folder
        from asperity.vibrotactile.ar import CRITERIA
        from asperity.vibrotactile.fit import KINDS, FitSettings, fit, judge
        from asperity.vibrotactile.model_file import read_model
        from asperity.vibrotactile.summary import in_words, summary_of

        require_choice("--kind", self.kind, KINDS)
        if self.criterion is not None:
            require_choice("--criterion", self.criterion, CRITERIA)
        if not self.sources:
            raise AsperityError("SOURCE is missing: give a scene, or recordings")
        settings = with_options(FitSettings, in_si(self))
        given = None if self.model is None else read_model(self.model)
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            training, held_out = self._data(given)
            fitted = None
            if given is None:
                fitted = fit(training, settings, name=self._name())
                model = fitted.model
            else:
                model = self._at_rate_of(given, held_out)
            judged = judge(model, held_out, settings, seed=self.seed)
            summary = summary_of(model, fitted, judged) | {
                "sources": list(self.sources), "mass_kg": self.mass_kg, "seed": self.seed,
            }  # fmt: skip
            self._write(folder, model, fitted, judged, summary)
        notes = [f"model.xml: {note}" for note in summary.get("model_xml_loses", [])]
        written = f"{self.out}: {', '.join(summary['files'])}"
        print_result([in_words(summary), *notes, written], summary | {"out": self.out})

    def _name(self) -> str:
        """Return the name of the model."""
        return Path(self.sources[0]).name if len(self.sources) == 1 else f"{len(self.sources)} runs"

    def _at_rate_of(self, model: TextureModel, held_out: list[Exploration]) -> TextureModel:
        """Return a model at the lowest rate of the recordings."""
        from asperity.vibrotactile.rates import at_rate

        lowest = min(one.rate for one in held_out)
        if lowest > model.rate:
            raise AsperityError(
                f"the recordings' lowest rate is {lowest:g} Hz, above the model's; give one at "
                f"{model.rate:g} Hz or below"
            )
        return at_rate(model, lowest)

    def _data(self, given: TextureModel | None) -> tuple[list[Exploration], list[Exploration]]:
        """Return the data to fit, and the data held out of the fit."""
        recordings = [_recording_at(Path(source)) for source in self.sources]
        if not any(recordings):
            if len(self.sources) > 1:
                raise AsperityError(
                    f"SOURCE must be one scene, or recordings, got {len(self.sources)} scenes: "
                    f"{', '.join(self.sources)}"
                )
            if self.held_out:
                raise AsperityError(
                    "--held-out needs recordings as SOURCE; a scene makes its own held-out runs"
                )
            return self._of_scene(given)
        options = [name for name in _FOR_SCENES if getattr(self, name) is not None]
        if options:
            option = options[0].replace("_", "-")
            raise AsperityError(f"--{option} needs a scene as SOURCE; it is fixed in recordings")
        missing = [s for s, file in zip(self.sources, recordings, strict=True) if file is None]
        if missing:
            raise AsperityError(
                f"no such recording: {missing[0]}; give recording.h5, or its folder"
            )
        files = [file for file in recordings if file is not None]
        complete = [self._read(file) for file in files]
        if given is not None:
            return [], complete
        held_out = [_recording_at(file) or file for file in self.held_out]
        twice = {file.resolve() for file in files} & {file.resolve() for file in held_out}
        if twice:
            raise AsperityError(f"--held-out {twice.pop().name} is also a SOURCE; give another")
        if self.held_out:
            return complete, [self._read(file) for file in held_out]
        ends = [int((1.0 - _HELD_OUT) * one.vibration.size) for one in complete]
        return (
            [one.part(0, end) for one, end in zip(complete, ends, strict=True)],
            [one.part(end, one.vibration.size) for one, end in zip(complete, ends, strict=True)],
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

        scene, options = load_scene(self.sources[0]), in_si(self)
        speeds = list(options.speeds or _SPEEDS)
        forces = list(options.forces or _FORCES)
        seconds = _SECONDS if options.seconds is None else options.seconds
        rate = options.rate or (_RATE if given is None else given.rate)
        between = geometric_means(speeds), geometric_means(forces)
        announce_compiling()
        runs = [between] if given is not None else [(speeds, forces), between]
        total = sum(len(v) * len(f) for v, f in runs) * round(seconds * rate)
        with progress_bars() as bars:
            task = bars.add_task(scene.name, total=total)
            explored: list[Any] = [
                explore(
                    scene, v, f, rate=rate, seconds=seconds, mass=self.mass_kg,
                    on_tick=lambda n: bars.advance(task, n),
                )
                for v, f in runs
            ]  # fmt: skip
        return ([], explored[0]) if given is not None else (explored[0], explored[1])

    def _write(
        self, folder: Path, model: TextureModel, fitted: Any, judged: list[Any],
        summary: dict[str, Any],
    ) -> None:  # fmt: skip
        from asperity._core.output import write_json
        from asperity.drawing import figure_style
        from asperity.vibrotactile import figures
        from asperity.vibrotactile.hatt import write_hatt
        from asperity.vibrotactile.model_file import write_model

        title = f"{model.name}: synthesis against data held out of the fit"
        files = []
        if fitted is not None:
            write_model(model, folder / "model.json")
            summary["model_xml_loses"] = list(write_hatt(model, folder / "model.xml"))
            files += ["model.json", "model.xml"]
            plane = figures.plane_figure(
                fitted, judged, f"{model.name}: {fitted.recorded} fitted models"
            )
            files += [path.name for path in figure_style.save(plane, folder, "plane")]
        if judged:
            for figure in (figures.spectra_figure, figures.waves_figure):
                name = figure.__name__.removesuffix("_figure")
                saved = figure_style.save(figure(model, judged, title), folder, name)
                files += [path.name for path in saved]
        if self.wav:
            self._sound(model, folder / "vibration.wav", summary)
            files.append("vibration.wav")
        summary["files"] = ["fit.json", *files]
        write_json(folder / "fit.json", summary)

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


def _recording_at(path: Path) -> Path | None:
    """Return the recording at a path, or None if it is none."""
    if path.is_dir():
        inside = path / "recording.h5"
        return inside if inside.is_file() else None
    return path if path.suffix in (".h5", ".hdf5", ".nc") else None
