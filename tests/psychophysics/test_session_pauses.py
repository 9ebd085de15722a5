"""Taking back an answer, breaks, practice with feedback, languages, catch trials."""

import io
import multiprocessing
import os
import random
import signal
import time
from datetime import UTC, datetime, timedelta

import pytest
from fakes import CHOICE, MAGNITUDE, Nothing, design

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.results import read_results
from asperity.psychophysics.design import ExperimentDesign, parse_design
from asperity.psychophysics.interfaces.protocol import (
    ParticipantInterface,
    Paused,
    Reply,
    SimulatedInterface,
    TakenBack,
)
from asperity.psychophysics.interfaces.terminal import TerminalInterface
from asperity.psychophysics.session.journal import read_journal
from asperity.psychophysics.session.session import Session
from asperity.psychophysics.session.tables import answers_table
from asperity.psychophysics.session.trials import standing_answers
from asperity.psychophysics.texts import FILE, read_texts
from asperity.scene.document import read_toml

pytestmark = pytest.mark.usefixtures("without_scenes")


def run(made, folder, front, presenter=None, now=lambda: datetime.now(UTC)):
    with Session(made, folder, "P1", 1, now=now) as session:
        return session.run(presenter or Nothing(), front, sleep=lambda _: None)


def answers_of(folder):
    kept = ("trial", "block", "level", "catch", "right_interval", "answer", "right")
    return [{k: row[k] for k in kept} for row in answers_table(read_journal(folder))]


TAKE_BACK = {"session": {"take_back": True}}


class Hesitant(SimulatedInterface):
    """Mistypes some answers, takes them back at once, and pauses now and then."""

    def __init__(self, made, wrong=(), pauses=()):
        super().__init__(made, "P1", 1)
        self.wrong, self.pauses = set(wrong), set(pauses)
        self._slip, self.notices = False, 0

    def answer(self, trial, felt):
        answer = super().answer(trial, felt)
        if trial.number in self.wrong:
            self.wrong.remove(trial.number)
            self._slip = True
            return 3 - answer
        return answer

    def ready(self, trial, progress):
        if trial.number in self.pauses:
            self.pauses.remove(trial.number)
            raise Paused
        self._undo(progress)

    def last(self, progress):
        self._undo(progress)

    def _undo(self, progress):
        if self._slip and progress.can_take_back:
            self._slip = False
            raise TakenBack

    def taken_back(self):
        self.notices += 1


@pytest.mark.parametrize("adaptive", ["staircase", "quest+"])
def test_a_mistyped_answer_that_is_taken_back_changes_nothing(adaptive, tmp_path):
    extra = {} if adaptive == "staircase" else {
        "forced_choice": {"adaptive": "quest+"}, "staircase": None, "quest": {"trials": 25},
    }  # fmt: skip
    made = design(CHOICE, **TAKE_BACK, **extra)
    last = run(made, tmp_path / "straight", Hesitant(made)).answers
    front = Hesitant(made, wrong=(1, 5, 11, last))
    assert run(made, tmp_path / "back", front).complete
    assert front.notices == 4
    assert answers_of(tmp_path / "back") == answers_of(tmp_path / "straight")
    # The trace: the journal holds both answers, and the table counts the first one.
    events = read_journal(tmp_path / "back")
    assert len([e for e in events if e["event"] == "answer"]) == last + 4
    assert [e["by"] for e in events if e["event"] == "taken_back"] == ["simulated"] * 4
    counts = {row["trial"]: row["taken_back"] for row in answers_table(events)}
    assert {n for n, count in counts.items() if count} == {1, 5, 11, last}
    attempts = [e["attempt"] for e in events if e["event"] == "trial" and e["trial"]["number"] == 5]
    assert attempts == [1, 2]
    result = read_results(tmp_path / "back")[0]
    assert (len(result.answers), result.taken_back) == (last, 4)


