"""The style of all figures, and saving them.

Figures are made at the smallest size at which pages show them (`REPORT_WIDTH`), so that text of
`SMALLEST` points is at least that large for a reader.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from asperity._core.digits import SUPERSCRIPTS

# Okabe & Ito (2008): distinguishable by colour-blind readers, and in grey by the markers.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
MARKERS = ("o", "s", "^", "D", "v", "P")


def colour_and_marker(i: int) -> tuple[str, str]:
    """Return colour and marker of series i; among 36 in a row no two have both alike."""
    return COLOURS[i % 6], MARKERS[(i + i // 6) % 6]


PAGE_WIDTH = 9.6
"""Largest width of a figure that stands alone [inch]."""
REPORT_WIDTH = 6.6
"""Width of a figure of a report [inch]: it fits a window of 700 pixels and a sheet of paper. Where
there is more room, `page.css` shows it larger."""
COLUMN_WIDTH = 7.6
"""Width of a figure in a column of the documentation [inch]."""
SMALLEST = 9.0
"""Size of the smallest text in a figure [pt]."""
SHADE = "#f2ead2"
"""Colour of a band that is marked."""
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10,
    "xtick.labelsize": SMALLEST,
    "ytick.labelsize": SMALLEST,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": SMALLEST,
    "lines.linewidth": 1.4,
    "figure.dpi": 100,
    "savefig.dpi": 200,
    "svg.fonttype": "path",
    "svg.hashsalt": "asperity",
}


@contextmanager
def style() -> Iterator[None]:
    """Set asperity's plotting style for a block."""
    with mpl.rc_context(_STYLE):  # type: ignore[arg-type]
        yield


def save(
    figure: Figure, folder: Path, name: str, kinds: Sequence[str] = ("png", "svg")
) -> list[Path]:
    """Write a figure into `folder`, by default as PNG and SVG; return the paths."""
    paths = [folder / f"{name}.{kind}" for kind in kinds]
    with style():  # which sets resolution, and what makes two files of one figure the same
        for path in paths:
            metadata = {"Date": None} if path.suffix == ".svg" else None
            figure.savefig(path, metadata=metadata)
    return paths


def log_scale(axis: Axes, *, x: bool = True, y: bool = True) -> None:
    """Make the axes x and y of a plot logarithmic, with ticks as of `plain_ticks`."""
    if x:
        axis.set_xscale("log")
        plain_ticks(axis.xaxis)
    if y:
        axis.set_yscale("log")
        plain_ticks(axis.yaxis)


def plain_ticks(axis: Axis) -> None:
    """Label a logarithmic axis, whose limits are final, with plain numbers at readable ticks."""
    low, high = sorted(axis.get_view_interval())
    if high / low < 1e4 and high < 1e5:  # 100000 is read less easily than its power
        spans = ((2.5, (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8)), (12.0, (1, 2, 3, 5, 7)),
                 (120.0, (1, 2, 5)), (np.inf, (1, 3)))  # fmt: skip
        fine = next(numbers for span, numbers in spans if high / low <= span)
        ticks = [m * 10.0**e for e in range(-15, 15) for m in fine]
        axis.set_ticks([t for t in ticks if low <= t <= high])
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    else:
        axis.set_major_formatter(FuncFormatter(_power_of_ten))
    axis.set_minor_formatter(NullFormatter())
    axis.set_tick_params(which="minor", length=0)


def _power_of_ten(value: float, _: int) -> str:
    """Return a power of ten in characters of full size, as mathematical text has none."""
    power = round(float(np.log10(value))) if value > 0.0 else 0
    if not np.isclose(value, 10.0**power):
        return f"{value:g}"
    return f"10{str(power).translate(SUPERSCRIPTS)}" if power else "1"
