"""The page of a comparison: sections that templates lay out as Markdown and as one HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from asperity import __version__
from asperity.drawing.pages import data_uri, render
from asperity.scene.trajectory import ScriptedMotion
from asperity.studies.comparison.compare import BAND, Comparison, MethodResult, format_number
from asperity.studies.comparison.properties import CRITERIA, Measured

FIGURES = {
    "traces": "Force along the motion during part of it; asperity's in grey.",
    "spectra": "Spectra of the tangential force; the band of 20 to 200 Hz is shaded.",
    "cost": "Cost of a tick over asperity's median in the same run.",
}
"""Name of each figure -> its caption."""
_COLUMNS = (
    "median [us]", "p99 [us]", "over asperity", "RMS [mN]", "20-200 Hz [mN]", "torque [mN m]",
    "ticks",
)  # fmt: skip
"""The columns of `cells_of`."""
_STILL_COLUMNS = ("buzzing, above 150 Hz [mN]", "aliveness, below 20 Hz [mN]", "strays [um]")


class Section(NamedTuple):
    """A section of the page; its texts may hold bold, italics and code as Markdown has them."""

    title: str
    text: str
    head: tuple[str, ...]
    """Heads of the table's columns."""
    rows: list[list[str]]
    figures: tuple[str, ...] = ()
    """Keys of `FIGURES`, shown below the table."""
    notes: tuple[str, ...] = ()
    """Lines below the table."""


def cells_of(row: MethodResult) -> list[str]:
    """Return the cells of a method in the table of cost and force."""
    if row.run is None or row.cost is None:
        return ["-"] * len(_COLUMNS)
    return [
        format_number(1e6 * row.cost[0]),
        format_number(1e6 * row.cost[1]),
        format_number(row.ratio or 0.0),
        format_number(1e3 * (row.tangential or 0.0)),
        format_number(1e3 * (row.band_rms or 0.0)),
        format_number(1e3 * float(row.run.torque.std(axis=0).max())),
        f"{len(row.run.force)}",
    ]


def sections(result: Comparison) -> list[Section]:
    """Return the sections of the page; those without rows are left out."""
    refused = Section(
        "Methods that could not render this scene", "", ("method", "why"),
        [[row.method.label, row.reason] for row in result.rows if row.reason is not None],
    )  # fmt: skip
    optional = [part for part in (_properties(result), _still_hand(result)) if part.rows]
    return [_cost(result), *optional, _sources(result), *([refused] if refused.rows else [])]


def _cost(result: Comparison) -> Section:
    motion = result.settings.motion or result.scene.motion
    path = (
        f"{motion.kind} at {1e3 * motion.speed:g} mm/s"
        if isinstance(motion, ScriptedMotion)
        else f"along {motion.name}"
    )
    seconds = (len(result.poses) - 1) * result.settings.dt
    rows = [[row.method.label, *cells_of(row)] for row in result.rows if row.reason is None]
    return Section(
        "Cost and force",
        f"Scene `{result.scene.name}`, {path} for {seconds:g} s, every method pressed to a mean "
        f"of {result.push:.2g} N. RMS: of the change of the tangential force. "
        f"{BAND[0]:g}-{BAND[1]:g} Hz: its part in that band. Torque: the largest standard "
        "deviation of a component, about the tool's centre of mass. Times are processor times on "
        "one busy machine; the ratio is one of medians of the same run.",
        ("method", *_COLUMNS), rows, tuple(FIGURES) if rows else (),
    )  # fmt: skip


def _properties(result: Comparison) -> Section:
    rows = [
        [row.method.label, *(_cell(*item) for item in row.properties.measured.items())]
        for row in result.rows
        if row.properties is not None
    ]
    criteria = [
        f"*{one.title}*: {one.what}; yes from {one.limit:g} {one.unit} "
        f"{'upwards' if one.above else 'downwards'}."
        for one in CRITERIA.values()
    ]
    return Section(
        "Properties, measured",
        "On a small plate with waves of 0.2 mm by 2 mm, 4 N/mm, pressed to 0.58 N; the criteria "
        "are listed below. A yes of a method that is not silent on a smooth plate may be due to "
        "its own noise.",
        ("method", *(one.title for one in CRITERIA.values())), rows, (),
        (*criteria,
         "The limits are asperity's. Those of torque, size, force and meshing were set before any "
         "method was measured; those of speed and silence after the noise of two methods had been "
         "seen."),
    )  # fmt: skip


def _cell(name: str, measured: Measured) -> str:
    if measured.value is None:
        return measured.detail
    return f"**{verdict(measured)}**, {format_number(measured.value)} {CRITERIA[name].unit}"


def verdict(measured: Measured) -> str:
    """Return whether a property holds, in words."""
    return {True: "yes", False: "no", None: "not measured"}[measured.holds]


def _still_hand(result: Comparison) -> Section:
    rows = [
        [row.method.label, format_number(1e3 * still.buzzing), format_number(1e3 * still.aliveness),
         format_number(1e6 * still.motion)]
        for row in result.rows
        if row.properties is not None and (still := row.properties.still) is not None
    ]  # fmt: skip
    return Section(
        "A hand at rest",
        "Choi and Tan (2003, 2004), on point-based texture of sinusoids: *buzzing*, noise of high "
        "frequency that excites the device, limits the stiffness that feels clean; its largest "
        "value rises from 0.325 to 0.904 N/mm as the rate rises from 250 Hz to 40 kHz, and they "
        "recommend 5 to 10 kHz (read in public material about the papers). *Aliveness*, a slow "
        "change of force under a still hand, happens while the system is passive, with a force in "
        "a fixed direction over a sinusoid (read in an abstract). *Ridge instability*, by which a "
        "resting stylus is pushed into valleys, is recalled with medium confidence. The papers "
        "themselves were not available. The table shows the force on a simulated hand that "
        "presses with 0.58 N on the slope of a wave, at 1 kHz and 4 N/mm, and tries to be still. "
        "A simulated hand has no device that could resonate, so these are not their numbers, and "
        "a method that is quiet here may buzz on a device.",
        ("method", *_STILL_COLUMNS), rows,
    )  # fmt: skip


def _sources(result: Comparison) -> Section:
    return Section(
        "Sources, and how each method differs from them", "",
        ("method", "source", "differences"),
        [[row.method.label, row.method.source, row.method.what_it_is_not] for row in result.rows],
    )  # fmt: skip


def markdown(result: Comparison, command: str, images: Mapping[str, str]) -> str:
    """Return the page as Markdown.

    Parameters
    ----------
    result : Comparison
    command : str
        The command that made it.
    images : mapping
        Name of a figure, a key of `FIGURES` -> address of its image.
    """
    return render("comparison.md", **_values(result, command), images=images)


def page(result: Comparison, command: str, folder: Path) -> str:
    """Return the page as one HTML file that contains its figures, the SVG files in `folder`."""
    files = {name: folder / f"{name}.svg" for name in FIGURES}
    images = {name: data_uri(file) for name, file in files.items() if file.is_file()}
    return render("comparison.html", **_values(result, command), images=images)


def _values(result: Comparison, command: str) -> dict[str, Any]:
    return {
        "sections": sections(result), "captions": FIGURES, "command": command,
        "version": __version__,
        "lead": "Every approach that Otaduy and Lin (2004) name, behind one interface and on one "
        "motion. Poses are given, without a coupling or a hand; friction is left out, because not "
        "all methods have any. Methods differ in stiffness at equal depth, so each path is raised "
        "or lowered as a whole until the mean upward force is the same.",
    }  # fmt: skip
