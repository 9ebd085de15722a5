"""When ticks begin, what a miss is, what the deadline's guard does: all by an injected clock."""

import os
import threading
import time
import tracemalloc
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from scripted import DT, LIMITS, WALL, Bench, HandClock, wave

from asperity._core import cores as cores_in_use
from asperity._core.cores import usable_cores
from asperity.dynamics.passivity.controller import PassivityController
from asperity.errors import AsperityError
from asperity.realtime.servo.deadlines import BUSY, SPIN, Pace
from asperity.realtime.servo.loop import GUARD, STALE
from asperity.realtime.servo.scheduling import keep_off_core, pick_core, share_core
from asperity.simulation.tool_contact import FALLBACK, LATE


class Kept:
    """What would have gone to the recorder."""

    def __init__(self):
        self.ticks = []

    def push(self, tick):
        self.ticks.append(tick.copy())

    @property
    def flags(self):
        return np.array([int(tick["flags"]) for tick in self.ticks])

    @property
    def time(self):
        return np.array([float(tick["time"]) for tick in self.ticks])


def test_ticks_begin_at_absolute_times_and_lateness_does_not_add_up():
    clock = HandClock()
    pace = Pace(DT, clock)
    begin, starts = clock.time, []
    for n in range(200):
        pace.wait()
        starts.append(clock.time - begin)
        clock.work(0.9 * DT if n % 3 else 0.1 * DT)
    np.testing.assert_allclose(starts, DT * np.arange(1, 201), atol=1e-6)
    assert pace.skipped == 0


def test_it_sleeps_until_near_the_tick_and_then_watches_the_clock():
    clock = HandClock()
    pace = Pace(DT, clock, spin=1e-4)
    for _ in range(20):
        pace.wait()
    assert np.allclose(clock.slept, DT - 1e-4, atol=2e-6)
    assert pace.late < 1e-6


def test_a_busy_one_watches_the_clock_all_the_time():
    clock = HandClock()
    pace = Pace(DT, clock, spin=BUSY)
    for _ in range(5):
        pace.wait()
        assert pace.late < 1e-6
    assert clock.slept == []
    # Until shortly before the tick other threads may have the interpreter.
    assert clock.given_way == pytest.approx(5 * (DT - 5e-5) / 1.1e-6, rel=0.02)


def test_the_contact_comes_first_where_the_core_is_shared():
    """It has what is left of the tick; only what it leaves is slept away, or watched."""
    clock, given = HandClock(), []
    pace = Pace(DT, clock)

    def work(seconds):
        given.append(seconds)
        clock.work(0.3 * DT if len(given) == 1 else seconds)

    clock.work(0.2 * DT)
    pace.wait(work)
    assert given == [pytest.approx(0.8 * DT, abs=1e-6)]
    assert clock.slept == [pytest.approx(0.5 * DT - SPIN, abs=1e-6)]
    pace.wait(work)
    assert len(clock.slept) == 1
    assert pace.late < 1e-6
    clock.work(1.5 * DT)
    pace.wait(work)  # nothing is left to be given
    assert len(given) == 2


@pytest.mark.parametrize("shares", [False, True])
def test_a_contact_is_asked_for_when_all_else_is_done(shares):
    busy = []

    class Told:
        def push(self, row):
            busy.append(bench.contacts.busy)

    bench = Bench(mode="implicit", ring=Told(), shares=shares, takes=lambda n: 0.4 * DT)
    bench.run(20)
    assert not any(busy)
    assert len(bench.contacts.submitted) == 21
    assert bench.stats.fallbacks == 0
    assert bench.contacts.rests == (20 if shares else 0)


@pytest.mark.parametrize("shares", [False, True])
def test_after_a_late_contact_the_next_is_asked_for_at_once(shares):
    """On a core of one's own the tick that found none ends with the next one asked for."""
    bench = Bench(mode="implicit", shares=shares, takes=lambda n: 1.3 * DT if n == 5 else 0.1 * DT)
    bench.run(20)
    submitted = [
        round((now - bench.device.begin) / DT, 3) for now, _ in bench.contacts.submitted[1:]
    ]
    late = [t for t in submitted if t % 1.0 > 0.05]
    # Without sharing nobody looks between two ticks.
    assert bench.stats.fallbacks == (1 if shares else 2)
    assert len(late) == (1 if shares else 0)
    assert any(jumped for _, jumped in bench.contacts.submitted[1:]) != shares


