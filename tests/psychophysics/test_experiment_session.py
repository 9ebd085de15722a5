"""Sessions: their order, going on, and that no answer is lost wherever one is killed."""

import csv
import itertools
import multiprocessing
import os
import random
import signal
import stat
import time

import pytest
from fakes import CHOICE, MAGNITUDE, PAIRS, Nothing, Person, design, document

from asperity._core.output import write_whole
from asperity.errors import AsperityError, OutputError
from asperity.psychophysics.analysis.results import read_results
from asperity.psychophysics.analysis.thresholds import AnalysisOptions, analyse_threshold
from asperity.psychophysics.design import ExperimentDesign, read_design
from asperity.psychophysics.interfaces.protocol import Paused, SimulatedInterface
from asperity.psychophysics.procedures.procedures import procedure
from asperity.psychophysics.session import journal as journal_module
from asperity.psychophysics.session import session as session_module
from asperity.psychophysics.session.journal import read_journal
from asperity.psychophysics.session.session import Session
from asperity.psychophysics.session.tables import answers_table
from asperity.scene.document import write_toml

pytestmark = pytest.mark.usefixtures("without_scenes")


def run(made, folder, front=None, participant="P1", number=1):
    with Session(made, folder, participant, number) as session:
        front = front or SimulatedInterface(made, participant, number)
        return session.run(Nothing(), front, sleep=lambda _: None)


