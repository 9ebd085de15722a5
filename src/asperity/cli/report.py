"""The report of `asperity demo`: one HTML file that contains its figures and sounds.

The text of the page is the template `demo_report.html`; here are the numbers that fill it.
"""

from __future__ import annotations

from functools import partial

from asperity import __version__
from asperity._core.digits import plain_number
from asperity.cli.claims_table import measured_text, verdict_rows
from asperity.cli.demo_pipeline import PROBES, SOUND_PROBES, Results
from asperity.drawing.pages import render
from asperity.runs.run_scene import described
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import count_reproduced
from asperity.viewer.pictures import PICTURED, PICTURES


def report_page(results: Results) -> str:
    """Return the report of a demo as HTML."""
    measured = [origin.startswith("Measured") for origin in results.remarks.values()]
    return render(
        "demo_report.html",
        version=__version__,
        results=results,
        folder=results.folder,
        claims=results.claims,
        reproduced=count_reproduced(results.claims),
        holding={claim["id"] for claim in results.claims if claim["holds"]},
        settings=results.settings,
        middle=results.settings.middle(),
        metrics=METRICS,
        verdicts=partial(verdict_rows, results.claims),
        measured_text=measured_text,
        plain_number=plain_number,
        described=described,
        surfaces_title="Real surfaces" if all(measured) else (
            "Real surfaces, and stand-ins where the measured file is missing" if any(measured)
            else "Stand-ins for real surfaces"
        ),
        sound_level=f"{next(iter(results.sounds.values()))[0].level:.1f}".replace("-", "−"),
        sound_probes=[f"{PROBES[place] * 1e3:g} mm" for place in SOUND_PROBES],
        probes=PROBES,
        view_pictures=[(name, PICTURES / f"{name}.jpg") for name in PICTURED],
    )  # fmt: skip
