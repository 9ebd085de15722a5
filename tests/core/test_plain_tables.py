"""Large texts whose head and tail are plain: read as if nothing of them were taken for granted."""

import warnings
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from asperity._core import text_table
from asperity._core.text_table import read_text_table
from asperity.baking import points
from asperity.errors import AsperityError
from asperity.scene.trajectory_file import read_poses
from asperity.texture.files.reading import read_heights

COUNT = 9_000
POSES = "time,x [mm],y [mm],z [mm],qw,qx,qy,qz\n"


def heights(separator: str, header: str = "") -> str:
    values = np.random.default_rng(1).normal(size=(COUNT // 18, 90)).round(5)
    return header + "\n".join(separator.join(map(str, row)) for row in values) + "\n"


def poses() -> str:
    places = np.random.default_rng(2).normal(size=(COUNT, 3)).cumsum(axis=0).round(4)
    rows = (f"{k / 1000},{x},{y},{z},1,0,0,0" for k, (x, y, z) in enumerate(1e-3 * places))
    return POSES + "\n".join(rows) + "\n"


def cloud(header: str = "") -> str:
    places = np.random.default_rng(3).uniform(-20.0, 20.0, (2 * COUNT, 3)).round(6)
    return header + "\n".join(" ".join(map(str, row)) for row in places) + "\n"


KINDS = {
    "heights.csv": (heights(","), lambda path: read_heights(path, pixel_size=1e-5, missing="fill")),
    "heights.txt": (
        heights("\t", "Height [µm]\n"), lambda path: read_heights(path, pixel_size=1e-5),
    ),
    "poses.csv": (poses(), lambda path: vars(read_poses(path))),
    "points.xyz": (cloud("// x y z [mm]\n"), points.read_points),
    "points.csv": (cloud("z y x\n"), points.read_points),
}  # fmt: skip
ODD = b'0123456789.,;+-eEdn# \t\r\n"/\0\x1a\xb5\xa0'
"""Bytes, of which some are in few tables."""
CELLS = (
    *("nan", "bad", "---", "no data", "", "inf", "+nan", "True", "1_0", "0x1p3", "1d5", "−1.5"),
    *("1e-400", "4.9e-324", "1e400", "0.12345678901234567890123", "98765432109876543210"),
    *("1,5", '"1.5"', '"1,5"', "1,234.5", "1 5", "1;5", "1 # seen", "1.5\xa0", "1.5\x1c", "1\x002"),
)
LINES = (
    *("", "  ", "# seen", "End of data", "1", "1;2;3;4;5;6;7;8", "x,y,z", "Channel: Height"),
    *("1.5\r2.5", "\x0c", "1 2 3\r4 5 6\n", "nan nan nan", "\n\n[um]\n\n"),
)


def outcome(read, path):
    """Return all that a file is read as, or what is said of it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read(path)
    except AsperityError as error:
        return str(error)


def assert_same(first, second):
    assert type(first) is type(second)
    if isinstance(first, str):
        assert first == second
        return
    pairs = first.items() if isinstance(first, dict) else enumerate(first)
    for key, value in pairs:
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, second[key])
            assert value.flags.c_contiguous == second[key].flags.c_contiguous
        elif key == "origins":
            assert [*value] == [*second[key]]
        else:
            assert value == second[key]


def assert_read_alike(kind, content, folder, monkeypatch):
    """Assert that a file is read as it is without the way for plain ones."""
    path, read = folder / kind, KINDS[kind][1]
    path.write_bytes(content)
    found = outcome(read, path)
    with monkeypatch.context() as patch:
        patch.setattr(text_table, "_plain_table", lambda *_: None)
        patch.setattr(points, "_plain_points", lambda *_: ([], None, None))
        assert_same(found, outcome(read, path))


def changed(text: str, way: str) -> str:
    """Return a text with its middle line changed."""
    at = text.index("\n", len(text) // 2) + 1
    line, newline, rest = text[at:].partition("\n")
    kind, _, by = way.partition(":")
    if kind == "cell":
        cells = next((line.split(mark), mark) for mark in ",\t " if mark in line)
        line = cells[1].join([*cells[0][:1], by, *cells[0][2:]])
    elif kind == "line":
        line = f"{by}\n{line}"
    elif kind == "last":
        return text + by
    return text[:at] + line + newline + rest


@pytest.mark.parametrize("kind", KINDS)
def test_the_plain_ones_are_parsed_by_numpy_alone(kind, tmp_path, monkeypatch):
    for module in (text_table, points):
        monkeypatch.setattr(module, "content_of", lambda *_: pytest.fail("read as a whole"))
    (tmp_path / kind).write_text(KINDS[kind][0], encoding="utf-8")
    KINDS[kind][1](tmp_path / kind)


@pytest.mark.parametrize("kind", KINDS)
def test_what_stands_in_the_middle_or_at_the_end_is_read_as_ever(kind, tmp_path, monkeypatch):
    text = KINDS[kind][0]
    ways = [
        "", *(f"cell:{cell}" for cell in CELLS), *(f"line:{line}" for line in LINES),
        *(f"last:{line}" for line in ("\n \n\n", "End of data", "+nan", "\x1a", "1", "nan nan")),
    ]  # fmt: skip
    for way in ways:
        assert_read_alike(kind, changed(text, way).encode(), tmp_path, monkeypatch)
    line = text.index("\n", len(text) // 2)
    for content in (
        text.replace("\n", "\r\n"),
        text[:line] + "\r" + text[line:],
        text.replace("\n", "\r\n")[:-line] + text[-line:],
        text.replace("\n", "\r"),
        text[:-1],
    ):
        assert_read_alike(kind, content.encode(), tmp_path, monkeypatch)
    for encoding in ("utf-8-sig", "cp1252", "utf-16"):
        assert_read_alike(kind, text.encode(encoding), tmp_path, monkeypatch)


@pytest.mark.parametrize(("kind", "seed"), [*product(KINDS, range(8))])
def test_any_bytes_anywhere_are_read_as_ever(kind, seed, tmp_path, monkeypatch):
    rng = np.random.default_rng(seed)
    content = bytearray(KINDS[kind][0].encode())
    for at in rng.integers(0, len(content), rng.integers(1, 4)):
        some = rng.choice([*ODD], rng.integers(0, 4)).tolist()
        content[at : at + rng.integers(0, 3)] = bytes(some)
    assert_read_alike(kind, bytes(content), tmp_path, monkeypatch)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_plain_tables_are_parsed_from_their_file(end, encoding, tmp_path, monkeypatch):
    path = tmp_path / "map.txt"
    path.write_bytes(heights("\t", "Height [µm]\n").replace("\n", end).encode(encoding))
    table = read_text_table(path)
    assert table.numbers is not None
    assert [*table.rows_at()] == [*range(2, 502)]
    monkeypatch.setattr(text_table, "_plain_table", lambda *_: None)
    whole = read_text_table(path)
    np.testing.assert_array_equal(table.values([3, 1]), whole.values([3, 1]))
    np.testing.assert_array_equal(table.values(), whole.values())
    assert table.complete() == whole == replace(table, body=whole.body)


def test_long_times_keep_their_digits_in_large_files(tmp_path):
    path = tmp_path / "log.csv"
    rows = (f"{1700000000 + k // 1000}.{k % 1000:03d}000001,0,0,0,1,0,0,0" for k in range(COUNT))
    path.write_text(POSES + "\n".join(rows))
    assert read_text_table(path).numbers is not None
    np.testing.assert_array_equal(read_poses(path).times, np.arange(COUNT) / 1000)
