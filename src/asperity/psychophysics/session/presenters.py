"""Presenters render a stimulus and record every tick: in simulated time, or on a device."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.output import output_errors
from asperity.errors import AsperityError
from asperity.psychophysics.session.trials import PresentedInterval
from asperity.psychophysics.stimuli import Stimuli, Stimulus
from asperity.realtime.servo.process import ServoSpec
from asperity.realtime.servo.running import Servo
from asperity.realtime.servo.session import recording_attributes
from asperity.runs.recording import Recording, read_recording
from asperity.runs.run_scene import run_scene
from asperity.runs.vibration_metrics import DEFAULT_BAND, band_rms, spectrum
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion

_LOOKED_AT = 0.05
"""Interval between checks whether the participant ends the interval [s]."""
_KEPT = 32
"""Number of compiled scenes that are cached."""


class Presenter:
    """Presents stimuli.

    Parameters
    ----------
    stimuli : Stimuli
    """

    def __init__(self, stimuli: Stimuli) -> None:
        self._stimuli = stimuli
        self._scene = lru_cache(_KEPT)(stimuli.scene)

    def check(self, stimulus: Stimulus) -> None:
        """Raise AsperityError if what presents a stimulus is not there."""

    def prepare(self, wanted: Sequence[tuple[Stimulus, Path]], seconds: float) -> None:
        """Prepare the next stimuli and their recordings in the background."""

    def present(
        self, stimulus: Stimulus, recording: Path, seconds: float,
        begun: Callable[[], None], done: Callable[[], bool],
    ) -> PresentedInterval:  # fmt: skip
        """Render a stimulus for `seconds`, or until `done`; return when the recording is complete.

        `begun` is called when rendering starts.
        """
        raise NotImplementedError

    def drop(self) -> None:
        """Release everything that was prepared and not presented."""


class HeadlessPresenter(Presenter):
    """Moves the tool along the scene's own trajectory in simulated time.

    In simulated time a stimulus always gives the same recording to the bit, so it is computed once
    and copied for each further presentation.

    Parameters
    ----------
    stimuli : Stimuli
    hand : bool
        Whether a simulated hand holds the tool and yields.
    """

    def __init__(self, stimuli: Stimuli, *, hand: bool = False) -> None:
        super().__init__(stimuli)
        self._hand = hand
        self._earlier: dict[tuple[str, float], tuple[Path, PresentedInterval]] = {}

    def present(
        self, stimulus: Stimulus, recording: Path, seconds: float,
        begun: Callable[[], None], done: Callable[[], bool],
    ) -> PresentedInterval:  # fmt: skip
        """Run the scene to its end; `done` is ignored, as there is no participant."""
        begun()
        earlier = self._earlier.get((stimulus.name, seconds))
        if earlier is not None and earlier[0].is_file():
            with output_errors(recording):
                shutil.copyfile(earlier[0], recording)
            return replace(earlier[1], recording=recording.name)
        scene = self._scene(stimulus)
        motion = scene.motion
        if isinstance(motion, ScriptedMotion):
            motion = replace(motion, seconds=seconds)
        run = run_scene(
            scene, recording, motion=motion, hand=self._hand,
            source=self._stimuli.source(stimulus),
        )  # fmt: skip
        interval = presented_interval(recording, {"status": run.summary["status"]})
        self._earlier[stimulus.name, seconds] = recording, interval
        return interval


class DevicePresenter(Presenter):
    """Renders scenes on a device with the servo loop.

    All intervals of a trial are prepared before it begins: each has a separate servo process that
    waits, with its contact solver compiled and warmed up. So the pause between two intervals is
    that of the design and does not depend on the stimulus. Call `close` at the end.

    Parameters
    ----------
    stimuli : Stimuli
    make_spec : callable
        Returns the specification of a servo process for a scene and a duration [s].
    on_servo : callable
        Called with each servo loop when it starts, and with None when it has ended.
    """

    def __init__(
        self, stimuli: Stimuli, make_spec: Callable[[Scene, float], ServoSpec], *,
        on_servo: Callable[[Servo | None], None] = lambda _: None,
    ) -> None:  # fmt: skip
        super().__init__(stimuli)
        self._make_spec, self._on_servo = make_spec, on_servo
        self._making = ThreadPoolExecutor(1, "asperity-interval")
        self._ready: dict[Path, Future[Servo]] = {}

    def check(self, stimulus: Stimulus) -> None:
        """Open the device and close it again; AsperityError if it is not there."""
        device = self._make_spec(self._scene(stimulus), 1.0).make_device()
        try:
            device.open()
        finally:
            device.close()

    def prepare(self, wanted: Sequence[tuple[Stimulus, Path]], seconds: float) -> None:
        """Start servo processes one after the other in the background."""
        for stimulus, recording in wanted:
            self._ready[recording] = self._making.submit(self._made, stimulus, recording, seconds)

    def present(
        self, stimulus: Stimulus, recording: Path, seconds: float,
        begun: Callable[[], None], done: Callable[[], bool],
    ) -> PresentedInterval:  # fmt: skip
        """Run the loop until the time is over, or `done`."""
        if recording not in self._ready:
            self.prepare([(stimulus, recording)], seconds)
        # Wait for all intervals of the trial, so that pauses do not depend on their preparation.
        for making in self._ready.values():
            making.result()
        with self._ready.pop(recording).result() as servo:
            servo.go()
            self._on_servo(servo)
            begun()
            try:
                while not servo.wait(_LOOKED_AT) and not done():
                    pass
            finally:
                self._on_servo(None)
            result = servo.finish()
        loop_report = {
            "misses": result["timing"]["misses"], "fallbacks": result["timing"]["fallbacks"],
            "clamped": result["safety"]["clamped_force"], "recorder": result["recorder"]["error"],
            "ended": result["ended"],
        }  # fmt: skip
        return presented_interval(recording, loop_report)

    def drop(self) -> None:
        """End prepared processes and delete their recordings, which contain no exploration."""
        for recording, making in self._ready.items():
            if not making.cancel():
                with suppress(AsperityError), making.result():
                    pass
            recording.unlink(missing_ok=True)
        self._ready.clear()

    def close(self) -> None:
        """End all processes."""
        self.drop()
        self._making.shutdown()

    def _made(self, stimulus: Stimulus, recording: Path, seconds: float) -> Servo:
        spec = replace(self._make_spec(self._scene(stimulus), seconds), held=True)
        attributes = recording_attributes(spec, self._stimuli.source(stimulus))
        servo = Servo(spec, recording, attributes)
        try:
            servo.start()
        except BaseException:
            with suppress(AsperityError), servo:
                pass
            raise
        return servo


def presented_interval(path: Path, loop_report: dict[str, Any]) -> PresentedInterval:
    """Return the facts of a presented interval from its recording."""
    recording = read_recording(path)
    ticks = len(recording.time)
    seconds = float(recording.time[-1] - recording.time[0]) if ticks > 1 else 0.0
    measures = exploration_measures(recording)
    return PresentedInterval(path.name, ticks, seconds, measures, loop_report)


def exploration_measures(recording: Recording) -> dict[str, float]:
    """Return measures of the exploration of an interval.

    `band_rms` is the RMS of the force along the direction in which the handle mostly moved, in 20
    to 200 Hz, as the studies' metric takes it of the acceleration; `largest_force` the largest
    force in that direction; `normal_force` the mean upward force; `speed` the mean speed [m/s].
    """
    ticks = len(recording.time)
    if ticks < 8:
        return {"band_rms": 0.0, "largest_force": 0.0, "normal_force": 0.0, "speed": 0.0}
    place = recording.handle_pose[:, :2] - recording.handle_pose[:, :2].mean(axis=0)
    _, _, axes = np.linalg.svd(place, full_matrices=False)
    along = recording.device_wrench[:, :2] @ axes[0]
    step = float(np.median(np.diff(recording.time)))
    lines = spectrum(along, step, periodic=False)
    way = np.linalg.norm(np.diff(recording.handle_pose[:, :3], axis=0), axis=1).sum()
    return {
        "band_rms": band_rms(*lines, DEFAULT_BAND),
        "largest_force": float(np.abs(along).max()),
        "normal_force": float(recording.device_wrench[:, 2].mean()),
        "speed": float(way / (recording.time[-1] - recording.time[0])),
    }


@contextmanager
def private_files() -> Iterator[None]:
    """Make files that are created in the block, also by child processes, private to the owner."""
    before = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(before)
