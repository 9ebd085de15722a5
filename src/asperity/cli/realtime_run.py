"""Real-time sessions with a device: the options and steps that several commands share."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from asperity.cli.options import Range, command
from asperity.cli.result import print_result
from asperity.errors import AsperityError

if TYPE_CHECKING:
    from asperity.realtime.servo.process import ServoSpec
    from asperity.scene.scene import Scene
    from asperity.scene.trajectory import ScriptedMotion, Trajectory


@command
@dataclass
class DeviceOptions:
    """Options of the device and of its servo loop. They need --device."""

    device_option: tuple[str, ...] = ()
    """Options of the device's driver, KEY=VALUE ...; see the documentation, Devices."""
    rate_hz: Annotated[float, Range(100.0, 20e3, "Hz")] = 1000.0
    """Tick rate of the servo loop."""
    scale: Annotated[float, Range(1e-3, 1e3)] = 1.0
    """Scene length per device length."""
    force_scale: Annotated[float, Range(1e-3, 1e3)] = 1.0
    """Device force per scene force."""
    max_force_n: Annotated[float | None, Range(0.0, 100.0, "N")] = None
    """Force limit. Default: the device's own limit, which this cannot raise."""
    clutch_button: Annotated[int | None, Range(0, 31)] = None
    """Number of the button that decouples the hand from the tool while pressed. Default: none."""
    no_passivity: bool = False
    """Let the passivity controller observe the energy without changing the force."""
    priority: bool = False
    """Request real-time priority from the operating system."""
    core: Annotated[int | None, Range(0, 1023)] = None
    """Request this CPU core."""
    lock_memory: bool = False
    """Request memory that is never swapped out."""
    no_busy_wait: bool = False
    """Sleep between ticks instead of keeping a core busy; ticks may then start late."""

    def session(self) -> dict[str, Any]:
        """Return the arguments that `ServoSpec` and `SessionConfig` share."""
        from asperity.realtime.servo.safety import SafetySettings
        from asperity.realtime.servo.scheduling import RealTime

        return {
            "rate": self.rate_hz,
            "passivity": not self.no_passivity,
            "mapping": {
                "scale": self.scale, "force_scale": self.force_scale,
                "clutch_button": self.clutch_button,
            },
            "safety": SafetySettings(max_force=self.max_force_n),
            "real_time": RealTime(
                self.priority, self.core, self.lock_memory, busy_wait=not self.no_busy_wait
            ),
        }  # fmt: skip


def servo_spec(
    scene: Scene,
    device_name: str,
    options: DeviceOptions,
    seconds: float | None,
    motion: ScriptedMotion | Trajectory | None,
) -> ServoSpec:
    """Return the specification of a servo process for a scene and a device.

    Parameters
    ----------
    scene : Scene
    device_name : str
    options : DeviceOptions
    seconds : float, optional
        Duration. Default: that of a simulated or replayed motion, else unlimited.
    motion : ScriptedMotion or Trajectory, optional
        Motion of the simulated hand. Default: the scene's.
    """
    from asperity.realtime.devices.catalogue import device, entry_of
    from asperity.realtime.servo.process import ServoSpec, simulated_device
    from asperity.scene.trajectory import Trajectory

    driver_options = parse_device_options(options.device_option)
    in_scene = entry_of(device_name).steady
    make: functools.partial[Any]
    if device_name == "simulated":
        if driver_options:
            raise AsperityError(
                f"the device 'simulated' has no options, got --device-option "
                f"{' '.join(options.device_option)}"
            )
        motion = scene.motion if motion is None else motion
        make = functools.partial(simulated_device, scene, motion, 1.0 / options.rate_hz)
        seconds = motion.seconds if seconds is None else seconds
    else:
        if isinstance(motion, Trajectory):
            raise AsperityError("--trajectory FILE needs --device simulated, or use replay:FILE")
        # Made here too, so that a wrong option is refused before the process starts.
        made: Any = device(device_name, **driver_options)
        make = functools.partial(device, device_name, **driver_options)
        if seconds is None and in_scene:
            seconds = getattr(made, "seconds", None)
    return ServoSpec(scene, make, in_scene=in_scene, seconds=seconds, **options.session())


def run_on_device(
    spec: ServoSpec, out: Path, *, source: str, figures: bool, overwrite: bool
) -> dict[str, Any]:
    """Run a session with a progress line; print and return its summary."""
    from asperity._core.output import growing_folder
    from asperity.cli.progress import progress_bars
    from asperity.realtime.servo.session import run_session

    scene = spec.scene
    out = out.with_name(growing_folder(out, overwrite=overwrite).name)
    with progress_bars() as bars:
        task = bars.add_task(f"{scene.name}: starting", total=spec.seconds)

        def show(moment: Any) -> None:
            fx, fy, fz = moment.device_wrench[:3]
            force = (fx * fx + fy * fy + fz * fz) ** 0.5
            label = (
                f"{scene.name}  {force:5.2f} N  {moment.misses} missed, "
                f"{moment.fallbacks} fallbacks"
            )
            bars.update(task, completed=round(moment.time, 1), description=label)

        def begun(ready: dict[str, Any]) -> None:
            bars.update(task, description=f"{scene.name}: {ready['device']}")

        summary = run_session(
            spec, out, source=source, figures=figures, overwrite=True,
            on_moment=show, on_start=begun,
        )  # fmt: skip
    print_session(summary, out)
    return summary


def print_session(summary: dict[str, Any], out: Path) -> None:
    """Print the summary of a session in a few lines."""
    timing, safety, recorder = summary["timing"], summary["safety"], summary["recorder"]
    line = (
        f"{out}: {summary['trajectory']['seconds']:.1f} s on {summary['trajectory']['device']}, "
        f"{timing['ticks']} ticks, {timing['misses']} missed ({timing['misses_percent']:.2g} %), "
        f"{timing['fallbacks']} fallbacks ({timing['fallbacks_percent']:.2g} %), "
        f"{timing['cut_short']} searches cut short; "
        f"contact force at most {summary['largest_force_n']:.3g} N; passivity corrections "
        f"{summary['passivity']['interventions']}, clamped forces {safety['clamped_force']}, "
        f"silences {safety['silences']}; ended: {summary['ended']}"
    )
    refused = summary["real_time"].items()
    more = [error for error in (safety["last_error"], recorder["error"]) if error]
    more += [f"{request}: {answer}" for request, answer in refused if answer.startswith("refused")]
    more += summary["notes"]
    print_result([line, *(f"  {one}" for one in more)], summary)


def with_coupling(scene: Scene, mode: str | None) -> Scene:
    """Return a scene with a virtual coupling: `mode`, else the scene's own, else implicit."""
    chosen = mode or scene.document.get("coupling", {}).get("mode", "implicit")
    return replace(scene.changed(coupling={"mode": chosen}), notes=scene.notes)


def parse_device_options(options: tuple[str, ...]) -> dict[str, Any]:
    """Return options of a driver from KEY=VALUE texts; numbers become numbers."""
    return dict(_key_value(text) for text in options)


def _key_value(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise AsperityError(f"--device-option must be KEY=VALUE, got {text!r}")
    for kind in (int, float):
        try:
            return key, kind(value)
        except ValueError:
            continue
    return key, value
