"""Large tables of numbers: as exact as NumPy reads them, and left alone where anything is odd."""

import numpy as np
import pytest

from asperity._core import large_tables
from asperity._core.large_tables import LARGE, numbers_of
from asperity.baking.points import read_points
from asperity.errors import AsperityError
from asperity.scene.trajectory_file import read_poses
from asperity.texture.files.reading import read_heights

RNG = np.random.default_rng(0)
VALUES = RNG.normal(size=(9000, 4)) * 10.0 ** RNG.integers(-300, 300, (9000, 4))


def table(values, separator=","):
    return "".join(separator.join(map(repr, row)) + "\n" for row in values.tolist())


@pytest.mark.parametrize(
    ("between", "separator"), [(",", ","), ("; ", ";"), ("\t", None), ("  ", None)]
)
def test_numbers_are_exact(between, separator):
    text = table(VALUES, between)
    assert len(text) > LARGE
    assert (numbers_of(text, separator) == VALUES).all()
    assert (numbers_of("\n" + text.replace("\n", "  # seen\r\n\n", 3), separator) == VALUES).all()
    assert (numbers_of(text, separator, (3, 1)) == VALUES[:, (3, 1)]).all()


@pytest.mark.parametrize(
    "row",
    [
        "1,2,3",
        "1,2,3,4,5",
        "1,2,,4",
        "1,nan,3,4",
        "1,2,3,Bad",
        "1,2,True,4",
        "1,2,3 4,5",
        '"1",2,3,4',
    ],
)
def test_what_is_no_plain_table_is_left_alone(row):
    text = table(VALUES)
    assert numbers_of(text + row + "\n" + text, ",") is None
    assert numbers_of("1,2\n3,4\n", ",") is None
    assert numbers_of(text, ",", (0, 4)) is None


def test_large_files_are_read_and_refused_like_small_ones(tmp_path, monkeypatch):
    times = np.arange(3000) * 1e-3
    poses = np.column_stack(
        [times, RNG.normal(size=(3000, 3)) * 1e-3, np.tile([1, 0, 0, 0], (3000, 1))]
    )
    heights = 1e-6 * RNG.normal(size=(200, 200))
    files = {
        "a.csv": (read_poses, "time,x,y,z,qw,qx,qy,qz\n", poses, {}),
        "a.txt": (read_heights, "height [m]\n", heights, {"pixel_size": 1e-5}),
        "a.xyz": (read_points, "", RNG.normal(size=(9000, 3)), {}),
    }
    for name, (read, head, values, options) in files.items():
        path = tmp_path / name
        text = head + table(values)
        got = []
        for large in (10, 10**9):
            monkeypatch.setattr(large_tables, "LARGE", large)
            path.write_text(text)
            found = read(path, **options)
            got.append([found.poses if name == "a.csv" else found[0], found.notes])
            path.write_text(text.replace(repr(float(values[1000 % len(values), 2])), "wrong"))
            with pytest.raises(AsperityError) as refused:
                read(path, **options)
            got[-1].append(str(refused.value))
        assert (got[0][0] == got[1][0]).all()
        assert got[0][1:] == got[1][1:]
