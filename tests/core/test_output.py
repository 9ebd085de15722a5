"""Results are whole or absent."""

import pytest

from asperity._core.output import growing_folder, result_folder, write_page, write_whole
from asperity.errors import OutputError


def entries(folder):
    return sorted(path.name for path in folder.glob("[!.]*"))


def write(folder, overwrite=False, **files):
    with result_folder(folder, overwrite=overwrite) as fresh:
        for name, text in files.items():
            (fresh / name).write_text(text)


def test_results_are_replaced_by_those_of_the_same_command_again(tmp_path):
    write(tmp_path / "out", a="1", b="1")
    write(tmp_path / "out", a="2", c="2")
    assert entries(tmp_path / "out") == ["a", "c"]
    assert (tmp_path / "out" / "a").read_text() == "2"
    write(tmp_path / "out", a="3")
    assert entries(tmp_path / "out") == ["a"]
    assert entries(tmp_path) == ["out"]


@pytest.mark.parametrize("name", ["a", "mine"])
def test_what_somebody_changed_or_added_is_not_replaced(tmp_path, name):
    write(tmp_path / "out", a="1")
    (tmp_path / "out" / name).write_text("mine")
    words = "was changed since" if name == "a" else "was not written by asperity"
    with pytest.raises(OutputError, match=f"not empty, and {name} in it {words}"):
        write(tmp_path / "out", a="2", c="2")
    assert (tmp_path / "out" / name).read_text() == "mine"
    assert "c" not in entries(tmp_path / "out")


def test_a_changed_file_outlives_overwriting_others(tmp_path):
    write(tmp_path / "out", a="1", b="1")
    (tmp_path / "out" / "b").write_text("mine, and longer")
    write(tmp_path / "out", overwrite=True, c="2")
    assert entries(tmp_path / "out") == ["b", "c"]
    assert (tmp_path / "out" / "b").read_text() == "mine, and longer"


def test_folders_in_results_are_replaced_too(tmp_path):
    for text in ("1", "2"):
        with result_folder(tmp_path / "out") as fresh:
            (fresh / f"in{text}").mkdir()
            (fresh / f"in{text}" / "x").write_text(text)
    assert entries(tmp_path / "out") == ["in2"]


def test_recordings_are_never_replaced_unasked(tmp_path):
    names = []
    for _ in range(3):
        folder = growing_folder(tmp_path / "out")
        (folder / "recording.h5").write_text("felt")
        names.append(folder.name)
    assert names == ["out", "out-2", "out-3"]
    assert growing_folder(tmp_path / "out", overwrite=True).name == "out"


def test_a_page_is_replaced_if_it_is_asperitys(tmp_path):
    page = tmp_path / "report.html"
    write_page(page, "one")
    write_page(page, "two")
    page.write_text("somebody's")
    with pytest.raises(OutputError, match="exists; give --overwrite"):
        write_page(page, "three")
    write_page(page, "three", overwrite=True)
    assert page.read_text() == "three"


def test_a_good_block_leaves_its_files_and_nothing_else(tmp_path):
    with result_folder(tmp_path / "a" / "b") as folder:
        (folder / "x").write_text("1")
    assert entries(tmp_path / "a") == ["b"]
    assert entries(tmp_path / "a" / "b") == ["x"]


@pytest.mark.parametrize("stop", [ValueError, KeyboardInterrupt])
def test_a_stopped_block_leaves_what_was_there(tmp_path, stop):
    with result_folder(tmp_path / "out") as folder:
        (folder / "old").write_text("1")

    def stopped():
        with result_folder(tmp_path / "out", overwrite=True) as folder:
            (folder / "new").write_text("2")
            raise stop

    with pytest.raises(stop):
        stopped()
    assert entries(tmp_path) == ["out"]
    assert entries(tmp_path / "out") == ["old"]


def test_nothing_is_overwritten_unasked(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("1")
    with (
        pytest.raises(OutputError, match="mine in it was not written by asperity; give --"),
        result_folder(tmp_path / "out"),
    ):
        pass
    with result_folder(tmp_path / "out", overwrite=True) as folder:
        (folder / "new").write_text("2")
    # Somebody's own file of another name is never lost.
    assert entries(tmp_path / "out") == ["mine", "new"]
    assert entries(tmp_path) == ["out"]


def test_a_file_in_the_way_is_named(tmp_path):
    (tmp_path / "out").write_text("1")
    with pytest.raises(OutputError, match="is a file"), result_folder(tmp_path / "out"):
        pass
    with pytest.raises(OutputError, match="cannot write"), result_folder(tmp_path / "out" / "x"):
        pass


def test_a_device_is_never_replaced(tmp_path):
    import os

    os.mkfifo(tmp_path / "pipe")
    with (
        pytest.raises(OutputError, match="is a file"),
        result_folder(tmp_path / "pipe", overwrite=True),
    ):
        pass
    assert not (tmp_path / "pipe").is_dir()


def test_a_page_is_replaced_in_one_go(tmp_path):
    write_whole(tmp_path / "page.html", "one")
    write_whole(tmp_path / "page.html", "two")
    assert (tmp_path / "page.html").read_text() == "two"
    assert entries(tmp_path) == ["page.html"]
    with pytest.raises(OutputError):
        write_whole(tmp_path / "none" / "page.html", "x")
