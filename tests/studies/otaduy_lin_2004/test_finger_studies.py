"""The studies with a soft finger in place of the probe."""

import json

import numpy as np
import pytest

from asperity.cli.study import StudyCommand
from asperity.errors import AsperityError
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import evaluate_claims
from asperity.studies.otaduy_lin_2004.drags import DragSimulator
from asperity.studies.otaduy_lin_2004.figures import study_figure
from asperity.studies.otaduy_lin_2004.studies import StudySettings, run_study
from asperity.studies.otaduy_lin_2004.write import write_studies
from asperity.studies.skin.fingertip import Fingertip

SETTINGS = StudySettings(finger=Fingertip(), spacings=6)


@pytest.fixture(scope="module")
def studies():
    simulator = SETTINGS.simulator()
    return {
        name: run_study(name, SETTINGS, simulator=simulator, peaks=False)
        for name in SETTINGS.studies()
    }


def test_modulus_force_and_speed_are_varied(studies):
    assert list(studies) == ["modulus", "force", "speed"]
    levels = (studies["modulus"]["modulus"], studies["force"]["normal_force"])
    np.testing.assert_array_equal(levels[0], [6e3, 12e3, 24e3])
    assert [values.attrs["units"] for values in levels] == ["Pa", "N"]
    for data in studies.values():
        assert data.attrs["tool"] == "finger"
        assert data.attrs["finger_thickness"] == 3e-3
        for metric in METRICS:
            assert np.all(data[metric].values > 0.0)
    # The middle levels of all three are the same drags.
    middle = [data["band_rms"].values[1] for data in studies.values()]
    np.testing.assert_array_equal(middle[0], middle[1])
    np.testing.assert_array_equal(middle[0], middle[2])


def test_a_finger_is_far_less_shaken_than_a_probe(studies):
    probe = run_study("speed", StudySettings(spacings=6), peaks=False)
    for metric in ("max_acceleration", "band_rms"):
        assert np.all(studies["speed"][metric].values < 0.1 * probe[metric].values)


def test_no_claim_is_judged_and_the_file_says_so(studies, tmp_path):
    assert evaluate_claims(studies) == []
    assert write_studies(studies, "band_rms", tmp_path) == []
    stored = json.loads((tmp_path / "claims.json").read_text("utf-8"))
    assert stored["claims"] == []
    assert "finger" in stored["note"]
    assert {f"{name}.{kind}" for name in studies for kind in ("nc", "png", "svg")} <= {
        path.name for path in tmp_path.iterdir()
    }


def test_the_figure_says_that_it_is_a_finger(studies):
    axis = study_figure(studies["modulus"], ["band_rms"]).axes[0]
    assert axis.get_title(loc="left").startswith("Finger: ")
    assert "finger" in axis.get_xlabel()
    texts = [text.get_text() for text in axis.get_legend().get_texts()]
    assert texts == ["6 kPa", "12 kPa", "24 kPa"]


@pytest.mark.parametrize("surface", ["trapezoid", "square", "dots"])
def test_a_finger_takes_other_surfaces(surface):
    settings = StudySettings(
        surface=surface, finger=Fingertip(pixel=50e-6), spacings=5, speeds=(0.083,)
    )
    data = run_study("speed", settings, peaks=False)
    assert np.all(data["band_rms"].values > 0.0)


def test_what_does_not_go_together_is_refused(tmp_path):
    with pytest.raises(AsperityError, match="a finger has no study 'diameter'; valid: modulus, f"):
        run_study("diameter", SETTINGS)
    with pytest.raises(AsperityError, match="a probe has no study 'modulus'; valid: diameter"):
        run_study("modulus")
    with pytest.raises(AsperityError, match=r"modulus.*-1"):
        StudySettings(finger=Fingertip(), moduli=(-1.0,))
    with pytest.raises(AsperityError, match=r"one force.*minsky"):
        DragSimulator(model="minsky", finger=Fingertip())
    out = tmp_path / "out"
    for command, said in (
        (StudyCommand("models", tool="finger"), "no study 'models'"),
        (StudyCommand(tool="thumb"), "tool.*thumb"),
        (StudyCommand(tool="finger", diameters_mm=(2.0,)), "no diameter.*--diameters-mm"),
        (StudyCommand(moduli_kpa=(2.0,)), "rigid.*--moduli-kpa"),
        (StudyCommand("speed", tool="finger", forces_n=(100.0,)), "100 N presses"),
    ):
        command.out = out
        with pytest.raises(AsperityError, match=said):
            command.run()
    assert not out.exists()


def test_the_command_writes_a_finger_study(tmp_path, capsys):
    StudyCommand("speed", tool="finger", spacings=5, out=tmp_path / "out").run()
    assert "none is judged for a finger" in capsys.readouterr().out
    assert (tmp_path / "out" / "speed.png").is_file()
    assert StudyCommand("speed", tool="finger").settings().spacings == 160
    assert StudyCommand("speed").settings().spacings == 40
