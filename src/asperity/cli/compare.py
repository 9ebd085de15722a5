"""`asperity compare`."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.motion import motion_of
from asperity.cli.options import Range, command, in_si
from asperity.cli.result import print_result
from asperity.errors import AsperityError

_BUDGET = 1.0


@command
@dataclass
class CompareCommand:
    """Compare rendering methods from the literature on one scene and one motion.

    Writes force traces, spectra, cost per tick and measured claims as tables (JSON, CSV), figures
    (PNG, SVG) and a page (HTML, Markdown). A method that cannot render the scene is listed with the
    reason.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """probe-plate, probe-plate-dots, probe-plate-grating, hammer-blocks, file-cad, or a folder."""
    method: tuple[str, ...] = ()
    """Methods to run, or Python files that define some. Default: all."""
    claim: tuple[str, ...] = ()
    """Claims to measure, on plates of their own, by name, or by text or part of it in quotes; all,
    or none. Default: all about methods of one's own, and the stored ones about the others."""
    motion: str | None = None
    """slide, circle, press-and-slide, rotate, or a file of poses. Default: the scene's."""
    seconds: Annotated[float | None, Range(0.05, 600.0, "s")] = None
    """Duration. Default: the motion's."""
    speed_mm_s: Annotated[float | None, Range(0.1, 2000.0, "mm/s")] = None
    """Sliding speed. Default: the motion's."""
    force_n: Annotated[float | None, Range(1e-3, 20.0, "N")] = None
    """Normal force. Default: the motion's."""
    budget_s: Annotated[float, Range(0.1, 36000.0, "s")] = _BUDGET
    """Longest time that the ticks of one method may take; a slower method runs a shorter motion."""
    no_properties: bool = False
    """Deprecated: use `--claim none`."""
    docs: Path | None = None
    """A folder of documentation that also receives comparison.md and its figures."""
    out: Path = Path("out/compare")
    """Folder for the results."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Compare, write the tables and the page, and print a line for each method."""
        from asperity._core.output import result_folder
        from asperity.scene.builtin import load_scene
        from asperity.studies.comparison.claims import choose_claims
        from asperity.studies.comparison.compare import CompareSettings, compare, find_methods
        from asperity.studies.comparison.write import summary, write_comparison, write_docs

        if self.no_properties:
            print("asperity: --no-properties is deprecated: use --claim none", file=sys.stderr)
            self.claim = ("none",)
        methods, claims = find_methods(self.method), choose_claims(self.claim)
        if self.docs is not None and not self.docs.is_dir():
            raise AsperityError(f"no such folder for --docs: {self.docs}")
        scene = load_scene(self.scene)
        options = in_si(self)
        changes = {
            "seconds": options.seconds, "press_force": options.force, "speed": options.speed,
        }  # fmt: skip
        motion = motion_of(scene, "--motion", self.motion, changes)
        settings = CompareSettings(motion=motion, budget=options.budget, claims=claims)
        with result_folder(self.out, overwrite=self.overwrite) as folder, _progress() as progress:
            result = compare(scene, methods, settings, progress=progress)
            write_comparison(result, folder, self._command())
            if self.docs is not None:
                write_docs(folder, self.docs, result, self._command())
        able = [row for row in result.rows if row.reason is None]
        lines = [f"{self.out}: {len(able)} of {len(result.rows)} methods render {scene.name}"]
        for row in result.rows:
            if row.reason is not None:
                lines.append(f"  {row.method.name}: not applicable: {row.reason}")
                continue
            done = row.rendered
            assert done is not None
            reference = row.method.name == "asperity"
            ratio = "" if reference else f", {done.ratio:.3g} times asperity's"
            lines.append(
                f"  {row.method.name}: median {1e6 * done.cost[0]:.3g} us{ratio}; "
                f"{1e3 * done.band_rms:.3g} mN between 20 and 200 Hz"
            )
        print_result(lines, summary(result, self._command()) | {"out": self.out})

    def _command(self) -> str:
        """Return the command that reproduces the page."""
        words = ["asperity compare", shlex.quote(self.scene)]
        if self.method:
            words.append(f"--method {' '.join(self.method)}")
        for name in ("motion", "seconds", "speed_mm_s", "force_n", "budget_s"):
            value = getattr(self, name)
            if value is not None and (name, value) != ("budget_s", _BUDGET):
                words.append(f"--{name.replace('_', '-')} {shlex.quote(str(value))}")
        if self.claim:
            words.append(f"--claim {shlex.join(self.claim)}")
        return " ".join(words)


@contextmanager
def _progress() -> Iterator[Callable[[str, int], None]]:
    """Yield a function that shows the current step and how much is done [%]."""
    from asperity.cli.progress import progress_bars

    with progress_bars() as bars:
        task = bars.add_task("comparing", total=100)

        def show(step: str, done: int) -> None:
            bars.update(task, description=step, completed=min(done, 100))

        yield show
