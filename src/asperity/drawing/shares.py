"""Shares as pictures: cells that are the darker the larger the share that they stand for."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import REPORT_WIDTH, SMALLEST, style
from asperity.dynamics.dragged_hand.hand import Hand

SHADES = LinearSegmentedColormap.from_list("share", ["#ffffff", "#9ecae1", "#08519c"])
NOT_COUNTED = "#e4e4e4"
"""Colour of a cell whose share does not count."""
_DARK = 0.6
"""Share above which a cell is so dark that its number is white."""
_EDGE = "#c9c9c9"
"""Colour of the edges of cells: an empty one is still seen as a cell."""


def draw_shares(
    axis: Axes, shares: NDArray[np.float64], counts: NDArray[np.bool_], top: float = 0.0
) -> None:
    """Draw a table of shares: a cell each, with its number in percent.

    Parameters
    ----------
    axis : Axes
        Rows run downwards from `top`, a row and a column each 1 high and wide.
    shares : (rows, columns) array
        0 to 1; NaN leaves a cell out.
    counts : (rows, columns) array
        Whether a share counts; those that do not are grey.
    top : float
        Upper edge of the first row.
    """
    for (i, j), share in np.ndenumerate(shares):
        if np.isnan(share):
            continue
        low, high = top + i, top + i + 1.0
        axis.fill(
            [j, j + 1, j + 1, j], [low, low, high, high], lw=1.0, ec="white",
            color=SHADES(share) if counts[i, j] else NOT_COUNTED,
        )  # fmt: skip
        axis.plot(
            [j, j + 1, j + 1, j, j], [low, low, high, high, low], color=_EDGE, lw=0.5,
            solid_joinstyle="miter",
        )  # fmt: skip
        axis.text(
            j + 0.5, low + 0.53, f"{100.0 * share:.0f}", ha="center", va="center",
            fontsize=SMALLEST, color="white" if counts[i, j] and share > _DARK else "#222222",
        )  # fmt: skip


def draw_hands(axis: Axes, hands: Sequence[Hand], shares: NDArray[np.float64]) -> None:
    """Draw a share for each hand of a grid: m upwards, and to the right b within k.

    Parameters
    ----------
    axis : Axes
    hands : sequence of Hand
        Every combination of some masses, stiffnesses and damping coefficients.
    shares : (hands,) array
        0 to 1.
    """
    masses, stiff, damp = (
        sorted({getattr(hand, name) for hand in hands}) for name in ("mass", "stiffness", "damping")
    )
    grid = np.full((len(masses), len(stiff) * len(damp)), np.nan)
    for hand, share in zip(hands, shares.tolist(), strict=True):
        column = stiff.index(hand.stiffness) * len(damp) + damp.index(hand.damping)
        grid[masses.index(hand.mass), column] = share
    axis.pcolormesh(grid, cmap=SHADES, vmin=0.0, vmax=1.0, edgecolors=_EDGE, linewidth=0.5)
    for k in range(1, len(stiff)):
        axis.axvline(k * len(damp), color="#333333", lw=1.2)
    axis.set_yticks(np.arange(len(masses)) + 0.5, [f"{1e3 * mass:g}" for mass in masses])
    axis.set_xticks(np.arange(grid.shape[1]) + 0.5, [f"{b:g}" for b in damp] * len(stiff))
    make_bare(axis)


def label_stiffness(axis: Axes, hands: Sequence[Hand]) -> None:
    """Write the stiffnesses of hands above a picture of `draw_hands`."""
    stiff = sorted({hand.stiffness for hand in hands})
    width = len({hand.damping for hand in hands})
    top = len({hand.mass for hand in hands})
    for i, value in enumerate(stiff):
        axis.text(
            (i + 0.5) * width, top + 0.1, f"k {value:g}", ha="center", va="bottom",
            fontsize=SMALLEST, color="#444444",
        )  # fmt: skip


def hands_grid(
    rows: Sequence[str],
    columns: Sequence[tuple[str, Sequence[Hand]]],
    shares_of: Callable[[int, int], NDArray[np.float64]],
) -> Figure:
    """Return pictures of `draw_hands` in rows and columns, with a scale of the shades below.

    Parameters
    ----------
    rows : sequence of str
        What stands beside each row.
    columns : sequence of (str, sequence of Hand)
        Title and hands of each column.
    shares_of : callable
        Returns the shares (hands,) of a row and a column, by their numbers.
    """
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 6.3))
        axes = figure.subplots(len(rows), len(columns), squeeze=False)
        for i, text in enumerate(rows):
            for j, (_, hands) in enumerate(columns):
                draw_hands(axes[i, j], hands, shares_of(i, j))
                if j > 0:
                    axes[i, j].set_yticklabels([])
            axes[i, 0].set_ylabel(f"{textwrap.fill(text, 17)}\n\nm [g]", fontsize=SMALLEST)
        for axis, (title, hands) in zip(axes[0], columns, strict=True):
            axis.set_title(title, loc="center", pad=20)
            label_stiffness(axis, hands)
        for axis in axes[:-1].flat:
            axis.set_xticklabels([])
        for axis in axes[-1]:
            axis.set_xlabel("b [N s/m], within k [N/m]", fontsize=SMALLEST)
        figure.tight_layout(w_pad=0.8, h_pad=1.0, rect=(0, 0.075, 1, 1))
        draw_scale(figure, (0.72, 0.045, 0.26, 0.018), "share of the plates [%]")
    return figure


def draw_scale(figure: Figure, place: tuple[float, float, float, float], title: str) -> None:
    """Draw the scale of shades, 0 to 100 %, into a place (left, bottom, width, height)."""
    axis = figure.add_axes(place)
    axis.imshow(np.linspace(0, 1, 64)[None, :], cmap=SHADES, aspect="auto", extent=(0, 100, 0, 1))
    axis.set(yticks=[], xticks=[0, 50, 100])
    axis.set_title(title, fontsize=SMALLEST, loc="left")
    axis.grid(False)


def make_bare(axis: Axes) -> None:
    """Take spines, grid and tick marks away."""
    axis.tick_params(length=0)
    axis.grid(False)
    for spine in axis.spines.values():
        spine.set_visible(False)
