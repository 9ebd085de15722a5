"""Makes scenes.png, soft-bodies.png and elastic-block.png: scenes, close, with the forces."""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from asperity import load_scene
from asperity.drawing.figure_style import COLOURS, style
from asperity.drawing.renderer.contact import close_picture
from asperity.runs.run_scene import run_scene

_BESIDE = Path(__file__).parent
FIGURES = {
    "scenes": {"probe-plate-dots": 0.2, "hammer-blocks": 0.12, "file-cad": 0.08},
    "soft-bodies": {"tactile-map": 0.4, "sponge": 0.2, "palpation": 0.65},
    "elastic-block": {"elastic-block": 0.2},
}
"""Scenes of each picture, and how long each is run [s]; it is of the moment of the largest force
across the normal."""


def draw(name: str, scenes: dict[str, float], folder: Path) -> None:
    """Write one picture beside this file."""
    figure, out = Figure(figsize=(3.4 * len(scenes), 3.6), dpi=125), _BESIDE / f"{name}.png"
    axes = figure.subplots(1, len(scenes), squeeze=False)[0]
    for axis, (name, seconds) in zip(axes, scenes.items(), strict=True):
        scene = load_scene(name).changed(
            trajectory={"seconds": seconds}, force={"anti_alias": "off"}
        )
        moment = run_scene(scene, folder / f"{name}.h5").moment
        picture = close_picture(scene, moment, columns=520, rows=520)
        axis.imshow(np.clip(picture.image, 0.0, 1.0), interpolation="antialiased")
        longest = 0.3 * picture.camera.width / np.linalg.norm(moment.force, axis=1).max()
        for point, force in zip(moment.point + moment.pushed, moment.force, strict=True):
            ends = [picture.camera.place(p) for p in (point + longest * force, point)]
            look = {"arrowstyle": "-|>", "color": COLOURS[1], "lw": 2.2, "shrinkA": 0, "shrinkB": 0}
            axis.annotate("", *ends, arrowprops=look)
            axis.plot(*ends[1], "o", color=COLOURS[1], mec="white", ms=5.0)
        width = picture.camera.width * 1e3
        axis.set(xticks=[], yticks=[], xlim=(-0.5, 519.5), ylim=(519.5, -0.5))
        axis.set_title(f"{name}, {width:.2g} mm wide")
        axis.grid(False)
        axis.spines[:].set_visible(False)
    figure.subplots_adjust(left=0.008, right=0.992, top=0.9, bottom=0.02, wspace=0.03)
    figure.savefig(out, dpi=140)
    picture = Image.open(out).convert("RGB").quantize(256)
    picture.save(out, optimize=True)


with style(), tempfile.TemporaryDirectory() as folder:
    for name, scenes in FIGURES.items():
        draw(name, scenes, Path(folder))
