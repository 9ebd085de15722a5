"""`asperity stability`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command, in_si, with_options
from asperity.cli.result import print_result

if TYPE_CHECKING:
    from asperity.scene.scene import Scene
    from asperity.studies.stability.measure import Stability

_USUAL = 1000.0
"""Rate that the answer is about, or the measured one that is nearest [Hz]."""


@command
@dataclass
class StabilityCommand:
    """Find the largest stable stiffness of a scene over tick rate and damping.

    Writes stability.json and a chart (PNG and SVG): Colgate's bound, the limit without and with
    textures, and the force on a hand at rest (buzzing and aliveness).
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """probe-plate, probe-plate-dots, probe-plate-grating, hammer-blocks, file-cad, or a folder."""
    rates_khz: Annotated[tuple[float, ...], Range(0.01, 100.0, "kHz")] = (0.5, 1.0, 2.0, 4.0)
    """Tick rates."""
    dampings_n_s_m: Annotated[tuple[float, ...], Range(1e-3, 100.0, "N s/m")] = (
        0.1, 0.3, 1.0, 3.0,
    )  # fmt: skip
    """Damping of the device, or of device and hand together."""
    mass_kg: Annotated[float, Range(1e-3, 10.0, "kg")] = 0.05
    """Mass of device and hand."""
    force_n: Annotated[float, Range(1e-3, 20.0, "N")] = 0.58
    """Normal force."""
    places: Annotated[int, Range(1, 100)] = 4
    """Number of positions along one texture wavelength at which the scene is tested."""
    out: Path = Path("out/stability")
    """Folder for the results."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Measure, write, and print the limits."""
        from asperity._core.output import result_folder, write_json
        from asperity.cli.progress import progress_bars
        from asperity.drawing import figure_style
        from asperity.dynamics.dragged_hand.hand import Hand
        from asperity.scene.builtin import load_scene
        from asperity.simulation.tool_contact import announce_compiling
        from asperity.studies.stability.figures import stability_figure
        from asperity.studies.stability.measure import StabilitySettings, measure_stability, summary

        options = in_si(self)
        settings = with_options(StabilitySettings, options, hand=Hand(mass=options.mass))
        scene = load_scene(self.scene)
        announce_compiling()
        with result_folder(self.out, overwrite=self.overwrite) as folder, progress_bars() as bars:
            total = len(settings.rates) * len(settings.dampings)
            task = bars.add_task(scene.name, total=total)
            result = measure_stability(scene, settings, progress=lambda: bars.advance(task))
            write_json(folder / "stability.json", summary(result, scene))
            figure = stability_figure(result, scene.name, scene.force.stiffness)
            figure_style.save(figure, folder, "stability")
        smooth = result.plain / result.bound
        textured = result.textured / result.bound
        symptoms = result.symptoms[scene.coupling.mode]
        details = (
            f"{self.out}: largest stable stiffness {smooth.min():.2f} to {smooth.max():.2f} of "
            f"2 b / T without texture, at least {textured.min():.2g} with; contact stiffness up to "
            f"{result.raised.max():.3g} times the scene's; {scene.coupling.mode} coupling: buzzing "
            f"{symptoms.buzzing * 1e3:.3g} mN, aliveness {symptoms.aliveness * 1e3:.3g} mN"
        )
        print_result([verdict(result, scene), details], summary(result, scene))


def verdict(result: Stability, scene: Scene) -> str:
    """Return in one sentence which stiffness is safe, and whether that of the scene is."""
    settings, own = result.settings, scene.force.stiffness
    row = min(range(len(settings.rates)), key=lambda i: abs(settings.rates[i] - _USUAL))
    limits = dict(zip(settings.dampings, result.textured[row], strict=True))
    safe = [damping for damping, limit in limits.items() if own <= limit]
    if len(safe) == len(limits):
        answer = "is below that for all of these dampings"
    elif safe:
        answer = f"is below that from a damping of {min(safe):g} N s/m on, and unstable with less"
    else:
        answer = "is above that for all of these dampings, so it would be unstable"
    stable = ", ".join(f"{limit:.3g}" for limit in limits.values())
    dampings = ", ".join(f"{damping:g}" for damping in limits)
    return (
        f"{scene.name} at {1e-3 * settings.rates[row]:g} kHz is stable up to {stable} N/m with a "
        f"damping of {dampings} N s/m; the scene's {own:.4g} N/m {answer}"
    )