def test_taken_back_and_interrupted_it_goes_on_identically(tmp_path):
    made = design(CHOICE, **TAKE_BACK)
    run(made, tmp_path / "straight", Hesitant(made))
    # Paused right after a slip: the answer is taken back only in the next run.
    front = Hesitant(made, wrong=(4, 9, 20), pauses=(5, 9, 21, 30))
    for _ in range(6):
        if run(made, tmp_path / "parts", front).complete:
            break
    assert front.notices == 3
    assert answers_of(tmp_path / "parts") == answers_of(tmp_path / "straight")


class Fickle(SimulatedInterface):
    """Mistypes each fourth answer once and takes it back; knows by the journal that it did."""

    def __init__(self, made, session):
        super().__init__(made, "P1", 1)
        self._events = session.journal.events

    def _slips(self, number):
        before = [e["trial"]["number"] for e in self._events if e["event"] == "answer"]
        return number % 4 == 0 and number not in before

    def answer(self, trial, felt):
        answer = super().answer(trial, felt)
        return answer % 3 + 1 if self._slips(trial.number) else answer

    def ready(self, trial, progress):
        self.last(progress)

    def last(self, progress):
        standing = standing_answers(self._events)
        slipped = standing and standing[-1]["trial"]["number"] % 4 == 0
        if progress.can_take_back and slipped and not standing[-1]["taken_back"]:
            raise TakenBack


def _journal_length(folder):
    return sum(path.stat().st_size for path in folder.glob("*.jsonl"))


def _session_of(made, folder):
    ExperimentDesign.check_scenes = lambda self: {}
    with Session(made, folder, "P1", 1) as session:
        return session.run(Nothing(), Fickle(made, session), sleep=lambda _: None)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_killed_at_random_moments_it_is_the_same_as_undisturbed(tmp_path):
    settings = {**CHOICE["forced-choice"], "practice": 3, "practice_feedback": False}
    made = design(
        CHOICE, method="odd-one-out", forced_choice=None, odd_one_out=settings,
        catch={"every": 6}, staircase={"trials": 30},
        session={"take_back": True, "break_every": 7, "break_seconds": 0.0},
    )  # fmt: skip
    count = _session_of(made, tmp_path / "whole").answers
    # Killed where its journal has grown by up to a twelfth of the whole: as often on any machine.
    length = _journal_length(tmp_path / "whole")
    fork, rng, kills = multiprocessing.get_context("fork"), random.Random(3), 0
    for _ in range(80):
        process = fork.Process(target=_session_of, args=(made, tmp_path / "parts"))
        process.start()
        if kills < 30:
            until = _journal_length(tmp_path / "parts") + rng.uniform(0.0, length / 12)
            while process.is_alive() and _journal_length(tmp_path / "parts") < until:
                time.sleep(1e-4)
            process.kill()
        process.join()
        kills += process.exitcode == -signal.SIGKILL
        if process.exitcode == 0:
            break
    assert kills > 5
    assert answers_of(tmp_path / "parts") == answers_of(tmp_path / "whole")
    for name in ("whole", "parts"):
        events = read_journal(tmp_path / name)
        taken = [e for e in events if e["event"] == "taken_back"]
        assert len(taken) == count // 4
        ended = [e["after"] for e in events if e["event"] == "break_end"]
        assert ended == sorted(set(ended)) == list(range(7, count, 7))


def test_only_the_last_answer_is_taken_back_and_none_after_feedback(tmp_path):
    class Greedy(ParticipantInterface):
        kind = "test"

        def __init__(self):
            self.able = []

        def ready(self, trial, progress):
            self.able.append(progress.can_take_back)
            if progress.can_take_back and len(self.able) < 8:
                raise TakenBack

        def ask(self, trial, felt):
            return Reply(1, 0.1)

    front = Greedy()
    run(design(MAGNITUDE, **TAKE_BACK), tmp_path / "a", front)
    # After taking one back, the one before it stands.
    assert front.able[:6] == [False, True, False, True, False, True]
    front = Greedy()
    run(design(CHOICE, forced_choice={"feedback": True}, **TAKE_BACK), tmp_path / "b", front)
    assert not any(front.able)
    front = Greedy()
    run(design(CHOICE), tmp_path / "c", front)
    assert not any(front.able)


