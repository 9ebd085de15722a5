"""Fixtures of the tests of experiments."""

import pytest

from asperity.psychophysics.design import ExperimentDesign


@pytest.fixture
def without_scenes(monkeypatch):
    """Sessions look at the scenes of their design; here there are none."""
    monkeypatch.setattr(ExperimentDesign, "check_scenes", lambda self: {})
