"""The studies: the figures of the default settings, and claims that can come out false."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import count_reproduced, evaluate_claims
from asperity.studies.otaduy_lin_2004.stimuli import SURFACES, StimulusOptions
from asperity.studies.otaduy_lin_2004.studies import STUDIES, StudySettings, run_study
from asperity.studies.otaduy_lin_2004.write import write_dataset, write_studies

# Found by an independent prototype at the default settings (D = 3 mm, 0.58 N), to the digits
# printed there.
PEAKS_MM = {0.042: 1.31, 0.083: 1.44, 0.169: 1.51}
FITTED_PEAKS_MM = {0.042: 1.34, 0.083: 1.395, 0.169: 1.393}
AT_LARGEST = {"max_acceleration": (1.75, 2.05, 2.01), "max_abs_acceleration": (3.82, 2.86, 2.33)}


@pytest.fixture(scope="module")
def studies():
    settings = StudySettings()
    simulator = settings.simulator()
    return {name: run_study(name, settings, simulator=simulator) for name in STUDIES}


@pytest.fixture(scope="module")
def claims(studies):
    return {claim["id"]: claim for claim in evaluate_claims(studies)}


def test_speed_study_gives_the_known_figures(studies):
    data = studies["speed"]
    peaks = data["max_acceleration_peak"].values * 1e3
    doubt = data["max_acceleration_peak_uncertainty"].values * 1e3
    assert np.all(np.abs(peaks - list(PEAKS_MM.values())) < doubt + 0.005)
    fitted = data["max_acceleration_fit_peak"].values * 1e3
    np.testing.assert_allclose(fitted, list(FITTED_PEAKS_MM.values()), atol=0.005)
    for metric, values in AT_LARGEST.items():
        np.testing.assert_allclose(data[metric].values[:, -1], values, atol=0.006)


@pytest.mark.parametrize(
    "claim",
    [
        "diameter.quadratic", "diameter.peak_higher", "diameter.peak_smaller_spacing",
        "diameter.peak_scales", "force.quadratic", "force.more_everywhere", "force.peak_stays",
        "speed.quadratic", "speed.faster_rougher_at_large", "speed.constant_at_small",
        "speed.peak_moves_right",
    ],
)  # fmt: skip
def test_what_the_paper_reports_of_its_metric_comes_out(claims, claim):
    assert claims[f"{claim}.max_acceleration"]["holds"]


def test_the_papers_metric_misses_the_effect_of_speed_and_the_band_metric_does_not(claims):
    name = "speed.slower_rougher_at_small"
    assert not claims[f"{name}.max_acceleration"]["holds"]
    assert claims[f"{name}.band_rms"]["holds"]
    assert claims["speed.faster_rougher_at_largest.band_rms"]["holds"]
    assert claims["speed.peak_moves_right.band_rms"]["holds"]
    assert "after the paper's" in claims[f"{name}.band_rms"]["note"]


def test_only_the_papers_model_feels_the_probe(claims):
    for model in ("otaduy-lin", "minsky", "ho", "siira-pai"):
        spread = claims[f"models.probe_size.{model}.max_acceleration"]["measured"]
        assert (spread["median_spread"] > 0.3) == (model == "otaduy-lin")
        assert (spread["largest_spread"] == 0.0) == (model != "otaduy-lin")


def test_every_claim_is_there_for_every_metric(claims):
    names = {claim.rsplit(".", 1)[0] for claim in claims}
    assert len(claims) == len(names) * len(METRICS)


def test_only_what_the_paper_claims_and_can_fail_is_counted(claims):
    counted = {name for name, claim in claims.items() if claim["counted"]}
    assert counted == {
        "diameter.quadratic.max_acceleration", "diameter.peak_higher.max_acceleration",
        "diameter.peak_smaller_spacing.max_acceleration", "force.peak_stays.max_acceleration",
        "speed.faster_rougher_at_large.max_acceleration",
        "speed.faster_rougher_at_largest.max_acceleration",
        "speed.peak_moves_right.max_acceleration", "speed.constant_at_small.max_acceleration",
    }  # fmt: skip
    missed = claims["speed.slower_rougher_at_small.max_acceleration"]
    assert missed["question"] == "people"
    assert claims["diameter.peak_scales.max_acceleration"]["question"] == "asperity"
    assert "By construction" in claims["force.more_everywhere.max_acceleration"]["note"]
    # A claim that holds when the model misses people is no finding about people.
    assert claims["speed.constant_at_small.band_rms"]["question"] == "asperity"


def test_another_surface_is_not_the_papers_analysis(studies):
    dots = studies["diameter"].copy()
    dots.attrs = studies["diameter"].attrs | {"surface": "dots"}
    assert count_reproduced(evaluate_claims({"diameter": dots})) == (0, 0)


def test_claims_are_computed_not_asserted(studies):
    # The same data with its levels in the opposite order: every ordering turns round.
    data = studies["diameter"]
    turned = data.isel(level=slice(None, None, -1)).assign_coords(
        diameter=("level", data["diameter"].values, data["diameter"].attrs)
    )
    turned.attrs = data.attrs
    found = {claim["id"]: claim["holds"] for claim in evaluate_claims({"diameter": turned})}
    assert not found["diameter.peak_higher.max_acceleration"]
    assert not found["diameter.peak_smaller_spacing.max_acceleration"]
    assert not found["diameter.peak_scales.max_acceleration"]
    flat = data.copy(deep=True)
    flat["max_acceleration_fit_r_squared"][:] = 0.89
    found = {claim["id"]: claim["holds"] for claim in evaluate_claims({"diameter": flat})}
    assert not found["diameter.quadratic.max_acceleration"]


def test_results_on_disk_are_what_was_measured(studies, tmp_path):
    claims = write_studies({"force": studies["force"]}, "band_rms", tmp_path)
    with xr.open_dataset(tmp_path / "force.nc", engine="h5netcdf") as data:
        xr.testing.assert_allclose(data["band_rms"].load(), studies["force"]["band_rms"])
        assert data["spacing"].attrs["units"] == "m"
        assert data["normal_force"].attrs["units"] == "N"
        assert data["acceleration"].dims == ("level", "spacing", "phase")
        assert data.attrs["hand_mass"] == 0.05
    stored = json.loads((tmp_path / "claims.json").read_text("utf-8"))["claims"]
    assert stored == claims
    assert set(stored[0]) == {
        "id", "claim", "source", "question", "counted", "measured", "holds", "note",
    }  # fmt: skip
    for name in ("force", "force_metrics"):
        assert (tmp_path / f"{name}.svg").stat().st_size > 10_000
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("surface", SURFACES)
def test_every_surface_can_be_studied(surface):
    settings = StudySettings(surface=surface, spacings=6, diameters=(3e-3,))
    data = run_study("diameter", settings, peaks=False)
    for metric in METRICS:
        assert np.all(np.isfinite(data[metric].values))
        assert np.all(data[metric].values > 0.0)


def test_a_height_map_file_can_be_studied(tmp_path):
    # A stored sinusoid, stretched to each spacing, gives what the sinusoid gives.
    u = (np.arange(400) + 0.5) / 40.0
    np.save(tmp_path / "wave.npy", np.tile(1e-4 * np.cos(2 * np.pi * u), (160, 1)))
    file = str(tmp_path / "wave.npy")
    settings = {"spacings": 5, "diameters": (2e-3,), "spacing_range": (1e-3, 2e-3)}
    stored = run_study("diameter", StudySettings(surface=file, **settings), peaks=False)
    shape = run_study("diameter", StudySettings(**settings), peaks=False)
    np.testing.assert_allclose(
        stored["max_abs_acceleration"], shape["max_abs_acceleration"], rtol=0.02
    )


def test_a_stiffer_hand_and_other_levels_are_used():
    settings = StudySettings(hand=Hand(0.1, 600.0, 5.0), forces=(0.5,), spacings=5)
    data = run_study("force", settings, peaks=False)
    default = run_study("force", StudySettings(forces=(0.5,), spacings=5), peaks=False)
    assert data.attrs["hand_mass"] == 0.1
    assert np.all(data["max_acceleration"].values < default["max_acceleration"].values)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ({"spacing_range": (2e-3, 1e-3)}, "must rise"),
        ({"spacing_range": (0.0, 1e-3)}, "spacing.*0.0"),
        ({"spacings": 3}, "at least 5.*3"),
        ({"diameters": (-2e-3,)}, "diameter.*-0.002"),
        ({"forces": ()}, "force needs"),
        ({"speeds": (0.1, 0.05)}, "speed must rise"),
        ({"band": (0.0, 10.0)}, "band"),
    ],
)
def test_bad_settings_are_named(bad, said):
    with pytest.raises(AsperityError, match=said):
        StudySettings(**bad)


def test_unknown_study_and_surface_list_the_choices():
    with pytest.raises(AsperityError, match="diameter, force, speed, models"):
        run_study("diametre")
    with pytest.raises(AsperityError, match="did you mean 'sinusoid'"):
        run_study("force", StudySettings(surface="sinusoide"))
    assert StimulusOptions().amplitude == 1e-4


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a full disk")
def test_a_full_disk_is_an_error_and_not_the_end_of_the_process():
    data = xr.Dataset({"force": (("a", "b", "time"), np.zeros((2, 3, 500)))})
    with pytest.raises(OSError, match="No space left"):
        write_dataset(data, Path("/dev/full"))
