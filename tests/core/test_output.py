"""Results are whole or absent."""

import pytest

from asperity._core.output import result_folder, write_whole
from asperity.errors import OutputError


def entries(folder):
    return sorted(path.name for path in folder.iterdir())


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
        pytest.raises(OutputError, match="not empty; give --overwrite"),
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