def test_a_loop_that_was_held_up_leaves_ticks_out_and_falls_into_step_again():
    clock = HandClock()
    pace = Pace(DT, clock)
    begin = clock.time
    pace.wait()
    clock.work(5.5 * DT)
    pace.wait()
    # Ticks 2 to 5 are over; tick 6 has begun half a tick ago.
    assert pace.skipped == 4
    assert pace.late == pytest.approx(0.5 * DT, abs=1e-6)
    pace.wait()
    assert pace.skipped == 0
    assert clock.time - begin == pytest.approx(7 * DT, abs=1e-6)


def test_misses_are_late_ticks_and_ticks_left_out():
    bench = Bench()
    bench.device.hold_up = lambda t: 3.4 * DT if 0.0505 < t < 0.0515 else 0.0
    bench.run(100)
    stats = bench.stats
    assert stats.skipped == 2
    assert stats.misses == 3
    assert stats.ticks + stats.skipped == 100
    summary = stats.summary()
    assert summary["misses_percent"] == pytest.approx(3.0)
    assert sum(summary["start_late_histogram_us"].values()) == stats.ticks
    assert summary["start_late_us"]["max"] == pytest.approx(400.0, abs=110.0)


def test_contacts_in_time_are_felt_at_the_pose_just_read():
    bench = Bench()
    bench.device.pose = wave
    bench.run(500)
    assert bench.stats.fallbacks == bench.stats.misses == 0
    times = np.array([t for t, _ in bench.device.written[:-1]]) - bench.device.begin
    depth = np.array([-wave(t - 1.0e-4)[2] for t in times])
    np.testing.assert_allclose(bench.device.forces[:-1], WALL * np.maximum(depth, 0.0), atol=2e-5)


def test_a_slow_contact_costs_the_tick_its_guard_and_no_more():
    kept = Kept()
    bench = Bench(takes=lambda n: 3.3 * DT if n == 51 else 1e-4, ring=kept)
    bench.device.pose = wave
    bench.run(100)
    stats = bench.stats
    assert stats.misses == 0
    # The tick that asked, and those at whose beginning it was still not there.
    assert stats.fallbacks == stats.longest_fallback == 4
    assert stats.stages["contact_wait"].largest == pytest.approx((1 - GUARD) * DT, rel=0.02)
    flagged = np.flatnonzero(kept.flags & FALLBACK)
    assert flagged.tolist() == [50, 51, 52, 53]
    # The next contact knows that ticks were left out, and those after it that none were.
    jumps = [False, *(jumped for _, jumped in bench.contacts.submitted[1:])]
    assert [n for n, jumped in enumerate(jumps) if jumped] == [52]


@pytest.mark.parametrize("mode", ["direct", "implicit", "static"])
def test_between_slow_contacts_the_wall_goes_on_as_it_was(mode):
    """Contacts of four ticks each: the wall is linear, so carrying on is exact but for touching."""
    slow, quick = Bench(mode=mode, takes=lambda n: 4.2 * DT), Bench(mode=mode)
    for bench in (slow, quick):
        bench.device.pose = wave
        bench.run(1000)
    assert slow.stats.misses == 0
    assert slow.stats.fallbacks > 700
    assert quick.stats.fallbacks == 0
    apart = np.abs(slow.device.forces - quick.device.forces)
    assert quick.device.forces.max() > 0.2
    assert np.median(apart) < 0.01
    assert apart.max() < 0.15


def test_a_contact_that_never_comes_is_let_go_of():
    kept = Kept()
    bench = Bench(mode="implicit", takes=lambda n: 1e9 if n == 100 else 1e-4, ring=kept)
    bench.run(500)
    forces = bench.device.forces
    assert forces[90] > 0.3
    given_up = np.flatnonzero(forces[:-1] == 0.0)
    assert given_up[0] == pytest.approx(100 + STALE / DT, abs=3)
    assert (forces[given_up[0] :] == 0.0).all()
    assert bench.safe.counts.contact_lost_ticks == len(given_up)
    assert bench.stats.misses == 0


