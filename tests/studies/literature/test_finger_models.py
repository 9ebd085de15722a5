"""The findings about bare fingers, with other models of the finger."""

import json
from dataclasses import replace

import pytest

from asperity.cli.findings import FindingsCommand
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.literature.catalogue import FINDINGS, of_fingers
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.finger_conditions import finger_touch
from asperity.studies.literature.laboratory import Laboratory
from asperity.studies.literature.measures import COLUMNS
from asperity.studies.literature.plates import Gratings
from asperity.studies.literature.table import FINGERS, judge_all, make_columns


class TouchedError(Exception):
    pass


def test_the_findings_about_fingers_are_those_that_touch_with_one(monkeypatch):
    def refuse(*args, **kwargs):
        raise TouchedError

    monkeypatch.setattr(Finger, "slope_table", refuse)
    lab = Laboratory()
    touching = set()
    for finding in FINDINGS:
        if finding.any_metric:
            continue
        try:
            finding.judge(lab, COLUMNS["band_rms"])
        except TouchedError:
            touching.add(finding.id)
        except AsperityError:
            pass
    assert {finding.id for finding in of_fingers("averaging")} == touching


def test_texts_of_another_model_do_not_describe_the_averaging_one():
    assert of_fingers("averaging")[0].caveat
    for finding in of_fingers("soft"):
        assert "8 mm" not in finding.condition + finding.caveat
    kept = {finding.id for finding in of_fingers("soft") if finding.by_construction}
    assert kept == {"probe.smoothest"}


def test_a_soft_finger_takes_the_place_of_the_averaging_one():
    soft = FINGERS["soft"]["fingertip"]
    labs = {"averaging": Laboratory(), "soft": Laboratory(fingertip=soft)}
    table = {
        name: lab.curve(COLUMNS["band_rms"], Gratings(), finger_touch(lab), [1e-3])[0]
        for name, lab in labs.items()
    }
    assert table["soft"] != table["averaging"]
    (key,) = labs["soft"].tables
    assert key[2] == (soft, 0.58)
    # The path is another for another force, and its own for another modulus.
    stiff = Laboratory(fingertip=replace(soft, modulus=2e4))
    other = stiff.curve(COLUMNS["band_rms"], Gratings(), finger_touch(stiff), [1e-3])[0]
    assert other != table["soft"]
    light = finger_touch(labs["soft"], force=0.2)
    labs["soft"].curve(COLUMNS["band_rms"], Gratings(), light, [1e-3])
    assert len(labs["soft"].tables) == 2


def test_the_verdicts_can_differ_between_models():
    force = [finding for finding in of_fingers("soft") if finding.id == "finger.force"]
    columns = make_columns()[:1]
    assert columns[0].hand == Hand()
    holds = {}
    for finger in ("averaging", "soft"):
        rows, _ = judge_all(columns, findings=force, finger=finger)
        holds[finger] = rows[0].verdicts["max_acceleration"].holds
    assert holds == {"averaging": True, "soft": False}


def test_unknown_models_and_other_work_beside_are_refused(tmp_path):
    with pytest.raises(AsperityError, match=r"finger.*hard.*averaging, pressed, soft"):
        FindingsCommand(finger="hard").run()
    with pytest.raises(AsperityError, match=r"--finger soft: leave out --fit"):
        FindingsCommand(finger="soft", fit=True).run()


def test_the_command_writes_the_verdicts(tmp_path, monkeypatch, capsys):
    import asperity.studies.literature.catalogue as catalogue

    some = of_fingers("pressed")[4:6]
    monkeypatch.setattr(catalogue, "of_fingers", lambda finger: some)
    FindingsCommand(finger="pressed", out=tmp_path / "out", spacings=8).run()
    found = json.loads((tmp_path / "out" / "fingers.json").read_text("utf-8"))
    assert found["finger"] == "pressed"
    assert [row["id"] for row in found["findings"]] == [finding.id for finding in some]
    assert "pressed finger" in capsys.readouterr().out
