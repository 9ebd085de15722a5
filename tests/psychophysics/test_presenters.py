"""Presenting through a device, in the terminal and in the page."""

import io
import threading
import time
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from fakes import ADJUSTMENT, CHOICE, MAGNITUDE, PAIRS, YES_NO, Nothing, design, document

from asperity.errors import AsperityError
from asperity.psychophysics.interfaces.protocol import Paused, SimulatedInterface
from asperity.psychophysics.interfaces.terminal import TerminalInterface
from asperity.psychophysics.session import presenters
from asperity.psychophysics.session.presenters import DevicePresenter
from asperity.psychophysics.session.session import Session
from asperity.psychophysics.session.tables import answers_table
from asperity.runs.recording import read_recording

DEVICE = document(
    PAIRS, stimuli={"c": None, "d": None}, pairs={"repeats": 1},
    presentation={"seconds": 0.3, "pause": 0.0},
)  # fmt: skip
DEVICE["stimuli"] = {
    "a": {"change": {"bodies": {"plate": {"texture": {"amplitude": 5e-5}}}}, "value": 1.0},
    "b": {"change": {"bodies": {"plate": {"texture": {"amplitude": 2e-4}}}}, "value": 2.0},
}  # fmt: skip


def spec_of(scene, seconds):
    from asperity.cli.realtime_run import DeviceOptions, servo_spec, with_coupling

    return servo_spec(with_coupling(scene, None), "simulated", DeviceOptions(), seconds, None)


class Pretended:
    """A servo process that is none, and says what it is told to do."""

    told: ClassVar[list] = []

    def __init__(self, spec, recording, attributes):
        assert spec.held
        self.name, self._over = recording.stem, threading.Event()
        recording.write_bytes(b"")

    def start(self):
        time.sleep(0.02)
        self.told.append(f"ready {self.name}")

    def go(self):
        self.told.append(f"go {self.name}")

    def wait(self, seconds):
        return self._over.wait(0.01) or self._over.set()

    def finish(self):
        return {
            "timing": {"misses": 3, "fallbacks": 0}, "safety": {"clamped_force": 0},
            "recorder": {"error": ""}, "ended": "its time was over",
        }  # fmt: skip

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.told.append(f"end {self.name}")


def test_all_intervals_are_ready_before_the_first_and_none_is_left(tmp_path, monkeypatch):
    made, seen = design(DEVICE), []
    nothing = SimpleNamespace(time=np.zeros(0))
    monkeypatch.setattr(Pretended, "told", [])
    monkeypatch.setattr(presenters, "Servo", Pretended)
    monkeypatch.setattr(presenters, "read_recording", lambda path: nothing)
    presenter = DevicePresenter(made.stimuli, spec_of, on_servo=seen.append)
    recordings = [tmp_path / "0001-1.h5", tmp_path / "0001-2.h5"]
    wanted = list(zip(made.all_stimuli(), recordings, strict=True))
    presenter.prepare(wanted, 0.3)
    presenter.drop()
    assert not any(path.exists() for path in recordings)
    assert {told for told in Pretended.told if told.startswith("go")} == set()
    assert all(told.replace("ready", "end") in Pretended.told for told in Pretended.told)
    Pretended.told.clear()
    presenter.prepare(wanted, 0.3)
    for stimulus, recording in wanted:
        felt = presenter.present(stimulus, recording, 0.3, lambda: seen.append("felt"), lambda: 0)
        assert felt.loop_report["misses"] == 3
    presenter.close()
    assert Pretended.told == [
        "ready 0001-1", "ready 0001-2", "go 0001-1", "end 0001-1", "go 0001-2", "end 0001-2",
    ]  # fmt: skip
    assert [type(one).__name__ for one in seen] == ["Pretended", "str", "NoneType"] * 2


