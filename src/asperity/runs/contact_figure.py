"""The figure of a contact: the whole tool, and the contact with its normal and force."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from asperity.drawing.figure_style import COLOURS, REPORT_WIDTH, SMALLEST, style
from asperity.drawing.renderer.contact import ContactMoment, Picture

_ARROW_SHARE = 0.30
"""Length of the longest arrow, as a part of the picture's width."""
_DPI = 160
_EDGE = 6.0
"""Words in a picture keep so far from its edge [dots]."""


def contact_figure(close: Picture, whole: Picture, moment: ContactMoment, title: str) -> Figure:
    """Return the picture of a moment: the whole tool at the left, the contact at the right."""
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 4.2), dpi=_DPI)
        shares = [_shape(whole)[1] / _shape(whole)[0], _shape(close)[1] / _shape(close)[0]]
        left, right = figure.subplots(1, 2, width_ratios=shares)
        for axis, picture in ((left, whole), (right, close)):
            rows, columns = _shape(picture)
            axis.imshow(np.clip(picture.image, 0.0, 1.0), interpolation="antialiased")
            axis.set(xticks=[], yticks=[], xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
            axis.grid(False)
            for spine in axis.spines.values():
                spine.set_visible(True)
                spine.set_color("#cccccc")
            _scale_bar(axis, picture)
        left.set_title("The tool on the scene")
        depth = (
            f";\nraised by its depth of {moment.depth.max() * 1e3:.3g} mm, which would hide it"
            if len(moment.depth)
            else "; no contact"
        )
        right.set_title(f"The contact at {moment.time:.3f} s{depth}")
        _arrows(right, close, moment)
        _frame_mark(left, whole, close, moment)
        figure.suptitle(title, x=0.012, ha="left", fontsize=11, fontweight="bold")
        figure.subplots_adjust(left=0.012, right=0.988, top=0.85, bottom=0.02, wspace=0.03)
        _keep_inside(figure, right)
    return figure


def _keep_inside(figure: Figure, axis: Axes) -> None:
    """Shift the words in a picture that would be cut off at its edge."""
    figure.draw_without_rendering()
    frame = axis.get_window_extent()
    for text in axis.texts:
        box = text.get_window_extent()
        if not text.get_text() or not box.width:
            continue
        shift_x = max(frame.x0 + _EDGE - box.x0, 0.0) + min(frame.x1 - _EDGE - box.x1, 0.0)
        shift_y = max(frame.y0 + _EDGE - box.y0, 0.0) + min(frame.y1 - _EDGE - box.y1, 0.0)
        x, y = axis.transData.transform(text.get_position())
        x, y = axis.transData.inverted().transform((x + shift_x, y + shift_y)).tolist()
        text.set_position((x, y))


def _shape(picture: Picture) -> tuple[int, int]:
    return picture.image.shape[0], picture.image.shape[1]


def _scale_bar(axis: Axes, picture: Picture) -> None:
    """Draw a bar of a round length in the lower left corner."""
    rows, columns = _shape(picture)
    longest = 0.28 * picture.camera.width
    power = 10.0 ** np.floor(np.log10(longest))
    length = float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest))
    x, y = 0.045 * columns if columns > 500 else 0.06 * columns, 0.95 * rows
    outline = [withStroke(linewidth=4.5, foreground="white")]
    axis.plot(
        [x, x + length / picture.camera.pixel], [y, y], color="black", lw=2.5,
        solid_capstyle="butt", path_effects=outline,
    )  # fmt: skip
    _label(axis, x, y - 0.016 * rows, f"{length * 1e3:g} mm", "black", "left", "bottom")


def _label(axis: Axes, x: float, y: float, text: str, colour: str, across: str, up: str) -> None:
    axis.text(
        x, y, text, color=colour, ha=across, va=up, fontsize=SMALLEST, fontweight="bold",
        path_effects=[withStroke(linewidth=2.6, foreground="white")], zorder=6, clip_on=True,
    )  # fmt: skip


def _arrows(axis: Axes, picture: Picture, moment: ContactMoment) -> None:
    """Draw at each contact the normal and the force on the tool, all forces to one scale."""
    if not len(moment.depth):
        return
    sizes = np.linalg.norm(moment.force, axis=1)
    largest = int(np.argmax(sizes))
    length = _ARROW_SHARE * picture.camera.width
    per_newton = length / max(float(sizes[largest]), 1e-300)
    for i, point in enumerate(np.asarray(moment.point + moment.pushed)):
        normal = point + moment.normal[i] * 0.85 * length
        force = point + moment.force[i] * per_newton
        if sizes[i] < 0.03 * sizes[largest]:
            continue
        leans_right = picture.camera.place(force)[0] >= picture.camera.place(normal)[0]
        _arrow(axis, picture, point, normal, "#222222", 1.3, "normal" * (i == largest),
               "right" if leans_right else "left")  # fmt: skip
        label = f"force {sizes[i]:.2g} N" * (i == largest)
        _arrow(axis, picture, point, force, COLOURS[1], 2.4, label,
               "left" if leans_right else "right")  # fmt: skip
        x, y = picture.camera.place(point)
        axis.plot(x, y, "o", color=COLOURS[1], mec="white", mew=1.0, ms=6.0, zorder=7)


def _arrow(
    axis: Axes, picture: Picture, start: NDArray[np.float64], end: NDArray[np.float64],
    colour: str, width: float, label: str, across: str,
) -> None:  # fmt: skip
    (x0, y0), (x1, y1) = picture.camera.place(start), picture.camera.place(end)
    axis.annotate(
        "", (x1, y1), (x0, y0),
        arrowprops={"arrowstyle": "-|>,head_width=0.28,head_length=0.6", "color": colour,
                    "lw": width, "shrinkA": 0.0, "shrinkB": 0.0,
                    "path_effects": [withStroke(linewidth=width + 1.8, foreground="white")]},
        zorder=5,
    )  # fmt: skip
    if label:
        shift = 8.0 if across == "left" else -8.0
        _label(axis, float(x1) + shift, float(y1), label, colour, across, "center")


def _frame_mark(axis: Axes, whole: Picture, close: Picture, moment: ContactMoment) -> None:
    """Mark in the whole picture what the close one shows."""
    x, y = whole.camera.place(close.camera.centre)
    half = 0.5 * close.camera.width / whole.camera.pixel
    tall = half * _shape(close)[0] / _shape(close)[1]
    axis.plot(
        [x - half, x + half, x + half, x - half, x - half],
        [y - tall, y - tall, y + tall, y + tall, y - tall],
        color=COLOURS[1], lw=1.1,
    )  # fmt: skip
