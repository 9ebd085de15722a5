"""`asperity run`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import OmitArgPrefixes, Positional, arg

from asperity.cli.ranges import Between, check_ranges
from asperity.cli.realtime_run import DeviceOptions
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from asperity.scene.scene import Scene
    from asperity.scene.trajectory import ScriptedMotion, Trajectory


@dataclass
class RunCommand:
    """Move a textured tool over a textured scene: in simulated time, or with a device in real time.

    Writes summary.json, recording.h5, a picture of the contact, and plots of force, torque and
    the spectrum of the tangential force. What is not given, the scene says.
    """

    scene: Annotated[Positional[str | None], arg(metavar="SCENE")] = None
    """probe-plate, probe-plate-dots, probe-plate-grating, hammer-blocks, file-cad, or a folder
    with a scene. Or give --tool and --target."""
    tool: str | None = None
    """Mesh of the tool, z upwards (.obj, .glb, .gltf, .ply, .stl)."""
    target: str | None = None
    """Mesh of what it is moved over."""
    tool_texture: str | None = None
    """Heights on the tool: an image, an array, an instrument's file. Default: smooth."""
    target_texture: str | None = None
    """Heights on the target."""
    tool_unit: str | None = None
    """Of the tool's mesh: m, cm, mm, in, ... Default: m."""
    target_unit: str | None = None
    """Of the target's mesh. Default: m."""
    tool_mapping: str | None = None
    """uv, triplanar, planar, cylindrical: how the texture lies on the tool. Default: uv."""
    target_mapping: str | None = None
    """How the texture lies on the target."""
    tool_relief_mm: Annotated[float | None, Between(1e-6, 100.0)] = None
    """Lowest to highest of the tool's heights [mm]. Default: the file's, or 0.2."""
    target_relief_mm: Annotated[float | None, Between(1e-6, 100.0)] = None
    """Lowest to highest of the target's heights [mm]."""
    trajectory: str | None = None
    """slide, circle, press-and-slide, rotate, or a file of poses (.csv, .npy, .npz)."""
    seconds: Annotated[float | None, Between(0.01, 3600.0)] = None
    """Duration of a scripted trajectory."""
    speed_mm_s: Annotated[float | None, Between(0.1, 1e4)] = None
    """Of sliding [mm/s]."""
    length_mm: Annotated[float | None, Between(0.1, 1e4)] = None
    """Of a line, which is done to and fro [mm]."""
    direction_deg: Annotated[float | None, Between(-360.0, 360.0)] = None
    """Of the line, from x towards y [degrees]."""
    radius_mm: Annotated[float | None, Between(0.1, 1e4)] = None
    """Of the circle [mm]."""
    turning_deg_s: Annotated[float | None, Between(-1e5, 1e5)] = None
    """Of rotate [degrees/s]."""
    force_n: Annotated[float | None, Between(0.0, 100.0)] = None
    """Normal force at the start; the depth that gives it is searched [N]."""
    depth_mm: Annotated[float | None, Between(-100.0, 100.0)] = None
    """How deep to press instead [mm]."""
    anti_alias: str | None = None
    """off, tick, or band: what is done about texture faster than the tick."""
    coupling: str | None = None
    """direct, implicit, semi-implicit, static: how the tool hangs on the handle."""
    device: str | None = None
    """Feel it through a device, in real time: simulated, replay:FILE, haply, touch, ...: see
    `asperity devices`."""
    options: OmitArgPrefixes[DeviceOptions] = field(default_factory=DeviceOptions)
    hand: bool = False
    """A simulated hand holds the tool: it aims along the trajectory, presses, and yields."""
    seed: Annotated[int | None, Between(0, 2**31 - 1)] = None
    """Of textures that have one. Default: as the scene says."""
    out: Path = Path("out/run")
    """Folder for the results."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Run, write, and say what was felt."""
        check_ranges(self.options)
        check_ranges(self)
        if self.device is not None:
            self._feel(self.device)
            return
        if self.options != DeviceOptions():
            raise AsperityError("options of a device need --device")
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.runs.run_scene import run_scene, take_pictures, write_figures, write_summary
        from asperity.simulation.simulation import announce_compiling

        scene = self._scene()
        motion = self._motion(scene)
        announce_compiling()  # before the bar, not across it
        with result_folder(self.out, overwrite=self.overwrite) as folder, progress_bars() as bars:
            task = bars.add_task(scene.name, total=None)

            def show(i: int, rollout: Any) -> None:
                if i % 25 == 0 or i + 1 == len(rollout.time):
                    fx, fy, fz = rollout.device_wrench[i, :3]
                    force = (fx * fx + fy * fy + fz * fz) ** 0.5
                    told = f"{scene.name}  {force:6.3f} N"
                    bars.update(task, completed=i + 1, total=len(rollout.time), description=told)

            done = run_scene(
                scene, folder / "recording.h5", motion=motion, hand=self.hand, on_tick=show
            )
            bars.update(task, description="figures")
            write_summary(done, folder / "summary.json")
            write_figures(done, take_pictures(done, scene), folder)
        self._say(done.summary)

    def _feel(self, device: str) -> None:
        """Let the scene be felt through a device."""
        from asperity.cli.realtime_run import feel, servo_spec, with_coupling

        moved = [
            f"--{name.replace('_', '-')}"
            for name in (
                "trajectory", "speed_mm_s", "length_mm", "direction_deg", "radius_mm",
                "turning_deg_s", "force_n", "depth_mm", "hand",
            )
            if getattr(self, name)
        ]  # fmt: skip
        if moved and (device != "simulated" or self.hand):
            raise AsperityError(
                f"{', '.join(moved)}: a hand moves the device {device}; leave them out"
            )
        scene = with_coupling(self._scene(), self.coupling)
        motion = self._motion(scene) if device == "simulated" else None
        spec = servo_spec(scene, device, self.options, self.seconds, motion)
        source = self.scene or ""
        feel(spec, self.out, source=source, figures=True, overwrite=self.overwrite)

    def _scene(self) -> Scene:
        from asperity.dynamics.virtual_coupling.settings import MODES as COUPLINGS
        from asperity.scene.builtin import load_scene
        from asperity.scene.scene import ANTI_ALIAS_MODES

        if self.anti_alias is not None:
            require_choice("--anti-alias", self.anti_alias, ANTI_ALIAS_MODES)
        if self.coupling is not None:
            require_choice("--coupling", self.coupling, COUPLINGS)
        self._refuse_mixed()
        scene = self._of_files() if self.scene is None else load_scene(self.scene, seed=self.seed)
        changes = {}
        if self.anti_alias is not None:
            changes["force"] = {"anti_alias": self.anti_alias}
        if self.coupling is not None:
            changes["coupling"] = {"mode": self.coupling}
        return replace(scene.changed(**changes), notes=scene.notes) if changes else scene

    def _refuse_mixed(self) -> None:
        """Refuse options that do not say one scene."""
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
            told = f"{' and '.join(lacking)} missing: " if given else ""
            raise AsperityError(f"{told}give a scene, or a mesh each with --tool and --target")
        for body in ("tool", "target"):
            if getattr(self, f"{body}_texture") is None:
                for option in (f"--{body}-mapping", f"--{body}-relief-mm"):
                    if option in given:
                        raise AsperityError(f"{option} needs --{body}-texture")
        if self.scene is None and self.seed is not None:
            raise AsperityError("--seed is for scenes; textures from files have none")

    def _of_files(self) -> Scene:
        """Return the scene of the meshes and textures that the options name."""
        from asperity.scene.from_files import make_scene

        options: dict[str, Any] = {}
        for body in ("tool", "target"):
            unit, relief = getattr(self, f"{body}_unit"), getattr(self, f"{body}_relief_mm")
            options[body] = {"file": getattr(self, body), "unit": unit or "m"}
            if getattr(self, f"{body}_texture") is None:
                continue
            texture: dict[str, Any] = {"file": getattr(self, f"{body}_texture")}
            if getattr(self, f"{body}_mapping") is not None:
                texture["mapping"] = getattr(self, f"{body}_mapping")
            if relief is not None:
                texture["height_range"] = relief * 1e-3
            options[f"{body}_texture"] = texture
        return make_scene(**options)

    def _motion(self, scene: Scene) -> ScriptedMotion | Trajectory:
        """Return the scene's motion with what the options change."""
        import math

        from asperity.scene.trajectory import KINDS, ScriptedMotion
        from asperity.scene.trajectory_file import read_poses

        given = {
            "seconds": (self.seconds, 1.0), "speed": (self.speed_mm_s, 1e-3),
            "length": (self.length_mm, 1e-3), "direction": (self.direction_deg, math.pi / 180.0),
            "radius": (self.radius_mm, 1e-3), "turning": (self.turning_deg_s, math.pi / 180.0),
            "press_force": (self.force_n, 1.0), "press_depth": (self.depth_mm, 1e-3),
        }  # fmt: skip
        changes = {name: x * scale for name, (x, scale) in given.items() if x is not None}
        if self.force_n is not None and self.depth_mm is not None:
            raise AsperityError("give --force-n or --depth-mm, not both")
        if self.trajectory is not None and self.trajectory not in KINDS:
            if Path(self.trajectory).suffix.lower() in (".csv", ".txt", ".npy", ".npz"):
                if changes:
                    raise AsperityError(
                        f"a file of poses takes no {', '.join(changes)}; leave these options out"
                    )
                return read_poses(self.trajectory)
            require_choice("--trajectory", self.trajectory, [*KINDS, "FILE.csv, .npy or .npz"])
        motion = scene.motion
        if not isinstance(motion, ScriptedMotion):
            if self.trajectory is None and not changes:
                return motion
            motion = ScriptedMotion()
        if self.force_n is not None:
            motion = replace(motion, press_depth=None)
        return replace(motion, **changes, kind=self.trajectory or motion.kind)  # type: ignore[arg-type]

    def _say(self, summary: dict[str, Any]) -> None:
        us, status = summary["tick_us"], summary["status"]
        contacts = sum(status.values())
        aliasing = summary["anti_alias"]
        active = (
            f"; texture averaged ({aliasing['mode']}) in {aliasing['ticks_active']} ticks"
            if aliasing["ticks_active"]
            else f"; texture faster than the tick in {aliasing['ticks_too_fast_and_off']} ticks: "
            "see --anti-alias"
            if aliasing["ticks_too_fast_and_off"]
            else ""
        )
        hand = summary["hand"]
        held = (
            f"; hand: {hand['energy_j'] * 1e3:.3g} mJ in, {hand['gained_j'] * 1e3:.3g} mJ gained, "
            f"{hand['interventions']} corrections"
            if hand
            else ""
        )
        print(
            f"{self.out}: {summary['ticks']} ticks, median {us['median']:.0f} us, "
            f"p99 {us['p99']:.0f} us; at most {summary['largest_force_n']:.3g} N and "
            f"{summary['largest_torque_n_m'] * 1e3:.3g} mN m; {status['certified']} of {contacts} "
            f"depths certified{active}{held}"
        )
        for note in summary["notes"]:
            print(f"  {note}")