def test_it_recovers_when_the_contact_comes_back():
    bench = Bench(mode="implicit", takes=lambda n: 0.4 if n == 100 else 1e-4)
    bench.run(800)
    forces = bench.device.forces
    assert (forces[360:490] == 0.0).all()
    assert forces[700] == pytest.approx(forces[90], rel=1e-3)
    assert bench.stats.fallbacks == pytest.approx(400, abs=2)


def test_a_late_tick_is_flagged_and_its_time_is_that_of_the_clock():
    kept = Kept()
    bench = Bench(ring=kept)
    bench.device.hold_up = lambda t: 2.5 * DT if 0.0205 < t < 0.0215 else 0.0
    bench.run(50)
    late = np.flatnonzero(kept.flags & LATE)
    assert len(late) == 1
    assert np.diff(kept.time).max() == pytest.approx(2 * DT)
    assert kept.time[-1] == pytest.approx(49 * DT)


def test_after_a_stall_of_300_ms_the_force_comes_up_softly():
    from asperity.realtime.servo.safety import SafetySettings

    bench = Bench(settings=SafetySettings(soft_start=0.1))
    bench.device.hold_up = lambda t: 0.3 if 0.2005 < t < 0.2015 else 0.0
    bench.run(900)
    times = np.array([t for t, _ in bench.device.written[:-1]])
    forces = bench.device.forces[:-1]
    after = int(np.argmax(np.diff(times))) + 1
    assert forces[after - 2] == pytest.approx(0.5, rel=1e-3)
    assert abs(forces[after + 1]) < 0.02
    assert forces[after + 120] == pytest.approx(0.5, rel=1e-3)
    assert bench.stats.skipped == pytest.approx(299, abs=2)


def test_what_late_ticks_have_cost_is_forgiven_to_a_coupling():
    """Otherwise the force is taken away for ever: without it the hand puts nothing in."""
    bench = Bench(mode="implicit")
    controller = bench.loop.passivity = PassivityController(DT)
    bench.loop.begin(None)
    controller.reset(-0.01)
    corrected = []
    bench.loop.run(ticks=1500, between=lambda: corrected.append(controller.interventions))
    forces = bench.device.forces
    assert abs(forces[50]) < 0.1
    assert corrected[100] > 90
    assert corrected[-1] == corrected[1000]
    assert forces[-2] == pytest.approx(WALL * -bench.tool.pose[2], rel=0.01)
    assert controller.summary()["granted_j"] == pytest.approx(controller.energy, rel=0.1)


def test_what_a_correction_needs_is_loaded_before_the_first_tick(monkeypatch):
    """The passivity controller's first correction asks for the coupling's energy: its kernel."""
    from asperity.dynamics.virtual_coupling import coupled_tool

    calls, own = [], coupled_tool.displacement
    monkeypatch.setattr(
        coupled_tool,
        "displacement",
        lambda *given: (calls.append(bench.stats.ticks), own(*given))[1],
    )
    bench = Bench(mode="implicit")
    bench.loop.begin(None)
    assert calls
    assert bench.stats.ticks == 0


@pytest.mark.parametrize("how", ["stop", "exception"])
def test_however_it_ends_zero_is_sent_within_two_ticks(how):
    bench = Bench()
    seen = []

    def between():
        if bench.stats.ticks == 100:
            seen.append(bench.clock.time)
            if how == "exception":
                raise KeyboardInterrupt
            return True
        return False

    if how == "exception":
        with pytest.raises(KeyboardInterrupt):
            bench.run(1000, between=between)
    else:
        bench.run(1000, between=between)
    time, wrench = bench.device.written[-1]
    assert not wrench.any()
    assert bench.device.written[-2][1][2] > 0.3
    assert time - seen[0] < 2 * DT
    assert bench.device.closed == 1


def test_an_error_of_the_contact_ends_the_loop_with_zero():
    bench = Bench()
    bench.loop.begin(None)

    def wait(seconds):
        raise RuntimeError("search failed")

    bench.contacts.wait = wait
    with pytest.raises(RuntimeError, match="search failed"):
        bench.loop.run(ticks=100)
    assert not bench.device.written[-1][1].any()
    assert bench.device.closed == 1


