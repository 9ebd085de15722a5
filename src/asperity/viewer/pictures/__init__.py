"""Pictures of the page for the report and the README, made by `make pictures`."""

from __future__ import annotations

from pathlib import Path

PICTURES = Path(__file__).parent
PICTURED = ("probe-plate-dots", "hammer-blocks", "file-cad")
"""Scenes of which there is a `.jpg` in `PICTURES`."""
