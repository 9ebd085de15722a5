"""`asperity stability`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.ranges import Between, check_ranges


@dataclass
class StabilityCommand:
    """Find the largest stable stiffness of a scene over rate and damping.

    Writes stability.json and a chart (PNG and SVG): Colgate's bound, the scene without its
    textures, and with them; and how much a hand that wants to be still feels.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """probe-plate, probe-plate-dots, probe-plate-grating, hammer-blocks, file-cad, or a folder."""
    rates_khz: Annotated[tuple[float, ...], Between(0.01, 100.0)] = (0.5, 1.0, 2.0, 4.0)
    """Ticks a second [kHz]."""
    dampings_n_s_m: Annotated[tuple[float, ...], Between(1e-3, 100.0)] = (0.1, 0.3, 1.0, 3.0)
    """Of the device, or of device and hand together [N s/m]."""
    mass_kg: Annotated[float, Between(1e-3, 10.0)] = 0.05
    """Of device and hand [kg]."""
    force_n: Annotated[float, Between(1e-3, 20.0)] = 0.58
    """That presses [N]."""
    places: Annotated[int, Between(1, 100)] = 4
    """Along one wave, where the textured scene is tried."""
    out: Path = Path("out/stability")
    """Folder for the results."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Measure, write, and say what holds."""
        import json

        check_ranges(self)
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.drawing import figure_style
        from asperity.dynamics.dragged_hand.hand import Hand
        from asperity.scene.builtin import load_scene
        from asperity.simulation.tool_contact import announce_compiling
        from asperity.studies.stability.figures import stability_figure
        from asperity.studies.stability.measure import StabilitySettings, measure_stability, summary

        settings = StabilitySettings(
            rates=tuple(rate * 1e3 for rate in self.rates_khz),
            dampings=self.dampings_n_s_m,
            hand=Hand(mass=self.mass_kg),
            force=self.force_n,
            places=self.places,
        )
        scene = load_scene(self.scene)
        announce_compiling()
        with result_folder(self.out, overwrite=self.overwrite) as folder, progress_bars() as bars:
            total = len(settings.rates) * len(settings.dampings)
            task = bars.add_task(scene.name, total=total)
            result = measure_stability(scene, settings, progress=lambda: bars.advance(task))
            told = json.dumps(summary(result, scene), indent=2, allow_nan=False)
            (folder / "stability.json").write_text(told + "\n", "utf-8")
            figure = stability_figure(result, scene.name, scene.force.stiffness)
            figure_style.save(figure, folder, "stability")
        ratio = result.plain / result.bound
        worst = result.textured / result.bound
        symptoms = result.symptoms[scene.coupling.mode]
        print(
            f"{self.out}: plain wall stable up to {ratio.min():.2f} to {ratio.max():.2f} of "
            f"2 b / T, textured down to {worst.min():.2g}; Hessian up to "
            f"{result.raised.max():.3g} k; {scene.coupling.mode}: buzzing "
            f"{symptoms.buzzing * 1e3:.3g} mN, aliveness {symptoms.aliveness * 1e3:.3g} mN"
        )
