"""The computations of `asperity demo`: studies, real surfaces, and three scenes in 6-DoF.

`run_demo` writes their files and returns `Results`, from which `report.report_page` makes the page.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from asperity._core.kernels import is_compiled
from asperity._core.shared_compilation import HELPERS, helpers
from asperity.runs.sound import Sound, at_one_level, from_run
from asperity.studies.otaduy_lin_2004.real_surfaces import REAL_SURFACES, RealSurface
from asperity.studies.otaduy_lin_2004.rub import rub
from asperity.studies.otaduy_lin_2004.studies import STUDIES, StudySettings, run_study

if TYPE_CHECKING:
    import xarray as xr

    from asperity.drawing.renderer.contact import Picture
    from asperity.runs.run_scene import Run
    from asperity.scene.scene import Scene
    from asperity.simulation.simulation import Rollout
    from asperity.studies.otaduy_lin_2004.claims import Claim

PROBES = (1e-3, 2e-3, 3e-3, 4e-3)
"""Probe diameters on the real surfaces [m]."""
SOUND_PROBES = (0, -1)
"""Places in `PROBES` of the probes whose sounds are written."""
_SOUND_RATE, _SOUND_SECONDS = 22050, 2.0
"""Sampling rate [Hz] and duration [s] of the sounds."""
_PICTURE_ROWS = 440
"""Height of the pictures of scenes [pixels]."""
_TICKS = 25
"""Ticks of a scene between two calls of the progress callback."""
_TIMED = slice(98, 200)
"""Ticks that are run again to be timed; the first two warm up."""

Advance = Callable[[], None]


@dataclass(frozen=True)
class DemoScene:
    """A scene of the demo, and how long it runs."""

    name: str
    seconds: float
    """Simulated time [s]."""
    anti_alias: str

    @property
    def prefix(self) -> str:
        """Prefix of the names of its files."""
        return self.name.replace("-", "_") + "_"

    @property
    def calls(self) -> int:
        """Number of calls of the progress callback."""
        return round(self.seconds * 1e3) // _TICKS + 1

    def load(self) -> Scene:
        """Return the scene with the demo's settings."""
        from asperity.scene.builtin import load_scene

        return load_scene(self.name).changed(
            trajectory={"seconds": self.seconds}, force={"anti_alias": self.anti_alias}
        )


# The longest first, since they share two threads. Anti-aliasing evaluates several poses per tick.
SCENES = (
    DemoScene("file-cad", 0.2, "off"),
    DemoScene("hammer-blocks", 0.25, "off"),
    DemoScene("probe-plate-dots", 0.3, "tick"),
)
"""The 6-DoF scenes of the demo."""


_COMPILE = "from asperity.cli.demo_pipeline import compile_geoms; compile_geoms()"


@contextmanager
def _compiling_geoms() -> Iterator[None]:
    """Compile the kernels of scenes of geoms in a process beside, if need be.

    This process compiles those of meshes first: both need minutes where nothing is compiled yet.
    """
    if is_compiled("contact.geom_tick", "tick") or not helpers():
        yield
        return
    beside = subprocess.Popen(
        [sys.executable, "-c", _COMPILE], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env=os.environ | {HELPERS: "0"},
    )  # fmt: skip
    try:
        yield
    finally:
        beside.kill()
        beside.wait()


def compile_geoms() -> None:
    """Run the last scene of the demo for two ticks, for which its kernels are compiled.

    This process gives way to others: what it compiles is needed last.
    """
    if hasattr(os, "nice"):
        os.nice(10)
    from asperity.simulation.simulation import Simulation

    Simulation(replace(SCENES[-1], seconds=2e-3).load()).rollout()


@contextmanager
def _timing(seconds: dict[str, float], step: str) -> Iterator[None]:
    """Keep the wall time of a block [s]."""
    start = time.perf_counter()
    yield
    seconds[step] = time.perf_counter() - start


@dataclass
class Results:
    """Everything that the report shows."""

    settings: StudySettings
    studies: dict[str, xr.Dataset]
    claims: list[Claim]
    rubs: dict[str, xr.Dataset]
    remarks: dict[str, str]
    """Origin of each real surface: measured or generated."""
    sounds: dict[str, list[Sound]]
    """Sounds of each surface, one for each of `SOUND_PROBES`, all at one level."""
    runs: dict[str, Run]
    """Run of each 6-DoF scene, by name."""
    tick_us: dict[str, tuple[float, float]]
    """Tick time of each scene with no other work running: median and 99 % quantile [us]."""
    folder: Path
    seconds: dict[str, float]
    """Wall time of each step, by name [s]."""


def steps(settings: StudySettings) -> tuple[int, int, int]:
    """Return how often `run_demo` calls each of its three progress callbacks."""
    drags = settings.spacings * sum(settings.drags(name) for name in STUDIES)
    return drags, len(REAL_SURFACES) * len(PROBES), sum(shown.calls for shown in SCENES)


