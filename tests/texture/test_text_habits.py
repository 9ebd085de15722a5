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


@pytest.mark.parametrize(
    "head",
    [
        "Scan size: 300 x 200 µm\n", "Size: 0.3 mm x 200 µm\n", "Scan Size (um): 300 200\n",
        "Pixel size: 10 x 10 µm\n", "Pixel size: 10 µm × 10 µm, in µm\n", "Sampling: 10 µm\n",
        "间距X: 10 μm\n间距Y: 10 μm\n", "ピッチX: 10 μm\nピッチY: 10 μm\n",
        "Odstęp X: 10 µm\nOdstęp Y: 10 µm\n",
        "Ikkuna X: 10 µm\nIkkuna Y: 10 µm\n", "pixel size:,10 um\nSa:,8.1 um\nSz:,40 um\n",
    ],
)  # fmt: skip
def test_sizes_of_maps_and_of_pixels_in_one_line_or_two(tmp_path: Path, head: str) -> None:
    found = read(tmp_path / "a.txt", head + rows(HEIGHTS, "\t"), pixel_size=None)
    assert found.pixel_size == pytest.approx(PIXEL)


@pytest.mark.parametrize("head", ["Sa: 8.1 µm\nSz: 40 µm\n", "foo: 300 µm\nbar: 20 µm\n"])
def test_lengths_that_are_no_sizes_are_not_taken_for_them(tmp_path: Path, head: str) -> None:
    with pytest.raises(SurfaceError, match="choose a value for pixel_size"):
        read(tmp_path / "a.txt", head + rows(HEIGHTS, "\t"), pixel_size=None)


@pytest.mark.parametrize("unit", ["waves", "fringes", "λ", "°C", "-"])
def test_heights_in_what_is_no_length(tmp_path: Path, unit: str) -> None:
    with pytest.raises(SurfaceError, match="choose a value for height_range"):
        read(tmp_path / "a.txt", f"z [{unit}]\n" + rows(HEIGHTS, "\t"), unit=None)


def test_the_third_of_three_columns_is_the_height_whatever_its_name(tmp_path: Path) -> None:
    points = rows(np.column_stack([10.0 * U.ravel(), 10.0 * V.ravel(), HEIGHTS.ravel()]), ";")
    for name in ("Altitude (µm)", "w (µm)"):
        text = f'"X (µm)";"Y (µm)";"{name}"\n' + points
        found = read(tmp_path / "a.csv", text, unit=None, pixel_size=None)
        same(found)
        assert found.pixel_size == pytest.approx(PIXEL)
    found = read(tmp_path / "b.csv", "theta;r;z\n" + points, pixel_size=None)
    assert any(note.startswith("are theta, r, z x, y and heights?") for note in found.notes)
    line = rows(np.column_stack([10.0 * U[0], HEIGHTS[0], 0.1 * HEIGHTS[0]]), ";")
    found = read(tmp_path / "c.csv", "x;y;sigma\n" + line, pixel_size=None)
    np.testing.assert_allclose(found.samples, 1e-6 * HEIGHTS[0], atol=1e-10)


def test_a_point_that_is_there_twice_leaves_the_grid(tmp_path: Path) -> None:
    points = rows(np.column_stack([10.0 * U.ravel(), 10.0 * V.ravel(), HEIGHTS.ravel()]), " ")
    found = read(tmp_path / "a.xyz", points + points.splitlines()[40], pixel_size=None)
    same(found)
    assert "601 points on a grid of 30 x 20, 1 of them twice" in found.notes[0]


def test_places_beside_heights_in_npz(tmp_path: Path) -> None:
    x, y = 0.01 * np.arange(30), 0.02 * np.arange(20)
    np.savez(tmp_path / "a.npz", x_mm=x, y_mm=y[::-1], z_um=np.flipud(HEIGHTS))
    found = read_heights(tmp_path / "a.npz")
    same(found)
    assert found.pixel_size == pytest.approx((PIXEL, 2 * PIXEL))
    np.savez(tmp_path / "b.npz", z_um=HEIGHTS, spacing_um=10.0)
    assert read_heights(tmp_path / "b.npz").pixel_size == pytest.approx(PIXEL)


def test_a_unit_given_is_that_of_the_cells_of_a_grid_too(tmp_path: Path) -> None:
    head = "ncols 30\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 10\n"
    text = head + rows(HEIGHTS[::-1], " ")
    found = read(tmp_path / "a.asc", text, pixel_size=None)
    same(found)
    assert found.pixel_size == pytest.approx(PIXEL)
    assert "places and heights in um, as given" in found.notes
    same(read(tmp_path / "a.asc", text, unit=None))  # in which the cell is the given pixel
    text = text.replace("cellsize 10", "cellsize 1e-5")  # in um it would be less than an atom
    assert read(tmp_path / "b.asc", text, pixel_size=None).pixel_size == pytest.approx(PIXEL)


def test_a_head_that_a_spreadsheet_has_filled_with_empty_cells(tmp_path: Path) -> None:
    head = ["XY calibration,10,um", "Horizontal,30", "Vertical,20", "Unit,um", "", "Height"]
    padded = "".join(line + "," * (29 - line.count(",")) + "\n" for line in head)
    found = read(tmp_path / "a.csv", padded + rows(HEIGHTS[::-1]), unit=None, pixel_size=None)
    same(found)
    assert found.pixel_size == pytest.approx(PIXEL)


