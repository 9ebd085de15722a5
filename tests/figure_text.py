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


def _has_script(text: Text) -> bool:
    return bool(re.search(r"\$[^$]*[_^][^$]*\$", text.get_text()))
