"""The contact worker's calls and results, with an injected clock."""

from types import SimpleNamespace

import numpy as np
import pytest
from scripted import DT, Bench, HandClock

from asperity.dynamics.linear_contact import LinearContact
from asperity.realtime.servo.contact_worker import SEARCHED, WITHIN, ContactWorker
from asperity.simulation.tool_contact import CUT_SHORT

AT = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


class Told:
    """A stage that notes its arguments, and finds no contact."""

    dt = DT
    contacts = SimpleNamespace(depth=np.zeros(0))

    def __init__(self):
        self.submitted = []

    def evaluate(self, pose, *, jumped, seconds, search_seconds):
        self.submitted.append((jumped, seconds, search_seconds))
        return LinearContact(pose, np.zeros(6), np.zeros((6, 6)), 0, 0)

    def count_statuses(self, statuses):
        statuses[0] += 1


@pytest.mark.parametrize("begun", [0.0, 0.2, 0.6, 3.0])
def test_a_contact_has_what_is_left_of_the_tick_in_which_it_was_asked_for(begun):
    clock, stage = HandClock(), Told()
    worker = ContactWorker(stage, clock)
    submitted = clock.now()
    clock.work(begun * DT)
    worker.submit(AT, submitted, jumped=begun > 1.0)
    assert worker.wait(20.0)
    worker.stop()
    jumped, seconds, search_seconds = stage.submitted[0]
    assert jumped == (begun > 1.0)
    assert seconds == pytest.approx(max(WITHIN - begun, 0.0) * DT, abs=1e-6)
    assert search_seconds == pytest.approx(max(SEARCHED - begun, 0.0) * DT, abs=1e-6)


def test_ticks_whose_search_was_cut_short_are_counted():
    bench = Bench()
    submit = bench.contacts.submit

    def hasty(pose, now, *, jumped=False):
        submit(pose, now, jumped=jumped)
        linear, third = bench.contacts._next.linear, len(bench.contacts.submitted) % 3 == 0
        bench.contacts._next.linear = linear._replace(flags=CUT_SHORT if third else 0)

    bench.contacts.submit = hasty
    bench.run(90)
    summary = bench.stats.summary()
    assert summary["cut_short"] == pytest.approx(30, abs=1)
    assert summary["cut_short_percent"] == pytest.approx(100.0 / 3.0, abs=1.2)
    assert summary["fallbacks"] == 0
