"""`asperity compare`."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from asperity.cli.ranges import Between, check_ranges
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from collections.abc import Iterator

    from asperity.scene.scene import Scene
    from asperity.scene.trajectory import ScriptedMotion, Trajectory

_BUDGET = 60.0


@dataclass
class CompareCommand:
    """Run the methods that people compare against on one scene and one motion, side by side.

    Writes force traces, spectra, cost per tick and measured properties as tables (JSON, CSV),
    figures (PNG, SVG) and a page (HTML, Markdown). A method that cannot do the scene says why.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """probe-plate, probe-plate-dots, probe-plate-grating, hammer-blocks, file-cad, or a folder."""
    method: tuple[str, ...] = ()
    """Only these; by default all."""
    motion: str | None = None
    """slide, circle, press-and-slide, rotate, or a file of poses; by default the scene's."""
    seconds: Annotated[float | None, Between(0.05, 600.0)] = None
    """Duration [s]."""
    speed_mm_s: Annotated[float | None, Between(0.1, 2000.0)] = None
    """Of sliding."""
    force_n: Annotated[float | None, Between(1e-3, 20.0)] = None
    """That presses [N]; by default the motion's."""
    budget_s: Annotated[float, Between(1.0, 36000.0)] = _BUDGET
    """Longest that one method's ticks may take; slower ones go less far."""
    no_properties: bool = False
    """Leave out the properties, which are measured on scenes of their own."""
    docs: Path | None = None
    """A folder of documentation that gets comparison.md and its figures too."""
    out: Path = Path("out/compare")
    """Folder for the results."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Compare, write, and say what came of it."""
        check_ranges(self)
        from asperity._core.output import result_folder
        from asperity.scene.builtin import load_scene
        from asperity.studies.baselines import chosen
        from asperity.studies.comparison.compare import CompareSettings, compare
        from asperity.studies.comparison.write import write_comparison, write_docs

        methods = chosen(self.method)
        if self.docs is not None and not self.docs.is_dir():
            raise AsperityError(f"no such folder for --docs: {self.docs}")
        scene = load_scene(self.scene)
        settings = CompareSettings(
            motion=self._motion(scene), budget=self.budget_s, properties=not self.no_properties
        )
        with result_folder(self.out, overwrite=self.overwrite) as folder, _progress() as progress:
            result = compare(scene, methods, settings, progress=progress)
            write_comparison(result, folder, self._command())
            if self.docs is not None:
                write_docs(folder, self.docs, result, self._command())
        able = [row for row in result.rows if row.reason is None]
        print(f"{self.out}: {len(able)} of {len(result.rows)} methods on {scene.name}")
        for row in result.rows:
            if row.reason is not None:
                print(f"  {row.method.name}: cannot: {row.reason}")
                continue
            assert row.cost is not None
            own = row.method.name == "asperity"
            ratio = "" if own else f", {row.ratio:.3g} times asperity's"
            print(
                f"  {row.method.name}: median {1e6 * row.cost[0]:.3g} us{ratio}; "
                f"{1e3 * (row.band_rms or 0.0):.3g} mN between 20 and 200 Hz"
            )

    def _motion(self, scene: Scene) -> ScriptedMotion | Trajectory:
        """Return the scene's motion with what the options change."""
        from asperity.scene.trajectory import KINDS, ScriptedMotion
        from asperity.scene.trajectory_file import read_poses

        given = {"seconds": self.seconds, "press_force": self.force_n}
        if self.speed_mm_s is not None:
            given["speed"] = 1e-3 * self.speed_mm_s
        changes = {name: value for name, value in given.items() if value is not None}
        if self.motion is not None and self.motion not in KINDS:
            if Path(self.motion).suffix.lower() in (".csv", ".txt", ".npy", ".npz"):
                if changes:
                    raise AsperityError(
                        f"a file of poses takes no {', '.join(changes)}; leave these options out"
                    )
                return read_poses(self.motion)
            require_choice("--motion", self.motion, [*KINDS, "FILE.csv, .npy or .npz"])
        motion = scene.motion
        if not isinstance(motion, ScriptedMotion):
            if self.motion is None and not changes:
                return motion
            motion = ScriptedMotion()
        if self.force_n is not None:
            motion = replace(motion, press_depth=None)
        return replace(motion, **changes, kind=self.motion or motion.kind)  # type: ignore[arg-type]

    def _command(self) -> str:
        """Return the command that makes the page again."""
        words = ["asperity compare", shlex.quote(self.scene)]
        if self.method:
            words.append(f"--method {' '.join(self.method)}")
        for name in ("motion", "seconds", "speed_mm_s", "force_n", "budget_s"):
            value = getattr(self, name)
            if value is not None and (name, value) != ("budget_s", _BUDGET):
                words.append(f"--{name.replace('_', '-')} {shlex.quote(str(value))}")
        if self.no_properties:
            words.append("--no-properties")
        return " ".join(words)


@contextmanager
def _progress() -> Iterator[Callable[[str, int], None]]:
    """Give what to call with what is done and how far it is: a line on stderr, where it is seen."""
    from asperity.cli.progress import progress_bars

    with progress_bars() as bars:
        task = bars.add_task("comparing", total=100)

        def show(what: str, done: int) -> None:
            bars.update(task, description=what, completed=min(done, 100))

        yield show
