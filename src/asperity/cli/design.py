"""`asperity design`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import command
from asperity.cli.result import print_result


@command
@dataclass
class DesignCommand:
    """Find surfaces that have a wanted roughness, spectrum or distance, ready to print.

    Writes for each surface its map (float TIFF in metres), a plate (STL in mm), a scene to feel
    it, and for all report.html and design.json. A target that no surface has is refused.
    """

    target: Annotated[Positional[Path], arg(metavar="TARGET.toml")]
    """What is wanted, of which pattern, made by which process."""
    six_dof: bool = True
    """Check the surfaces by the 6-DoF contact solver as well."""
    out: Path = Path("out/design")
    """Folder for the result."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Search, write, and print how far each surface misses its target."""
        from asperity.cli.progress import progress_bars
        from asperity.designing.design import design

        with progress_bars() as bars:
            task = bars.add_task(self.target.name, total=100)

            def show(what: str, share: float) -> None:
                bars.update(task, completed=round(100 * share), description=what)

            made = design(
                self.target, self.out, six_dof=self.six_dof, overwrite=self.overwrite,
                on_progress=show,
            )  # fmt: skip
        lines = [f"{self.out}: {len(made.surfaces)} surfaces; see report.html"]
        for i, surface in enumerate(made.surfaces):
            shown = ", ".join(_shown(k, v) for k, v in surface.parameters.items())
            lines.append(f"  {i + 1}: {surface.kind}, {shown}; {100 * surface.worst:.2g} % off")
        if "series" in made.report:
            share = made.report["series"]["share_even_within_5_percent"]
            lines.append(f"  even within 5 % for {100 * share:.0f} % of 36 hands")
        lines += [f"  {note}" for note in made.report["notes"]]
        print_result(lines, made.report)


def _shown(name: str, value: float) -> str:
    """Return a parameter of a pattern as text, lengths in mm."""
    from asperity.scene.shorthand import NO_LENGTHS

    return f"{name} {value:.4g}" if name in NO_LENGTHS else f"{name} {1e3 * value:.4g} mm"
