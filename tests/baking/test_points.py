"""Point clouds of other programs, and what a map made of them keeps."""

import gzip
import re
import struct

import numpy as np
import pytest

import asperity
from asperity.baking.cloud import map_of_points
from asperity.baking.points import holds_points, read_points
from asperity.baking.sources import kind_of
from asperity.errors import AsperityError

COUNT = 300
DATA = np.round(np.random.default_rng(0).uniform(0, 20, (COUNT, 3)), 4)


def lines(rows, separator=" ", end="\n"):
    return end.join(separator.join(f"{value:.6g}" for value in row) for row in rows) + end


PLAIN = lines(DATA)
COLOURED = lines(np.column_stack([DATA, np.full((COUNT, 3), 128)]))
PLAIN_ROWS = lines(DATA, ",").split()
SWAPPED = np.column_stack([np.full(COUNT, 7.5), DATA[:, 2], DATA[:, 1], DATA[:, 0]])
TEXTS = {
    "plain.xyz": PLAIN, "hash.xyz": "# x y z\n" + PLAIN, "a.asc": PLAIN, "a.txt": PLAIN,
    "counted.pts": f"{COUNT}\n" + lines(np.column_stack([DATA, np.full((COUNT, 4), -200)])),
    "two_scans.pts": f"100\n{lines(DATA[:100])}200\n{lines(DATA[100:])}",
    "cloudcompare.txt": f"//X Y Z R G B\n{COUNT}\n" + COLOURED,
    "colours.txt": COLOURED, "named.csv": "x,y,z\n" + lines(DATA, ","),
    "quoted.csv": '"X","Y","Z"\r\n' + lines(DATA, ", ", "\r\n"), "semicolon.xyz": lines(DATA, ";"),
    "comma.xyz": PLAIN.replace(".", ","), "tab.dat": lines(DATA, "\t"),
    "german.csv": "X [mm];Y [mm];Z [mm]\n" + lines(DATA, ";").replace(".", ","),
    "trailing.txt": lines(DATA, ", ").replace("\n", ",\n"),
    "swapped.csv": "intensity,z,y,x\n" + lines(SWAPPED, ","),
    "paraview.csv": '"I","Points:2","Points:1","Points:0"\n' + lines(SWAPPED, ","),
    "survey.txt": "id Elevation Northing Easting\n" + lines(SWAPPED),
    "veloview.csv": "laser,Points_m_XYZ:2,Points_m_XYZ:1,Points_m_XYZ:0\n" + lines(SWAPPED, ","),
    "camel.tsv": "Reflectance\tPosZ\tPosY\tPosX\n" + lines(SWAPPED, "\t"),
    "topic.csv": "seq,point.z,point.y,point.x\n" + lines(SWAPPED, ","),
    "survey.csv": "Point,X,Y,Z\n" + "".join(f"P{i},{r}\n" for i, r in enumerate(PLAIN_ROWS)),
    "cr.xyz": PLAIN.replace("\n", "\r"),
    "utf16.txt": PLAIN.encode("utf-16"), "mark.xyz": b"\xef\xbb\xbf" + PLAIN.encode(),
    "commented.xyz": PLAIN.replace("\n", "  # seen\n"), "blank.xyz": PLAIN.replace("\n", "\n\n"),
    "every.csv": "x,y,z\n" + re.sub(r"[^,\n]+", r'"\g<0>"', lines(DATA, ",")),
    "fortran.xyz": re.sub(r"(?<=\d)(?=\s)", "D+00", PLAIN),
    "packed.xyz.gz": gzip.compress(PLAIN.encode()), "zip.csv.gz": gzip.compress(PLAIN.encode()),
    "bare16.xyz": PLAIN.encode("utf-16-le"), "bare16.txt": PLAIN.encode("utf-16-be"),
    "normals.txt": lines(np.column_stack([DATA, np.full((COUNT, 3), 0.5)])),
    "decimal.csv": "x,y,z\n"
    + re.sub(r"[^ \n]+", r'"\g<0>"', PLAIN.replace(".", ",")).replace(" ", ","),
    "numbered.txt": lines(np.column_stack([np.arange(COUNT), DATA])),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_texts_of_points(tmp_path, name):
    content = TEXTS[name]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    found = read_points(path)
    assert found.places == pytest.approx(DATA)
    assert found.unit == ("mm" if name == "german.csv" else None)
    assert kind_of(path) == "points"


def test_columns_that_are_not_named_x_y_and_z_are_doubted(tmp_path):
    (tmp_path / "a.csv").write_text("a,b,c,d\n" + lines(np.column_stack([DATA, DATA[:, 0]]), ","))
    (tmp_path / "b.xyz").write_text("".join(f"P{i},{row}\n" for i, row in enumerate(PLAIN_ROWS)))
    for name, columns in (("a.csv", "1, 2, 3"), ("b.xyz", "2, 3, 4")):
        found = read_points(tmp_path / name)
        assert found.places == pytest.approx(DATA)
        assert any(f"are x, y and z in columns {columns}?" in note for note in found.notes)


def test_maps_of_heights_are_no_points(tmp_path):
    path = tmp_path / "a.txt"
    rng = np.random.default_rng(1)
    for text in (
        lines(rng.normal(size=(40, 40))), lines(rng.normal(size=(40, 6))),
        "ncols 3\nnrows 40\n" + lines(rng.normal(size=(40, 3))), "words only\n" * 40,
        "# Channel: Height\n# Width: 1 mm\n" + lines(rng.normal(size=(9, 3))),
    ):  # fmt: skip
        path.write_text(text)
        assert not holds_points(path)


TURN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Of a scanner, as PTX has it: for rows x y z."""


def ptx(places, shape, shift):
    head = [*map(str, shape), "0 0 0", "1 0 0", "0 1 0", "0 0 1"]
    head += [" ".join(map(str, [*row, 0])) for row in TURN] + [" ".join(map(str, [*shift, 1]))]
    body = np.column_stack([places, np.full(len(places), 0.5)])
    return "\n".join(head) + "\n" + lines(body)


def test_scans_of_ptx_are_put_together(tmp_path):
    shift = np.array([5.0, 6.0, 7.0])
    own = (DATA - shift) @ TURN.T
    own[[3, 200]] = 0.0
    path = tmp_path / "a.ptx"
    path.write_text(ptx(own[:120], (12, 10), shift) + ptx(own[120:], (20, 9), shift))
    found = read_points(path)
    assert found.places == pytest.approx(np.delete(DATA, [3, 200], axis=0), abs=1e-3)
    assert found.notes[0] == "2 scans put together"
    assert "2 points at 0 0 0" in found.notes[1]
    assert kind_of(path) == "points"


def test_ptx_that_is_cut_short_is_refused(tmp_path):
    path = tmp_path / "a.ptx"
    whole = ptx(DATA, (20, 15), np.zeros(3))
    for wrong, why in (
        (whole[:-300], "counts 300 points"), (whole[:20], "line 1 begins no scan"),
        (whole.replace("\n20\n", "\nmany\n", 1).replace("20\n", "x\n", 1), "begins no scan"),
    ):  # fmt: skip
        path.write_text(wrong)
        with pytest.raises(AsperityError, match=why):
            read_points(path)


def pcd(form, *, fields="x y z intensity", kind="F", order=(0, 1, 2), end="\n"):
    rows = np.column_stack([DATA[:, order], np.ones(COUNT)])
    size = {"F": 4, "D": 8}[kind]
    words = fields.split()
    head = ["# .PCD v0.7", "VERSION 0.7", f"FIELDS {fields}"]
    head += ["SIZE " + " ".join([str(size)] * len(words)), "TYPE " + " ".join(["F"] * len(words))]
    head += ["COUNT " + " ".join(["1"] * len(words)), f"WIDTH {COUNT}", "HEIGHT 1"]
    head += ["VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {COUNT}", f"DATA {form}"]
    packed = rows.astype("<f4" if size == 4 else "<f8")
    if form == "ascii":
        body = lines(rows, end=end).encode()
    elif form == "binary":
        body = packed.tobytes()
    else:  # each field by itself, in runs of at most 32 bytes that LZF leaves as they are
        data = packed.T.tobytes()
        runs = [data[i : i + 32] for i in range(0, len(data), 32)]
        lzf = b"".join(bytes([len(run) - 1]) + run for run in runs)
        body = struct.pack("<II", len(lzf), len(data)) + lzf
    return end.join([*head, ""]).encode() + body


@pytest.mark.parametrize("form", ["ascii", "binary", "binary_compressed"])
def test_pcd_of_each_form(tmp_path, form):
    path = tmp_path / "a.pcd"
    for options in ({}, {"kind": "D"}, {"end": "\r\n"}):
        path.write_bytes(pcd(form, **options))
        assert read_points(path).places == pytest.approx(DATA, abs=1e-5)
    path.write_bytes(pcd(form, fields="z y x rgb", order=(2, 1, 0)))
    assert read_points(path).places == pytest.approx(DATA, abs=1e-5)
    path.write_bytes(pcd(form)[:-700])
    with pytest.raises(AsperityError, match="cut short"):
        read_points(path)
    path.write_bytes(pcd(form, fields="a b c d"))
    with pytest.raises(AsperityError, match="its fields are a b c d; valid: x, y and z too"):
        read_points(path)


@pytest.mark.parametrize("version", ["1.2", "1.4"])
def test_noise_and_withheld_points_of_las_are_left_out(tmp_path, version):
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create(point_format=6 if version == "1.4" else 0, file_version=version)
    cloud.header.scales = [1e-4, 1e-4, 1e-4]
    cloud.x, cloud.y, cloud.z = np.random.default_rng(0).random((3, 40))
    cloud.classification[:3] = 7
    cloud.withheld[3:5] = 1
    cloud.write(tmp_path / "a.las")
    found = read_points(tmp_path / "a.las")
    np.testing.assert_allclose(found.places, np.asarray(cloud.xyz)[5:])
    assert any("5 points are left out" in note for note in found.notes)


def test_las(tmp_path):
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create(point_format=0, file_version="1.2")
    cloud.header.scales, cloud.header.offsets = [1e-4] * 3, [0, 0, 0]
    cloud.x, cloud.y, cloud.z = DATA.T
    for name in ("a.las", "a.laz"):
        try:
            cloud.write(tmp_path / name)
        except laspy.errors.LaspyException:
            continue
        assert read_points(tmp_path / name).places == pytest.approx(DATA, abs=1e-4)
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 2])
        with pytest.raises(AsperityError, match=r"cut short|cannot be read"):
            read_points(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.xyz", "a b c\n" * 40, "no line of it holds three numbers; it begins with 'a b c'"),
        ("a.xyz", PLAIN + "1 2 what\n", "line 301 is '1 2 what'; valid: x, y and z"),
        ("a.xyz", lines(DATA[:10]), "10 points are too few; valid: 16 or more"),
        ("a.pcd", "hello\n", "its head has no line DATA"),
        ("a.pcd", "VERSION 0.7\nDATA ascii\n1 2 3\n", "its head needs FIELDS"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float q\nend_header\n1\n",
         "its vertices have no x"),
    ],
)  # fmt: skip
def test_what_holds_no_points_is_refused_in_one_line(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(AsperityError, match=said) as caught:
        read_points(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value).replace(str(tmp_path), "")) < 200


def test_a_count_that_is_not_reached_is_noted(tmp_path):
    (tmp_path / "a.pts").write_text(f"{2 * COUNT}\n{PLAIN}")
    assert "it counts 600 points and has 300" in read_points(tmp_path / "a.pts").notes[0]


# What the map keeps


def waves(length, *, noise=0.0, seed=0, count=4000):
    """Return points 0.3 mm apart on waves of 50 um amplitude [m]."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 0.02, (count, 2))
    z = 5e-5 * np.sin(2 * np.pi * xy[:, 0] / length) + noise * rng.normal(size=count)
    return np.column_stack([xy, z])


def amplitude(field, length):
    rows, columns = field.samples.shape
    inner = field.samples[rows // 8 : -(rows // 8), columns // 8 : -(columns // 8)]
    best = np.inf, 0.0
    v, u = (field.pixel_size[0] * i.ravel() for i in np.indices(inner.shape))
    for turn in np.linspace(-0.03, 0.03, 31):
        phase = 2 * np.pi / length * (np.cos(turn) * u + np.sin(turn) * v)
        basis = np.column_stack([np.cos(phase), np.sin(phase), np.ones_like(phase)])
        (c, s, _), (misfit,), *_ = np.linalg.lstsq(basis, inner.ravel())
        best = min(best, (misfit, float(np.hypot(c, s))))
    return best[1]


@pytest.mark.parametrize(("length", "least"), [(4e-3, 0.95), (2e-3, 0.93), (1e-3, 0.70)])
@pytest.mark.parametrize("seed", [0, 1])
def test_waves_keep_their_amplitude_and_the_error_is_true(length, least, seed):
    field, left_out = map_of_points(waves(length, seed=seed), size=512)
    found = amplitude(field, length)
    assert least * 5e-5 < found < 1.03 * 5e-5
    # What is lost of the amplitude is in the error; what is stated is not many times as much.
    rms = np.sqrt(np.mean(left_out**2))
    assert rms > 0.5 * (5e-5 - found) / 2**0.5
    assert rms < max(2e-6, 0.6 * 5e-5)
    assert any("of the amplitude of waves of" in note for note in field.notes)


def test_noise_is_averaged_and_is_in_the_error():
    field, left_out = map_of_points(waves(4e-3, noise=1e-5), size=512)
    assert amplitude(field, 4e-3) == pytest.approx(5e-5, rel=0.08)
    assert np.std(left_out) == pytest.approx(1e-5, rel=0.25)
    flat, _ = map_of_points(waves(4e-3, noise=1e-5) * [1, 1, 0.2], size=512)
    assert flat.rms < 1.5e-5


def test_points_astray_are_left_out_with_a_note():
    points = waves(4e-3)
    points[::200, 2] += 5e-3
    field, _ = map_of_points(points, size=512)
    assert field.relief < 2e-4
    assert any("points left out, more than" in note for note in field.notes)


def test_bake_states_the_error_at_points_left_out(tmp_path):
    np.savetxt(tmp_path / "a.txt", 1e3 * waves(1e-3), fmt="%.6f")
    report = asperity.bake(tmp_path / "a.txt", tmp_path / "out", unit="mm", picture=False).report
    assert 5 < report["error_um"]["rms"] < 30
    assert report["error_um"]["rms"] < report["error_um"]["p99"] < report["error_um"]["max"]
    assert any("points left out of the map" in note for note in report["notes"])


def test_a_column_that_counts_is_no_coordinate(tmp_path):
    (tmp_path / "a.xyz").write_text(lines(np.column_stack([np.arange(COUNT) + 1, DATA])))
    found = read_points(tmp_path / "a.xyz")
    assert found.places == pytest.approx(DATA)
    assert "its first column counts the points" in found.notes[0]


def test_points_on_a_full_grid_are_used_as_they_are(tmp_path):
    x, y = np.meshgrid(np.arange(20) * 0.1, np.arange(16) * 0.1)
    z = 0.01 * np.random.default_rng(2).normal(size=x.shape)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    np.savetxt(tmp_path / "a.xyz", points[np.random.default_rng(3).permutation(320)], fmt="%.6f")
    report = asperity.bake(tmp_path / "a.xyz", tmp_path / "out", unit="mm", picture=False).report
    assert report["error_um"]["max"] < 0.01
    assert report["texel_um"] == pytest.approx(100)


def test_each_axis_has_its_own_unit(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x [mm],y [mm],z [µm]\n" + lines(DATA * [1.0, 1.0, 1e3], ","))
    found = read_points(path)
    assert found.unit == "mm"
    assert found.places == pytest.approx(DATA, rel=1e-4)
    assert any("mm, mm, um" in note for note in found.notes)


@pytest.mark.parametrize("heading", ["lat,lon,alt", "# Latitude, Longitude, Height", "id;long;lat"])
def test_places_on_the_globe_are_refused(tmp_path, heading):
    (tmp_path / "gps.csv").write_text(heading + "\n" + lines(DATA, ";" if ";" in heading else ","))
    with pytest.raises(AsperityError, match="latitude and longitude; valid: x, y, z"):
        read_points(tmp_path / "gps.csv")


@pytest.mark.parametrize("form", ["semicolons", "quoted", "german"])
def test_marks_that_group_thousands_are_left_out(tmp_path, form):
    cells = [[f"{1e3 * value:,.2f}" for value in row] for row in DATA]
    text = "X;Y;Z\n" + "\n".join(";".join(row) for row in cells)
    if form == "quoted":
        text = "X,Y,Z\n" + "\n".join(",".join(f'"{cell}"' for cell in row) for row in cells)
    if form == "german":
        text = text.translate(str.maketrans(",.", ".,"))
    (tmp_path / "a.csv").write_text(text)
    assert read_points(tmp_path / "a.csv").places == pytest.approx(1e3 * DATA, abs=1e-2)
    assert kind_of(tmp_path / "a.csv") == "points"


def test_a_line_of_units_below_the_names_states_the_unit(tmp_path):
    (tmp_path / "a.csv").write_text(
        "x,y,z,i\n[um],[um],[um],[-]\n" + lines(np.c_[DATA, DATA[:, 0]], ",")
    )
    found = read_points(tmp_path / "a.csv")
    assert found.unit == "um"
    assert found.places == pytest.approx(DATA)


def test_points_at_the_origin_were_not_seen(tmp_path):
    (tmp_path / "a.xyz").write_text(PLAIN + 40 * "0 0 0\n")
    found = read_points(tmp_path / "a.xyz")
    assert found.places == pytest.approx(DATA)
    assert any("40 points at 0, 0, 0 are left out" in note for note in found.notes)


@pytest.mark.parametrize("place", [(-9999, -9999, -9999), (4.0, 5.0, -32768.0)])
def test_places_that_stand_for_none_are_left_out(tmp_path, place):
    path = tmp_path / "a.xyz"
    path.write_text(PLAIN + lines(np.tile(place, (3, 1))))
    found = read_points(path)
    assert found.places == pytest.approx(DATA)
    assert re.match(r"3 points with [xz] = -\d+ are left out", found.notes[0])


@pytest.mark.parametrize("names", ["range,azimuth,elevation", "r,theta,phi", "a,b,c"])
def test_three_columns_whose_names_are_no_axes_are_doubted(tmp_path, names):
    (tmp_path / "a.csv").write_text(f"{names}\n" + lines(DATA, ","))
    found = read_points(tmp_path / "a.csv")
    assert any("are x, y and z in columns 1, 2, 3?" in note for note in found.notes)
    (tmp_path / "b.csv").write_text("Unit,mm\nx,y,z\n" + lines(DATA, ","))
    found = read_points(tmp_path / "b.csv")
    assert (found.unit, found.notes) == ("mm", ())


def rows_with(cells, separator, last):
    """Rows of z, y, x, and a cell that every third row has, first or last."""
    for k, row in enumerate(DATA):
        own = [f"{value:.4f}" for value in row[::-1]]
        more = cells if k % 3 else ""
        yield separator.join([*own, more] if last else [more, *own])


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("last", [True, False])
@pytest.mark.parametrize("cells", ["", "0.5", "ok"])
def test_cells_that_are_empty_in_some_rows_or_in_all(tmp_path, separator, last, cells):
    names = ["z", "y", "x", "note"] if last else ["note", "z", "y", "x"]
    text = [separator.join(names), *rows_with(cells, separator, last)]
    (tmp_path / "a.csv").write_text("\n".join(text) + "\n")
    found = read_points(tmp_path / "a.csv")
    assert found.places == pytest.approx(DATA)  # the first row too, which has no such cell


@pytest.mark.parametrize("gap", ["", "N/A", "***", "Bad"])
@pytest.mark.parametrize("axis", [0, 2])
def test_places_that_are_missing_are_left_out(tmp_path, gap, axis):
    rows = [line.split(",") for line in PLAIN_ROWS]
    for row in rows[7::50]:
        row[axis] = gap
    (tmp_path / "a.csv").write_text("x,y,z\n" + "\n".join(map(",".join, rows)) + "\n")
    found = read_points(tmp_path / "a.csv")
    assert len(found.places) == COUNT - 6
    assert "6 points without a place are left out" in found.notes


def test_rows_and_columns_of_a_scan_are_no_places(tmp_path):
    """FARO writes them before x, y and z, and colours behind."""
    whole = [[k // 20, k % 20] for k in range(len(DATA))]
    rows = [
        [*map(str, w), *(f"{v:.5f}" for v in x[:3]), "9 8 7"]
        for w, x in zip(whole, DATA, strict=True)
    ]
    path = tmp_path / "a.xyz"
    path.write_text("\n".join(" ".join(row) for row in rows) + "\n")
    found = read_points(path)
    np.testing.assert_allclose(found.places, np.asarray(DATA)[:, :3], atol=1e-5)
    assert any("rows and columns of a scan?" in note for note in found.notes)


@pytest.mark.parametrize("other", ["Nominal", "Soll", "Dev"])
def test_measured_places_are_taken_beside_what_is_nominal(tmp_path, other):
    names = ["Name", *(f"{other} {a}" for a in "XYZ"), *(f"Actual {a} [mm]" for a in "XYZ")]
    rows = ([f"P{k}", *(f"{0.3 * v:.5f},{v:.5f}" for v in x[:3])] for k, x in enumerate(DATA))
    names = [names[0], *(n for pair in zip(names[1:4], names[4:], strict=True) for n in pair)]
    path = tmp_path / "a.csv"
    path.write_text(",".join(names) + "\n" + "\n".join(",".join(row) for row in rows) + "\n")
    found = read_points(path)
    assert found.unit == "mm"
    np.testing.assert_allclose(found.places, np.asarray(DATA)[:, :3], atol=1e-5)
    assert holds_points(path)
