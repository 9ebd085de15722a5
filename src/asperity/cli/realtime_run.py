"""What `asperity run --device` and `asperity record` have in common: a scene felt in real time."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from asperity.cli.ranges import Between
from asperity.errors import AsperityError

if TYPE_CHECKING:
    from asperity.realtime.servo.process import ServoSpec
    from asperity.realtime.servo.scheduling import RealTime
    from asperity.scene.scene import Scene
    from asperity.scene.trajectory import ScriptedMotion, Trajectory


@dataclass
class DeviceOptions:
    """How a device is used. Only with --device."""

    device_option: tuple[str, ...] = ()
    """Options of the device, KEY=VALUE ...; see the documentation of devices."""
    rate_hz: Annotated[float, Between(100.0, 20e3)] = 1000.0
    """Ticks a second."""
    scale: Annotated[float, Between(1e-3, 1e3)] = 1.0
    """Metres of the scene for one of the device."""
    force_scale: Annotated[float, Between(1e-3, 1e3)] = 1.0
    """Newtons at the device for one of the scene."""
    max_force_n: Annotated[float | None, Between(0.0, 100.0)] = None
    """Lower limit than the device's own [N]."""
    clutch_button: Annotated[int | None, Between(0, 31)] = None
    """Button that lets the hand move without the tool."""
    no_passivity: bool = False
    """Only keep the account of energy, correct nothing."""
    priority: bool = False
    """Ask for real-time priority."""
    core: Annotated[int | None, Between(0, 1023)] = None
    """Ask for this core."""
    lock_memory: bool = False
    """Ask for memory that is never swapped out."""
    no_busy_wait: bool = False
    """Sleep between ticks, rather than keep a core busy."""

    @property
    def real_time(self) -> RealTime:
        """What is to be asked of the system."""
        from asperity.realtime.servo.scheduling import RealTime

        return RealTime(self.priority, self.core, self.lock_memory, busy_wait=not self.no_busy_wait)


def servo_spec(
    scene: Scene,
    name: str,
    options: DeviceOptions,
    seconds: float | None,
    motion: ScriptedMotion | Trajectory | None,
) -> ServoSpec:
    """Return what a servo process needs to know.

    Parameters
    ----------
    scene : Scene
    name : str
        Of the device.
    options : DeviceOptions
    seconds : float, optional
    motion : ScriptedMotion or Trajectory, optional
        What a simulated hand does. Default: the scene's own.
    """
    from asperity.realtime.devices.catalogue import device
    from asperity.realtime.servo.device_makers import named_device, simulated_device
    from asperity.realtime.servo.process import ServoSpec
    from asperity.realtime.servo.safety import SafetySettings
    from asperity.scene.trajectory import Trajectory

    given = key_values(options.device_option)
    in_scene = name == "simulated" or name == "replay" or name.startswith("replay:")
    make: functools.partial[Any]
    if name == "simulated":
        if given:
            raise AsperityError("the device simulated takes no --device-option here")
        motion = scene.motion if motion is None else motion
        make = functools.partial(simulated_device, scene, motion, 1.0 / options.rate_hz)
        if seconds is None:
            seconds = motion.seconds
    else:
        if isinstance(motion, Trajectory):
            raise AsperityError("--trajectory is for the device simulated, or use replay:FILE")
        made: Any = device(name, **given)  # refuses here what would be refused there
        make = functools.partial(named_device, name, given)
        if seconds is None and in_scene:
            seconds = made.seconds
    return ServoSpec(
        scene,
        make,
        in_scene=in_scene,
        rate=options.rate_hz,
        seconds=seconds,
        passivity=not options.no_passivity,
        mapping={
            "scale": options.scale, "force_scale": options.force_scale,
            "clutch_button": options.clutch_button,
        },
        safety=SafetySettings(max_force=options.max_force_n),
        real_time=options.real_time,
    )  # fmt: skip


def feel(
    spec: ServoSpec, out: Path, *, source: str, figures: bool, overwrite: bool
) -> dict[str, Any]:
    """Run a session with a line of progress; print and return what there is to say."""
    from asperity.cli.progress import progress_bars
    from asperity.realtime.servo.session import run_session

    scene = spec.scene
    with progress_bars() as bars:
        task = bars.add_task(f"{scene.name}: starting", total=spec.seconds)

        def show(moment: Any) -> None:
            fx, fy, fz = moment.device_wrench[:3]
            force = (fx * fx + fy * fy + fz * fz) ** 0.5
            told = (
                f"{scene.name}  {force:5.2f} N  {moment.misses} missed, "
                f"{moment.fallbacks} fallbacks"
            )
            bars.update(task, completed=round(moment.time, 1), description=told)

        def begun(ready: dict[str, Any]) -> None:
            bars.update(task, description=f"{scene.name}: {ready['device']}")

        summary = run_session(
            spec, out, source=source, figures=figures, overwrite=overwrite,
            on_moment=show, on_start=begun,
        )  # fmt: skip
    say(summary, out)
    return summary


def say(summary: dict[str, Any], out: Path) -> None:
    """Print the summary of a session in a few lines."""
    timing, safety, recorder = summary["timing"], summary["safety"], summary["recorder"]
    print(
        f"{out}: {summary['trajectory']['seconds']:.1f} s on {summary['trajectory']['device']}, "
        f"{timing['ticks']} ticks, {timing['misses']} missed ({timing['misses_percent']:.2g} %), "
        f"{timing['fallbacks']} fallbacks ({timing['fallbacks_percent']:.2g} %), "
        f"{timing['cut_short']} searches cut short; "
        f"at most {summary['largest_force_n']:.3g} N in contact; passivity "
        f"{summary['passivity']['interventions']}, clamped {safety['clamped_force']}, "
        f"silent {safety['silences']} times; ended: {summary['ended']}"
    )
    for error in (safety["last_error"], recorder["error"]):
        if error:
            print(f"  {error}")
    for what, answer in summary["real_time"].items():
        if answer.startswith("refused"):
            print(f"  {what}: {answer}")
    for note in summary["notes"]:
        print(f"  {note}")


def with_coupling(scene: Scene, coupling: str | None) -> Scene:
    """Return a scene for a hand: on a coupling, if neither scene nor option says otherwise."""
    mode = coupling or scene.document.get("coupling", {}).get("mode", "implicit")
    return replace(scene.changed(coupling={"mode": mode}), notes=scene.notes)


def key_values(options: tuple[str, ...]) -> dict[str, Any]:
    """Return options of a device as they are given, KEY=VALUE."""
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
