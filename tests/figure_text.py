"""The text of figures: what they say, and how large its smallest letters are."""

from __future__ import annotations

import re

from matplotlib.figure import Figure
from matplotlib.text import Text

SUBSCRIPT = 0.7
"""Size of a subscript or superscript of matplotlib's mathematical text, over that of its text."""


def texts_of(figure: Figure) -> list[Text]:
    """Return every text that a figure shows."""
    figure.draw_without_rendering()
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
    hidden = {
        id(text)
        for axis in figure.axes
        if not axis.get_visible()
        for text in axis.findobj(Text)
    }  # fmt: skip
    return [text for text in shown if id(text) not in hidden]


def smallest_text(figure: Figure) -> tuple[float, str]:
    """Return the size of the smallest letters of a figure [pt], and the text that holds them."""
    return min(
        (text.get_fontsize() * (SUBSCRIPT if _has_script(text) else 1.0), text.get_text())
        for text in texts_of(figure)
    )


def misplaced_text(figure: Figure, slack: float = 1.0) -> list[str]:
    """Return texts of a figure that are cut off at its edge, or that lie on another text.

    `slack` [pt] is how far boxes, which are larger than their letters, may reach.
    """
    boxes = []
    for text in texts_of(figure):
        box = text.get_window_extent()
        if _is_drawn(text, figure) and box.width > 0.0:
            boxes.append((text.get_text(), box))
    pixels = slack * figure.dpi / 72.0
    frame, wrong = figure.bbox.padded(pixels), []
    for i, (words, box) in enumerate(boxes):
        inside = frame.x0 <= box.x0 and box.x1 <= frame.x1
        if not (inside and frame.y0 <= box.y0 and box.y1 <= frame.y1):
            wrong.append(f"{words!r} is cut off")
        for others, other in boxes[:i]:
            across = min(box.x1, other.x1) - max(box.x0, other.x0)
            up = min(box.y1, other.y1) - max(box.y0, other.y0)
            if across > pixels and up > 2.0 * pixels:
                wrong.append(f"{words!r} lies on {others!r}")
    return wrong


def _is_drawn(text: Text, figure: Figure) -> bool:
    """Return whether a text is not the label of a tick beyond the end of its axis."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            room = 1e-9 * (high - low)
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if text in (tick.label1, tick.label2):
                    return bool(low - room <= tick.get_loc() <= high + room)
    return True


def _has_script(text: Text) -> bool:
    return bool(re.search(r"\$[^$]*[_^][^$]*\$", text.get_text()))
