"""Options of the commands about people that need no long run."""

import json

import pytest

from asperity.cli import main
from asperity.errors import AsperityError
from asperity.studies.ensemble import predictions


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["study", "--ensemble", "--surface", "dots"], "leave out surface, or --ensemble"),
        (["study", "speed", "--ensemble"], "leave out name, or --ensemble"),
        (["study", "--ensemble", "--hand.mass-kg", "0.1"], "leave out hand, or --ensemble"),
        (["findings", "--halves"], "--halves needs --out"),
        (["findings", "--parts"], "--parts needs --out"),
        (["predict", "none.csv", "--model", "m.csv"], "none.csv: no such file"),
    ],
)
def test_what_does_not_go_together_is_refused(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert said in capsys.readouterr().err


def test_several_tables_are_one_set_of_answers(tmp_path, capsys):
    for person in ("A", "B"):
        (tmp_path / f"{person}.csv").write_text("stimulus,rating\nx,1\ny,2\nz,4\n")
    files = [str(tmp_path / f"{person}.csv") for person in ("A", "B")]
    assert main(["analyse", *files, "--samples", "100", "--out", str(tmp_path / "out")]) == 0
    assert "3 stimuli, 2 people, 6 ratings" in capsys.readouterr().out


def test_predictions_of_a_day_are_not_rewritten(tmp_path, monkeypatch):
    row = {"contrast": "a over b", "members": 1, "log10_ratio": {
        name: {"median": 0.1, "low": 0.0, "high": 0.2, "share_above_0": 1.0}
        for name in ("paper", "band", "chosen")
    }}  # fmt: skip
    monkeypatch.setattr(predictions, "predict", lambda *_, **__: [row])
    page = predictions.write_predictions(tmp_path, "2026-01-02")
    assert page == tmp_path / "2026-01-02.md"
    assert predictions.write_predictions(tmp_path, "2026-01-02") == page
    stored = json.loads((tmp_path / "2026-01-02.json").read_text("utf-8"))
    assert stored["sha256"] == predictions.content_hash(stored)
    row["members"] = 2
    with pytest.raises(AsperityError, match="other predictions of that date"):
        predictions.write_predictions(tmp_path, "2026-01-02")
    with pytest.raises(AsperityError, match="date must be YYYY-MM-DD, got 'soon'"):
        predictions.write_predictions(tmp_path, "soon")
