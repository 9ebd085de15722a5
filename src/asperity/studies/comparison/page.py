"""The comparison in words and tables: one Markdown text, and the HTML page of it."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping
from pathlib import Path

from asperity import __version__
from asperity.drawing.page_style import STYLE
from asperity.scene.trajectory import ScriptedMotion
from asperity.studies.comparison.compare import BAND, Comparison, MethodResult, rounded
from asperity.studies.comparison.properties import CRITERIA, Measured

FIGURES = {
    "traces": "Force along the motion, a stretch of it; asperity's in grey.",
    "spectra": "Spectra of the tangential force; the band of 20 to 200 Hz is shaded.",
    "cost": "Cost of a tick over asperity's median in the same run.",
}
"""What each figure shows, by name."""
_COSTS, _PROPERTIES = "What each costs and feels", "Properties, measured"
_STABILITY = (
    "Choi and Tan (2003, 2004), on point-based texture of sinusoids: *buzzing*, noise of high "
    "frequency that excites the device, limits the stiffness that feels clean; its largest value "
    "rises from 0.325 to 0.904 N/mm as the rate rises from 250 Hz to 40 kHz, and they recommend 5 "
    "to 10 kHz (read in public material about the papers). *Aliveness*, a slow change of force "
    "under a still hand, happens while the system is passive, with a force in a fixed direction "
    "over a sinusoid (read in an abstract). *Ridge instability*, by which a resting stylus is "
    "pushed into valleys, is recalled with medium confidence. The papers themselves were not at "
    "hand. Beside that, measured here: what a simulated hand feels that presses with 0.58 N on the "
    "slope of a wave, 1 kHz, 4 N/mm, and wants to be still. A simulated hand has no device that "
    "could resonate, so these are not their numbers, and a method that is quiet here may buzz "
    "there."
)


def columns(row: MethodResult) -> list[str]:
    """Return the cells of a method in the table of one motion."""
    if row.felt is None or row.cost is None:
        return ["-"] * 7
    cost, ratio = row.cost, row.ratio or 0.0
    return [
        rounded(1e6 * cost[0]),
        rounded(1e6 * cost[1]),
        rounded(ratio),
        rounded(1e3 * (row.tangential or 0.0)),
        rounded(1e3 * (row.band_rms or 0.0)),
        rounded(1e3 * float(row.felt.torque.std(axis=0).max())),
        f"{len(row.felt.force)}",
    ]


_HEAD = [
    "median [us]", "p99 [us]", "over asperity", "RMS [mN]", "20-200 Hz [mN]", "torque [mN m]",
    "ticks",
]  # fmt: skip


def verdict(measured: Measured) -> str:
    """Return a property in a few words."""
    return {True: "yes", False: "no", None: "not measured"}[measured.holds]


def _number(name: str, measured: Measured) -> str:
    if measured.value is None:
        return measured.detail
    unit = CRITERIA[name].unit
    return f"{rounded(measured.value)} {unit}"


def _tables(result: Comparison) -> list[tuple[str, str, list[str], list[list[str]]]]:
    """Return title, what it says, head and rows of each table."""
    able = [row for row in result.rows if row.reason is None]
    tables = [
        (
            _COSTS,
            f"On `{result.scene.name}`, {_motion(result)}. RMS: of the tangential force's change. "
            f"{BAND[0]:g}-{BAND[1]:g} Hz: the part of it in that band. Torque: the largest "
            "standard deviation of a component, about the tool's centre of mass. Times are the "
            "processor's, of one busy machine; the ratio is of medians of one run.",
            ["method", *_HEAD],
            [[row.method.label, *columns(row)] for row in able],
        )
    ]
    measured = [row for row in result.rows if row.properties is not None]
    if measured:
        rows = []
        for row in measured:
            assert row.properties is not None
            cells = [
                f"**{verdict(one)}**, {_number(name, one)}" if one.value is not None else one.detail
                for name, one in row.properties.measured.items()
            ]
            rows.append([row.method.label, *cells])
        tables.append(
            (
                _PROPERTIES,
                "On a small plate of waves of 0.2 mm by 2 mm, 4 N/mm, pressed to 0.58 N; the "
                "criteria stand below. A yes of a method that is not silent on a smooth plate may "
                "be its own noise.",
                ["method", *(one.title for one in CRITERIA.values())],
                rows,
            )
        )
        still = [
            [
                row.method.label,
                rounded(1e3 * row.properties.still.buzzing),
                rounded(1e3 * row.properties.still.aliveness),
                rounded(1e6 * row.properties.still.motion),
            ]
            for row in measured
            if row.properties is not None and row.properties.still is not None
        ]
        tables.append(
            (
                "A hand that wants to be still",
                _STABILITY,
                ["method", "buzzing, above 150 Hz [mN]", "aliveness, below 20 Hz [mN]",
                 "strays [um]"],
                still,
            )
        )  # fmt: skip
    tables.append(
        (
            "Sources, and what each is not",
            "",
            ["method", "source", "what it is not"],
            [[row.method.label, row.method.source, row.method.what_it_is_not] for row in
             result.rows],
        )
    )  # fmt: skip
    refused = [[row.method.label, row.reason] for row in result.rows if row.reason is not None]
    if refused:
        tables.append(("What could not render this scene", "", ["method", "why"], refused))
    return tables


def _motion(result: Comparison) -> str:
    motion = result.settings.motion or result.scene.motion
    told = (
        f"{motion.kind} at {1e3 * motion.speed:g} mm/s"
        if isinstance(motion, ScriptedMotion)
        else f"along {motion.name}"
    )
    seconds = (len(result.poses) - 1) * result.settings.dt
    return f"{told} for {seconds:g} s, all pressed to a mean of {result.push:.2g} N"


def _criteria() -> list[str]:
    return [
        f"*{one.title}*: {one.what}; yes from {one.limit:g} {one.unit} "
        f"{'upwards' if one.above else 'downwards'}."
        for one in CRITERIA.values()
    ] + [
        "The limits are asperity's. Those of torque, size, force and meshing were set before any "
        "method was measured; that of speed, and silence as a whole, after the noise of two had "
        "been seen."
    ]


_LEAD = (
    "Every approach that Otaduy and Lin (2004) name, behind one interface and on one motion. Poses "
    "are given, without a coupling or a hand; friction is left out, since not all methods have "
    "any. Methods differ in stiffness at one depth, so each is raised or lowered along the path "
    "as a whole until its mean force upwards is the same."
)


def markdown(result: Comparison, command: str, images: Mapping[str, str]) -> str:
    """Return the page as Markdown.

    Parameters
    ----------
    result : Comparison
    command : str
        That makes it.
    images : mapping
        From the names of `FIGURES` to where they lie.
    """
    parts = [
        "# Methods side by side\n",
        f"*Generated by `{command}` (asperity {__version__}); not edited by hand.*\n",
        _LEAD + "\n",
    ]
    for title, text, head, rows in _tables(result):
        parts.append(f"## {title}\n")
        if text:
            parts.append(text + "\n")
        parts.append(_markdown_table(head, rows))
        if title == _COSTS and rows:
            parts += [f"![{told}]({images[name]})\n\n*{told}*\n" for name, told in FIGURES.items()]
        if title == _PROPERTIES:
            parts.append("\n".join(f"- {line}" for line in _criteria()) + "\n")
    return "\n".join(parts)


def _markdown_table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(c.replace("|", "/") for c in r) + " |" for r in lines) + "\n"


def page(result: Comparison, command: str, folder: Path) -> str:
    """Return the page as one HTML file with its figures, SVG in `folder`, inside it."""
    parts = [
        "<header><h1>Methods side by side</h1>"
        f"<p class='lead'>{html.escape(_LEAD)}</p>"
        f"<p class='meta'>asperity {__version__} &middot; <code>{html.escape(command)}</code></p>"
        "</header>"
    ]
    for title, text, head, rows in _tables(result):
        body = "".join("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in rows)
        top = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
        table = f"<table class='claims'><tr>{top}</tr>{body}</table>"
        section = f"<h2>{title}</h2><p>{_inline(text)}</p>{table}"
        if title == _COSTS and rows:
            section += "".join(_figure(folder / f"{n}.svg", told) for n, told in FIGURES.items())
        if title == _PROPERTIES:
            section += "<p>" + "<br>".join(_inline(line) for line in _criteria()) + "</p>"
        parts.append(f"<section>{section}</section>")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>asperity: methods side by side</title><style>{STYLE}</style></head>"
        f"<body><main>{''.join(parts)}</main></body></html>\n"
    )


def _cell(text: str) -> str:
    kind = next((k for k in ("yes", "no") if text.startswith(f"**{k}**")), None)
    return f"<td class='{kind}'>{_inline(text)}</td>" if kind else f"<td>{_inline(text)}</td>"


def _inline(text: str) -> str:
    """Return HTML of Markdown's code, bold and italics."""
    out = html.escape(text)
    for mark, tag in (("**", "b"), ("*", "i"), ("`", "code")):
        pieces = out.split(mark)
        if len(pieces) % 2 == 0:
            continue
        out = "".join(
            f"<{tag}>{piece}</{tag}>" if i % 2 else piece for i, piece in enumerate(pieces)
        )
    return out


def _figure(path: Path, caption: str) -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    told = html.escape(caption)
    return (
        f'<figure><img alt="{told}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption>{told}</figcaption></figure>"
    )
