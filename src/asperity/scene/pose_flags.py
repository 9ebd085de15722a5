"""Columns of a file of poses that state which of them were tracked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from asperity._core.arrays import Mask
from asperity._core.text_table import TextTable
from asperity.scene.pose_columns import words_of

_FLAGS = frozenset({"valid", "tracked", "visible"})
"""Last words of columns that are 0 where a pose is not there."""
_BEFORE = frozenset(
    {"is", "b", "was", "pose", "poses", "position", "orientation", "rotation", "tracking", "track",
     "tracker", "device", "rigid", "body", "tool", "marker", "data", "sample"}
)  # fmt: skip
_WORDS = {"0": False, "1": True, "false": False, "true": True}


def lost_poses(text: TextTable, names: Sequence[str]) -> tuple[Mask | None, str]:
    """Return which rows a column marks as not tracked, and a note; None and "" if none does.

    Parameters
    ----------
    text : TextTable
    names : sequence of str
        Of its columns.
    """
    for at, name in enumerate(names):
        if not any(flag in name.lower() for flag in _FLAGS):
            continue
        words = words_of(name)
        if not words or words[-1] not in _FLAGS or not {*words[:-1]} <= _BEFORE:
            continue
        lines = [line for line in text.complete().body.split("\n") if line.strip()]
        cells = [line.split(text.separator) for line in lines]
        flags = [_WORDS.get(own[at].strip(" \"'\r").lower()) if len(own) > at else None
                 for own in cells]  # fmt: skip
        if None not in flags and any(flags) and not all(flags):
            return ~np.array(flags, dtype=bool), f"poses are missing where {name.strip()!r} is 0"
    return None, ""
