"""What STUDY.toml may say, which combinations that makes, and how it is refused."""

import json
import tomllib

import numpy as np
import pytest

from asperity import AsperityError, load_scene
from asperity.scene.document import write_toml
from asperity.studies.otaduy_lin_2004.drags import Condition
from asperity.studies.sweeps.drag_runs import DragRuns
from asperity.studies.sweeps.new_store import block_shape, blocks
from asperity.studies.sweeps.scene_runs import SceneRuns
from asperity.studies.sweeps.study import read_study, seed_of


def study(vary, **sections):
    return {"schema": 1, "kind": "drag", "vary": vary} | sections


def combinations(document, **options):
    read = read_study(document, **options)
    columns = read.design.columns(range(read.size))
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def test_a_grid_has_every_combination_and_ends_where_it_is_told():
    spacing = {"from": 0.5e-3, "to": 3.5e-3, "count": 4, "scale": "log"}
    found = combinations(study({"speed": [0.05, 0.1], "spacing": spacing, "diameter": [2e-3]}))
    assert len(found) == len({json.dumps(row) for row in found}) == 8
    values = sorted({row["spacing"] for row in found})
    np.testing.assert_allclose(values, np.geomspace(0.5e-3, 3.5e-3, 4), rtol=1e-14)
    assert (values[0], values[-1]) == (0.5e-3, 3.5e-3)
    # The table of slopes is made for a spacing and a diameter: speed comes last.
    assert [row["speed"] for row in found[:4]] == [0.05, 0.1, 0.05, 0.1]


@pytest.mark.parametrize("kind", ["sobol", "latin-hypercube"])
def test_sampled_designs_cover_their_ranges_evenly_and_cross_what_has_values(kind):
    vary = {
        "hand": {"mass": {"from": 0.01, "to": 1.0, "scale": "log"}},
        "normal_force": {"from": 0.2, "to": 1.0},
        "surface": {"choose": ["sinusoid", "square"]},
        "speed": [0.05, 0.1],
    }
    document = study(vary, design={"kind": kind, "count": 64, "seed": 5})
    read = read_study(document)
    sample, speed = read.design.axes
    assert (sample.name, read.design.shape, speed.name) == ("sample", (64, 2), "speed")
    mass, force = np.array(sample.columns["hand.mass"]), np.array(sample.columns["normal_force"])
    # One in each 64th of a Latin hypercube, and of a Sobol sequence of 64.
    assert np.unique((np.log10(mass / 0.01) / 2.0 * 64).astype(int)).size == 64
    assert np.unique(((force - 0.2) / 0.8 * 64).astype(int)).size == 64
    assert sample.columns["surface"].count("square") == 32
    assert read.fingerprint == read_study(document).fingerprint
    other = study(vary, design={"kind": kind, "count": 64, "seed": 6})
    assert read.fingerprint != read_study(other).fingerprint


def test_a_list_goes_along_together():
    found = combinations(
        study({"speed": [0.05, 0.1], "diameter": [2e-3, 3e-3]}, design={"kind": "list"})
    )
    assert found == [{"speed": 0.05, "diameter": 2e-3}, {"speed": 0.1, "diameter": 3e-3}]


HANDS = {"mass": [0.05, 0.1, 0.1], "stiffness": [300.0, 300.0, 500.0]}


@pytest.mark.parametrize("kind", ["grid", "sobol"])
def test_rows_of_a_table_cross_the_other_axes(kind):
    vary, design = {"speed": [0.05, 0.1]}, {"kind": kind}
    if kind == "sobol":
        vary["diameter"], design["count"] = {"from": 2e-3, "to": 3e-3}, 4
    document = study(vary, zip={"person": {"hand": HANDS}}, design=design)
    found = combinations(document)
    rows = list(zip(*HANDS.values(), strict=True))
    assert len(found) == 6 * design.get("count", 1)
    assert {(row["hand.mass"], row["hand.stiffness"]) for row in found} == set(rows)
    assert found[0]["speed"] == found[2]["speed"]  # hands share the table of slopes
    axis = read_study(document).design.axes[-1]
    assert (axis.name, axis.size) == ("person", 3)


@pytest.mark.parametrize(
    ("table", "words"),
    [({"speed": {"hand": HANDS}}, "zip.speed: the store has something else of that name"),
     ({"p": {"hand": HANDS | {"damping": [2.0]}}}, "equally many values, got 3 of hand.mass"),
     ({"p": {"hand": {"mass": [0.1, 0.1], "damping": [2, 2.0]}}}, "row 0.1, 2.0 twice"),
     ({"p": {"speed": [0.1], "hand": HANDS}}, "speed is under vary and under zip.p"),
     ({"p": {"hand": HANDS | {"mass": [99.0]}}}, "zip.p.hand.mass must lie between 0.001 and 10"),
     ({"p": {"hand": {"mass": [0.1]}}}, "at least two parameters"),
     ({"p": {"hand": HANDS | {"damping": {"from": 1, "to": 2}}}}, "must be a list of values")],
)  # fmt: skip
def test_tables_that_are_not_valid(table, words):
    with pytest.raises(AsperityError, match=words):
        read_study(study({"speed": [0.05]}, zip=table))


