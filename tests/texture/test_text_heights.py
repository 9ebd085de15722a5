"""Heights in text as instruments and spreadsheets write them: the right metres, or a refusal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.errors import SurfaceError
from asperity.texture.files.reading import read_heights

PIXEL, RELIEF = 1e-5, 4e-5
V, U = np.mgrid[0:20, 0:30]
HEIGHTS = np.sin(U / 3.0) + 0.5 * np.cos(V / 4.0 + U / 9.0)
HEIGHTS = RELIEF * (HEIGHTS - HEIGHTS.min()) / np.ptp(HEIGHTS)
X, Y = (PIXEL * grid.ravel() for grid in (U, V))
XYZ = np.column_stack([X, Y, HEIGHTS.ravel()])


def rows(values: np.ndarray, separator: str = "\t", *, comma: bool = False) -> str:
    lines = (separator.join(f"{value:.7g}" for value in row) for row in values)
    text = "\n".join(lines) + "\n"
    return text.replace(".", ",") if comma else text


def write(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.write_bytes(text.encode(encoding))
    return path


def same(found, *, tall: float = 1.0, atol: float = 1e-10) -> None:
    np.testing.assert_allclose(
        np.broadcast_to(found.pixel_size, 2), [PIXEL, tall * PIXEL], rtol=1e-5
    )
    assert found.samples.shape == HEIGHTS.shape
    ways = (HEIGHTS, np.flipud(HEIGHTS))
    assert min(np.abs(found.samples - way).max() for way in ways) < atol


GWYDDION = {
    "en": "# Channel: Topography\n# Width: 300 µm\n# Height: 0.2 mm\n# Value units: µm\n",
    "de": "# Kanal: Topographie\n# Breite: 0.3 mm\n# Höhe: 200 µm\n# Value units: µm\n",
    "cs": "# Kanál: Výška\n# Šířka: 300 µm\n# Výška: 200 µm\n# Jednotky hodnot: µm\n",
    "fr": "# Canal : Hauteur\n# Largeur : 300 µm\n# Hauteur : 200 µm\n# Unités : µm\n",
    "it": "# Canale: h\n# Larghezza: 300 µm\n# Altezza: 200 µm\n# unità valore: µm\n",
    "es": "# Canal: h\n# Anchura: 300 µm\n# Altura: 200 µm\n# Value units: µm\n",
    "ru": "# Канал: h\n# Ширина: 300 мкм\n# Высота: 200 мкм\n# Единицы измерения: мкм\n",
    "ko": "# 채널: h\n# 폭: 300 µm\n# 높이: 200 µm\n# 값 단위: µm\n",
    "ja": "# チャンネル: h\n# 幅: 300 µm\n# 高さ: 200 µm\n# 値の単位: µm\n",
    "unknown": "# Kanaal: h\n# Breedte: 300 µm\n# Hoogte: 200 µm\n# Waarde-eenheden: µm\n",
}


@pytest.mark.parametrize("language", GWYDDION)
def test_gwyddion_s_export_says_its_scale(tmp_path: Path, language: str) -> None:
    path = write(tmp_path / "a.txt", GWYDDION[language] + rows(1e6 * HEIGHTS))
    same(read_heights(path))
    given = read_heights(path, pixel_size=2 * PIXEL)
    assert given.pixel_size == 2 * PIXEL
    assert any("the file has 10 um" in note for note in given.notes)


@pytest.mark.parametrize(
    ("head", "factor"),
    [
        ("ncols 30\nnrows 20\nxllcorner 0\ncellsize 0.00001\nNODATA_value -9999\n", 1.0),
        ("pixel size=1e-5 m\ndata unit=rad\nheight conversion factor (-> m)=2e-6\n", 5e5),
        ("Pixel size: 10 µm\nHeight unit: nm\n", 1e9),
        ("x-pixel size [um]\t10\ny-pixel size [um]\t10\nZ Unit\tum\n", 1e6),
        ("X Range = 0.3 mm\nY Range = 0.2 mm\nUnits = nm\n", 1e9),
        ("X pixels,30\nX pitch,10.0,um\nY pitch,10.0,um\nZ unit,um\n", 1e6),
        ("ncols 30\nnrows 20\ncellsize 0,00001\nNODATA_value -9999\n", 1.0),
    ],
)  # fmt: skip
def test_other_heads_say_their_scale(tmp_path: Path, head: str, factor: float) -> None:
    same(read_heights(write(tmp_path / "a.asc", head + rows(factor * HEIGHTS, " "))))


def test_nodata_of_a_text_grid_is_missing(tmp_path: Path) -> None:
    holed = HEIGHTS.copy()
    holed[3, 4] = -9999
    text = "ncols 30\nnrows 20\ncellsize 1e-5\nNODATA_value -9999\n" + rows(holed, " ")
    with pytest.raises(SurfaceError, match="1 of 600 values are missing"):
        read_heights(write(tmp_path / "a.asc", text))


@pytest.mark.parametrize(
    "heading",
    ["height [µm]", "Höhe (µm)", "z/um", "height_um", "z in µm", "Height µm", '"z [micron]"'],
)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_a_heading_names_the_unit(tmp_path: Path, heading: str, encoding: str) -> None:
    text = heading + "\n" + rows(1e6 * HEIGHTS, ",")
    found = read_heights(write(tmp_path / "a.csv", text, encoding), pixel_size=PIXEL)
    same(found)
    assert any("as the file states" in note for note in found.notes)


@pytest.mark.parametrize(
    ("separator", "comma"), [(";", True), ("\t", True), (" ", True), (";", False), (", ", False)]
)
def test_separators_and_decimal_commas(tmp_path: Path, separator: str, comma: bool) -> None:
    path = write(tmp_path / "a.txt", "z_um\n" + rows(1e6 * HEIGHTS, separator, comma=comma))
    same(read_heights(path, pixel_size=PIXEL))


@pytest.mark.parametrize("word", ["Bad", "NaN", "---", "N/A", "#N/A", "1.#QNAN", "1e38"])
@pytest.mark.parametrize("separator", [" ", ",", ";", "\t"])
def test_words_for_missing_values(tmp_path: Path, word: str, separator: str) -> None:
    lines = rows(1e6 * HEIGHTS, separator).split("\n")
    lines[4] = lines[4].replace(lines[4].split(separator)[2], word)
    path = write(tmp_path / "a.txt", "z_um\n" + "\n".join(lines))
    with pytest.raises(SurfaceError, match="1 of 600 values are missing"):
        read_heights(path, pixel_size=PIXEL)
    same(read_heights(path, pixel_size=PIXEL, missing="fill"), atol=3e-6)


@pytest.mark.parametrize("word", ["No Data", "no value", "Not measured"])
def test_two_words_for_a_missing_value(tmp_path: Path, word: str) -> None:
    lines = rows(1e6 * HEIGHTS, "\t").split("\n")
    lines[4] = lines[4].replace(lines[4].split("\t")[2], word)
    path = write(tmp_path / "a.txt", "z_um\n" + "\n".join(lines))
    with pytest.raises(SurfaceError, match="1 of 600 values are missing"):
        read_heights(path, pixel_size=PIXEL)


def test_names_with_units_may_be_set_apart_by_spaces_alone(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dat", "# x [um] y [um] z [nm]\n" + rows(XYZ * [1e6, 1e6, 1e9]))
    same(read_heights(path))


@pytest.mark.parametrize("order", ["rows", "columns", "shuffled"])
@pytest.mark.parametrize(
    ("head", "factors"),
    [
        ("", (1, 1, 1)),
        ("x,y,z\n", (1, 1, 1)),
        ("x [mm],y [mm],z [um]\n", (1e3, 1e3, 1e6)),
        ("X (um),Y (um),Height (nm)\n", (1e6, 1e6, 1e9)),
        ("x,y,height\nmm,mm,um\n", (1e3, 1e3, 1e6)),
    ],
)
def test_points_on_a_grid_are_a_map(tmp_path: Path, head: str, factors: tuple, order: str) -> None:
    ways = {
        "rows": np.arange(600), "columns": np.arange(600).reshape(20, 30).T.ravel(),
        "shuffled": np.random.default_rng(0).permutation(600),
    }  # fmt: skip
    points = XYZ[ways[order]] * factors
    path = write(tmp_path / "a.csv", head + rows(points, ","))
    found = read_heights(path, pixel_size=PIXEL)
    same(found)
    assert any("600 points on a grid of 30 x 20" in note for note in found.notes)


def test_points_may_lack_some_and_have_more_columns(tmp_path: Path) -> None:
    more = np.column_stack([XYZ, np.arange(600) % 7])
    path = write(tmp_path / "a.txt", rows(np.delete(more, [45, 300], axis=0), " "))
    with pytest.raises(SurfaceError, match="2 of 600 values are missing"):
        read_heights(path)
    head = write(
        tmp_path / "b.csv", "intensity;z [mm];y [mm];x [mm]\n" + rows(1e3 * more[:, ::-1], ";")
    )
    same(read_heights(head))


def test_a_damaged_place_of_scattered_points_is_named(tmp_path: Path) -> None:
    points = 1e-3 * np.random.default_rng(2).random((500, 3))
    points[122, 0] = 0.7
    path = write(tmp_path / "a.xyz", rows(points, " "))
    with pytest.raises(SurfaceError, match=r"point 123 is at 0\.7, .* far from all others"):
        read_heights(path, unit="m")


def test_scattered_points_are_interpolated_aloud(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.0, 3e-4, 4000), rng.uniform(0.0, 2e-4, 4000)
    z = 1e-5 * np.sin(2 * np.pi * x / 1e-4)
    path = write(
        tmp_path / "a.xyz", "x_mm y_mm z_mm\n" + rows(1e3 * np.column_stack([x, y, z]), " ")
    )
    found = read_heights(path, missing="fill", pixel_size=2e-6)
    assert any("lie on no grid" in note for note in found.notes)
    at = x.min() + 2e-6 * (np.arange(found.samples.shape[1]) + 0.5)
    right = 1e-5 * np.sin(2 * np.pi * at / 1e-4)
    assert np.abs(found.samples - right)[5:-5, 5:-5].max() < 2e-6


def test_points_with_more_behind_and_maps_in_one_column_are_doubted(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path = write(tmp_path / "a.txt", rows(1e-5 * rng.normal(size=(200, 6))))
    assert any("are they points" in note for note in read_heights(path, pixel_size=PIXEL).notes)
    for count, doubted in ((64 * 64, True), (64 * 64 + 1, False)):
        path = write(tmp_path / "b.txt", rows(1e-6 * rng.normal(size=(count, 1))))
        notes = read_heights(path, pixel_size=PIXEL).notes
        assert any("is it a map of 64 x 64?" in note for note in notes) == doubted


def test_two_columns_are_a_profile(tmp_path: Path) -> None:
    x = np.arange(50) * 2e-6
    z = 1e-6 * np.sin(x / 1e-5)
    text = "Lateral um,Raw Micrometer,,\n" + "".join(
        f"{1e6 * a:.6f},{1e6 * b:.6f},,\n" for a, b in zip(x, z, strict=True)
    )
    found = read_heights(write(tmp_path / "a.csv", "Scan,Standard\nLength,100 um\n" + text))
    assert found.pixel_size == pytest.approx(2e-6)
    np.testing.assert_allclose(found.samples, z, atol=1e-12)


def test_implausible_scales_are_doubted(tmp_path: Path) -> None:
    tall = read_heights(write(tmp_path / "a.txt", rows(1e6 * HEIGHTS)), pixel_size=PIXEL)
    assert any(note.startswith("is that plausible? A relief of 4e+04 mm") for note in tall.notes)
    wide = read_heights(write(tmp_path / "b.txt", rows(HEIGHTS)), pixel_size=0.3)
    assert any("pixel size of 300 mm" in note for note in wide.notes)
    assert not any(
        "plausible" in note for note in read_heights(tmp_path / "b.txt", pixel_size=PIXEL).notes
    )


def test_a_unit_may_be_given_and_a_contradiction_is_noted(tmp_path: Path) -> None:
    plain = write(tmp_path / "a.txt", rows(1e6 * HEIGHTS))
    same(read_heights(plain, pixel_size=PIXEL, unit="um"))
    points = write(tmp_path / "b.txt", rows(1e3 * XYZ, " "))
    same(read_heights(points, unit="mm"))
    said = write(tmp_path / "c.txt", "z_nm\n" + rows(1e6 * HEIGHTS))
    found = read_heights(said, pixel_size=PIXEL, unit="um")
    same(found)
    assert any("the file states nm" in note for note in found.notes)


def test_values_that_are_no_lengths_need_a_scale(tmp_path: Path) -> None:
    head = "# Width: 300 µm\n# Height: 200 µm\n# Value units: V\n"
    path = write(tmp_path / "a.txt", head + rows(HEIGHTS))
    with pytest.raises(SurfaceError, match="height_range"):
        read_heights(path)
    found = read_heights(path, height_range=RELIEF)
    assert np.ptp(found.samples) == pytest.approx(RELIEF)
    assert any("'V', which is no length" in note for note in found.notes)


def test_an_outlying_value_is_suspected_and_may_be_named(tmp_path: Path) -> None:
    holed = 1e6 * HEIGHTS
    holed[2, 3:7] = -9999
    path = write(tmp_path / "a.txt", "z_um\n" + rows(holed))
    found = read_heights(path, pixel_size=PIXEL)
    assert any("is -9999 a missing value? It occurs 4 times" in note for note in found.notes)
    with pytest.raises(SurfaceError, match="4 of 600 values are missing"):
        read_heights(path, pixel_size=PIXEL, nodata=-9999)


def test_a_usual_sentinel_is_suspected_even_once(tmp_path: Path) -> None:
    holed = 1e6 * HEIGHTS
    holed[2, 3] = -32768
    found = read_heights(write(tmp_path / "a.txt", "z_um\n" + rows(holed)), pixel_size=PIXEL)
    assert any("is -32768 a missing value? It occurs once" in note for note in found.notes)


def test_a_japanese_instrument_s_head_is_read(tmp_path: Path) -> None:
    head = "機種,VK-X1000\nXYキャリブレーション,10.000,um\n水平,30\n垂直,20\n単位,um\n\n高さ\n"
    path = write(tmp_path / "a.csv", head + rows(1e6 * HEIGHTS, ","), "cp932")
    found = read_heights(path)
    same(found)
    np.testing.assert_allclose(found.samples, np.flipud(HEIGHTS), atol=1e-10)


def test_numbered_rows_and_columns_are_no_heights(tmp_path: Path) -> None:
    body = [f"{j}," + ",".join(f"{z:.7g}" for z in row) for j, row in enumerate(1e6 * HEIGHTS)]
    frame = "," + ",".join(map(str, range(30))) + "\n" + "\n".join(body)  # as pandas writes it
    found = read_heights(write(tmp_path / "a.csv", frame), pixel_size=PIXEL, unit="um")
    same(found)
    assert any("number the samples, by 1 and 1" in note for note in found.notes)
    named = "row," + ",".join(f"c{i} [um]" for i in range(30)) + "\n" + "\n".join(body)
    same(read_heights(write(tmp_path / "b.csv", named), pixel_size=PIXEL))


def test_a_word_in_the_first_row_is_refused(tmp_path: Path) -> None:
    lines = rows(1e6 * HEIGHTS, ",").split("\n")
    lines[0] = lines[0].replace(lines[0].split(",")[3], "oops", 1)
    path = write(tmp_path / "a.csv", "z_um\n" + "\n".join(lines))
    with pytest.raises(SurfaceError, match="line 2: 'oops' is no number"):
        read_heights(path, pixel_size=PIXEL)


def test_units_as_powers_of_ten_and_heights_in_volts(tmp_path: Path) -> None:
    head = "# Width: 3.0×10<sup>-4</sup> m\n# Height: 2×10^-4 m\n# Value units: 10<sup>-9</sup> m\n"
    same(read_heights(write(tmp_path / "a.txt", head + rows(1e9 * HEIGHTS))))
    volts = "x [um],y [um],z [V]\n" + rows(XYZ * [1e6, 1e6, 1e4], ",")
    path = write(tmp_path / "b.csv", volts)
    with pytest.raises(SurfaceError, match="height_range"):
        read_heights(path)
    assert np.ptp(read_heights(path, height_range=RELIEF).samples) == pytest.approx(RELIEF)


def test_words_behind_the_numbers_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "a.txt", "z_um\n" + rows(1e6 * HEIGHTS) + "\nEnd of data\n")
    same(read_heights(path, pixel_size=PIXEL))


def test_the_distance_of_points_shows_their_unit(tmp_path: Path) -> None:
    path = write(tmp_path / "a.txt", rows(1e3 * XYZ, " "))
    found = read_heights(path, pixel_size=PIXEL)
    same(found)
    assert any("places and heights in mm, in which" in note for note in found.notes)


@pytest.mark.parametrize("text", ["0;0;0\n0,5;1,5;2\n1,5;1;0,25\n2;2;1,5\n1,5;1;1\n", "0 0\n1 2\n"])
def test_the_first_row_of_whole_numbers_is_a_row(tmp_path: Path, text: str) -> None:
    found = read_heights(write(tmp_path / "a.txt", text), pixel_size=PIXEL)
    first = [float(word) for word in text.split("\n")[0].replace(";", " ").split()]
    assert found.samples.shape[0] == text.count("\n")
    np.testing.assert_array_equal(found.samples[0], first)


def test_axes_beside_a_matrix_are_no_heights(tmp_path: Path) -> None:
    across = ",".join(f"{10 * k}" for k in range(30))
    beside = [f"{10 * k},{row}" for k, row in enumerate(rows(1e6 * HEIGHTS, ",").splitlines())]
    body = "\n".join(beside) + "\n"
    found = read_heights(write(tmp_path / "a.csv", f"y\\x (µm),{across}\n{body}"), unit="um")
    same(found, atol=1e-9)
    assert any("its first row and column are places, by 10 and 10" in n for n in found.notes)
    # Without a word for them they are suspected.
    for text, what in (
        (f"0,{across}\n{body}", "row and column"), (body, "column"),
        (f"{across}\n{rows(1e6 * HEIGHTS, ',')}", "row"),
    ):  # fmt: skip
        found = read_heights(write(tmp_path / "b.csv", text), pixel_size=PIXEL, unit="um")
        assert any(f"is its first {what} places?" in note for note in found.notes)
    found = read_heights(write(tmp_path / "c.csv", rows(1e6 * HEIGHTS, ",")), pixel_size=PIXEL)
    assert not any("places?" in note for note in found.notes)


@pytest.mark.parametrize(
    ("heading", "unit"),
    [
        ("heightUm", 1e-6), ("height [1e-6 m]", 1e-6), ("height (x10^-6 m)", 1e-6),
        ("height (µin)", 2.54e-8), ("height (kÅ)", 1e-7), ("height [㎛]", 1e-6),
        ("height [ƒÊm]", 1e-6),
    ],
)  # fmt: skip
def test_units_that_few_programs_write(tmp_path: Path, heading: str, unit: float) -> None:
    path = write(tmp_path / "a.csv", f"{heading}\n" + rows(HEIGHTS / unit, ","))
    same(read_heights(path, pixel_size=PIXEL))


@pytest.mark.parametrize("steps", ["Pas en {} :", "Schrittweite {}:", "Krok {}:", "Paso {}:"])
def test_steps_in_other_languages_are_those_of_pixels(tmp_path: Path, steps: str) -> None:
    head = "".join(f"{steps.format(axis)} {n} µm\n" for axis, n in (("X", 10), ("Y", 20)))
    same(read_heights(write(tmp_path / "a.txt", f"{head}Z unit: m\n{rows(HEIGHTS)}")), tall=2.0)


def test_numbers_in_quotation_marks_and_with_thousands(tmp_path: Path) -> None:
    nanometres = 1e9 * HEIGHTS + 20000.0
    english = [[f"{value:,.3f}" for value in row] for row in nanometres]
    swap = str.maketrans(",.", ".,")
    for name, text in {
        "quoted": "\n".join(",".join(f'"{cell}"' for cell in row) for row in english),
        "decimal": "\n".join(
            ",".join(f'"{value:.4f}"'.replace(".", ",") for value in row) for row in nanometres
        ),
        "tabs": "\n".join("\t".join(row) for row in english),
        "german": "\n".join(";".join(row) for row in english).translate(swap),
    }.items():
        path = write(tmp_path / f"{name}.csv", text)
        found = read_heights(path, unit="nm", pixel_size=PIXEL)
        assert not found.notes[1:], name
        np.testing.assert_allclose(found.samples - 2e-5, HEIGHTS, atol=1e-11)
    whole = "\n".join("\t".join(f"{value:,.0f}" for value in row) for row in nanometres)
    found = read_heights(write(tmp_path / "a.txt", whole), unit="nm", pixel_size=PIXEL)
    assert any("with a decimal mark; write thousands without" in note for note in found.notes)


def test_a_grid_of_esri_may_stand_in_one_line_and_be_cut_short(tmp_path: Path) -> None:
    head = "ncols 30\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 1e-5\n"
    same(read_heights(write(tmp_path / "a.asc", head + rows(HEIGHTS, " ").replace("\n", " "))))
    short = read_heights(write(tmp_path / "b.asc", head + rows(HEIGHTS[:-1], " ")))
    assert any("It states 30 x 20 heights, and has 30 x 19" in note for note in short.notes)


def test_rows_and_columns_that_are_numbered_are_a_map_from_the_top(tmp_path: Path) -> None:
    table = np.column_stack([V.ravel(), U.ravel(), 1e6 * HEIGHTS.ravel()])
    path = write(tmp_path / "a.csv", "row,col,height_um\n" + rows(table, ","))
    found = read_heights(path, pixel_size=PIXEL)
    np.testing.assert_allclose(found.samples, np.flipud(HEIGHTS), atol=1e-10)
    with pytest.raises(SurfaceError, match="pixel_size"):
        read_heights(path)


def test_a_profile_of_several_columns_needs_to_say_which_are_its_heights(tmp_path: Path) -> None:
    x, z = 1e3 * X[:30], 1e6 * HEIGHTS[0]
    several = write(tmp_path / "a.csv", "x_mm,raw_um,fine_um\n" + rows(np.c_[x, z, 0.1 * z], ","))
    with pytest.raises(SurfaceError, match=r"x_mm, raw_um, fine_um\).* which one has the heights"):
        read_heights(several)
    pair = write(tmp_path / "b.csv", "Lateral,Raw_Millimeter/Micron\n" + rows(np.c_[x, z], ","))
    found = read_heights(pair)
    np.testing.assert_allclose(found.samples, HEIGHTS[0], atol=1e-10)
    np.testing.assert_allclose(found.pixel_size, PIXEL, rtol=1e-5)


@pytest.mark.parametrize(
    ("name", "heading", "doubted"),
    [("a", "Depth (µm)", True), ("wood_depth", "z (µm)", True), ("WoodDepth", "z (µm)", True),
     ("Rautiefe", "z (µm)", False), ("depths", "height (µm)", False)],
)  # fmt: skip
def test_depths_are_doubted(tmp_path: Path, name: str, heading: str, doubted: bool) -> None:
    path = write(tmp_path / f"{name}.csv", f"{heading}\n" + rows(1e6 * HEIGHTS, ","))
    found = read_heights(path, pixel_size=PIXEL)
    assert any("invert=True exchanges hills and valleys" in n for n in found.notes) == doubted
    found = read_heights(path, pixel_size=PIXEL, invert=True)
    assert not any("downwards?" in note for note in found.notes)


def test_of_several_blocks_of_rows_the_first_is_read(tmp_path: Path) -> None:
    head = "# Width: 300 µm\n# Height: 200 µm\n# Value units: µm\n"
    block = rows(1e6 * HEIGHTS)
    for between in ("\n", "# Channel: Phase\n# Value units: deg\n"):
        found = read_heights(write(tmp_path / "a.txt", head + block + between + block))
        same(found)
        assert any("2 blocks: the first, of 20, is read" in note for note in found.notes)
    lines = block.replace("\n", "\n\n")  # a blank line behind each row sets no block apart
    same(read_heights(write(tmp_path / "b.txt", head + lines)))
    half = block.split("\n")
    half.insert(10, "# the second half")
    same(read_heights(write(tmp_path / "c.txt", head + "\n".join(half))))


@pytest.mark.parametrize("corner", ["", "um"])
@pytest.mark.parametrize(("down", "left"), [(False, False), (True, False), (False, True)])
def test_places_beside_a_matrix_state_where_it_begins(
    tmp_path: Path, corner: str, down: bool, left: bool
) -> None:
    x, y, values = 10.0 * np.arange(30), 10.0 * np.arange(20), 1e6 * HEIGHTS
    if down:
        y, values = y[::-1], values[::-1]
    if left:
        x, values = x[::-1], values[:, ::-1]
    table = rows(np.column_stack([y, values]), ",")
    text = ",".join([corner, *(f"{place:g}" for place in x)]) + "\n" + table
    found = read_heights(write(tmp_path / "a.csv", text), unit="um", pixel_size=PIXEL)
    np.testing.assert_allclose(found.samples, HEIGHTS, atol=1e-10)
    assert any("columns are turned" in note for note in found.notes) == left
    assert any("top of the map, as its places state" in note for note in found.notes) == down


@pytest.mark.parametrize("heading", ["Voltage [V]", "current (nA)", "phase [deg]", "z (counts)"])
def test_a_heading_with_another_unit_is_no_length(tmp_path: Path, heading: str) -> None:
    path = write(tmp_path / "a.csv", f"{heading}\n" + rows(HEIGHTS, ","))
    with pytest.raises(SurfaceError, match="height_range"):
        read_heights(path, pixel_size=PIXEL)


def test_places_and_speeds_are_no_sizes_of_a_map(tmp_path: Path) -> None:
    for head in ("Stage X: 12.5 mm\nStage Y: 7.5 mm\n", "Scan length: 300 µm\nSpeed: 0.1 mm/s\n"):
        with pytest.raises(SurfaceError, match="pixel_size"):
            read_heights(write(tmp_path / "a.txt", f"{head}Z unit: m\n" + rows(HEIGHTS)))
    same(read_heights(write(tmp_path / "b.txt", "Scale: 10 µm\nPixel size: 10 µm/px\n"
                            "Z unit: m\n" + rows(HEIGHTS))))  # fmt: skip


@pytest.mark.parametrize(
    ("head", "scale", "note"),
    [
        ("Scale factor: 0.002 um", 2e-9, "heights in 0.002 um"),
        ("Unit: um\nScale factor 0.002", 2e-9, "heights in 0.002 um"),
        ("Z scale: 0.002 um/LSB", 2e-9, "heights in 0.002 um"),
        ("Height conversion (nm/count)\t2", 2e-9, "heights in 2 nm"),
        ("Unit: um\nZ scale: 2 nm", 1e-6, "is 'Z scale', 2, a factor of the heights"),
    ],
)
def test_a_factor_above_whole_numbers_is_used_or_doubted(
    tmp_path: Path, head: str, scale: float, note: str
) -> None:
    counts = np.arange(48).reshape(6, 8) ** 2 % 37
    text = f"{head}\nPixel size: 10 um\n" + rows(counts, "\t")
    read = read_heights(write(tmp_path / "a.txt", text))
    np.testing.assert_allclose(np.ptp(read.samples), scale * np.ptp(counts), rtol=1e-9)
    assert any(note in own for own in read.notes)


@pytest.mark.parametrize(
    "head",
    [
        "X-Axis Unit:\tmm\nY-Axis Unit:\tmm\nZ-Axis Unit:\tµm\nSpacing X:\t0.01 mm\n"
        "Spacing Y:\t0.01 mm\n",
        "# PixelSizeX: 1e-05 m\n# PixelSizeY: 1e-05 m\n# HeightUnit: um\n",
        "# dx=10um, dy=10um, z in um\n",
        "Resolution: 10 µm/px\nZ step: 3 µm/step\nHeight in µm\n",
    ],
)
def test_labels_of_axes_and_without_spaces(tmp_path: Path, head: str) -> None:
    same(read_heights(write(tmp_path / "a.txt", head + rows(1e6 * HEIGHTS))))


def test_the_unit_of_the_pixels_is_not_that_of_the_heights(tmp_path: Path) -> None:
    """The last line above the numbers is no heading if it states a length."""
    read = read_heights(write(tmp_path / "a.txt", "Pixel size: 10 um\n" + rows(HEIGHTS, "\t")))
    np.testing.assert_allclose(np.ptp(read.samples), np.ptp(HEIGHTS), rtol=1e-5)
    assert any("no unit is stated" in note for note in read.notes)


def test_a_sheet_of_excel_is_read_as_text(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["Pixel size", "10 um"], ["Height unit", "um"], *(1e6 * HEIGHTS).tolist()):
        book.active.append(row)
    book.create_sheet("empty")
    path = tmp_path / "a.xlsx"
    book.save(path)
    same(read_heights(path))
    book["empty"].append([1, 2])
    book.save(path)
    with pytest.raises(SurfaceError, match=r"2 of its sheets have cells \(Sheet, empty\)"):
        read_heights(path)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(SurfaceError, match=r"an Excel file: damaged.*or save its sheet as \.csv"):
        read_heights(path)
