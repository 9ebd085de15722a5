"""The page of a comparison: sections that templates lay out as Markdown and as one HTML file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from asperity import __version__
from asperity._core.digits import telling
from asperity.drawing.pages import data_uri, render
from asperity.scene.trajectory import ScriptedMotion
from asperity.studies.comparison.claims import CLAIMS, Measured
from asperity.studies.comparison.compare import BAND, Comparison, MethodResult, format_number

FIGURES = {
    "traces": "Force along the motion during part of it; asperity's in grey.",
    "spectra": "The tangential force in third octaves; the band of 20 to 200 Hz is shaded.",
    "cost": "Cost of a tick over asperity's median in the same run.",
}
"""Name of each figure -> its caption."""
_COLUMNS = (
    "median [us]", "p99 [us]", "over asperity", "mean [mN]", "RMS [mN]", "20-200 Hz [mN]",
    "mean torque [mN m]", "RMS torque [mN m]", "ticks",
)  # fmt: skip
"""The columns of `cells_of`."""
_STILL = (
    ("buzzing, above 150 Hz", "mN", 1e3, "buzzing"),
    ("aliveness, below 20 Hz", "mN", 1e3, "aliveness"),
    ("strays", "um", 1e6, "motion"),
)
"""Symptoms of a hand at rest: title, unit, its scale, and field of `Symptoms`."""


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
    done = row.rendered
    if done is None:
        return ["-"] * len(_COLUMNS)
    numbers = (
        1e6 * done.cost[0], 1e6 * done.cost[1], done.ratio, 1e3 * done.mean_tangential,
        1e3 * done.tangential, 1e3 * done.band_rms, *(1e3 * size for size in done.torque),
    )  # fmt: skip
    return [*map(format_number, numbers), f"{len(done.run.force)}"]


def sections(result: Comparison) -> list[Section]:
    """Return the sections of the page; those without rows are left out."""
    measured = [(row.method.label, row.claims) for row in result.rows if row.claims]
    names = [name for name in CLAIMS if any(name in of.measured for _, of in measured)]
    claims = Section(
        "Claims, measured", _text("claims"),
        ("method", *(CLAIMS[name].title for name in names)),
        [[label, *(_cell(name, of.measured[name]) for name in names)] for label, of in measured],
        notes=tuple(
            f"*{one.title}*: {one.what}; yes from {one.limit:g} {one.unit} "
            f"{'upwards' if one.above else 'downwards'}."
            for one in (CLAIMS[name] for name in names)
        ),
    )  # fmt: skip
    rest = Section(
        "A hand at rest", _text("rest"),
        ("method", *(f"{what} [{unit}]" for what, unit, _, _ in _STILL)),
        [[label, *(format_number(scale * getattr(s, key)) for _, _, scale, key in _STILL)]
         for label, of in measured if (s := of.still)],
    )  # fmt: skip
    sources = Section(
        "Sources, and how each method differs from them", "",
        ("method", "source", "differences"),
        [[row.method.label, row.method.source, row.method.what_it_is_not] for row in result.rows],
    )  # fmt: skip
    refused = Section(
        "Methods that could not render this scene", "", ("method", "why"),
        [[row.method.label, row.reason] for row in result.rows if row.reason is not None],
    )  # fmt: skip
    shown = (claims, _others_better(result), rest, sources, refused)
    return [_cost(result), *(section for section in shown if section.rows)]


def _cost(result: Comparison) -> Section:
    motion = result.settings.motion or result.scene.motion
    path = (
        f"{motion.kind} at {1e3 * motion.speed:g} mm/s"
        if isinstance(motion, ScriptedMotion)
        else f"along {motion.name}"
    )
    seconds = (len(result.poses) - 1) * result.settings.dt
    text = _text(
        "cost", scene=result.scene.name, path=path, seconds=f"{seconds:g}",
        push=f"{result.push:.2g}", band=f"{BAND[0]:g}-{BAND[1]:g}",
    )  # fmt: skip
    rows = [[row.method.label, *cells_of(row)] for row in result.rows if row.reason is None]
    figures = tuple(FIGURES) if rows else ()
    return Section("Cost and force", text, ("method", *_COLUMNS), rows, figures)


def _others_better(result: Comparison) -> Section:
    """Return the section on figures in which other methods are better than asperity."""
    own = next((row for row in result.rows if row.method.name == "asperity"), None)
    rows = []
    if own is not None:
        others = [row for row in result.rows if row is not own]
        for what, better in better_than(own, others).items():
            rows.append([what, ", ".join(better) or "none"])
    return Section("Where other methods are better", _text("better"), ("in", "methods"), rows)


def better_than(own: MethodResult, others: Sequence[MethodResult]) -> dict[str, list[str]]:
    """Return, for each figure in which less is better, the methods that are better than `own`.

    Better is less than 0.9 times the value of `own`; of claims, to hold where `own` does not.
    """
    out = {}
    for title, unit, scale, figure in _LESS_IS_BETTER:
        mine = figure(own)
        if mine is not None:
            out[f"{title}: asperity {format_number(scale * mine)} {unit}"] = [
                f"{row.method.label} ({format_number(scale * value)})"
                for row in others
                if (value := figure(row)) is not None and value < 0.9 * mine
            ]
    for name, claim in CLAIMS.items():
        if _holds(own, name) is False:
            better = [row.method.label for row in others if _holds(row, name)]
            out[f"{claim.title}: no for asperity"] = better
    return out


def _holds(row: MethodResult, claim: str) -> bool | None:
    measured = row.claims.measured.get(claim) if row.claims else None
    return measured.holds if measured else None


def _symptom(key: str) -> Callable[[MethodResult], float | None]:
    """Return a function from a row to a symptom of the hand at rest."""

    def figure(row: MethodResult) -> float | None:
        return getattr(row.claims.still, key) if row.claims and row.claims.still else None

    return figure


_LESS_IS_BETTER: list[tuple[str, str, float, Callable[[MethodResult], float | None]]] = [
    ("cost of a tick", "us", 1e6, lambda row: row.rendered.cost[0] if row.rendered else None),
    *((what, unit, scale, _symptom(key)) for what, unit, scale, key in _STILL),
]
"""Title, unit, its scale, and the figure of a row [SI]."""


def _text(part: str, **values: str) -> str:
    """Return a text of the page as one line."""
    return " ".join(render("comparison_text.md", part=part, **values).split())


def _cell(name: str, measured: Measured) -> str:
    if measured.value is None:
        return measured.detail
    verdict = {True: "yes", False: "no", None: "not measured"}[measured.holds]
    # As many digits as show on which side of the limit the value lies.
    value = telling([measured.value], [CLAIMS[name].limit])[0]
    if abs(measured.value) < 1e-3 and abs(CLAIMS[name].limit) >= 1e-3:
        value = format_number(measured.value)  # noise, far below the limit
    return f"**{verdict}**, {value} {CLAIMS[name].unit}"


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
    return _rendered("comparison.md", result, command, images)


def page(result: Comparison, command: str, folder: Path) -> str:
    """Return the page as one HTML file that contains its figures, the SVG files in `folder`."""
    files = {name: folder / f"{name}.svg" for name in FIGURES}
    images = {name: data_uri(file) for name, file in files.items() if file.is_file()}
    return _rendered("comparison.html", result, command, images)


def _rendered(template: str, result: Comparison, command: str, images: Mapping[str, str]) -> str:
    return render(
        template, sections=sections(result), captions=FIGURES, command=command,
        version=__version__, lead=_text("lead"), images=images,
    )  # fmt: skip