@pytest.mark.slow
def test_a_trial_through_a_device_and_one_that_was_made_ready_for_nothing(tmp_path):
    made, seen = design(DEVICE), []

    class Tired(SimulatedInterface):
        def ready(self, trial, progress):
            if not progress.resumed:
                raise Paused

        def begun(self, interval):
            seen.append(interval)

    for complete in (False, True):
        presenter = DevicePresenter(made.stimuli, spec_of)
        with Session(made, tmp_path / "s", "P1") as session:
            outcome = session.run(presenter, Tired(made), sleep=lambda _: None)
        presenter.close()
        assert outcome.complete == complete
        if not complete:
            assert list((tmp_path / "s" / "recordings").iterdir()) == []
    assert seen == [1, 2]
    for interval in (1, 2):
        recording = read_recording(tmp_path / "s" / "recordings" / f"0001-{interval}.h5")
        assert recording.attributes["source"] == "probe-plate"
        assert len(recording.time) > 0
        assert recording.time[-1] < 0.5
        assert np.isfinite(recording.device_wrench).all()


def test_what_cannot_be_felt_is_told(tmp_path, monkeypatch):
    made = design(DEVICE)

    def broken(scene, seconds):
        raise AsperityError("no such device")

    presenter = DevicePresenter(made.stimuli, broken)
    with (
        Session(made, tmp_path / "s", "P1") as session,
        pytest.raises(AsperityError, match="no su"),
    ):
        session.run(presenter, SimulatedInterface(made), sleep=lambda _: None)
    presenter.close()


def test_a_device_that_is_not_there_is_refused_before_the_instructions(tmp_path, monkeypatch):
    made, told = design(DEVICE), []

    class Absent:
        def open(self):
            raise AsperityError("no device answers at port 3")

        def close(self):
            told.append("closed")

    class Asking(SimulatedInterface):
        def welcome(self, design, progress):
            told.append("welcome")

    presenter = DevicePresenter(made.stimuli, lambda *_: SimpleNamespace(make_device=Absent))
    with (
        Session(made, tmp_path / "s", "P1") as session,
        pytest.raises(AsperityError, match="no device answers"),
    ):
        session.run(presenter, Asking(made), sleep=lambda _: None)
    presenter.close()
    assert told == ["closed"]


@pytest.mark.usefixtures("without_scenes")
def test_the_terminal_asks_explains_and_pauses(tmp_path):
    made = design(
        MAGNITUDE, magnitude={"blocks": 1, "practice": 1}, levels={"values": [1e-4, 2e-4]},
        instructions="Feel it.", question="How rough?",
    )  # fmt: skip

    def session(typed):
        told = io.StringIO()
        with Session(made, tmp_path / "s", "P1") as session:
            outcome = session.run(Nothing(), TerminalInterface(io.StringIO(typed), told))
            return outcome, told.getvalue(), session.journal.events

    outcome, told, _ = session("\nrough\n10\n\n5\nq\n")
    assert (outcome.answers, outcome.complete) == (2, False)
    assert "Feel it." in told
    assert "please give a number above 0" in told
    assert told.index("for practice") < told.index("Practice is over")
    outcome, told, events = session("\n20\n")
    assert "goes on after 2 answers" in told
    assert outcome.complete
    assert [row["answer"] for row in answers_table(events)] == [10.0, 5.0, 20.0]


def clicks(desk, stage, what):
    """Do something in the page when it has come to a stage."""
    waits(desk, lambda: desk.stage == stage)
    desk.done.put(what)
    waits(desk, lambda: desk.stage != stage)


def waits(desk, until):
    end = time.monotonic() + 60.0
    while not until():
        assert time.monotonic() < end, f"the page stays at {desk.stage}"
        time.sleep(0.005)


@pytest.fixture
def in_page(without_scenes):
    """Return a function that opens a session's page."""
    pytest.importorskip("viser")
    from asperity.psychophysics.interfaces.page import ParticipantPanel, TrialClient, panels
    from asperity.scene.builtin import load_scene
    from asperity.viewer.server.server import Page
    from asperity.viewer.session_config import SessionConfig

    opened = []

    def open_page(made, show=False):
        scene = load_scene("probe-plate-dots")
        choice = SessionConfig(scene if show else scene.smooth(), made.name)
        desk, link = ParticipantPanel(made), TrialClient(choice, show=show)
        page = Page(link, panels(desk, choice, show=show), port=0)
        opened.append((page, link))
        return desk, link, page

    yield open_page
    for page, link in opened:
        page.close()
        link.close()


