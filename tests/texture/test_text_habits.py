"""Text of heights with commas, gaps and numbers as spreadsheets write them: right, or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.baking.points import read_points
from asperity.errors import AsperityError, SurfaceError
from asperity.texture.files.reading import read_heights

PIXEL = 1e-5
V, U = np.mgrid[0:20, 0:30]
HEIGHTS = 20.0 + 15.0 * np.sin(U / 3.0) + 4.5 * np.cos(V / 4.0 + U / 9.0)
"""Micrometres."""
SCALED = {"pixel_size": PIXEL, "unit": "um"}


def rows(values: np.ndarray, separator: str = ",", form: str = "{:.4f}") -> str:
    return "".join(separator.join(map(form.format, row)) + "\n" for row in values)


def read(path: Path, text: str, encoding: str = "utf-8", **options):
    path.write_bytes(text.encode(encoding))
    return read_heights(path, **{**SCALED, **options})


def same(found, atol: float = 1e-10) -> None:
    np.testing.assert_allclose(found.samples, 1e-6 * HEIGHTS, atol=atol)


def test_empty_cells_at_the_end_of_the_first_rows(tmp_path: Path) -> None:
    cut = rows(HEIGHTS).splitlines()
    cut[:3] = [row.rpartition(",")[0] + "," for row in cut[:3]]
    found = read(tmp_path / "a.csv", "\n".join(cut), missing="fill")
    assert found.samples.shape == HEIGHTS.shape
    np.testing.assert_allclose(found.samples[:, :-1], 1e-6 * HEIGHTS[:, :-1], atol=1e-10)
    assert any("3 of 600 values are missing" in note for note in found.notes)
    same(read(tmp_path / "b.csv", rows(HEIGHTS).replace("\n", ",\n")))


def test_commas_between_numbers_with_decimal_commas_are_refused(tmp_path: Path) -> None:
    text = rows(HEIGHTS + 0.001 * U, ";").replace(".", ",").replace(";", ",")
    assert ",0" in text
    with pytest.raises(SurfaceError, match="commas are decimal marks in it and stand between"):
        read(tmp_path / "a.csv", text)
    points = rows(np.column_stack([U.ravel(), V.ravel(), HEIGHTS.ravel()]), ";")
    (tmp_path / "a.xyz").write_text(points.replace(".", ",").replace(";", ","))
    with pytest.raises(AsperityError, match="commas are decimal marks in it and stand between"):
        read_points(tmp_path / "a.xyz")
    padded = rows(np.round(HEIGHTS), form="{:03.0f}")
    np.testing.assert_allclose(
        read(tmp_path / "b.csv", padded).samples, 1e-6 * np.round(HEIGHTS), atol=1e-12
    )


@pytest.mark.parametrize("mark", ["'", "’", "\u00a0", "\u202f", " "])
def test_thousands_set_apart(tmp_path: Path, mark: str) -> None:
    text = rows(1e3 * HEIGHTS, ";", "{:,.1f}").replace(",", mark)
    same(read(tmp_path / "a.csv", text, unit="nm"), atol=1e-10)
    same(read(tmp_path / "b.csv", text.replace(".", ","), unit="nm"), atol=1e-10)


@pytest.mark.parametrize("word", ["#NV", "#N/D", "#BEZUG!", "#¡VALOR!", "n.a.", "<NA>", "lost"])
def test_words_for_missing_values_of_other_languages(tmp_path: Path, word: str) -> None:
    text = rows(HEIGHTS, ";").replace(f"{HEIGHTS[4, 5]:.4f}", word, 1)
    with pytest.raises(SurfaceError, match="1 of 600 values are missing"):
        read(tmp_path / "a.csv", text)


def test_numbers_of_columns_as_pandas_writes_them(tmp_path: Path) -> None:
    found = read(tmp_path / "a.csv", ",".join(map(str, range(30))) + "\n" + rows(HEIGHTS))
    same(found)
    assert "its first row numbers its samples and is left out" in found.notes
    numbered = [f"{k},{row}" for k, row in enumerate(rows(HEIGHTS).splitlines())]
    same(read(tmp_path / "b.csv", "\n".join(numbered)))
    whole = read(tmp_path / "c.csv", rows(np.vstack([np.arange(30), np.round(HEIGHTS)])))
    assert whole.samples.shape == (21, 30)  # it may be a row of heights


@pytest.mark.parametrize(
    "head",
    ["Scan Size: 300 um\n", "X Amplitude: 300 um\nY Amplitude: 200 um\nZ Amplitude: 40 um\n"],
)
def test_sizes_of_scans(tmp_path: Path, head: str) -> None:
    found = read(tmp_path / "a.txt", head + rows(HEIGHTS, "\t"), pixel_size=None)
    assert found.pixel_size == pytest.approx(PIXEL)


def test_a_unit_in_a_cyrillic_code_page(tmp_path: Path) -> None:
    found = read(tmp_path / "a.csv", "Высота [мкм]\n" + rows(HEIGHTS), "cp1251", unit=None)
    same(found)