def test_a_folder_of_maps_is_a_variation(tmp_path):
    (tmp_path / "maps").mkdir()
    for name in ("b", "a"):
        np.save(tmp_path / "maps" / f"{name}.npy", np.sin(np.arange(64.0)) * 1e-4)
    document = study({"surface": {"folder": "maps", "pattern": "*.npy"}})
    read = read_study(document, folder=tmp_path)
    assert read.design.axes[0].columns["surface"] == ["maps/a.npy", "maps/b.npy"]
    before = read.fingerprint
    np.save(tmp_path / "maps" / "a.npy", np.cos(np.arange(64.0)) * 1e-4)
    assert read_study(document, folder=tmp_path).fingerprint != before


def test_a_folder_without_a_pattern_gives_its_maps_and_nothing_else(tmp_path):
    (tmp_path / "maps").mkdir()
    np.save(tmp_path / "maps" / "b.npy", np.sin(np.arange(64.0)) * 1e-4)
    for other in ("LICENSE", "about.txt", "sizes.csv"):
        (tmp_path / "maps" / other).write_text("not heights")
    read = read_study(study({"surface": {"folder": "maps"}}), folder=tmp_path)
    assert read.design.axes[0].columns["surface"] == ["maps/b.npy"]
    (tmp_path / "maps" / "b.npy").unlink()
    with pytest.raises(AsperityError, match=r"no file in .*maps is a map of heights"):
        read_study(study({"surface": {"folder": "maps"}}), folder=tmp_path)


def test_a_map_outside_its_scenes_folder_counts_for_the_study(tmp_path):
    """A scene may name files anywhere; a study of it has to begin anew when one has changed."""
    rows = np.sin(np.arange(64.0) / 5.0)
    np.save(tmp_path / "heights.npy", 1e-5 * np.outer(rows, rows))
    load_scene("probe-plate").save(tmp_path / "mine")
    scene = tmp_path / "mine" / "scene.toml"
    document = tomllib.loads(scene.read_text())
    document["bodies"]["plate"]["texture"] = {"file": "../heights.npy", "pixel_size": 1e-4}
    scene.write_text(write_toml(document))
    document = study({"force.stiffness": [200.0, 400.0]}, kind="scene", fixed={"scene": "mine"})
    read = read_study(document, folder=tmp_path)
    assert set(read.files) == {"mine", "mine: ../heights.npy"}
    assert read_study(document, folder=tmp_path).fingerprint == read.fingerprint
    np.save(tmp_path / "heights.npy", 2e-5 * np.outer(rows, rows))
    assert read_study(document, folder=tmp_path).fingerprint != read.fingerprint


def test_a_drag_is_that_of_the_studies():
    from asperity.studies.otaduy_lin_2004.studies import StudySettings

    numbers = DragRuns({"diameter": 2e-3}, None, 0).numbers({"spacing": 1e-3}, ["band_rms"])
    sweep = StudySettings().simulator()
    assert numbers == [sweep.metric("band_rms", Condition(1e-3, 2e-3, 0.58, 0.083))]


def test_seeds_follow_from_content():
    plain = {"surface": "dots", "spacing": 1e-3}
    runs = DragRuns({}, None, 0)

    def metric(**more):
        return runs.numbers(plain | more, ["max_acceleration"])[0]

    assert metric() == metric()
    # The same plate, whatever drags over it.
    seeds = [runs._seed(_drag(plain | more)) for more in ({}, {"speed": 0.1}, {"repeat": 1})]
    assert seeds[0] == seeds[1] != seeds[2]
    assert metric(repeat=1) != metric()
    assert metric(**{"stimulus.seed": 3}) == metric(**{"stimulus.seed": 3, "repeat": 1})
    assert seed_of({"a": 1.0, "b": 2}, 0) == seed_of({"b": 2, "a": 1.0}, 0) == 959936640


def _drag(values):
    from asperity.studies.sweeps.drag_runs import drag_of

    return drag_of(values)


