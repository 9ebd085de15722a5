"""The journal: what it is told is there, wherever it is cut."""

import os
import stat

import pytest

from asperity.errors import AsperityError, OutputError
from asperity.psychophysics.session import journal as module
from asperity.psychophysics.session.journal import FILE, TORN, Journal, read_journal

EVENTS = [
    {"event": "begin", "participant": "P1", "text": "line\nfeed, ä, #0badf00d"},
    {"event": "answer", "number": 1, "answer": 12.5},
    {"event": "answer", "number": 2, "answer": [3, 1, 2]},
    {"event": "end"},
]


def written(folder):
    with Journal(folder) as journal:
        for event in EVENTS:
            journal.append(**event)
    return (folder / FILE).read_bytes()


def test_what_is_written_is_read(tmp_path):
    written(tmp_path / "s")
    assert read_journal(tmp_path / "s") == EVENTS
    with Journal(tmp_path / "s") as journal:
        assert journal.events == EVENTS
        journal.append("more")
    assert read_journal(tmp_path / "s") == [*EVENTS, {"event": "more"}]


def test_only_the_owner_can_look(tmp_path):
    written(tmp_path / "s")
    assert stat.S_IMODE(os.stat(tmp_path / "s").st_mode) == 0o700
    assert stat.S_IMODE(os.stat(tmp_path / "s" / FILE).st_mode) == 0o600


def test_cut_anywhere_it_keeps_every_whole_event_and_goes_on(tmp_path):
    data = written(tmp_path / "whole")
    ends = [i + 1 for i, byte in enumerate(data) if byte == 10]
    for cut in range(len(data) + 1):
        folder = tmp_path / f"cut{cut}"
        folder.mkdir()
        (folder / FILE).write_bytes(data[:cut])
        # All but the line feed is enough.
        whole = sum(end <= cut + 1 for end in ends)
        assert read_journal(folder) == EVENTS[:whole]
        with Journal(folder) as journal:
            assert journal.events == EVENTS[:whole]
            journal.append("after", cut=cut)
        assert read_journal(folder) == [*EVENTS[:whole], {"event": "after", "cut": cut}]
        # Nothing was thrown away.
        torn = data[([0, *ends])[whole] : cut] if cut not in ends and cut + 1 not in ends else b""
        aside = (folder / TORN).read_bytes() if (folder / TORN).exists() else b""
        assert aside == (torn + b"\n" if torn else b"")


@pytest.mark.parametrize("tail", [b"\0" * 40, b"\0" * 40 + b"\n", b'{"event": "x"} #00000000\n'])
def test_a_last_line_that_a_crash_left_in_any_state(tail, tmp_path):
    data = written(tmp_path)
    (tmp_path / FILE).write_bytes(data + tail)
    with Journal(tmp_path) as journal:
        assert journal.events == EVENTS
    assert (tmp_path / FILE).read_bytes() == data


def test_damage_in_the_middle_is_refused_and_nothing_is_touched(tmp_path):
    data = written(tmp_path)
    broken = data.replace(b"12.5", b"99.5")
    (tmp_path / FILE).write_bytes(broken)
    with pytest.raises(AsperityError, match="line 2 is damaged; nothing was changed"):
        Journal(tmp_path)
    assert (tmp_path / FILE).read_bytes() == broken


def test_one_process_at_a_time(tmp_path):
    pytest.importorskip("fcntl")
    with Journal(tmp_path), pytest.raises(OutputError, match="in use by another process"):
        Journal(tmp_path)


class Disk:
    """The module os, with a disk that runs full."""

    def __init__(self, room):
        self.room = room

    def write(self, file, data):
        kept = data[: self.room]
        self.room -= len(kept)
        if not kept:
            raise OSError(28, "No space left on device")
        return os.write(file, kept)

    def __getattr__(self, name):
        return getattr(os, name)


def test_a_full_disk_leaves_no_half_line(tmp_path, monkeypatch):
    data = written(tmp_path)
    monkeypatch.setattr(module, "os", Disk(10))
    with Journal(tmp_path) as journal:
        with pytest.raises(OutputError, match="No space left"):
            journal.append("answer", number=3, answer=1.0)
        with pytest.raises(OutputError, match="No space left"):
            journal.append("answer", number=3, answer=1.0)
    assert (tmp_path / FILE).read_bytes() == data