def points(form: str) -> str:
    return "".join(
        form.format(x=10 * U[at], y=10 * V[at], z=HEIGHTS[at], i=U[at], j=V[at]) + "\n"
        for at in np.ndindex(HEIGHTS.shape)
    )


@pytest.mark.parametrize(
    ("head", "form"),
    [
        ("# units: micrometers\n# x y z\n", "{x} {y} {z:.4f}"),
        ("XYZ data in um\n", "{x} {y} {z:.4f}"),
        ("Unit: um\nX,Y,Z\n", "{x},{y},{z:.4f}"),
        ("X [mm],Y [um],Z [um]\n", "{x}e-3,{y},{z:.4f}"),
        ("Northing [um],Easting [um],Elevation [um]\n", "{y},{x},{z:.4f}"),
        ("X Nom [um],Y Nom [um],Z Nom [um],X Act [um],Y Act [um],Z Act [um],Dev\n",
         "{x},{y},0,{x},{y},{z:.4f},{z}"),
        ("Pitch: 10 um\nUnit: um\nX,Y,Z\n", "{i},{j},{z:.4f}"),
    ],
)  # fmt: skip
def test_units_and_columns_of_points_as_the_lines_above_state(
    tmp_path: Path, head: str, form: str
) -> None:
    found = read(tmp_path / "a.csv", head + points(form), pixel_size=None, unit=None)
    same(found)
    assert found.pixel_size == pytest.approx(PIXEL)
    assert not any("no unit" in note for note in found.notes)


@pytest.mark.parametrize("names", ["x_idx,y_idx,z_um", "X (pixel),Y (pixel),Z (um)", "i,j,z_um"])
def test_numbers_of_samples_are_no_places(tmp_path: Path, names: str) -> None:
    text = names + "\n" + points("{i},{j},{z:.4f}")
    with pytest.raises(SurfaceError, match="pixel_size"):
        read(tmp_path / "a.csv", text, pixel_size=None, unit=None)
    same(read(tmp_path / "a.csv", text, unit=None))


def test_profiles_over_time_need_a_pixel_size_and_those_along_a_line_none(tmp_path: Path) -> None:
    line = HEIGHTS[0]
    timed = "".join(f"{0.01 * n:.2f},{z:.4f}\n" for n, z in enumerate(line))
    with pytest.raises(SurfaceError, match="pixel_size"):
        read(tmp_path / "a.csv", "Time [s],Height [um]\n" + timed, pixel_size=None, unit=None)
    flat = "".join(f"{1e-2 * n:.2f},0,{1e-3 * z:.7f}\n" for n, z in enumerate(line))
    found = read(tmp_path / "b.csv", "X (mm),Y (mm),Z (mm)\n" + flat, pixel_size=None, unit=None)
    np.testing.assert_allclose(found.samples, 1e-6 * line, atol=1e-10)
    assert found.pixel_size == pytest.approx(PIXEL)


@pytest.mark.parametrize(
    "head",
    [
        "numCols\tnumRows\tpixelSize (um)\n30\t20\t10.0\nZ-data (um)\n",
        "Columns,Rows,Pitch [mm]\n30,20,0.01\nHeight [um]\n",
        "# pixel_size_um: 10\n# z_unit: um\n",
        "# x_step_mm = 0.01\n# y_step_mm = 0.01\n# unit = um\n",
        "Scan length = 0.3 mm\nScan width = 0.2 mm\nData in um\n",
    ],
)
def test_sizes_in_lines_above_a_matrix(tmp_path: Path, head: str) -> None:
    mark = "\t" if "\t" in head else ","
    found = read(tmp_path / "a.txt", head + rows(HEIGHTS, mark), pixel_size=None, unit=None)
    if any("top of the map" in note for note in found.notes):
        found = found._replace(samples=np.flipud(found.samples))
    same(found)
    assert found.pixel_size == pytest.approx(PIXEL)


@pytest.mark.parametrize("names", ["lat,lon,height_um", "Longitude [deg],Latitude [deg],z"])
def test_latitude_and_longitude_are_refused(tmp_path: Path, names: str) -> None:
    with pytest.raises(SurfaceError, match=r"angles .*valid: x, y, z in a unit of length"):
        read(tmp_path / "a.csv", names + "\n" + points("{x}e-7,{y}e-7,{z}"), pixel_size=None)


def test_tables_of_r_have_names_of_rows_and_none_above_them(tmp_path: Path) -> None:
    lines = points("{x} {y} {z:.4f}").splitlines()
    table = "".join(f'"{n}" {line}\n' for n, line in enumerate(lines, 1))
    same(read(tmp_path / "a.txt", '"x" "y" "z"\n' + table, pixel_size=None))
    matrix = "".join(f'"{n}" {line}\n' for n, line in enumerate(rows(HEIGHTS, " ").splitlines(), 1))
    names = " ".join(f'"V{n}"' for n in range(1, 31))
    same(read(tmp_path / "b.txt", f"{names}\n{matrix}"))