def test_the_page_asks(in_page, tmp_path):
    from asperity.psychophysics.interfaces.page import PageInterface

    made = design(CHOICE, staircase={"trials": 2}, forced_choice={"feedback": True})
    desk, link, _ = in_page(made)
    told, done = [], []

    def go():
        with Session(made, tmp_path / "s", "P1") as session:
            done.append(session.run(Nothing(), PageInterface(desk, told.append)))

    runner = threading.Thread(target=go, daemon=True)
    runner.start()
    clicks(desk, "welcome", ("next", None))
    desk.done.put(("answer", 2))  # what is pressed too early counts for nothing
    clicks(desk, "ready", ("next", None))
    clicks(desk, "ask", ("answer", 1))
    clicks(desk, "ready", ("next", None))
    waits(desk, lambda: desk.stage == "ask" and all(b.visible for b in desk._choices))
    assert not desk._entry.visible
    clicks(desk, "ask", ("answer", 2))
    runner.join(20.0)
    assert done[0].complete
    assert [line.split(", ")[1][:12] for line in told] == [
        "level 0.8: 1",
        told[1].split(", ")[1][:12],
    ]
    assert desk.stage == "over"
    with pytest.raises(AsperityError, match="settings cannot be changed"):
        link.change(stiffness=100.0)


def visible(desk):
    """Return the labels of the buttons that can be pressed."""
    words = [button for kind in desk._words.values() for button in kind.values()]
    buttons = [desk._next, desk._back, desk._pause, *desk._choices, *words]
    return [button.label for button in buttons if button.visible]


def in_thread(made, folder, desk):
    from asperity.psychophysics.interfaces.page import PageInterface

    told, done = [], []

    def go():
        with Session(made, folder, "P1") as session:
            done.append(session.run(Nothing(), PageInterface(desk, told.append)))
            done.append(answers_table(session.journal.events))

    runner = threading.Thread(target=go, daemon=True)
    runner.start()
    return runner, done, told


def test_the_page_takes_back_rests_and_speaks_german(in_page, tmp_path):
    made = design(
        YES_NO, yes_no={"repeats": 1, "levels": [1e-4]}, language="de",
        session={"take_back": True, "break_every": 1, "break_seconds": 0.5},
    )  # fmt: skip
    desk, _, _ = in_page(made)
    runner, done, told = in_thread(made, tmp_path / "s", desk)
    # The stage is set just before its buttons are shown.
    waits(desk, lambda: visible(desk) == ["Beginnen", "Ein andermal weiter"])
    clicks(desk, "welcome", ("next", None))
    clicks(desk, "ready", ("next", None))
    waits(desk, lambda: desk.stage == "ask" and "Nein" in visible(desk))
    assert visible(desk) == ["Ein andermal weiter", "Ja", "Nein"]
    clicks(desk, "ask", ("answer", 1))
    waits(desk, lambda: desk.stage == "rest")
    assert "Weiter" not in visible(desk)
    assert "Zeit für eine Pause. Bitte ruhen Sie noch 1 s." in desk._message.content
    waits(desk, lambda: "Weiter" in visible(desk))
    desk.done.put(("next", None))
    waits(desk, lambda: desk.stage == "ready" and "Letzte Antwort zurücknehmen" in visible(desk))
    desk.done.put(("back", None))
    waits(desk, lambda: desk.stage == "ready" and "zurückgenommen" in desk._message.content)
    assert "Letzte Antwort zurücknehmen" not in visible(desk)
    desk.done.put(("next", None))
    clicks(desk, "ask", ("answer", 0))
    clicks(desk, "ready", ("next", None))
    clicks(desk, "ask", ("answer", 0))
    waits(desk, lambda: desk.stage == "last" and "Abschließen" in visible(desk))
    desk.done.put(("next", None))
    runner.join(20.0)
    outcome, rows = done
    assert outcome.complete
    assert [(row["answer"], row["taken_back"]) for row in rows] == [(0, 1), (0, 0)]
    assert "the last answer was taken back" in told
    assert desk._message.content == "Das war der letzte von 2 Durchgängen. Vielen Dank."