def test_breaks_come_and_one_that_is_interrupted_goes_on(tmp_path):
    made = design(CHOICE, session={"break_every": 10, "break_seconds": 90.0})
    clock = [datetime(2026, 1, 1, tzinfo=UTC)]

    class Resting(SimulatedInterface):
        def __init__(self, leaves=False):
            super().__init__(made, "P1", 1)
            self.rests, self.leaves = [], leaves

        def rest(self, seconds, progress):
            self.rests.append((progress.done, seconds))
            if self.leaves:
                clock[0] += timedelta(seconds=40)
                raise Paused
            clock[0] += timedelta(seconds=seconds + 5)

    whole = Resting()
    count = run(made, tmp_path / "whole", whole, now=lambda: clock[0]).answers
    assert whole.rests == [(n, 90.0) for n in range(10, count, 10)]
    assert not run(made, tmp_path / "parts", Resting(leaves=True), now=lambda: clock[0]).complete
    events = [e["event"] for e in read_journal(tmp_path / "parts")]
    assert events[-2:] == ["break", "pause"]
    clock[0] += timedelta(seconds=20)
    front = Resting()
    assert run(made, tmp_path / "parts", front, now=lambda: clock[0]).complete
    # 60 of the 90 seconds are over; the others are rested, and no break comes twice.
    assert front.rests == [(10, 30.0), *whole.rests[1:]]
    assert answers_of(tmp_path / "parts") == answers_of(tmp_path / "whole")


def test_practice_gives_feedback_and_the_others_do_not(tmp_path):
    class Told(SimulatedInterface):
        def __init__(self, made):
            super().__init__(made, "P1", 1)
            self.told, self.number = [], 0

        def ready(self, trial, progress):
            self.number = trial.number

        def feedback(self, right):
            self.told.append(self.number)

    for settings, expected in (
        ({"practice": 5}, [1, 2, 3, 4, 5]), ({"practice": 5, "practice_feedback": False}, []),
        ({"practice": 2, "feedback": True}, list(range(1, 13))),
    ):  # fmt: skip
        made = design(CHOICE, forced_choice=settings, staircase={"trials": 10})
        front = Told(made)
        run(made, tmp_path / str(len(expected)), front)
        assert front.told == expected


def test_catch_trials_are_extra_and_reported(tmp_path):
    plain, made = design(CHOICE), design(CHOICE, catch={"every": 10, "level": 1.0})
    run(plain, tmp_path / "plain", SimulatedInterface(plain, "P1", 1))

    class Asleep(SimulatedInterface):
        """Guesses at catch trials; answers the others as without them."""

        def __init__(self):
            super().__init__(made, "P1", 1)
            self.ordinary = 0

        def answer(self, trial, felt):
            if trial.catch:
                return 1
            self.ordinary += 1
            numbered = {**trial.to_json(), "number": self.ordinary}
            return super().answer(type(trial).from_json(numbered), felt)

    run(made, tmp_path / "catch", Asleep())
    without, among = read_results(tmp_path / "plain")[0], read_results(tmp_path / "catch")[0]
    # The procedure does not see them.
    assert [a.trial.level for a in among.answers] == [a.trial.level for a in without.answers]
    assert [a.answer for a in among.answers] == [a.answer for a in without.answers]
    assert len(among.catch) == len(without.answers) // 10
    assert {a.trial.level for a in among.catch} == {1.0}
    for answered in among.catch:
        first, second = (stimulus.value for stimulus in answered.trial.stimuli)
        assert answered.right == ((answered.answer == 1) == (first > second))
    gaps = [a.trial.number for a in among.catch]
    assert all(0 <= n - 1 - 11 * i < 11 for i, n in enumerate(gaps))
    assert len({n - 11 * i for i, n in enumerate(gaps)}) > 2


