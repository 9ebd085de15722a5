"""A run whose depths are not certified says so in a note of its own."""

import numpy as np
import pytest
from test_recording import made_up

from asperity.runs.run_scene import summary_of
from asperity.scene.builtin import load_scene
from asperity.simulation.tool_contact import CUT_SHORT, FALLBACK


@pytest.mark.parametrize(("statuses", "has_note"), [
    ((990, 10, 0), False), ((989, 11, 0), True), ((0, 0, 0), False), ((0, 0, 3), True),
])  # fmt: skip
def test_fewer_than_99_percent_certified_are_told(statuses, has_note):
    rollout = made_up(20)
    object.__setattr__(rollout, "statuses", np.array(statuses))
    notes = summary_of(load_scene("probe-plate"), {}, rollout)["notes"]
    assert any("certified" in note for note in notes) == has_note
    if has_note:
        assert "max_nodes (now 8000)" in notes[-1]


def test_searches_that_ran_out_of_time_do_not_call_for_more_boxes():
    rollout = made_up(20)
    object.__setattr__(rollout, "statuses", np.array((900, 100, 0)))
    flags = np.zeros(20, rollout.flags.dtype)
    flags[:7] = CUT_SHORT
    object.__setattr__(rollout, "flags", flags)
    note = summary_of(load_scene("probe-plate"), {}, rollout)["notes"][-1]
    assert "in 7 ticks the time ended a search" in note
    assert "max_nodes" not in note


@pytest.mark.parametrize(("count", "has_note"), [(1, False), (2, True)])
def test_contacts_that_take_longer_than_a_tick_call_for_a_lower_rate(count, has_note):
    rollout = made_up(20)
    flags = np.zeros(20, rollout.flags.dtype)
    flags[:count] = FALLBACK
    object.__setattr__(rollout, "flags", flags)
    notes = summary_of(load_scene("probe-plate"), {}, rollout)["notes"]
    assert any("--rate-hz 500" in note for note in notes) == has_note