def rows(folder, name="answers.csv"):
    with open(folder / name, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def answers_of(folder):
    """Return what was answered, without times."""
    kept = ("trial", "block", "level", "right_interval", "answer", "right")
    return [{k: row[k] for k in kept} for row in answers_table(read_journal(folder))]


def test_magnitudes_come_in_blocks_with_practice_and_none_twice_in_a_row(tmp_path):
    made = design(MAGNITUDE)
    assert run(made, tmp_path / "s").complete
    told = rows(tmp_path / "s", "trials.csv")
    assert [row["block"] for row in told] == ["0"] * 2 + ["1"] * 5 + ["2"] * 5 + ["3"] * 5
    for block in "123":
        values = [float(row["value"]) for row in told if row["block"] == block]
        assert sorted(values) == sorted(made.values)
    names = [row["stimulus"] for row in told]
    assert all(a != b for a, b in itertools.pairwise(names))
    assert {row["practice"] for row in rows(tmp_path / "s")} == {"0", "1"}
    assert len(read_results(tmp_path / "s")[0].answers) == 15


def test_order_follows_from_seed_participant_and_session():
    def order(participant="P1", session=1, **changes):
        steps = procedure(design(MAGNITUDE, **changes), participant, session)
        told = []
        while (trial := steps.next()) is not None:
            told.append(trial.stimuli[0].name)
            steps.answer(trial, 1.0)
        return told

    assert order() == order()
    assert len({tuple(o) for o in (order(), order("P2"), order(session=2), order(seed=4))}) == 4


def test_pairs_are_balanced():
    steps = procedure(design(PAIRS, pairs={"repeats": 2}), "P1", 1)
    told = []
    while (trial := steps.next()) is not None:
        told.append(tuple(s.name for s in trial.stimuli))
        steps.answer(trial, 1)
    assert len(told) == 12
    assert len(set(told)) == 12  # every pair once in either order


def test_staircases_are_interleaved_and_end(tmp_path):
    made = design(CHOICE, staircase={"start": [0.8, 0.05]})
    run(made, tmp_path / "s")
    tracks = [row["track"] for row in rows(tmp_path / "s")]
    assert abs(tracks.count("1") - tracks.count("2")) < 40
    assert set(tracks[:2]) == {"1", "2"}
    assert {row["right_interval"] for row in rows(tmp_path / "s")} == {"1", "2"}


@pytest.mark.parametrize(
    ("settings", "comparison"),
    [({}, True), ({"more": "smaller"}, False), ({"direction": "down"}, False),
     ({"direction": "down", "more": "smaller"}, True),
     ({"level": "value", "low": 3e-4, "high": 1e-3}, True)],
)  # fmt: skip
def test_what_is_right_follows_from_the_direction(settings, comparison):
    starts = {"start": [3e-4 if settings.get("low") == 3e-4 else 5e-5]} if "low" in settings else {}
    made = design(CHOICE, forced_choice=settings, staircase=starts)
    assert made.forced_choice.comparison_is_target == comparison
    trial = procedure(made, "P1", 1).next()
    larger = 1 if trial.stimuli[0].value > trial.stimuli[1].value else 2
    assert (trial.right == larger) == (settings.get("more", "larger") == "larger")


def test_only_answers_are_taken_for_answers(tmp_path):
    given = iter(["", "-1", "many", "nan", "0", "inf", "2,5"] + ["7"] * 50)
    person = Person(lambda trial: next(given))
    run(design(MAGNITUDE), tmp_path / "s", person)
    assert person.refused == ["please give a number above 0"] * 6
    first = rows(tmp_path / "s")[0]
    assert first["answer"] == "2.5"
    assert first["response_seconds"] == "3.5"


def test_rankings(tmp_path):
    made = design(
        PAIRS, method="ranking", pairs=None, ranking={"repeats": 2}, simulated={"noise": 0.0}
    )
    run(made, tmp_path / "s")
    for answered in read_results(tmp_path / "s")[0].answers:
        values = [answered.trial.stimuli[i - 1].value for i in answered.answer]
        assert values == sorted(values, reverse=True)
    given = iter(["1 2 3", "1 2 3 5", "1 2 3 3", "a b c d", *["4,3,2,1"] * 9])
    person = Person(lambda trial: next(given))
    run(made, tmp_path / "t", person)
    assert person.refused == ["please give the numbers 1 to 4, each once, in order"] * 4


@pytest.mark.parametrize("base", [CHOICE, MAGNITUDE, PAIRS], ids=["choice", "magnitude", "pairs"])
def test_a_session_that_is_paused_again_and_again_is_the_same(base, tmp_path):
    made = design(base)
    run(made, tmp_path / "whole")

    class Restless(SimulatedInterface):
        left = 7

        def ready(self, trial, progress):
            self.left -= 1
            if self.left == 0:
                raise Paused

    for _ in range(40):
        if run(made, tmp_path / "parts", Restless(made, "P1", 1)).complete:
            break
    assert answers_of(tmp_path / "parts") == answers_of(tmp_path / "whole")
    begun = [event["event"] for event in read_journal(tmp_path / "parts")]
    assert begun.count("run") == begun.count("pause") + 1 >= 3


def test_quest_plus_goes_on_where_it_was(tmp_path):
    made = design(CHOICE, forced_choice={"adaptive": "quest+"}, staircase=None,
                  quest={"trials": 20})  # fmt: skip
    run(made, tmp_path / "whole")

    class Once(SimulatedInterface):
        def ready(self, trial, progress):
            if trial.number == 11 and not progress.resumed:
                raise Paused

    assert not run(made, tmp_path / "parts", Once(made, "P1", 1)).complete
    assert run(made, tmp_path / "parts", Once(made, "P1", 1)).complete
    assert answers_of(tmp_path / "parts") == answers_of(tmp_path / "whole")


def test_tables_are_made_now_and_then_and_at_the_end(tmp_path, monkeypatch):
    made, counts = design(CHOICE), []
    real = session_module.write_tables
    monkeypatch.setattr(
        session_module, "write_tables",
        lambda events, folder: (counts.append(len(events)), real(events, folder)),
    )  # fmt: skip
    run(made, tmp_path / "s")
    # At its beginning and its end, however many answers there are.
    assert len(counts) == 2
    assert len(rows(tmp_path / "s")) == 60

    class Dying(SimulatedInterface):
        def ready(self, trial, progress):
            if trial.number == 20:
                raise Killed

    with pytest.raises(Killed):
        run(made, tmp_path / "t", Dying(made, "P1", 1))
    # What SIGKILL leaves: tables of the beginning, which count for nothing.
    (tmp_path / "t" / "answers.csv").write_text("")
    assert len(read_results(tmp_path / "t")[0].answers) == 19
    monkeypatch.setattr(session_module, "_TABLES_EVERY", -1.0)
    run(made, tmp_path / "t")
    assert len(counts) > 40
    assert answers_of(tmp_path / "t") == answers_of(tmp_path / "s")


class Killed(BaseException):
    """As SIGKILL: nothing is done about it."""


class Deadly:
    """The module os, which dies at the n-th write or fsync: before, amid, or after it."""

    def __init__(self, at, how):
        self.left, self.how = at, how

    def write(self, file, data):
        self.left -= 1
        if self.left == 0:
            if self.how == "amid":
                os.write(file, data[: len(data) // 2])
            elif self.how == "after":
                os.write(file, data)
            raise Killed
        return os.write(file, data)

    def fsync(self, file):
        self.left -= 1
        if self.left == 0:
            raise Killed
        os.fsync(file)

    def __getattr__(self, name):
        return getattr(os, name)


def finished_after(made, folder, monkeypatch, at, how):
    """Run a session that dies once and is taken up; return all answers that were taken, first."""
    counter = iter(range(1, 10**6))
    taken = []

    def go(fatal):
        person = Person(lambda trial: float(next(counter)))  # another one each time it is asked
        monkeypatch.setattr(journal_module, "os", fatal)
        try:
            return run(made, folder, person).complete
        except Killed:
            return False
        finally:
            monkeypatch.setattr(journal_module, "os", os)
            taken.extend(person.taken)

    died = not go(Deadly(at, how))
    assert not died or go(os)
    return died, taken


@pytest.mark.parametrize("how", ["before", "amid", "after"])
def test_killed_between_any_two_writes_it_loses_no_answer(how, tmp_path, monkeypatch):
    made = design(document(MAGNITUDE, magnitude={"blocks": 1, "practice": 0}))
    deaths = 0
    for at in range(1, 200):
        folder = tmp_path / str(at)
        died, taken = finished_after(made, folder, monkeypatch, at, how)
        kept = {row["trial"]: row["answer"] for row in answers_table(read_journal(folder))}
        assert len(kept) == 5
        # Whatever the participant saw to have been taken is there, as it was given.
        assert all(kept[number] == answer for number, answer in taken)
        assert len(rows(folder)) == 5
        if not died:
            break
        deaths += 1
    assert deaths > 20  # every write and fsync of the session was died at


def _endless(made, folder, told):
    """Run a session whose participant says what was taken: a process to be killed."""
    ExperimentDesign.check_scenes = lambda self: {}
    count = random.SystemRandom()

    class Telling(Person):
        def _take(self):
            if self._pending:
                told.send(self._pending)
            super()._take()

    run(made, folder, Telling(lambda trial: round(count.uniform(1, 100), 6)))
    told.send("over")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_killed_by_the_system_at_random_moments(tmp_path):
    made = design(document(MAGNITUDE, magnitude={"blocks": 12, "practice": 0}))
    fork, rng = multiprocessing.get_context("fork"), random.Random(1)
    taken, kills, over = [], 0, False
    for _ in range(60):
        mine, theirs = fork.Pipe(duplex=False)
        process = fork.Process(target=_endless, args=(made, tmp_path / "s", theirs))
        process.start()
        theirs.close()
        if kills < 25:
            time.sleep(rng.uniform(0.0, 0.06))
            os.kill(process.pid, signal.SIGKILL)
            kills += 1
        process.join()
        try:
            while True:
                said = mine.recv()
                over = over or said == "over"
                taken += [said] if said != "over" else []
        except EOFError:
            pass
        if over:
            break
    assert over
    kept = {row["trial"]: row["answer"] for row in answers_table(read_journal(tmp_path / "s"))}
    assert sorted(kept) == list(range(1, 61))
    assert taken
    assert all(kept[number] == answer for number, answer in taken)


def test_another_session_is_not_taken_up(tmp_path):
    run(design(MAGNITUDE), tmp_path / "s")
    for made, participant, number, told in (
        (design(MAGNITUDE, seed=9), "P1", 1, "the experiment's file"),
        (design(MAGNITUDE), "P2", 1, "the participant"),
        (design(MAGNITUDE), "P1", 2, "the number of the session"),
    ):
        with pytest.raises(AsperityError, match=told):
            run(made, tmp_path / "s", participant=participant, number=number)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("mine")
    with pytest.raises(OutputError, match="is not empty and holds no session"):
        run(design(MAGNITUDE), tmp_path / "other")


@pytest.mark.parametrize("code", ["", "Ada Lovelace", "ada@example.org", "-x", "a/b", "x" * 33])
def test_a_participant_is_a_code(code, tmp_path):
    with pytest.raises(AsperityError, match="must be a code"):
        run(design(MAGNITUDE), tmp_path / "s", participant=code)
    assert not (tmp_path / "s").exists()


def test_everything_is_the_owners(tmp_path):
    run(design(MAGNITUDE), tmp_path / "s")
    for path in [tmp_path / "s", *(tmp_path / "s").rglob("*")]:
        assert stat.S_IMODE(path.stat().st_mode) & 0o077 == 0, path


def test_a_complete_session_stays_as_it_is(tmp_path):
    run(design(MAGNITUDE), tmp_path / "s")
    before = answers_of(tmp_path / "s")
    assert run(design(MAGNITUDE), tmp_path / "s").complete
    assert answers_of(tmp_path / "s") == before


SIGNED = {
    "forced_choice": {"low": -0.6, "high": 0.6, "scale": "linear", "adaptive": "constant"},
    "staircase": None,
    "constant": {"levels": [-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6], "repeats": 40},
    "simulated": {"threshold": 0.1, "width": 0.5, "function": "normal"},
}


@pytest.mark.parametrize("more", ["larger", "smaller"])
def test_on_both_sides_of_the_standard_the_stimuli_say_what_is_right(more, tmp_path):
    made = design(CHOICE, **document(SIGNED, forced_choice={"more": more}))
    run(made, tmp_path / "s")
    result = read_results(tmp_path / "s")[0]
    assert {answered.trial.level for answered in result.answers} == set(made.adaptive.levels)
    for answered in result.answers:
        first, second = (stimulus.value for stimulus in answered.trial.stimuli)
        larger = None if first == second else 1 if first > second else 2
        right = larger if larger is None or more == "larger" else 3 - larger
        assert answered.trial.right == right
        assert answered.right == (None if right is None else answered.answer == right)
    # The simulated participant takes the larger one at 0.1 half of the times.
    found = analyse_threshold(result, AnalysisOptions("normal", samples=20)).summary
    psychometric = found["psychometric"]
    assert psychometric["threshold_low"] < 0.1 < psychometric["threshold_high"]
    assert abs(psychometric["threshold"] - 0.1) < 0.1


def test_a_person_and_a_machine_never_answer_in_one_session(tmp_path):
    made = design(CHOICE)

    def tired(trial):
        if trial.number == 5:
            raise Paused
        return trial.right

    run(made, tmp_path / "P1", Person(tired))
    before = (tmp_path / "P1" / "journal.jsonl").read_bytes()
    with pytest.raises(AsperityError, match=r"session of a person, in which a machine"):
        run(made, tmp_path / "P1", SimulatedInterface(made, "P1", 1))
    assert (tmp_path / "P1" / "journal.jsonl").read_bytes() == before

    class Tired(SimulatedInterface):
        def ready(self, trial, progress):
            if trial.number == 5:
                raise Paused

    run(made, tmp_path / "TEST", Tired(made, "P1", 1))
    with pytest.raises(AsperityError, match=r"session of a machine, in which a person"):
        run(made, tmp_path / "TEST", Person(lambda trial: trial.right))
    # The machine's is left out beside the person's, and said to be one by itself.
    assert [r.simulated for r in read_results(tmp_path)] == [False]
    assert read_results(tmp_path / "TEST")[0].simulated
    runs = [e for e in read_journal(tmp_path / "P1") if e["event"] == "run"]
    assert len(runs) == 1
    assert runs[0]["by"] == "test"
    assert runs[0]["machine"]


def test_a_finished_session_is_not_written_to_again(tmp_path):
    made = design(CHOICE)
    run(made, tmp_path / "s")
    before = (tmp_path / "s" / "journal.jsonl").read_bytes()
    assert run(made, tmp_path / "s").complete
    assert (tmp_path / "s" / "journal.jsonl").read_bytes() == before


def test_an_experiment_without_a_name_is_called_as_its_file(tmp_path):
    write_whole(tmp_path / "height.toml", write_toml(document(CHOICE, name=None)))
    assert read_design(tmp_path / "height.toml").name == "height"
