"""The style of all figures, and saving them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

# Okabe & Ito (2008): distinguishable by colour-blind readers, and in grey by the markers.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
MARKERS = ("o", "s", "^", "D", "v", "P")
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
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
        fine = (
            (1, 2, 3, 5, 7) if high / low < 12.0 else (1, 2, 5) if high / low <= 120.0 else (1, 3)
        )
        ticks = [m * 10.0**e for e in range(-15, 15) for m in fine]
        axis.set_ticks([t for t in ticks if low <= t <= high])
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axis.set_minor_formatter(NullFormatter())
    axis.set_tick_params(which="minor", length=0)


def spectrum_limits(amplitude: NDArray[np.floating[Any]]) -> tuple[float, float]:
    """Return the limits of a logarithmic axis that is filled by the lines of a spectrum.

    At most four decades; up to a hundredth of the lines may be below.
    """
    top = float(np.max(amplitude, initial=0.0))
    if not top > 0.0:
        return 1e-12, 1.0
    low = float(np.percentile(amplitude, 1.0))
    return min(max(0.5 * low, 1e-4 * top), 0.1 * top), 2.0 * top