def test_a_scene_is_changed_as_its_toml_would_be():
    runs = SceneRuns({"scene": "probe-plate-dots", "trajectory.seconds": 0.05}, None, 0)
    values = runs.fixed | {"force.stiffness": 800.0, "bodies.plate.texture.pitch": 3e-3}
    scene = runs._scene_of(values)
    assert scene.force.stiffness == 800.0
    assert scene.document["bodies"]["plate"]["texture"]["pitch"] == 3e-3
    assert scene.document["bodies"]["plate"]["texture"]["seed"] == 0
    seeded = [
        runs._scene_of(values | {"seeds": "content", "repeat": i}).document["bodies"]["plate"]
        for i in (0, 0, 1)
    ]
    assert seeded[0] == seeded[1] != seeded[2]
    # Another kind of texture begins afresh: a sinusoid has no jitter.
    changed = {f"bodies.plate.texture.{k}": v for k, v in
               {"kind": "sinusoid", "wavelength": 1e-3, "amplitude": 1e-4}.items()}  # fmt: skip
    texture = runs._scene_of(runs.fixed | changed).document["bodies"]["plate"]["texture"]
    assert texture == {"kind": "sinusoid", "wavelength": 1e-3, "amplitude": 1e-4}


def test_probe_and_hand_of_a_scene_are_varied():
    fixed = {"scene": "probe-plate", "trajectory.seconds": 0.1}
    runs = SceneRuns(fixed, None, 0)

    def felt(**parameters):
        varied = {key.replace("_of_", "."): value for key, value in parameters.items()}
        return runs.numbers(varied, ["vibration_rms_n", "mean_force_n"])

    small, large = felt(probe_of_diameter=1e-3), felt(probe_of_diameter=4e-3)
    assert small[0] > 1.2 * large[0]  # it reaches deeper into the waves
    assert felt(probe_of_diameter=1e-3) == small
    assert felt(probe_of_diameter=3e-3) == felt()  # what the scene has
    light, heavy = felt(hand_of_mass=0.02), felt(hand_of_mass=0.5)
    assert felt(hand=True) == felt(hand_of_mass=0.05)  # the usual one
    assert len({felt(hand=True)[0], light[0], heavy[0], felt()[0]}) == 4


