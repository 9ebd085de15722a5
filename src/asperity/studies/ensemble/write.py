"""Write the ensemble: shares, every member, a page, figures."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict
from pathlib import Path
from typing import Any

from asperity._core.output import write_json
from asperity.drawing import figure_style
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.ensemble.figures import claims_figure, hands_figure
from asperity.studies.ensemble.run import Answer, EnsembleResult
from asperity.studies.ensemble.stored import members_document
from asperity.studies.literature.plates import Dots

QUESTIONS = {
    "paper": "Does the paper's analysis reproduce?",
    "people": "Does the model predict people?",
}
NOTED_HANDS = {"default hand": Hand(), "default hand, b = 10 N s/m": Hand(damping=10.0)}
"""Hands whose verdicts over the dots are given one by one."""


def write_ensemble(result: EnsembleResult, folder: Path) -> dict[str, Any]:
    """Write ensemble.json, .csv and .md, members.json and two figures; return the summary."""
    summary = summarise(result)
    write_json(folder / "ensemble.json", summary)
    write_json(folder / "members.json", members_document(result))
    (folder / "ensemble.csv").write_text(members_csv(result), "utf-8")
    (folder / "ensemble.md").write_text("\n".join(tables(result)), "utf-8")
    figure_style.save(claims_figure(result), folder, "ensemble_claims")
    figure_style.save(hands_figure(result), folder, "ensemble_hands")
    return summary


def summarise(result: EnsembleResult) -> dict[str, Any]:
    """Return the shares of both questions, ready for JSON."""
    return {"schema": 1} | {
        name: _summary(answer) | {"question": QUESTIONS[name]}
        for name, answer in (("paper", result.paper), ("people", result.people))
    }


def _summary(answer: Answer) -> dict[str, Any]:
    hands, plates = answer.holds.shape[:2]
    return {
        "members": hands * plates,
        "hands": hands,
        "plates": [asdict(plate) for plate in answer.plates],
        "counted": int(answer.counted.sum()),
        "median_count": {metric: answer.median_count(metric) for metric in answer.metrics},
        "claims": [
            {
                "id": claim.id, "claim": claim.text, "source": claim.source,
                "by_construction": claim.by_construction,
                "share": {
                    metric: float(answer.shares[i, j]) for i, metric in enumerate(answer.metrics)
                },
            }
            for j, claim in enumerate(answer.claims)
        ],
    }  # fmt: skip


def members_csv(result: EnsembleResult) -> str:
    """Return a line for each member, metric and claim."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([
        "question", "surface", "size_mm", "seed", "mass_kg", "stiffness_n_m", "damping_n_s_m",
        "metric", "claim", "holds",
    ])  # fmt: skip
    for question, answer in (("paper", result.paper), ("people", result.people)):
        for i, hand in enumerate(answer.hands):
            for j, plate in enumerate(answer.plates):
                dots = isinstance(plate, Dots)
                size = plate.height if isinstance(plate, Dots) else plate.amplitude
                about = [
                    question, "dots" if dots else "sinusoid", f"{size * 1e3:g}",
                    plate.seed if isinstance(plate, Dots) else "",
                    hand.mass, hand.stiffness, hand.damping,
                ]  # fmt: skip
                for k, metric in enumerate(answer.metrics):
                    for n, claim in enumerate(answer.claims):
                        holds = int(answer.holds[i, j, k, n])
                        writer.writerow([*about, metric, claim.id, holds])
    return text.getvalue()


def tables(result: EnsembleResult) -> list[str]:
    """Return the tables of both questions, and of the noted hands, as lines of Markdown."""
    lines = [f"## (a) {QUESTIONS['paper']}", "", *_table(result.paper), ""]
    lines += [f"## (b) {QUESTIONS['people']}", "", *_table(result.people), ""]
    answer = result.people
    plates = [p for p in answer.plates if isinstance(p, Dots) and p.height == Dots().height]
    for name, hand in NOTED_HANDS.items():
        if hand not in answer.hands or not plates:
            continue
        counts = [
            f"{METRICS[metric].label}: "
            + ", ".join(str(int(answer.of_hand(hand, plate)[i][answer.counted].sum()))
                        for plate in plates)
            for i, metric in enumerate(answer.metrics)
        ]  # fmt: skip
        lines.append(
            f"{name[0].upper()}{name[1:]}, dots 0.4 mm high, {len(plates)} plates, counted "
            f"claims that hold of {int(answer.counted.sum())}: {'; '.join(counts)}."
        )
        lines.append("")
    return lines


def _table(answer: Answer) -> list[str]:
    names = [METRICS[metric].label.replace("|", "\\|") for metric in answer.metrics]
    lines = [f"| claim | {' | '.join(names)} |", "|---|" + "---|" * len(names)]
    for j, claim in enumerate(answer.claims):
        note = " (by construction, not counted)" if claim.by_construction else ""
        cells = [f"{100.0 * share:.0f} %" for share in answer.shares[:, j]]
        lines.append(f"| {claim.text}{note} | {' | '.join(cells)} |")
    counts = [f"{answer.median_count(m):g} of {answer.counted.sum()}" for m in answer.metrics]
    lines.append(f"| **median member: counted claims that hold** | {' | '.join(counts)} |")
    return lines