def test_a_device_that_never_speaks_is_refused():
    bench = Bench()
    bench.device.fresh = lambda t: False
    with pytest.raises(AsperityError, match="scripted gave no reading within 3 s"):
        bench.loop.begin(None)


def test_the_tick_can_be_changed_on_the_way():
    bench = Bench()
    bench.loop.begin(None)
    bench.loop.run(ticks=100)
    bench.loop.set_tick(DT / 4)
    before = bench.clock.time
    bench.loop.run(ticks=200)
    assert bench.clock.time - before == pytest.approx(100 * DT / 4, rel=0.05)


def memory_of_ticks(mode):
    """Return ticks, and bytes: kept after every thousand ticks, and the most there were."""
    bench = Bench(mode=mode)
    bench.contacts.submitted = type(
        "Nothing", (), {"append": lambda *_: None, "__len__": lambda _: 0}
    )()
    bench.device.write = lambda wrench: None
    bench.clock.sleep = bench.clock.work
    bench.loop.begin(None)
    bench.device.pose = wave
    bench.loop.run(ticks=500)
    tracemalloc.start()
    kept = []
    for ticks in range(1000, 6000, 1000):
        bench.loop.run(ticks=ticks)
        kept.append(tracemalloc.get_traced_memory()[0])
    return bench.stats.ticks, kept, tracemalloc.get_traced_memory()[1]


@pytest.mark.parametrize("mode", ["direct", "implicit"])
def test_memory_stays_flat(mode):
    """What thousands of ticks leave behind, in bytes: nothing that grows with their number.

    What is kept for once (free lists, a table that grew) may come in any thousand, but not in
    each. In a process of its own: threads that other tests leave behind allocate as well.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
        ticks, kept, peak = alone.submit(memory_of_ticks, mode).result()
    assert ticks == 5000
    assert min(np.diff(kept)) < 500
    assert peak - kept[-1] < 40_000


def test_limits_reach_the_gains():
    bench = Bench(mode="implicit")
    assert bench.tool.gains.stiffness <= LIMITS.max_stiffness


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no way to ask")
def test_threads_come_to_share_a_core_that_they_may_use():
    allowed, held = os.sched_getaffinity(0), threading.Event()
    thread = threading.Thread(target=held.wait)
    thread.start()
    try:
        core = pick_core()
        assert core in allowed
        outcome = share_core(core, [thread.native_id])
        assert os.sched_getaffinity(thread.native_id) == {core}
        assert outcome == f"on core {core}, with the loop"
        assert os.sched_getaffinity(0) == allowed
    finally:
        held.set()
        thread.join()


@pytest.mark.parametrize(
    ("quota", "cores"),
    [("max 100000", 3), ("200000 100000", 2), ("150000 100000", 1), ("-1", 3), ("50000", 1),
     ("", 3), ("no number", 3), ("900000 100000", 3)],
)  # fmt: skip
def test_a_container_may_have_the_time_of_fewer_cores(tmp_path, monkeypatch, quota, cores):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    (tmp_path / "quota").write_text(quota)
    (tmp_path / "period").write_text("100000")
    one = " " in quota  # both numbers are in one file
    places = ((tmp_path / "quota", None if one else tmp_path / "period"), (tmp_path / "no", None))
    monkeypatch.setattr(cores_in_use, "_QUOTAS", places)
    assert usable_cores() == cores
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3})
    assert usable_cores() == 1


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no way to ask")
def test_a_process_can_be_kept_off_a_core():
    allowed = os.sched_getaffinity(0)
    process = get_context("spawn").Process(target=time.sleep, args=(60.0,))
    process.start()
    try:
        core = pick_core()
        outcome = keep_off_core(core, process.pid)
        if len(allowed) > 1:
            assert outcome == f"not on core {core}"
            assert os.sched_getaffinity(process.pid) == allowed - {core}
        for other in sorted(os.sched_getaffinity(process.pid)):
            outcome = keep_off_core(other, process.pid)
        # One has to be left.
        assert outcome == "refused: there is no other core"
        assert os.sched_getaffinity(process.pid)
    finally:
        process.kill()
        process.join()
