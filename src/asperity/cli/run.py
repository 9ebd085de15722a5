"""`asperity run`."""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.motion import motion_of
from asperity.cli.options import Range, command, in_si
from asperity.cli.realtime_run import DeviceOptions
from asperity.cli.result import print_result
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from asperity.scene.scene import Scene
    from asperity.scene.trajectory import ScriptedMotion, Trajectory


_MOTION_OPTIONS = (
    "trajectory", "speed_mm_s", "length_mm", "direction_deg", "radius_mm", "turning_deg_s",
    "force_n", "depth_mm", "order", "hand",
)  # fmt: skip
"""Options of the motion, which only a simulated hand follows."""
_NO_TORQUE = 1e-9
"""Torque over force that counts as none [m]."""


@command
@dataclass
class RunCommand:
    """Move a textured tool over a textured scene, in simulated time or with a device in real time.

    Writes summary.json, recording.h5, a picture of the contact, and plots of force, torque and
    the spectrum of the tangential force. Options without a default take the scene's value.
    """

    scene: Annotated[Positional[str | None], arg(metavar="SCENE")] = None
    """probe-plate, probe-plate-dots, probe-plate-grating, hammer-blocks, file-cad, finger-plate,
    tactile-map, sponge, palpation, elastic-block,
    or a folder with a scene, or an MJCF or URDF file. Alternatively, give --tool and --target."""
    tool: str | None = None
    """Mesh of the tool, z upwards (.obj, .glb, .gltf, .ply, .stl, .usd), or a solid: sphere:3mm,
    box:20x10x5mm, capsule:3x20mm, cylinder:3x20mm, ellipsoid:8x6x4mm."""
    target: str | None = None
    """Mesh of the object that the tool moves over, or a solid."""
    tool_texture: str | None = None
    """Height map on the tool: an image, an array, an instrument's file, a folder of maps, or a
    pattern: knurl:0.8mm. Options of a file follow it: cast.png:colour=red,pixel_size=10um. Default:
    the displacement or normal map that the mesh brings."""
    target_texture: str | None = None
    """Height map on the target. Default: the one that the mesh brings, else smooth."""
    tool_unit: str | None = None
    """Length unit of the tool's mesh: m, cm, mm, in, ... Default: as the file states, or m."""
    target_unit: str | None = None
    """Length unit of the target's mesh. Default: as the file states, or m."""
    tool_mapping: str | None = None
    """Texture mapping on the tool: uv, triplanar, planar, cylindrical. Default: uv."""
    target_mapping: str | None = None
    """Texture mapping on the target. Default: uv."""
    tool_relief_mm: Annotated[float | None, Range(1e-6, 100.0, "mm")] = None
    """Peak-to-valley height of the tool's texture. Default: the file's, or 0.2."""
    target_relief_mm: Annotated[float | None, Range(1e-6, 100.0, "mm")] = None
    """Peak-to-valley height of the target's texture. Default: the file's, or 0.2."""
    trajectory: str | None = None
    """slide, circle, press-and-slide, rotate, or a file of poses (.csv, .json, .npy, .npz), also
    with options: poses.csv:unit=mm."""
    order: str | None = None
    """Order of a file of poses without names: wxyz, xyzw, rotvec, rpy, matrix, matrix-columns."""
    seconds: Annotated[float | None, Range(0.01, 3600.0, "s")] = None
    """Duration of a scripted trajectory; with a device, of the session (default: until Ctrl-C)."""
    speed_mm_s: Annotated[float | None, Range(0.1, 1e4, "mm/s")] = None
    """Sliding speed."""
    length_mm: Annotated[float | None, Range(0.1, 1e4, "mm")] = None
    """Length of the line along which slide moves back and forth."""
    direction_deg: Annotated[float | None, Range(-360.0, 360.0, "deg")] = None
    """Direction of the line, from x towards y."""
    radius_mm: Annotated[float | None, Range(0.1, 1e4, "mm")] = None
    """Radius of circle."""
    turning_deg_s: Annotated[float | None, Range(-1e5, 1e5, "deg/s")] = None
    """Angular speed of rotate."""
    force_n: Annotated[float | None, Range(0.0, 100.0, "N")] = None
    """Normal force at the start, from which the press depth is found."""
    depth_mm: Annotated[float | None, Range(-100.0, 100.0, "mm")] = None
    """Press depth, instead of a normal force."""
    anti_alias: str | None = None
    """Anti-aliasing of texture that passes faster than the tick rate can represent: off, tick,
    or band."""
    coupling: str | None = None
    """Virtual coupling of tool and handle: direct, implicit, semi-implicit, static."""
    device: str | None = None
    """Run in real time with this device: simulated, replay:FILE, haply, touch, ...: see
    `asperity devices`."""
    options: Annotated[DeviceOptions, arg(name="")] = field(default_factory=DeviceOptions)
    field_rate_hz: Annotated[float | None, Range(0.1, 1e5, "Hz")] = None
    """Rate at which the pressure and shear on a soft body, or on a rigid tool, go into the
    recording, pictures of the pressure into the folder pressure, and images of pressure and shear
    as three channels into traction. Default: none are recorded."""
    hand: bool = False
    """Hold the tool with a simulated hand, which follows the trajectory, presses, and yields."""
    seed: Annotated[int | None, Range(0, 2**31 - 1)] = None
    """Seed of random textures."""
    out: Path = Path("out/run")
    """Folder for the results."""
    save: Path | None = None
    """Also save the scene to this folder, with what these options change of it, to change
    scene.toml there and run it again. A file of poses is not saved."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Run, write, and print a summary."""
        if self.device is not None:
            self._run_on_device(self.device)
            return
        if self.options != DeviceOptions():
            raise AsperityError("options of the servo loop need --device NAME")
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.runs.pressure_figure import write_skin_pictures
        from asperity.runs.run_scene import run_scene, take_pictures, write_figures, write_summary
        from asperity.scene.scale import scale_table
        from asperity.simulation.tool_contact import announce_compiling, tick_kernel

        with ExitStack() as ending:
            bars = ending.enter_context(progress_bars())
            # Reading a mesh takes seconds, and at first what does it has to be compiled.
            task = bars.add_task("making the scene ready", total=None)
            scene = self._scene()
            scale = scale_table(scene)
            motion = self._motion(scene)
            self._save(scene, motion)
            announce_compiling(tick_kernel(scene))
            folder = ending.enter_context(result_folder(self.out, overwrite=self.overwrite))
            bars.update(task, description=scene.name)

            def show(i: int, rollout: Any) -> None:
                if i == 0 and scale:
                    bars.console.print(scale, markup=False, highlight=False, soft_wrap=True)
                if i % 25 == 0 or i + 1 == len(rollout.time):
                    fx, fy, fz = rollout.device_wrench[i, :3]
                    force = (fx * fx + fy * fy + fz * fz) ** 0.5
                    label = f"{scene.name}  {force:6.3f} N"
                    bars.update(task, completed=i + 1, total=len(rollout.time), description=label)

            done = run_scene(
                scene, folder / "recording.h5", motion=motion, hand=self.hand, on_tick=show,
                field_rate=self.field_rate_hz or 0.0,
            )  # fmt: skip
            bars.update(task, description="figures")
            write_summary(done, folder / "summary.json")
            write_figures(done, take_pictures(done, scene), folder)
            if self.field_rate_hz:
                write_skin_pictures(folder, scene.name)
        self._print(done.summary)

    def _run_on_device(self, device: str) -> None:
        """Run the scene on a device in real time."""
        from asperity.cli.realtime_run import run_on_device, servo_spec, with_coupling

        if self.field_rate_hz:
            raise AsperityError("--field-rate-hz: fields are recorded in simulated time only")
        moved = [f"--{name.replace('_', '-')}" for name in _MOTION_OPTIONS if getattr(self, name)]
        if moved and (device != "simulated" or self.hand):
            raise AsperityError(
                f"{', '.join(moved)}: the user's hand moves the device {device}; leave them out"
            )
        scene = with_coupling(self._scene(), self.coupling)
        motion = self._motion(scene) if device == "simulated" else None
        self._save(scene, motion)
        spec = servo_spec(scene, device, self.options, self.seconds, motion)
        source = self.scene or ""
        run_on_device(spec, self.out, source=source, figures=True, overwrite=self.overwrite)

    def _scene(self) -> Scene:
        """Return the scene that the options describe."""
        from asperity.dynamics.virtual_coupling.settings import COUPLING_MODES
        from asperity.scene.builtin import load_scene
        from asperity.scene.sections import ANTI_ALIAS_MODES

        if self.anti_alias is not None:
            require_choice("--anti-alias", self.anti_alias, ANTI_ALIAS_MODES)
        if self.coupling is not None:
            require_choice("--coupling", self.coupling, COUPLING_MODES)
        self._refuse_mixed()
        scene = (
            self._scene_of_meshes()
            if self.scene is None
            else load_scene(self.scene, seed=self.seed)
        )
        changes = {}
        if self.anti_alias is not None:
            changes["force"] = {"anti_alias": self.anti_alias}
        if self.coupling is not None:
            changes["coupling"] = {"mode": self.coupling}
        return replace(scene.changed(**changes), notes=scene.notes) if changes else scene

    def _save(self, scene: Scene, motion: ScriptedMotion | Trajectory | None) -> None:
        """Save the scene, with a scripted motion as the options change it."""
        from asperity.scene.trajectory import ScriptedMotion

        if self.save is None:
            return
        if isinstance(motion, ScriptedMotion) and motion != scene.motion:
            values = {one.name: getattr(motion, one.name) for one in fields(motion)}
            usual = {one.name: one.default for one in fields(motion)}
            old: dict[str, Any] = dict.fromkeys(scene.document.get("trajectory", {}))
            new = {name: value for name, value in values.items() if value != usual[name]}
            scene = scene.changed(trajectory=old | {"kind": motion.kind} | new)
        scene.save(self.save, overwrite=self.overwrite)

    def _refuse_mixed(self) -> None:
        """Refuse options that do not describe exactly one scene."""
        given = [
            f"--{body}{part.replace('_', '-')}"
            for body in ("tool", "target")
            for part in ("", "_texture", "_unit", "_mapping", "_relief_mm")
            if getattr(self, body + part) is not None
        ]
        if self.scene is not None and given:
            raise AsperityError(f"give a scene ({self.scene}) or {', '.join(given)}, not both")
        if self.scene is None and (self.tool is None or self.target is None):
            lacking = [f"--{name}" for name in ("tool", "target") if getattr(self, name) is None]
            missing = f"{' and '.join(lacking)} missing: " if given else ""
            raise AsperityError(f"{missing}give a scene, or a mesh each with --tool and --target")
        for body in ("tool", "target"):
            if getattr(self, f"{body}_texture") is None:
                for option in (f"--{body}-mapping", f"--{body}-relief-mm"):
                    if option in given:
                        raise AsperityError(f"{option} needs --{body}-texture")
        if self.scene is None and self.seed is not None:
            raise AsperityError("--seed needs a SCENE; textures from files are not random")

    def _scene_of_meshes(self) -> Scene:
        """Return the scene of the meshes and textures that the options name."""
        from asperity.scene.from_files import make_scene
        from asperity.scene.shorthand import file_table, pattern, primitive

        values = in_si(self)
        options: dict[str, Any] = {}
        for body in ("tool", "target"):
            unit, relief = getattr(self, f"{body}_unit"), getattr(values, f"{body}_relief")
            options[body] = getattr(self, body)
            if unit is not None:
                if primitive(options[body]) is not None:
                    raise AsperityError(f"--{body}-unit is for meshes; {options[body]} has a unit")
                options[body] = file_table(options[body]) | {"unit": unit}
            texture = options[f"{body}_texture"] = getattr(self, f"{body}_texture")
            mapping = getattr(self, f"{body}_mapping")
            if texture is None or (mapping is None and relief is None):
                continue
            named = pattern(texture)
            table: dict[str, Any] = file_table(texture) if named is None else named[0]
            if mapping is not None:
                table["mapping"] = mapping
            if relief is not None:
                table["height_range"] = relief
            options[f"{body}_texture"] = table
        try:
            return make_scene(**options)
        except AsperityError as error:
            body, _, what = str(error).partition(":")
            if body not in ("tool", "target"):
                raise
            # As an option, not as an argument in Python.
            what = re.sub(r"\bunit='(\w+)'", rf"--{body}-unit \1", what)
            raise AsperityError(f"{body}:{what}") from None

    def _motion(self, scene: Scene) -> ScriptedMotion | Trajectory:
        """Return the scene's motion with what the options change."""
        if self.force_n is not None and self.depth_mm is not None:
            raise AsperityError("give --force-n or --depth-mm, not both")
        options = in_si(self)
        changes = {
            "seconds": options.seconds, "speed": options.speed, "length": options.length,
            "direction": options.direction, "radius": options.radius, "turning": options.turning,
            "press_force": options.force, "press_depth": options.depth,
        }  # fmt: skip
        kind = self.trajectory
        if self.order is not None:
            if kind is None:
                raise AsperityError("--order needs a file of poses, --trajectory FILE")
            kind += f"{',' if '=' in kind else ':'}order={self.order}"
        return motion_of(scene, "--trajectory", kind, changes)

    def _print(self, summary: dict[str, Any]) -> None:
        us, status = summary["tick_us"], summary["status"]
        contacts = sum(status.values())
        aliasing = summary["anti_alias"]
        active = (
            f"; texture anti-aliased ({aliasing['mode']}) in {aliasing['ticks_active']} ticks"
            if aliasing["ticks_active"]
            else ""
        )
        hand = summary["hand"]
        held = (
            f"; hand: {hand['energy_j'] * 1e3:.3g} mJ in, {hand['gained_j'] * 1e3:.3g} mJ gained, "
            f"{hand['interventions']} corrections"
            if hand
            else ""
        )
        torque = summary["largest_torque_n_m"]
        if torque < _NO_TORQUE * summary["largest_force_n"]:
            torque = 0.0  # of rounding alone, as that of a sphere
        line = (
            f"{self.out}: {summary['ticks']} ticks, median {us['median']:.0f} us, "
            f"p99 {us['p99']:.0f} us; at most {summary['largest_force_n']:.3g} N and "
            f"{torque * 1e3:.3g} mN m; {status['certified']} of {contacts} "
            f"depths certified{active}{held}"
        )
        print_result([line, *(f"  {note}" for note in summary["notes"])], summary)
