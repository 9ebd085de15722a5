"""Pictures of the page, by `make pictures`: for the report and the README."""

from __future__ import annotations

from pathlib import Path

PICTURES = Path(__file__).parent
PICTURED = ("probe-plate-dots", "hammer-blocks", "file-cad")
"""Scenes; of each there is a `.jpg` in `PICTURES`."""
