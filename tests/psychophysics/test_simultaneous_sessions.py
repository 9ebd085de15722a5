"""Sessions that start at the same moment in one folder: one runs, the others say so in a line."""

import multiprocessing
import os

import pytest
from fakes import CHOICE, MAGNITUDE, Nothing, design

from asperity.errors import AsperityError
from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.session.journal import read_journal
from asperity.psychophysics.session.session import Session

pytestmark = pytest.mark.usefixtures("without_scenes")

STARTS = 20


def start(i, folder, together, said):
    # Every second one has another experiment.
    made = design(MAGNITUDE if i % 2 else CHOICE)
    together.wait()
    try:
        with Session(made, folder, "P1") as session:
            said.put((i, "runs"))
            together.wait()
            session.run(Nothing(), SimulatedInterface(made, "P1"), sleep=lambda _: None)
    except AsperityError as error:
        said.put((i, str(error)))
        together.wait()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_of_many_that_start_at_once_one_runs(tmp_path):
    fork = multiprocessing.get_context("fork")
    together, said = fork.Barrier(STARTS), fork.Queue()
    folder = tmp_path / "s"
    children = [fork.Process(target=start, args=(i, folder, together, said)) for i in range(STARTS)]
    for child in children:
        child.start()
    lines = dict(said.get(timeout=60) for _ in children)
    for child in children:
        child.join()
    assert [child.exitcode for child in children] == [0] * STARTS
    winner = next(i for i, line in lines.items() if line == "runs")
    taken = [line for i, line in lines.items() if i != winner]
    assert all("is in use by another process" in line and "\n" not in line for line in taken)
    events = read_journal(folder)
    assert [event["event"] for event in events if event["event"] in ("begin", "end")] == [
        "begin", "end",
    ]  # fmt: skip
    assert events[0]["method"] == ("magnitude" if winner % 2 else "forced-choice")
