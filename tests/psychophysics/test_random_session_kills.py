"""Fifty kills of sessions at random moments: what comes of them is what an undisturbed one gives.

Those of sweeps, workers and schedulers: tests/studies/sweeps/test_random_kills.py.
"""

import multiprocessing
import os
import random
import signal
import time

import pytest
from fakes import CHOICE, MAGNITUDE, YES_NO, Nothing, design, document

from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.session.journal import read_journal
from asperity.psychophysics.session.session import Session
from asperity.psychophysics.session.tables import answers_table

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("without_scenes")]

KILLS = 50
QUEST = document(CHOICE, forced_choice={"adaptive": "quest+"}, staircase=None,
                 quest={"trials": 60}, catch={"every": 7})  # fmt: skip
DESIGNS = [CHOICE, QUEST, YES_NO, document(MAGNITUDE, magnitude={"blocks": 12})]


def run(made, folder):
    with Session(made, folder, "P1") as session:
        session.run(Nothing(), SimulatedInterface(made, "P1"), sleep=lambda _: None)


def results(folder):
    """Return all that was answered, but for times and how often a trial was begun."""
    left_out = ("answered_at", "attempt")
    table = answers_table(read_journal(folder))
    return [{k: v for k, v in row.items() if k not in left_out} for row in table]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_of_sessions(tmp_path):
    fork, dice, kills, round_ = multiprocessing.get_context("fork"), random.Random(4), 0, 0
    while kills < KILLS:
        made = design(DESIGNS[round_ % len(DESIGNS)])
        whole, parts = tmp_path / f"whole{round_}", tmp_path / f"parts{round_}"
        begun = time.perf_counter()
        run(made, whole)
        lasted = time.perf_counter() - begun
        while True:
            process = fork.Process(target=run, args=(made, parts))
            process.start()
            time.sleep(dice.uniform(0.0, 0.5 * lasted))
            if process.is_alive() and kills < KILLS:
                os.kill(process.pid, signal.SIGKILL)
                kills += 1
            process.join()
            if process.exitcode == 0:
                break
        assert results(parts) == results(whole)
        round_ += 1
    assert round_ >= len(DESIGNS)