SCENE = {"scene": "probe-plate"}
RANGE = {"from": 1.0, "to": 2.0}


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"schema": 1}, ["vary is empty"]),
        ({"schema": 2}, ["schema must be 1, got 2"]),
        (study({"speed": [1.0]}, kind="drags"), ["unknown kind 'drags'", "did you mean 'drag'"]),
        (study({"speed": [1.0]}, keeps=[]), ["unknown key keeps (did you mean keep?)"]),
        (study({"speed": [1.0]}, keep=["band_rmss"]), ["keep[0]", "did you mean 'band_rms'"]),
        (study({"hand": {"mas": [1.0]}}), ["vary.hand.mas (did you mean vary.hand.mass?)"]),
        (study({"speed": [1.0]}, fixed={"hand": {"mas": 1.0}}),
         ["fixed.hand.mas (did you mean fixed.hand.mass?)"]),
        (study({"speed": 0.1}), ["vary.speed must be a list", "fixed.speed"]),
        (study({"speed": [0.1, "fast"]}), ["vary.speed must be a number, got 'fast'"]),
        (study({"speed": [83.0]}), ["vary.speed must lie between 0.0001 and 10 m/s, got 83.0"]),
        (study({"speed": [0.1, 0.1]}), ["vary.speed has the value 0.1 twice"]),
        (study({"speed": []}), ["vary.speed.values", "at least one"]),
        (study({"speed": RANGE | {"counts": 3}}), ["vary.speed.counts", "vary.speed.count?"]),
        (study({"speed": RANGE | {"count": 1}}), ["vary.speed.count", "2 to", "got 1"]),
        (study({"speed": RANGE | {"scale": "logg"}}), ["vary.speed.scale", "'logg'", "'log'"]),
        (study({"speed": {"from": 2.0, "to": 1.0}}), ["vary.speed must rise, got 2 to 1"]),
        (study({"speed": {"from": 0.0, "to": 1.0, "scale": "log"}}), ["vary.speed.from", "log"]),
        (study({"speed": RANGE}), ["vary.speed", "sampled designs", "give count"]),
        (study({"speed": {"choose": [0.1]}}), ["vary.speed", "sampled designs", "give values"]),
        (study({"speed": RANGE}, design={"kind": "sobol"}), ["design.count is missing"]),
        (study({"speed": RANGE}, design={"kind": "sobol", "count": 100}),
         ["design.count must be a power of two", "64 or 128", "got 100"]),
        (study({"speed": [0.1]}, design={"kind": "sobol", "count": 4}), ["without count"]),
        (study({"speed": [0.1]}, design={"kind": "grids"}), ["design.kind", "'grid'"]),
        (study({"speed": [0.1, 0.2], "diameter": [2e-3]}, design={"kind": "list"}),
         ["equally many", "2 of speed", "1 of diameter"]),
        (study({"speed": [0.1]}, fixed={"speed": 0.1}), ["speed is under fixed and under vary"]),
        (study({"surface": ["sinusoidal"]}), ["vary.surface", "did you mean 'sinusoid'"]),
        (study({"surface": ["none.png"]}), ["vary.surface: no such file", "none.png"]),
        (study({"surface": {"folder": "none"}}), ["vary.surface.folder: no such folder"]),
        (study({"band": [[200.0, 20.0]]}), ["vary.band must rise", "[200.0, 20.0]"]),
        (study({"model": ["minskie"]}), ["vary.model", "did you mean 'minsky'"]),
        (study({"force": {"stiffness": [400.0]}}, kind="scene"), ["fixed.scene is missing"]),
        (study({"force": {"stifness": [400.0]}}, kind="scene", fixed=SCENE),
         ["vary.force.stifness (did you mean vary.force.stiffness?)"]),
        (study({"force": {"stiffness": [-1.0]}}, kind="scene", fixed=SCENE),
         ["vary.force.stiffness", "got -1.0"]),
        (study({"force": {"stiffness": [1.0]}}, kind="scene", fixed={"scene": "probe-plat"}),
         ["fixed.scene", "did you mean 'probe-plate'"]),
        (study({"bodies": {"plat": {"texture": {"pitch": [1e-3]}}}}, kind="scene", fixed=SCENE),
         ["bodies.plat (did you mean", "plate?"]),
        (study({"bodies": {"plate": {"texture": {"pitch": [1e-3]}}}}, kind="scene", fixed=SCENE),
         ["bodies.plate.texture.pitch", "wavelength"]),
        (study({"repeat": [0, 1]}, kind="scene", fixed=SCENE), ["vary.repeat", '"content"']),
        (study({"dt": [1e-3]}, kind="scene", fixed=SCENE, keep=["hand.energy_j"]),
         ["hand.energy_j needs fixed.hand = true"]),
        (study({"hand": {"mass": [0.05, -1.0]}}, kind="scene", fixed=SCENE),
         ["vary.hand.mass", "-1"]),
        (study({"hand": {"mass": [0.05]}}, kind="scene", fixed=SCENE | {"hand": False}),
         ["hand.mass needs hand = true"]),
        (study({"probe": {"diameter": [1e-3, 0.1]}}, kind="scene", fixed=SCENE),
         ["vary.probe.diameter", "0.0002 and 0.008", "0.1"]),
        (study({"probe": {"diameter": [1e-3]}}, kind="scene", fixed={"scene": "file-cad"}),
         ["probe.diameter", "probe-plate-dots", "'file-cad'"]),
        (study({"dt": [1, 1.0]}, kind="scene", fixed=SCENE), ["twice"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_by_its_key(document, words, tmp_path):
    with pytest.raises(AsperityError) as refused:
        read_study(document, folder=tmp_path)
    line = str(refused.value)
    assert all(word in line for word in words), line
    assert "\n" not in line


def test_a_file_says_the_same_as_a_mapping(tmp_path):
    document = study({"speed": [0.05, 0.1]}, fixed={"hand": {"mass": 0.1}})
    path = tmp_path / "study.toml"
    path.write_text(write_toml(document))
    assert read_study(path).fingerprint == read_study(document).fingerprint
    path.write_text("schema = 1\nvary = 3\n")
    with pytest.raises(AsperityError, match=r"study.toml: vary must be a table"):
        read_study(path)


@pytest.mark.parametrize("shape", [(7,), (3, 5), (4, 3, 5), (2, 1, 9, 2), (1, 1)])
@pytest.mark.parametrize("most", [1, 2, 4, 10, 1000])
def test_blocks_cover_everything_once_with_consecutive_numbers(shape, most):
    chunk = block_shape(shape, most)
    numbers = np.arange(np.prod(shape)).reshape(shape)
    found = []
    for block in blocks(shape, chunk):
        part = numbers[block.slices]
        assert part.shape == block.shape
        assert block.size <= most
        np.testing.assert_array_equal(part.ravel(), block.first + np.arange(block.size))
        assert all(s.start % c == 0 for s, c in zip(block.slices, chunk, strict=True))
        found += list(part.ravel())
    assert found == list(range(numbers.size))


def test_repeats_need_no_more_words_than_a_number():
    for spec in (5, {"from": 0, "to": 4}, {"from": 0, "to": 4, "count": 5}, [0, 1, 2, 3, 4]):
        study = read_study({"schema": 1, "vary": {"speed": [0.05], "repeat": spec}})
        assert study.design.columns(range(5))["repeat"] == [0, 1, 2, 3, 4]
    sampled = {"kind": "latin-hypercube", "count": 8}
    vary = {"stimulus": {"seed": {"from": 0, "to": 999}}}
    study = read_study({"schema": 1, "design": sampled, "vary": vary})
    assert all(type(v) is int for v in study.design.columns(range(8))["stimulus.seed"])
