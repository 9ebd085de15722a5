"""Catch trials: how many a participant got right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asperity.psychophysics.analysis.results import SessionResult

ENOUGH = 0.8
"""Part of the catch trials below which a session is pointed out; a project choice."""


def catch_summary(results: Sequence[SessionResult]) -> list[dict[str, Any]]:
    """Return the catch trials of each session that had any, and how many were right."""
    return [
        {
            "session": result.name, "trials": len(result.catch),
            "right": sum(bool(answered.right) for answered in result.catch),
        }
        for result in results if result.catch
    ]  # fmt: skip
