"""Answers and intervals as tidy CSV tables, written from the journal and never read back."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from asperity._core.output import write_whole
from asperity.psychophysics.session.trials import standing_answers

ANSWER_COLUMNS = (
    "participant", "session", "trial", "block", "practice", "catch", "track", "step", "level",
    "intensity", "right_interval", "answer", "right", "response_seconds", "answered_at",
    "answered_by", "attempt", "taken_back",
)  # fmt: skip
INTERVAL_COLUMNS = (
    "participant", "session", "trial", "block", "practice", "interval", "stimulus", "value",
    "recording", "ticks", "seconds", "band_rms", "largest_force", "normal_force", "speed",
    "misses", "fallbacks", "attempt",
)  # fmt: skip


def answers_table(events: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each answer that was not taken back."""
    begin, rows = _begin(events), []
    for event in standing_answers(events):
        trial, answer = event["trial"], event["answer"]
        rows.append(
            _common_columns(begin, trial) | {
                "catch": int(trial.get("catch", False)), "track": trial["track"],
                "step": trial.get("step"), "level": trial["level"],
                "intensity": trial["intensity"],
                "right_interval": trial["right"],
                "answer": " ".join(map(str, answer)) if isinstance(answer, list) else answer,
                "right": None if event["right"] is None else int(event["right"]),
                "response_seconds": event["response_seconds"], "answered_at": event["time"],
                "answered_by": event["by"], "attempt": event["attempt"],
                "taken_back": event["taken_back"],
            }
        )  # fmt: skip
    return rows


def trials_table(events: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each interval of each trial that was answered."""
    begin, rows = _begin(events), []
    for event in standing_answers(events):
        trial = event["trial"]
        pairs = zip(trial["stimuli"], event["intervals"], strict=True)
        for number, (stimulus, interval) in enumerate(pairs, 1):
            rows.append(
                _common_columns(begin, trial) | {
                    "interval": number, "stimulus": stimulus["name"], "value": stimulus["value"],
                    "recording": f"recordings/{interval['recording']}",
                    "ticks": interval["ticks"], "seconds": interval["seconds"],
                    **interval["measures"],
                    "misses": interval.get("misses"), "fallbacks": interval.get("fallbacks"),
                    "attempt": event["attempt"],
                }
            )  # fmt: skip
    return rows


def write_tables(events: list[dict[str, Any]], folder: Path) -> None:
    """Write `answers.csv` and `trials.csv`, each atomically."""
    write_whole(folder / "answers.csv", as_csv(ANSWER_COLUMNS, answers_table(events)))
    write_whole(folder / "trials.csv", as_csv(INTERVAL_COLUMNS, trials_table(events)))


def as_csv(columns: tuple[str, ...], rows: list[dict[str, Any]]) -> str:
    """Return rows as CSV; missing values are empty."""
    out = io.StringIO()
    writer = csv.DictWriter(out, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def _begin(events: list[dict[str, Any]]) -> dict[str, Any]:
    return {"participant": events[0]["participant"], "session": events[0]["session"]}


def _common_columns(begin: dict[str, Any], trial: dict[str, Any]) -> dict[str, Any]:
    return begin | {
        "trial": trial["number"], "block": trial["block"], "practice": int(trial["block"] == 0),
    }  # fmt: skip
