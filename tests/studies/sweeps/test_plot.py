"""Views of a sweep: which are chosen, and what they draw."""

import numpy as np
import pytest

from asperity import AsperityError
from asperity.cli import main
from asperity.studies.sweeps.batch import DONE
from asperity.studies.sweeps.figures import Groups, draw, share
from asperity.studies.sweeps.store import BlockResults, open_store, open_sweep
from asperity.studies.sweeps.study import read_study
from asperity.studies.sweeps.views import choose_views

RANGE = {"from": 0.01, "to": 1.0, "scale": "log"}
SPACING = {"from": 0.5e-3, "to": 3.5e-3, "count": 9, "scale": "log"}
PEAK = 1.3e-3


def made(path, vary, number, design=None):
    """Make a store of which the metric is `number(columns)`, without running anything."""
    document = {"schema": 1, "keep": ["band_rms"], "vary": vary, "design": design or {}}
    study = read_study(document)
    columns = {k: np.array(v) for k, v in study.design.columns(range(study.size)).items()}
    values = number(columns)
    with open_store(path, study, block_size=study.size) as store:
        for block in store.blocks:
            results = BlockResults.empty(block.size, len(study.numbers))
            results.values[:, 0], results.states[:] = values[block.places], DONE
            store.write(block, results)
    return open_sweep(path)


def hill(columns):
    x = np.log10(columns["spacing"] / PEAK)
    return columns["normal_force"] * 10.0 ** (-2.0 * x**2)


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    path = tmp_path_factory.mktemp("grid") / "grid.zarr"
    vary = {"spacing": SPACING, "diameter": [2e-3, 3e-3, 4e-3, 5e-3], "normal_force": [0.3, 0.6]}
    return path, made(path, vary, hill)


def test_a_grid_has_a_curve_a_map_and_effects(grid):
    views = choose_views(grid[1])
    assert [v.kind for v in views] == ["curve", "map", "effects"]
    assert (views[0].x, views[0].colour) == ("spacing", "diameter")
    assert (views[1].x, views[1].y) == ("spacing", "diameter")


def test_the_curve_has_the_quadratic_and_its_peak(grid):
    view = choose_views(grid[1], view="curve", colour="normal_force")[0]
    axis = draw(grid[1], view).axes[0]
    labels = [text.get_text() for text in axis.get_legend().get_texts()]
    assert labels == [f"normal force {force} N  R² 1, peak 1.3 mm" for force in ("0.3", "0.6")]
    assert axis.get_xscale() == axis.get_yscale() == "log"
    peaks = [line for line in axis.get_lines() if line.get_markersize() == 7.5]
    np.testing.assert_allclose([p.get_xdata()[0] for p in peaks], 1e3 * PEAK, rtol=1e-6)
    np.testing.assert_allclose([p.get_ydata()[0] for p in peaks], [0.3, 0.6], rtol=1e-6)


def test_the_map_has_the_values_at_their_places(grid):
    figure = draw(grid[1], choose_views(grid[1], view="map", x="spacing", y="normal_force")[0])
    heat = figure.axes[0].collections[0].get_array()
    expected = grid[1]["band_rms"].median("diameter").transpose("normal_force", "spacing")
    np.testing.assert_allclose(heat, expected)


def test_effects_find_what_explains_the_spread(tmp_path):
    vary = {"hand": {"mass": RANGE, "damping": RANGE}, "normal_force": RANGE}

    def number(columns):
        return columns["hand.mass"] ** -2.0 * columns["normal_force"]

    data = made(tmp_path / "a.zarr", vary, number, {"kind": "sobol", "count": 512})
    axis = draw(data, choose_views(data, view="effects")[0]).axes[0]
    words = [text.get_text() for text in axis.get_yticklabels()]
    widths = [bar.get_width() for bar in axis.patches]
    # The variance of the logarithm is 4 parts of the mass, one of the force.
    assert words == ["hand mass", "normal force", "hand damping"]
    np.testing.assert_allclose(widths, [80.0, 20.0, 0.0], atol=2.0)


def test_noise_explains_nothing():
    rng = np.random.default_rng(3)
    shares = [share(rng.random(200), rng.normal(size=200)) for _ in range(200)]
    assert np.mean(shares) < 0.03
    assert share(np.arange(300.0), np.arange(300.0)) > 0.98
    groups = Groups(np.array(["a", "b", "a"]), np.array([1.0, 2.0, 3.0]))
    assert [list(part) for part in groups.parts] == [[1.0, 3.0], [2.0]]


def test_the_command_writes_what_it_says(grid, tmp_path, capsys):
    path = grid[0]
    assert main(["plot", str(path), "--out", str(tmp_path / "p"), "--view", "effects"]) == 0
    assert {f.name for f in (tmp_path / "p").glob("[!.]*")} == {
        "band_rms_effects.png", "band_rms_effects.svg",
    }  # fmt: skip
    assert "band_rms effects" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--view", "curves"], ["unknown view", "'curve'"]),
        (["--metric", "band_rm"], ["unknown metric", "'band_rms'"]),
        (["--x", "spacin"], ["parameter for x", "'spacing'"]),
    ],
)
def test_what_a_store_does_not_hold_is_refused(grid, options, words, tmp_path, capsys):
    assert main(["plot", str(grid[0]), "--out", str(tmp_path / "p"), *options]) == 2
    line = capsys.readouterr().err
    assert all(word in line for word in words), line
    assert not (tmp_path / "p").exists()


def test_a_parameter_without_numbers_is_no_axis(tmp_path):
    vary = {"surface": ["sinusoid", "square"], "speed": [0.1, 0.2]}
    data = made(tmp_path / "a.zarr", vary, lambda c: c["speed"] * 1.0)
    assert [v.kind for v in choose_views(data)] == ["effects"]
    with pytest.raises(AsperityError, match="x must be a parameter with numbers"):
        choose_views(data, x="surface")
    with pytest.raises(AsperityError, match=r"no parameter has 4 values .* --x"):
        choose_views(data, view="curve")
    assert draw(data, choose_views(data)[0]).axes
