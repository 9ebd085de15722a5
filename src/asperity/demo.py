"""`asperity demo`: the studies, real surfaces and a probe in 6-DoF, into one report."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from asperity.perception.rub import rub
from asperity.perception.studies import STUDIES, StudySettings, run_study
from asperity.real_surfaces import REAL_SURFACES, RealSurface
from asperity.sound import Sound, from_run

if TYPE_CHECKING:
    import xarray as xr

    from asperity.headless import Run
    from asperity.perception.claims import Claim
    from asperity.picture.contact import Picture

PROBES = (1e-3, 2e-3, 3e-3, 4e-3)
"""Diameters rubbed over the real surfaces [m]."""
_SOUND_PROBE = 2
_SOUND_RATE = 22050
_SOUND_SECONDS = 2.0
SCENE = "probe-plate-dots"
"""What the probe is dragged over at the end."""
_DRAG_SECONDS = 0.3
_PICTURE_ROWS = 440

Advance = Callable[[], None]


@dataclass
class Stopwatch:
    """How long each step took, by name [s]."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a block."""
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


@dataclass
class Results:
    """All that the report shows."""

    settings: StudySettings
    studies: dict[str, xr.Dataset]
    claims: list[Claim]
    rubs: dict[str, xr.Dataset]
    remarks: dict[str, str]
    """What each real surface is, measured or generated."""
    sounds: dict[str, Sound]
    run: Run
    """The probe on the plate, in 6-DoF."""
    folder: Path
    watch: Stopwatch


def steps(settings: StudySettings) -> tuple[int, int]:
    """Return how often each of the two progress callbacks of `run_demo` is called."""
    drags = settings.spacings * sum(settings.drags(name) for name in STUDIES)
    return drags, len(REAL_SURFACES) * len(PROBES)


def run_demo(
    folder: Path,
    data: Path | None,
    *,
    settings: StudySettings | None = None,
    on_drag: Advance = lambda: None,
    on_rub: Advance = lambda: None,
) -> Results:
    """Run everything, write figures, datasets, claims and sounds into `folder`.

    Parameters
    ----------
    folder : Path
        An existing folder.
    data : Path or None
        Folder of measured surfaces; what is not there is generated.
    settings : StudySettings, optional
    on_drag, on_rub : callable
        Called after each drag of the studies, and after each probe on a real surface.
    """
    settings = settings or StudySettings()
    watch = Stopwatch()
    sweep = settings.sweep()
    # The rubs' kernels let go of the interpreter's lock: they run beside the studies.
    with ThreadPoolExecutor(max_workers=2) as pool:
        start = time.perf_counter()
        pending = [
            pool.submit(_rub_one, surface, data, settings, on_rub) for surface in REAL_SURFACES
        ]
        pending_run = pool.submit(_drag_probe, folder)
        # Slow to import; by now the rubs are under way.
        from asperity import plots
        from asperity.perception.write import write_dataset, write_studies

        with watch.step("studies"):
            studies = {
                name: run_study(name, settings, sweep=sweep, progress=lambda _: on_drag())
                for name in STUDIES
            }
        with watch.step("figures and data of the studies"):
            claims = write_studies(studies, None, folder, ("svg",))
        done = [future.result() for future in pending]
        run, pictures = pending_run.result()
        watch.seconds["real surfaces (beside the two above)"] = time.perf_counter() - start
    rubs, remarks, sounds = {}, {}, {}
    with watch.step("figures, data and sounds of the real surfaces"):
        for surface, (dataset, remark) in zip(REAL_SURFACES, done, strict=True):
            rubs[surface.name], remarks[surface.name] = dataset, remark
            write_dataset(dataset, folder / f"{surface.name}.nc")
            plots.save(plots.rub_figure(dataset), folder, surface.name, ("png",))
            sounds[surface.name] = from_run(
                dataset, level=_SOUND_PROBE, rate=_SOUND_RATE, seconds=_SOUND_SECONDS
            )
            sounds[surface.name].write(folder / f"{surface.name}.wav")
    with watch.step("figures and data of the probe on the plate"):
        from asperity.headless import write_figures, write_summary

        write_summary(run, folder / "probe_plate_summary.json")
        write_figures(run, pictures, folder, prefix="probe_plate_", kinds=("svg",))
    return Results(settings, studies, claims, rubs, remarks, sounds, run, folder, watch)


def _drag_probe(folder: Path) -> tuple[Run, tuple[Picture, Picture]]:
    """Drag the probe over the plate in 6-DoF; return what came of it, and pictures of it."""
    from asperity.headless import run_scene, take_pictures
    from asperity.scenes import load_scene

    scene = load_scene(SCENE).changed(trajectory={"seconds": _DRAG_SECONDS})
    run = run_scene(scene, folder / "probe_plate_recording.h5")
    return run, take_pictures(run, scene, rows=_PICTURE_ROWS)


def _rub_one(
    surface: RealSurface, data: Path | None, settings: StudySettings, on_rub: Advance
) -> tuple[xr.Dataset, str]:
    """Rub all probes over one surface; return what came of it, and what the surface is."""
    middle = settings.middle()
    heights, remark = surface.load(data)
    title = surface.title if remark.startswith("Measured") else f"Stand-in for: {surface.title}"
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