def test_the_page_adjusts_and_chooses_among_three(in_page, tmp_path):
    made = design(ADJUSTMENT, adjustment={"repeats": 1, "low": 1e-6, "high": 1e-2})
    desk, _, _ = in_page(made)
    runner, done, _ = in_thread(made, tmp_path / "s", desk)
    clicks(desk, "welcome", ("next", None))
    for answer in (2, -1, 0):
        clicks(desk, "ready", ("next", None))
        waits(desk, lambda: desk.stage == "ask" and "much rougher" in visible(desk))
        desk.done.put(("answer", answer))
    runner.join(20.0)
    outcome, rows = done
    assert outcome.complete
    assert [(row["step"], row["answer"]) for row in rows] == [(1, 2), (2, -1), (3, 0)]
    assert rows[1]["level"] == pytest.approx(rows[0]["level"] * 1.05**4)

    made = design(CHOICE, forced_choice={"intervals": 3}, staircase={"trials": 1})
    desk, _, _ = in_page(made)
    runner, done, _ = in_thread(made, tmp_path / "t", desk)
    clicks(desk, "welcome", ("next", None))
    clicks(desk, "ready", ("next", None))
    waits(desk, lambda: desk.stage == "ask" and "3" in visible(desk))
    assert visible(desk)[-3:] == ["1", "2", "3"]
    assert "1, 2 or 3?" in desk._message.content
    desk.done.put(("answer", 3))
    runner.join(20.0)
    assert done[1][0]["answer"] == 3


def test_the_page_shows_no_relief_unless_it_may(in_page):
    made = design(CHOICE)
    for show in (False, True):
        _, link, page = in_page(made, show)
        stage = page.panels[0]
        plate = next(shape for shape in stage.shapes if not shape.is_tool)
        heights = np.round(plate.vertices[:, 2], 7)
        assert (len(np.unique(heights)) > 10) == show
        assert any(body.fields for body in link.config.scene.bodies) == show


@pytest.mark.slow
def test_in_a_browser(in_page, tmp_path):
    """A whole session by clicks and keys: a number, a pause."""
    pytest.importorskip("playwright")
    from asperity.psychophysics.interfaces.page import PageInterface
    from asperity.viewer.browser import browser_tab, chromium

    if chromium() is None:
        pytest.skip("no Chromium here")
    made = design(
        MAGNITUDE, magnitude={"blocks": 1, "practice": 0}, instructions="Feel **it**.",
        question="How rough?",
    )  # fmt: skip
    desk, _, page = in_page(made)
    done = []

    def go():
        with Session(made, tmp_path / "s", "P1") as session:
            done.append(session.run(Nothing(), PageInterface(desk)))
            done.append(answers_table(session.journal.events))

    runner = threading.Thread(target=go, daemon=True)
    runner.start()
    with browser_tab((500, 500)) as tab:
        tab.set_default_timeout(120e3)
        tab.goto(page.url)
        tab.get_by_role("button", name="Begin").click()
        tab.get_by_role("button", name="Start").click()
        tab.get_by_text("How rough?").wait_for()
        tab.get_by_role("textbox").last.fill("nothing")
        tab.get_by_role("button", name="OK").click()
        tab.get_by_text("please give a number above 0").wait_for()
        tab.get_by_role("textbox").last.fill("12.5")
        tab.get_by_role("button", name="OK").click()
        tab.get_by_role("button", name="Start").wait_for()
        tab.get_by_role("button", name="another time").click()
        runner.join(30.0)
    outcome, rows = done
    assert (outcome.answers, outcome.complete) == (1, False)
    assert rows[0]["answer"] == 12.5
