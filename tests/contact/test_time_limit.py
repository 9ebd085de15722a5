"""A search that has no time left ends with what it has found, and says how far that may be off.

No clock is waited for: a search has no time at all, or as much as it likes.
"""

import time

import numpy as np
import pytest
from naive_engine import ball, engine_for, patches_of_meshes, plate, pose, waves

from asperity._core.clock import IS_KNOWN, ends_in, seconds_now
from asperity._core.kernels import kernel
from asperity.contact.contacts import Contacts
from asperity.geometry.poses import rotated
from asperity.scene.builtin import load_scene
from asperity.simulation.press import touching_pose
from asperity.simulation.tool_contact import CUT_SHORT, NOT_CERTIFIED, ToolContact

DT = 1e-3
needs_clock = pytest.mark.skipif(not IS_KNOWN, reason="kernels know no time here")


@kernel
def _read():
    return seconds_now()


@needs_clock
def test_kernels_and_python_read_the_same_clock():
    before = ends_in(0.0)
    there = _read()
    after = ends_in(0.0)
    assert before <= there <= after
    assert ends_in(1e4) >= after + 1e4
    assert ends_in(np.inf) == 0.0
    assert time.monotonic() == pytest.approx(there, abs=60.0)


def rubbed(name, count):
    """Return a stage with the scene's tool, and poses of a quick rub."""
    stage = ToolContact(load_scene(name).changed(force={"anti_alias": "off"}))
    start = touching_pose(stage.engine, stage.scene.start)
    start[2] -= 8e-4
    s = np.linspace(0.0, 1.0, count)[:, None]
    path = np.array([rotated(start, tilt) for tilt in 0.02 * np.sin(7.0 * s) * [0.7, 0.4, 1.0]])
    path[:, :3] += 5e-5 * count * s * [0.8, 0.6, 0.0]
    return stage, path


def found(engine, there, seconds):
    engine.wrench(there, DT, seconds)
    count = engine.contacts.count[0]
    return Contacts(*(field[:count].copy() for field in engine.contacts))


@needs_clock
@pytest.mark.parametrize("name", ["file-cad", "hammer-blocks"])
def test_what_a_search_without_time_says_holds_the_certified_depth(name):
    """The depth found is the least that it can be, with the gap it is the most; in every patch."""
    stage, path = rubbed(name, 60)
    engine = stage.engine
    cut, off, nodes = 0, 0.0, np.zeros(2)
    for there in path:
        # Only looking, so that both begin from what is known of the tick before.
        free = engine.wrench(there, 0.0).copy()
        sure = patches_of_meshes(engine)
        assert not engine.was_cut
        assert (sure["status"] == 0).all()
        hasty = engine.wrench(there, 0.0, 0.0).copy()
        patches = patches_of_meshes(engine)
        assert len(patches) == len(sure)
        depth = patches["depth"]
        assert (depth <= sure["depth"] + 1e-9).all()
        assert (depth + patches["gap"] >= sure["depth"] - 1e-9).all()
        assert np.isfinite(hasty).all()
        nodes += np.array([patches["nodes"].sum(), sure["nodes"].sum()])
        if engine.was_cut:
            cut += 1
            off = max(off, np.abs(sure["depth"] - depth).max())
            # As the first found, from the last tick's place, is deep: more than half of it.
            assert np.linalg.norm(hasty[:3]) > 0.5 * np.linalg.norm(free[:3])
        engine.wrench(there, DT)
    assert cut > 50
    assert nodes[0] < 0.5 * nodes[1]
    assert 0.0 < off < 2e-4


@needs_clock
def test_a_hasty_tick_leaves_nothing_behind():
    """After it a search with time finds what one finds that always had it."""
    (stage, path), (other, _) = rubbed("file-cad", 40), rubbed("file-cad", 40)
    for i, there in enumerate(path):
        hasty = i % 3 == 1
        got = found(stage.engine, there, 0.0 if hasty else np.inf)
        want = found(other.engine, there, np.inf)
        if not hasty:
            np.testing.assert_allclose(got.depth, want.depth, rtol=0.0, atol=2e-9)
            assert (got.status == 0).all()


def test_with_time_to_spare_nothing_changes():
    stage, path = rubbed("hammer-blocks", 20)
    free = [stage.engine.wrench(there, DT).copy() for there in path]
    stage.reset()
    timed = [stage.engine.wrench(there, DT, 1e4).copy() for there in path]
    np.testing.assert_array_equal(free, timed)
    assert not stage.engine.was_cut


@needs_clock
def test_the_stage_says_which_contacts_were_cut_short():
    stage, path = rubbed("file-cad", 6)
    for there in path[:3]:
        assert not stage.evaluate(there).flags & (CUT_SHORT | NOT_CERTIFIED)
    for jumped in (False, True):
        hasty = stage.evaluate(path[3], search_seconds=0.0, jumped=jumped)
        assert hasty.flags & CUT_SHORT
        assert hasty.flags & NOT_CERTIFIED
        assert hasty.count > 0
    assert not stage.evaluate(path[4]).flags & CUT_SHORT


def test_a_probe_is_found_before_it_is_late():
    """Few nodes are enough where one ball meets one plate: every search has those."""
    engine = engine_for(ball(), plate(waves(2e-5, 1e-3)))
    there = pose(0.0, 0.0, 1.45e-3)
    engine.wrench(there, DT)
    want = engine.wrench(there, DT).copy()
    np.testing.assert_array_equal(engine.wrench(there, DT, 0.0), want)
    assert (engine.contacts.status[: engine.contacts.count[0]] == 0).all()
