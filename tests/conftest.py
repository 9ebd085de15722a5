"""Shared by all tests: where the real data lie, and one compile cache for all processes."""

from __future__ import annotations

from pathlib import Path

import pytest

_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder of real data beside the project, or skip the test."""
    if not _DATA.is_dir():
        pytest.skip("the folder shared/data is not beside the project")
    return _DATA
