"""Make demo.gif: a probe rubs over raised dots, with the force that the hand feels.

The run is deterministic, so the picture is the same wherever it is made. With a folder as its
argument the script also writes single frames there, as PNG.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from asperity import ScriptedMotion, Simulation, load_scene
from asperity.drawing.figure_style import COLOURS, style
from asperity.drawing.renderer.contact import ContactMoment, picture_from
from asperity.drawing.renderer.render import camera_at

OUT = Path(__file__).with_name("demo.gif")
MOTION = ScriptedMotion(
    kind="slide",
    speed=0.05,
    length=0.012,
    seconds=0.58,
    press_force=0.58,
    start=(-0.006, 0.0005, 0.002),
)
TICKS_A_FRAME = 5
SECONDS_A_FRAME = 0.04
SLOWER = 1e3 * SECONDS_A_FRAME / TICKS_A_FRAME
PIXELS = (360, 300)
"""Columns and rows of the rendered scene."""
CHART = (440, 300)
"""Columns and rows of the force trace."""
UPRIGHT = np.array([0.0, 0.0, 1.0])
CAMERA = camera_at(
    np.array([0.0, 0.0, 0.0016]), UPRIGHT, np.array([1.0, 0.0, 0.0]),
    width=0.019, azimuth=np.radians(-18.0), elevation=np.radians(32.0),
    columns=2 * PIXELS[0], rows=2 * PIXELS[1],
)  # fmt: skip
NEWTONS_TO_METRES = 0.008
"""Length of a force arrow in the picture [m/N]."""


def frames() -> list[Image.Image]:
    """Run the scene and draw every tenth tick."""
    scene = load_scene("probe-plate-dots")
    simulation = Simulation(scene)
    moments = []

    def keep(i, rollout):
        if i % TICKS_A_FRAME == 0:
            pose = rollout.tool_pose[i]
            moments.append((i, ContactMoment.of(rollout.time[i], pose, simulation.contacts)))

    rollout = simulation.rollout(MOTION, on_tick=keep)
    return [draw(scene, moment, rollout, i) for i, moment in moments[:-1]]


def draw(scene, moment, rollout, tick) -> Image.Image:
    """Draw the scene at one tick on the left, and the forces up to that tick on the right."""
    picture = picture_from(scene, moment, CAMERA, UPRIGHT, glass=True)
    columns, rows = PIXELS[0] + CHART[0], PIXELS[1]
    figure = Figure(figsize=(columns / 100, rows / 100), dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    left = figure.add_axes((0.0, 0.0, PIXELS[0] / columns, 1.0))
    left.imshow(np.clip(picture.image, 0.0, 1.0), aspect="auto")
    left.axis("off")
    force = rollout.device_wrench[tick, :3]
    at = moment.point.mean(axis=0) + moment.pushed if len(moment.point) else moment.pose[:3]
    ends = [picture.camera.place(p) for p in (at + NEWTONS_TO_METRES * force, at)]
    look = {"arrowstyle": "-|>,head_width=0.35,head_length=0.6", "color": COLOURS[1], "lw": 3.0,
            "shrinkA": 0, "shrinkB": 0}  # fmt: skip
    left.annotate("", *ends, arrowprops=look)
    left.text(
        0.03,
        0.955,
        f"{SLOWER:g} times slower than real",
        transform=left.transAxes,
        va="top",
        fontsize=10,
        color="#333333",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 3.0},
    )
    right = figure.add_axes((PIXELS[0] / columns + 0.095, 0.16, 0.435, 0.70))
    seconds = 1e3 * rollout.time
    for k, (name, colour) in enumerate(
        zip(("across the dots", "sideways", "up"), COLOURS, strict=False)
    ):
        values = rollout.device_wrench[:, k]
        right.plot(seconds[: tick + 1], values[: tick + 1], color=colour, lw=1.3, label=name)
        right.plot(seconds[tick], values[tick], "o", color=colour, ms=5)
    lowest, highest = rollout.device_wrench[:, :3].min(), rollout.device_wrench[:, :3].max()
    right.set(
        xlim=(0, seconds[-1]), ylim=(lowest - 0.08, highest + 0.2), xlabel="time [ms]",
        title="force on the hand [N], 1000 times a second",
    )  # fmt: skip
    right.legend(loc="upper left", ncols=3, handlelength=1.2, columnspacing=1.2)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def palette_of(frame: Image.Image) -> Image.Image:
    """Return a palette: colours of the scene, and the curves' colours down to white."""
    scene = frame.crop((0, 0, *PIXELS)).quantize(120, method=Image.Quantize.MEDIANCUT)
    colours = scene.getpalette()[: 3 * 120]
    for name in (*COLOURS[:3], "#000000"):
        full = np.array([int(name[k : k + 2], 16) for k in (1, 3, 5)])
        for share in np.linspace(0.0, 1.0, 10):
            colours += [round(float(value)) for value in 255 + share * (full - 255)]
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours)
    return palette


def main() -> None:
    """Write the animation, and the frames where a folder is given."""
    with style():
        drawn = frames()
    palette = palette_of(drawn[len(drawn) // 2])
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in drawn]
    indexed[0].save(
        OUT, save_all=True, append_images=indexed[1:], duration=round(1e3 * SECONDS_A_FRAME),
        loop=0, optimize=True, disposal=1,
    )  # fmt: skip
    for folder in map(Path, sys.argv[1:]):
        for number in range(0, len(drawn), 20):
            indexed[number].convert("RGB").save(folder / f"frame-{number:03}.png")
    print(f"{OUT}: {len(drawn)} frames, {OUT.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
