"""What is asked of the system, what comes of it, and how times are counted."""

import gc
import os
from types import SimpleNamespace

import numpy as np
import pytest
from scripted import Bench

from asperity.realtime.servo import scheduling as realtime
from asperity.realtime.servo.scheduling import PRIORITY, RealTime, request
from asperity.realtime.servo.stats import QUANTILES, Histogram

ALL = RealTime(priority=True, core=0, lock_memory=True)


def test_nothing_that_needs_rights_is_asked_for_by_itself():
    assert set(request(RealTime())) == {"timers"}


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="Linux is what is tested")
def test_what_is_asked_for_is_granted_and_reported(monkeypatch):
    asked = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: asked.append(given))
    monkeypatch.setattr(os, "sched_setaffinity", lambda *given: asked.append(given))
    library = SimpleNamespace(prctl=lambda *_: 0, mlockall=lambda flags: asked.append(flags) or 0)
    monkeypatch.setattr(realtime.ctypes, "CDLL", lambda *_, **__: library)
    outcomes = request(ALL)
    assert outcomes["priority"] == f"SCHED_FIFO {PRIORITY}"
    assert outcomes["core"] == "core 0"
    assert outcomes["memory"] == "locked"
    assert [one[1] for one in asked[:1]] == [os.SCHED_FIFO]
    assert asked[0][2].sched_priority == PRIORITY
    assert asked[1:] == [(0, {0}), 3]  # all memory that is there, and all that comes


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="Linux is what is tested")
def test_what_is_refused_is_reported_and_does_no_harm(monkeypatch):
    def refused(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    monkeypatch.setattr(os, "sched_setaffinity", refused)
    library = SimpleNamespace(prctl=lambda *_: -1, mlockall=lambda _: -1)
    monkeypatch.setattr(realtime.ctypes, "CDLL", lambda *_, **__: library)
    monkeypatch.setattr(realtime.ctypes, "get_errno", lambda: 12)
    outcomes = request(ALL)
    assert set(outcomes) == {"timers", "priority", "core", "memory"}
    assert all(answer.startswith("refused: ") for answer in outcomes.values())
    assert outcomes["priority"] == "refused: Operation not permitted"


@pytest.mark.parametrize("spread", [0.02, 0.7, 3.0])
def test_quantiles_of_a_histogram_are_right_to_half_a_bin(spread):
    times = 2e-4 * np.exp(spread * np.random.default_rng(1).normal(size=20_000))
    counted = Histogram()
    for seconds in times.tolist():
        counted.add(seconds)
    quantiles = counted.quantiles_us()
    for name, share in QUANTILES.items():
        # The sample whose share it is, not one between two.
        true = np.quantile(times, share, method="inverted_cdf") * 1e6
        assert quantiles[name] == pytest.approx(true, rel=0.0225)
    assert quantiles["max"] == pytest.approx(times.max() * 1e6, abs=0.01)
    less, more = (np.count_nonzero(times <= 2e-4 * 2.0 ** (k / 16.0)) for k in (-1.0, 1.0))
    assert less <= counted.below(2e-4) <= more


def test_the_collector_rests_while_it_ticks_and_works_again_after():
    bench, seen = Bench(), []
    bench.run(20, between=lambda: seen.append(gc.isenabled()))
    assert len(seen) == 20
    assert not any(seen)
    assert gc.isenabled()