def test_in_the_terminal_an_answer_is_taken_back_and_a_break_is_waited_for(tmp_path):
    made = design(
        MAGNITUDE, magnitude={"blocks": 1, "practice": 0}, levels={"values": [1e-4, 2e-4]},
        session={"take_back": True, "break_every": 1, "break_seconds": 30.0},
    )  # fmt: skip
    clock = iter(range(0, 10000, 10))
    lines = ["", "9", "", "", "b", "b", "", "3", "", "4", "b", "", "5", ""]
    written = io.StringIO()
    front = TerminalInterface(
        io.StringIO("\n".join(lines) + "\n"), written, clock=lambda: float(next(clock))
    )
    assert run(made, tmp_path / "s", front).complete
    rows = answers_table(read_journal(tmp_path / "s"))
    assert [(row["answer"], row["taken_back"]) for row in rows] == [(3.0, 1), (5.0, 1)]
    assert "Please rest for another 20 s." in written.getvalue()
    assert "Your last answer was taken back" in written.getvalue()
    assert written.getvalue().count("no answer that can be taken back") == 1


def test_every_language_has_every_text_with_its_fields():
    table = read_toml(FILE)
    english = table["en"]
    for language in ("de", "fr", "es"):
        assert set(table[language]) == set(english)
        texts = read_texts(language, FILE)  # checks the fields, too
        for key, text in english.items():
            assert text.count("{") == texts.by_key[key].count("{"), (language, key)
        changed = [key for key in english if texts.by_key[key] != english[key]]
        assert len(changed) > 0.9 * len(english)


def test_participants_read_their_language(tmp_path):
    (tmp_path / "own.toml").write_text(
        '[it]\nquestion_magnitude = "Quanto era ruvido?"\n[de]\nover = "Fertig: {count}."\n'
    )
    document = {**MAGNITUDE, "texts": "own.toml", "instructions": {"de": "Reiben.", "it": "Tocca."},
                "magnitude": {"blocks": 1, "practice": 0}}  # fmt: skip
    made = parse_design(document, tmp_path, language="de")
    assert made.question.startswith("Wie rau")
    written = io.StringIO()
    lines = ["", "viel", "2,5", *["", "1"] * 4]
    front = TerminalInterface(io.StringIO("\n".join(lines) + "\n"), written)
    assert run(made, tmp_path / "s", front).complete
    text = written.getvalue()
    assert "Reiben." in text
    assert "bitte geben Sie eine Zahl über 0 an" in text
    assert text.endswith("Fertig: 5.\n")
    assert {e["language"] for e in read_journal(tmp_path / "s") if e["event"] == "run"} == {"de"}
    # The language is no part of the design: another participant's does not make another experiment.
    other = parse_design(document, tmp_path, language="it")
    assert (other.question, other.digest) == ("Quanto era ruvido?", made.digest)
    assert other.texts("right") == "That was right."
    (tmp_path / "own.toml").unlink()
    assert len(read_results(tmp_path / "s")[0].answers) == 5


@pytest.mark.parametrize(
    ("changes", "own", "told"),
    [
        ({"language": "it"}, None, "unknown language 'it'; valid: de, en, es, fr"),
        ({"language": "en", "texts": "own.toml"}, "[en]\nrihgt = 'x'", "did you mean en.right?"),
        ({"texts": "own.toml"}, "[en]\nright = 3", "en.right must be a text, got 3"),
        ({"texts": "own.toml"}, "[en]\nover = '{n} done'", "en.over has a field {n}; valid: {coun"),
        ({"texts": "none.toml"}, None, "texts: no such file: "),
        ({"language": 3}, None, "language must be a text, got 3"),
        ({"question": {"en": 3}}, None, "question.en must be a text, got 3"),
        ({"question": {"de": "Na?"}}, None, "question has no text in the language 'en'; it has de"),
        ({"question": 3}, None, "question must be a table"),
        ({"session": {"break_every": -1}}, None, "session: break_every must lie between"),
        ({"session": {"order": "latin"}}, None, "unknown order 'latin'; choose from: random, bal"),
        ({"catch": {"every": 5}}, None, "catch trials need a right answer, which the method 'magn"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_in_a_line(changes, own, told, tmp_path):
    if own:
        (tmp_path / "own.toml").write_text(own)
    with pytest.raises(AsperityError) as caught:
        parse_design({**MAGNITUDE, **changes}, tmp_path)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