def run_demo(
    folder: Path,
    data: Path | None,
    *,
    settings: StudySettings | None = None,
    on_drag: Advance = lambda: None,
    on_rub: Advance = lambda: None,
    on_ticks: Advance = lambda: None,
) -> Results:
    """Run everything; write figures, datasets, claims and sounds into `folder`.

    Parameters
    ----------
    folder : Path
        An existing folder.
    data : Path or None
        Folder of measured surfaces; those that are not in it are generated.
    settings : StudySettings, optional
    on_drag, on_rub, on_ticks : callable
        Called after each drag of the studies, after each probe on a real surface, and every few
        ticks of a scene.
    """
    settings = settings or StudySettings()
    seconds: dict[str, float] = {}
    simulator = settings.simulator()
    # Compiled kernels release the interpreter's lock: scenes and rubs run beside the studies.
    with _compiling_geoms(), ThreadPoolExecutor(max_workers=2) as pool:
        start = time.perf_counter()
        pending_runs = [pool.submit(_run_one, shown, folder, on_ticks) for shown in SCENES]
        pending = [
            pool.submit(_rub_one, surface, data, settings, on_rub) for surface in REAL_SURFACES
        ]
        # These are slow to import, so they are imported while the threads already work.
        from asperity.drawing import figure_style
        from asperity.studies.ensemble.figures import claims_figure, hands_figure
        from asperity.studies.ensemble.stored import read_ensemble
        from asperity.studies.otaduy_lin_2004 import figures
        from asperity.studies.otaduy_lin_2004.write import write_dataset, write_studies

        with _timing(seconds, "studies"):
            studies = {
                name: run_study(name, settings, simulator=simulator, progress=lambda _: on_drag())
                for name in STUDIES
            }
        with _timing(seconds, "figures and data of the studies"):
            claims = write_studies(studies, "max_acceleration", folder, ("svg",))
            # The metric that reproduces what people report about speed.
            by_band = figures.study_figure(studies["speed"], ["band_rms"])
            figure_style.save(by_band, folder, "speed_band_rms", ("svg",))
            # The ensemble takes a minute: its stored result is drawn.
            members = read_ensemble()
            for name, draw_members in (
                ("ensemble_claims", claims_figure),
                ("ensemble_hands", hands_figure),
            ):
                figure_style.save(draw_members(members), folder, name, ("svg",))
        rubbed = [future.result() for future in pending]
        finished = [future.result() for future in pending_runs]
        seconds["scenes and real surfaces (beside the two above)"] = time.perf_counter() - start
    rubs, remarks = {}, {}
    with _timing(seconds, "figures, data and sounds of the real surfaces"):
        for surface, (dataset, remark) in zip(REAL_SURFACES, rubbed, strict=True):
            rubs[surface.name], remarks[surface.name] = dataset, remark
            write_dataset(dataset, folder / f"{surface.name}.nc")
        for name, draw in (
            ("maps", figures.maps_figure), ("offsets", figures.offsets_figure),
            ("ratios", figures.ratios_figure), ("vibration", figures.vibration_figure),
        ):  # fmt: skip
            kind = "png" if name == "maps" else "svg"
            figure_style.save(draw(list(rubs.values())), folder, f"surfaces_{name}", (kind,))
        sounds = _write_sounds(rubs, folder)
    with _timing(seconds, "ticks of the scenes, timed alone"):
        # Beside other threads, a tick would mostly wait for the interpreter's lock.
        tick_us = {
            shown.name: _timed(run, scene)
            for shown, (run, _, scene) in zip(SCENES, finished, strict=True)
        }
    runs = {}
    with _timing(seconds, "figures and data of the scenes"):
        from asperity.runs.run_scene import write_figures, write_summary

        for shown, (run, pictures, _) in zip(SCENES, finished, strict=True):
            runs[shown.name] = run
            write_summary(run, folder / f"{shown.prefix}summary.json")
            write_figures(run, pictures, folder, prefix=shown.prefix, kinds=("svg",))
    return Results(settings, studies, claims, rubs, remarks, sounds, runs, tick_us, folder, seconds)


def _write_sounds(rubs: dict[str, xr.Dataset], folder: Path) -> dict[str, list[Sound]]:
    """Write the sounds of surfaces under a small and a large probe, all at one level."""
    keys = [(name, place % len(PROBES)) for name in rubs for place in SOUND_PROBES]
    sounds = at_one_level([
        from_run(rubs[name], level=place, rate=_SOUND_RATE, seconds=_SOUND_SECONDS)
        for name, place in keys
    ])  # fmt: skip
    out: dict[str, list[Sound]] = {name: [] for name in rubs}
    for (name, place), sound in zip(keys, sounds, strict=True):
        sound.write(folder / f"{name}_{PROBES[place] * 1e3:g}mm.wav")
        out[name].append(sound)
    return out


def _run_one(
    shown: DemoScene, folder: Path, on_ticks: Advance
) -> tuple[Run, tuple[Picture, Picture], Scene]:
    """Run a 6-DoF scene; return the run, its pictures, and the scene."""
    from asperity.runs.run_scene import run_scene, take_pictures

    scene = shown.load()

    def advance(i: int, _: Rollout) -> None:
        if i % _TICKS == 0:
            on_ticks()

    run = run_scene(scene, folder / f"{shown.prefix}recording.h5", on_tick=advance)
    return run, take_pictures(run, scene, rows=_PICTURE_ROWS), scene


def _timed(run: Run, scene: Scene) -> tuple[float, float]:
    """Return the median and the 99 % quantile of the tick time [us]."""
    import numpy as np

    from asperity.scene.trajectory import Trajectory
    from asperity.simulation.simulation import Simulation

    path = Trajectory(run.rollout.time[_TIMED], run.rollout.handle_pose[_TIMED])
    tick_us = Simulation(scene).rollout(path).tick_seconds[2:] * 1e6
    return float(np.median(tick_us)), float(np.percentile(tick_us, 99.0))


def _rub_one(
    surface: RealSurface, data: Path | None, settings: StudySettings, on_rub: Advance
) -> tuple[xr.Dataset, str]:
    """Drag all probes over one surface; return the dataset and the origin of the surface."""
    middle = settings.middle()
    heights, remark = surface.load(data)
    title = surface.title if remark.startswith("Measured") else f"{surface.title} (stand-in)"
    dataset = rub(
        heights,
        title=title,
        diameters=PROBES,
        normal_force=middle["normal_force"],
        speed=middle["speed"],
        hand=settings.hand,
        band=settings.band,
        progress=on_rub,
    )
    return dataset, remark
