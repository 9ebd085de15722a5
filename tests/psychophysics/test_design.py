"""What is refused in the TOML of an experiment, and how."""

import pytest
from fakes import CHOICE, MAGNITUDE, PAIRS, design, document

from asperity.cli import main
from asperity.errors import AsperityError
from asperity.psychophysics.design import read_design


@pytest.mark.parametrize(
    ("base", "changes", "told"),
    [
        (CHOICE, {"schema": 2}, "schema must be 1, got 2"),
        (CHOICE, {"stimulas": {}}, "unknown key stimulas (did you mean stimulus?)"),
        (CHOICE, {"method": "2ifc"}, "unknown method '2ifc'"),
        (CHOICE, {"method": ""}, "method is missing"),
        (
            CHOICE,
            {"forced_choice": {"low": -0.6, "high": -0.1, "scale": "linear"}},
            "lie below the standard",
        ),
        (
            CHOICE,
            {"forced_choice": {"low": -0.6, "scale": "linear", "direction": "down"}},
            'have direction = "up"',
        ),
        (CHOICE, {"seed": -1}, "seed must be a whole number"),
        (CHOICE, {"forced_choice": {"standart": 1}}, "did you mean forced-choice.standard?"),
        (CHOICE, {"forced_choice": {"low": 2.0}}, "low (2) must be below high (1)"),
        (CHOICE, {"forced_choice": {"low": 0.0}}, "low must be a finite number above 0"),
        (CHOICE, {"forced_choice": {"level": "db"}}, "unknown level 'db'"),
        (CHOICE, {"forced_choice": {"adaptive": "quest"}}, "did you mean 'quest+'?"),
        (CHOICE, {"forced_choice": {"adaptive": "quest+"}}, "staircase is given, but forced"),
        (CHOICE, {"staircase": {"steps": [0.5]}}, "steps must be factors above 1, got 0.5"),
        (CHOICE, {"staircase": {"start": [3.0]}}, "staircase.start: a level must lie between"),
        (CHOICE, {"staircase": {"start": "high"}}, "staircase.start must be a list of numbers"),
        (CHOICE, {"levels": None}, "there are no stimuli"),
        (CHOICE, {"levels": {"key": "height"}}, "levels.key must be a dotted key"),
        (CHOICE, {"levels": {"values": [1.0, 2.0]}}, "a forced choice has low, high"),
        (CHOICE, {"presentation": {"seconds": 0.0}}, "presentation: seconds must lie between"),
        (CHOICE, {"simulated": {"lapse": 0.9}}, "simulated: lapse must lie between"),
        (CHOICE, {"magnitude": {}}, "magnitude is given, but the method is 'forced-choice'"),
        (MAGNITUDE, {"levels": {"values": [1.0, 1.0]}}, "must be a list of different numbers"),
        (MAGNITUDE, {"levels": {"values": None}}, "levels.values is missing"),
        (MAGNITUDE, {"staircase": {}}, "staircase is for the method 'forced-choice'"),
        (MAGNITUDE, {"stimuli": {"a": {}}}, "levels and stimuli are both given"),
        (MAGNITUDE, {"stimulus": {"scene": 3}}, "stimulus.scene must be a text, got 3"),
        (PAIRS, {"stimuli": {"e": {"sceen": "x"}}}, "did you mean stimuli.e.scene?"),
        (PAIRS, {"stimuli": {"e": {"value": "x"}}}, "stimuli.e.value must be a number"),
        (PAIRS, {"stimulus": None}, "stimuli.a.scene is missing"),
    ],
)
def test_what_is_wrong_is_told_by_its_key(base, changes, told):
    with pytest.raises(AsperityError) as caught:
        design(base, **changes)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_keys_of_the_scene_are_checked_by_the_scene():
    made = design(CHOICE, levels={"key": "bodies.plate.texture.hight"})
    with pytest.raises(AsperityError, match=r"did you mean bodies.plate.texture.height\?"):
        made.check_scenes()
    made = design(CHOICE, stimulus={"change": {"forces": {}}})
    with pytest.raises(AsperityError, match=r"unknown key forces \(did you mean force\?\)"):
        made.check_scenes()
    made = design(CHOICE, stimulus={"scene": "probe-plat"})
    with pytest.raises(AsperityError, match=r"did you mean 'probe-plate'"):
        made.check_scenes()


def test_levels_set_keys_of_the_scene_and_others_with_them():
    made = design(
        MAGNITUDE, levels={"also": {"bodies.plate.texture.width": 2.0}, "values": [2e-4, 4e-4]},
        stimulus={"change": {"force": {"stiffness": 700.0}}},
    )  # fmt: skip
    scene = made.stimuli.scene(made.all_stimuli()[1])
    texture = scene.document["bodies"]["plate"]["texture"]
    assert (texture["height"], texture["width"]) == (4e-4, 8e-4)
    assert scene.force.stiffness == 700.0
    marks = made.check_scenes()
    assert len(set(marks.values())) == 2
    assert marks == design(document(made.document)).check_scenes()


def test_files_that_are_none(tmp_path, capsys):
    with pytest.raises(AsperityError, match="no such file"):
        read_design(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("name = ")
    assert main(["experiment", str(tmp_path / "bad.toml"), "--check"]) == 2
    assert "is not TOML" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ([], "--participant is missing"),
        (["--participant", "P1"], "give --device NAME"),
        (["--participant", "P1", "--simulate", "--page"], "--page or --simulate, not both"),
        (["--participant", "Ada L.", "--simulate"], "must be a code"),
        (["--participant", "P1", "--simulate", "--rate-hz", "500"], "need --device"),
    ],
)
def test_options_that_do_not_go_together(options, told, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "e.toml"
    from asperity.scene.document import write_toml

    file.write_text(write_toml(MAGNITUDE))
    assert main(["experiment", str(file), *options]) == 2
    assert told in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["e.toml"]
