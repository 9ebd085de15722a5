"""A disk that is full in a session: one line, no answer lost, and the same command goes on."""

import csv
import subprocess
import sys

import pytest
from fakes import CHOICE, document

from asperity.cli import main
from asperity.psychophysics.session.journal import read_journal
from asperity.scene.document import write_toml

_CHILD = """
import resource, sys
sys.dont_write_bytecode = True
from asperity.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
sys.exit(main(sys.argv[2:]))
"""
MADE = document(
    CHOICE, staircase=None, forced_choice={"adaptive": "constant"},
    constant={"levels": [0.1, 0.4, 0.8], "repeats": 80},
)  # fmt: skip


def answers(folder):
    with open(folder / "answers.csv", encoding="utf-8") as file:
        return [{k: v for k, v in row.items() if k not in ("answered_at", "attempt")}
                for row in csv.DictReader(file)]  # fmt: skip


# Of a recording, and of the journal, which is the longest file in the end.
@pytest.mark.parametrize(
    "room", [0, 2000, pytest.param(100_000, marks=pytest.mark.slow),
             pytest.param(280_000, marks=pytest.mark.slow)],
)  # fmt: skip
def test_it_is_one_line_and_goes_on(room, tmp_path):
    (tmp_path / "e.toml").write_text(write_toml(MADE))
    command = ["experiment", str(tmp_path / "e.toml"), "--simulate", "--participant", "T", "--out"]
    out = tmp_path / "T-1"
    done = subprocess.run(
        [sys.executable, "-c", _CHILD, str(room), *command, str(out)], capture_output=True,
        text=True,
    )  # fmt: skip
    lines = [line for line in done.stderr.splitlines() if "%" not in line]
    assert done.returncode == 2, done.stderr
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith(f"asperity: error: cannot write to {out}")
    if room < 100_000:
        return
    given = sum(event["event"] == "answer" for event in read_journal(out))
    assert f"all {given} answers are kept, and the same command resumes" in lines[0]
    assert (given > 100) == (room == 280_000)
    assert main([*command, str(out)]) == 0
    assert main([*command, str(tmp_path / "whole")]) == 0
    assert answers(out) == answers(tmp_path / "whole")
