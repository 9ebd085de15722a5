"""Pictures of runs have few pixels in tests of commands, unless a test looks at them."""

import pytest


@pytest.fixture
def full_pictures():
    """Ask for pictures as large as a user's."""


@pytest.fixture(autouse=True)
def pictures(request):
    """Draw small pictures for whoever does not ask for full ones."""
    if "full_pictures" not in request.fixturenames:
        request.getfixturevalue("small_pictures")
